"""The energy of a hold, mean power and hours left: sums worked out by hand, and what is not known stays unknown."""

from __future__ import annotations

from dataclasses import replace

import pytest

from asvhil.config import PowerConfig
from asvhil.supervisor.energy import BLIND_S, LEAST_S, MEAN_S, EnergyWatch
from asvhil.types import BatterySum, EnergyUse, FrontseatStatus
from tests.support.supervisor_bench import status

S = 1_000_000_000
CURVE = [[-1.0, 200.0], [-0.5, 50.0], [0.0, 0.0], [0.5, 40.0], [1.0, 300.0]]


class Boat:
    """Ticks of a second; a pulse of 1500 + 400 c us means the command c."""

    def __init__(self, **keys: object) -> None:
        power = PowerConfig.model_validate({"power_curve": CURVE, **keys})
        self.watch = EnergyWatch(power, lambda pulse_us: (pulse_us - 1500) / 400.0)
        self.t_ns = 1_700_000_000 * S
        self.told = EnergyUse()

    def run(
        self,
        seconds: int,
        pulses_us: tuple[int, int] | None,
        told: FrontseatStatus | None = None,
        *,
        held: bool = True,
        silent: bool = False,
    ) -> EnergyUse:
        for _ in range(seconds):
            self.t_ns += S
            if told is not None and not silent:
                told = replace(told, battery_ns=self.t_ns, outputs_ns=self.t_ns)
                if told.batteries is not None:
                    told = replace(told, batteries=replace(told.batteries, t_ns=self.t_ns))
            self.told = self.watch.step(self.t_ns, told, pulses_us, held=held)
        return self.told


def test_the_power_of_a_tick_counts_until_the_next_one() -> None:
    """600 s of 300 + 50 + 10 W, then 300 s of 10 W: 60 and 0.8333 Wh; the last tick's has not been used yet."""
    boat = Boat(hotel_w=10.0)
    boat.run(600, (1900, 1300))
    boat.run(300, (1500, 1500))
    boat.run(1, None)
    assert boat.told.hold_wh == pytest.approx((600 * 360 + 300 * 10) / 3600.0)


@pytest.mark.parametrize(("pulse_us", "watts"), [(1900, 300.0), (1600, 20.0), (1800, 170.0), (1400, 25.0), (1500, 0.0)])
def test_the_curve_is_interpolated_for_each_motor(pulse_us: int, watts: float) -> None:
    assert Boat().run(1, (pulse_us, 1700)).power_w == pytest.approx(watts + 40.0)


def test_what_is_measured_beats_the_curve_until_it_is_old() -> None:
    boat = Boat()
    measured = replace(status(), battery_v=15.0, battery_a=4.0)
    assert boat.run(1, (1900, 1900), measured) == EnergyUse(hold_wh=None, power_w=60.0, by="measured")
    assert boat.run(1, (1900, 1900), replace(measured, battery_a=None)).by == "curve"
    heard = replace(measured, battery_ns=boat.t_ns)
    assert boat.run(4, (1900, 1900), heard, silent=True).by == "measured"
    old = boat.run(1, (1900, 1900), heard, silent=True)
    assert (old.power_w, old.by) == (600.0, "curve")
    # A second of 60, of 600, four of 60.
    assert old.hold_wh == pytest.approx((60 + 600 + 4 * 60) / 3600.0)


def test_an_autopilot_that_measures_needs_no_curve() -> None:
    boat = Boat(power_curve=None, capacity_wh=100.0)
    boat.run(361, (1900, 1900), replace(status(), battery_v=12.5, battery_a=8.0))
    assert (boat.told.hold_wh, boat.told.mean_w) == (pytest.approx(10.0), pytest.approx(100.0))
    assert boat.told.hours_left == pytest.approx(0.9)


def test_what_is_not_known_is_not_told() -> None:
    boat = Boat(power_curve=None, capacity_wh=100.0)
    unmeasured = replace(status(), battery_v=12.5)
    assert boat.run(60, (1900, 1900), unmeasured) == EnergyUse()
    assert boat.run(60, (1900, 1900)) == EnergyUse()
    known = Boat()  # without a capacity
    known.run(60, (1700, 1700), replace(status(), battery_percent=50.0))
    assert known.told.mean_w == pytest.approx(80.0) and known.told.hours_left is None
    assert known.run(1, (1700, 1700), held=False).hold_wh is None, "nothing is held"


