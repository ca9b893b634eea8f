"""The watch over the battery: low for long, well for long, unknown, and what follows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from asvhil.config import BatteryConfig
from asvhil.supervisor.battery_watch import BatteryWatch
from asvhil.supervisor.reasons import Reason
from asvhil.types import FrontseatStatus
from tests.support.supervisor_bench import status


class Battery:
    def __init__(self, **keys: object) -> None:
        self.watch = BatteryWatch(BatteryConfig.model_validate({"lasts_s": 5.0, **keys}))
        self.t_ns = 0

    def run(self, seconds: float, told: FrontseatStatus | None) -> bool:
        for _ in range(round(20 * seconds)):
            self.t_ns += 50_000_000
            self.watch.step(self.t_ns, told)
        return bool(self.watch.notes)


FULL = replace(status(), battery_v=12.6, battery_percent=90.0)
EMPTY = replace(status(), battery_v=10.9, battery_percent=12.0)


def test_low_for_long_is_told_and_well_for_long_is_forgotten() -> None:
    battery = Battery()
    assert not battery.run(30.0, FULL)
    assert not battery.run(4.9, EMPTY)
    assert battery.run(0.3, EMPTY)
    (note,) = battery.watch.notes
    assert note.text == "the battery is low: 12 %, less than 20 %" and not note.ok
    assert battery.watch.fault is None
    assert battery.run(4.9, FULL)
    assert not battery.run(0.3, FULL)


def test_it_is_low_from_the_moment_on_at_which_it_has_been_for_long() -> None:
    watch = Battery().watch
    for t_s, low in ((1, False), (4, False), (6, True)):
        watch.step(t_s * 1_000_000_000, EMPTY)
        assert bool(watch.notes) is low


def test_a_sag_under_thrust_is_not_low() -> None:
    battery = Battery(low_v=11.5)
    for _ in range(10):
        assert not battery.run(4.8, EMPTY)
        assert not battery.run(0.2, FULL)


@pytest.mark.parametrize(
    ("told", "low"),
    [
        (None, False),
        (status(), False),  # an autopilot that tells nothing of a battery
        (replace(status(), battery_v=10.9), True),
        (replace(status(), battery_v=11.6), False),
        (replace(status(), battery_v=12.6, battery_percent=19.0), True),
        (replace(status(), battery_percent=20.0), False),
        (replace(FULL, battery_complaint="battery 1 critical"), True),
    ],
)
def test_what_counts_as_low(told: FrontseatStatus | None, low: bool) -> None:
    assert Battery(low_v=11.5).run(6.0, told) is low


def test_without_limits_nothing_is_low() -> None:
    assert not Battery(low_percent=None).run(6.0, EMPTY)


def test_a_hold_ends_where_the_config_says_so() -> None:
    battery = Battery(on_low="release", low_v=11.5)
    battery.run(6.0, replace(EMPTY, battery_percent=None))
    fault = battery.watch.fault
    assert fault is not None and fault.reason is Reason.BATTERY_LOW
    assert dict(fault.detail) == {"reading": "10.9 V", "limit": "11.5 V"}


def test_what_the_autopilot_says_is_wrong_ends_a_hold_where_the_config_says_so() -> None:
    battery = Battery(on_low="release")
    battery.run(6.0, replace(FULL, battery_complaint="battery 2 not healthy"))
    fault = battery.watch.fault
    assert fault is not None and fault.reason is Reason.BATTERY_COMPLAINT
    (note,) = battery.watch.notes
    assert note.text == "the autopilot says: battery 2 not healthy" and not note.ok


def test_what_is_told_keeps_up_with_what_is_read() -> None:
    battery = Battery()
    battery.run(6.0, replace(FULL, battery_percent=19.0))

    def told() -> str:
        (note,) = battery.watch.notes
        return note.text

    texts = set()
    for tenth in range(1200):
        battery.run(0.1, replace(FULL, battery_percent=19.0 - 0.01 * tenth))
        texts.add(told())
    assert 2 <= len(texts) <= 4 and "7 %" in told()
    battery.run(0.1, replace(FULL, battery_percent=3.0, battery_complaint="battery 1 failed (fire)"))
    assert told() == "the autopilot says: battery 1 failed (fire); 3 %"


def test_a_charge_that_is_not_told_any_more_is_not_well() -> None:
    battery = Battery(on_low="release")
    battery.run(6.0, EMPTY)
    assert battery.run(60.0, replace(EMPTY, battery_percent=None)) and battery.watch.fault is not None
    assert battery.run(60.0, None)
    assert not battery.run(5.2, FULL)
    battery.run(6.0, replace(status(), battery_complaint="battery 1 critical"))
    assert not battery.run(5.2, status()), "what the autopilot said, it says no more"