def test_a_sum_that_lacks_much_is_not_told_and_the_next_hold_begins_anew() -> None:
    boat = Boat(power_curve=None, capacity_wh=100.0)
    measured = replace(status(), battery_v=12.5, battery_a=8.0)
    boat.run(30, (1900, 1900), measured)
    boat.run(round(BLIND_S) + 1, (1900, 1900))
    assert boat.told.hold_wh is not None
    boat.run(1, (1900, 1900))
    assert boat.told.hold_wh is None and boat.told.hours_left is None
    boat.run(1, None, measured, held=False)
    boat.run(37, (1900, 1900), measured)
    assert boat.told.hold_wh == pytest.approx(1.0) and boat.told.hours_left is None, "what was used is not known"
    assert boat.run(1, (1900, 1900), replace(measured, battery_percent=50.0)).hours_left == pytest.approx(0.5)


def test_hours_left_by_the_charge_or_else_by_what_was_used() -> None:
    boat = Boat(capacity_wh=800.0)
    boat.run(3600, (1700, 1700), held=False)  # the backseat drives for an hour at 80 W
    boat.run(1, (1700, 1700), held=False)
    assert boat.told.hours_left == pytest.approx((800.0 - 80.0) / 80.0)
    assert boat.run(1, (1700, 1700), replace(status(), battery_percent=25.0)).hours_left is None, "a new mean"
    told = boat.run(30, (1900, 1900), replace(status(), battery_percent=25.0))
    assert told.hours_left == pytest.approx(200.0 / (told.mean_w or 0.0)) and (told.mean_w or 0.0) > 500.0
    empty = Boat(capacity_wh=1.0)
    empty.run(60, (1900, 1900))
    assert empty.told.hours_left == 0.0


def test_the_mean_begins_as_one_and_forgets() -> None:
    boat = Boat()
    assert boat.run(round(LEAST_S), (1900, 1900)).mean_w is None
    boat.run(51, (1500, 1500))
    assert boat.told.mean_w == pytest.approx(600.0 * 10 / 60, rel=0.3)
    boat.run(round(6 * MEAN_S), (1700, 1700))
    assert boat.told.mean_w == pytest.approx(80.0, rel=0.01)


def test_while_others_drive_the_motors_are_what_the_autopilot_reports() -> None:
    boat = Boat()
    piloted = replace(status(), motors_us=(1700, 1900))
    assert boat.run(1, None, piloted, held=False).power_w == pytest.approx(340.0)
    assert boat.run(5, None, replace(piloted, outputs_ns=boat.t_ns), held=False, silent=True).power_w is None
    assert boat.run(1, (1500, 1500), piloted).power_w == 0.0, "ours are what was sent"


def batteries(number: int, used_wh: float | None = None) -> FrontseatStatus:
    """SYS_STATUS of the first battery, 60 W, and the batteries together, 150 W."""
    told = BatterySum(t_ns=0, number=number, power_w=150.0, used_wh=used_wh)
    return replace(status(), battery_v=15.0, battery_a=4.0, batteries=told)


@pytest.mark.parametrize(("number", "then"), [(1, (60.0, "measured")), (2, (600.0, "curve"))])
def test_all_batteries_count_and_one_of_several_does_not_for_all(number: int, then: tuple[float, str]) -> None:
    boat = Boat()
    told = batteries(number)
    assert boat.run(1, (1900, 1900), told).power_w == 150.0
    # BATTERY_STATUS of one falls silent, while SYS_STATUS goes on.
    for _ in range(5):
        old = replace(told, batteries=replace(told.batteries, t_ns=boat.t_ns - 5 * S), battery_ns=boat.t_ns)
        use = boat.run(1, (1900, 1900), old, silent=True)
    assert (use.power_w, use.by) == then


def test_what_was_used_before_this_program_began_is_gone_and_a_reboot_gives_nothing_back() -> None:
    """100 Wh, of which 40 were used before: 360 s at 150 W later there are 45, so 0.3 h."""
    boat = Boat(power_curve=None, capacity_wh=100.0)
    boat.run(1, (1900, 1900), batteries(1, used_wh=40.0))
    assert boat.run(360, (1900, 1900), batteries(1)).hours_left == pytest.approx(0.3)
    assert boat.run(1, (1900, 1900), batteries(1, used_wh=0.0)).hours_left == pytest.approx(0.3, abs=1e-3)
    assert boat.run(1, (1900, 1900), batteries(1, used_wh=70.0)).hours_left == pytest.approx(0.2)
