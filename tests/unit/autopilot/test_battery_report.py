"""What SYS_STATUS and BATTERY_STATUS say of the battery, through the conversation with either autopilot."""

from __future__ import annotations

from typing import Any

import pytest

from asvhil.backseat.build import build_link
from asvhil.config import load_config
from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.frames import dialect
from asvhil.types import BatterySum, Frame, FrontseatStatus


def frame(message: object, t_ns: int) -> Frame:
    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    mav.seq = t_ns // 1_000_000_000 % 256
    return Frame(t_ns=t_ns, port=AUTOPILOT, data=message.pack(mav))  # type: ignore[attr-defined]


@pytest.mark.parametrize("config", ["sitl", "sitl-px4"])
@pytest.mark.parametrize(
    ("millivolts", "remaining", "volts", "percent"),
    [
        (12_600, -1, 12.6, None),
        (11_800, 37, 11.8, 37.0),
        (0xFFFF, 0, None, 0.0),  # not measured
        (0, -1, None, None),  # a monitor that is not set up
    ],
)
def test_the_battery_is_read(
    config: str, millivolts: int, remaining: int, volts: float | None, percent: float | None
) -> None:
    link = build_link(load_config(config))
    kind = dialect.MAV_AUTOPILOT_PX4 if config == "sitl-px4" else dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    beat = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_SURFACE_BOAT, kind, 81, 0, 4, 3)
    told = dialect.MAVLink_sys_status_message(0, 0, 0, 0, millivolts, -1, remaining, 0, 0, 0, 0, 0, 0)
    link.receive(frame(beat, 1_000_000_000))
    ((message, status),) = link.receive(frame(told, 2_000_000_000))
    assert message == "SYS_STATUS" and isinstance(status, FrontseatStatus)
    assert status.battery_percent == percent and status.battery_ns == 2_000_000_000
    assert status.battery_a is None, "-1: not measured"
    assert status.battery_v == (None if volts is None else pytest.approx(volts))


@pytest.mark.parametrize(("centiamperes", "amperes"), [(-1, None), (0, 0.0), (1234, 12.34)])
def test_the_current_is_read_where_it_is_measured(centiamperes: int, amperes: float | None) -> None:
    link = build_link(load_config("sitl"))
    kind = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    beat = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_SURFACE_BOAT, kind, 81, 0, 4, 3)
    told = dialect.MAVLink_sys_status_message(0, 0, 0, 0, 12_600, centiamperes, -1, 0, 0, 0, 0, 0, 0)
    link.receive(frame(beat, 1_000_000_000))
    ((_, status),) = link.receive(frame(told, 2_000_000_000))
    assert isinstance(status, FrontseatStatus)
    assert status.battery_a == (None if amperes is None else pytest.approx(amperes))


S = 1_000_000_000
NONE = 0xFFFF
MANY_CELLS = [4100, 4150, *[NONE] * 8]


class Vehicle:
    """An ArduRover that tells of its batteries."""

    def __init__(self) -> None:
        self.link = build_link(load_config("sitl"))
        kind = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
        self.link.receive(frame(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_SURFACE_BOAT, kind, 81, 0, 4, 3), S))

    def tell(
        self,
        at_s: int,
        *,
        number: int = 0,
        cells: list[int] | None = None,
        ext: list[int] | None = None,
        centiamperes: int = 1000,
        mah: int = 500,
        hectojoules: int = 720,
        percent: int = 80,
        source: tuple[int, int] = (1, 1),
        state: int = 1,
        faults: int = 0,
    ) -> FrontseatStatus | None:
        cells = [12_000, *[NONE] * 9] if cells is None else cells
        used = (centiamperes, mah, hectojoules, percent)
        # Temperature, type and function are of no use here; 0 s: the time that is left is not told.
        told = dialect.MAVLink_battery_status_message(
            number, 0, 0, 0x7FFF, cells, *used, 0, state, ext or [0] * 4, 0, faults
        )
        mav = dialect.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
        sent = Frame(t_ns=at_s * S, port=AUTOPILOT, data=told.pack(mav))
        return self.status(self.link.receive(sent))

    def tell_sys_status(self, at_s: int, percent: int) -> FrontseatStatus:
        told = dialect.MAVLink_sys_status_message(0, 0, 0, 0, 12_600, 300, percent, 0, 0, 0, 0, 0, 0)
        status = self.status(self.link.receive(frame(told, at_s * S)))
        assert status is not None
        return status

    @staticmethod
    def status(found: list[Any]) -> FrontseatStatus | None:
        return next((status for _, status in found if isinstance(status, FrontseatStatus)), None)


def test_batteries_are_summed_and_the_lowest_charge_counts() -> None:
    vehicle = Vehicle()
    assert vehicle.tell_sys_status(2, 80).battery_percent == 80.0
    first = vehicle.tell(2)
    assert first is not None and first.battery_percent == 80.0 and first.battery_v == 12.6
    assert first.batteries == BatterySum(t_ns=2 * S, number=1, power_w=pytest.approx(120.0), used_wh=20.0)
    both = vehicle.tell(3, number=7, centiamperes=250, hectojoules=36, percent=35)
    assert both is not None and both.batteries is not None
    assert (both.batteries.number, both.batteries.power_w) == (2, pytest.approx(150.0))
    assert both.batteries.used_wh == pytest.approx(21.0)
    assert both.batteries.t_ns == 2 * S, "as old as the older one"
    assert both.battery_percent == 35.0 and vehicle.tell_sys_status(4, 80).battery_percent == 35.0


@pytest.mark.parametrize(
    ("told", "watts", "used_wh"),
    [
        ({"cells": MANY_CELLS}, 82.5, 20.0),
        ({"cells": [4000] * 10, "ext": [4000, 4000, 0, NONE]}, 480.0, 20.0),
        ({"cells": [0xFFFE, 10_000, *[NONE] * 8]}, 755.34, 20.0),  # more volts than one cell can tell
        ({"hectojoules": -1}, 120.0, 6.0),  # PX4: 500 mAh at 12 V
        ({"hectojoules": -1, "mah": -1, "percent": -1}, 120.0, None),
        ({"centiamperes": 0}, 0.0, 20.0),
        ({"centiamperes": -250}, -30.0, 20.0),  # it is being charged
    ],
)
def test_cells_are_added_and_marks_of_the_unknown_are_no_values(
    told: dict[str, Any], watts: float, used_wh: float | None
) -> None:
    status = Vehicle().tell(2, **told)
    assert status is not None and status.batteries is not None
    assert status.batteries.power_w == pytest.approx(watts)
    assert status.batteries.used_wh == (None if used_wh is None else pytest.approx(used_wh))


@pytest.mark.parametrize(
    ("told", "lowest"),
    [
        ({"percent": 35}, 35.0),
        ({"percent": 4, "centiamperes": -1}, 4.0),  # without a current sensor it does not count for power
        ({"percent": -1}, 60.0),
        ({"percent": 120}, 60.0),
    ],
)
def test_the_lowest_charge_is_of_all_that_tell_one(told: dict[str, Any], lowest: float) -> None:
    vehicle = Vehicle()
    vehicle.tell_sys_status(2, 80)
    vehicle.tell(2, percent=60)
    status = vehicle.tell(3, number=1, **told)
    assert status is not None and status.battery_percent == lowest
    vehicle.tell_sys_status(64, 80)
    status = vehicle.tell(64, percent=60)
    assert status is not None and status.battery_percent == 80.0, "a silent battery is not there any more"


def test_a_charge_that_is_old_is_not_known() -> None:
    vehicle = Vehicle()
    vehicle.tell_sys_status(2, 80)
    told = [vehicle.tell(second) for second in (61, 63)]
    assert [status.battery_percent for status in told if status is not None] == [80.0, None]


@pytest.mark.parametrize(
    "told",
    [
        *({"centiamperes": -1}, {"centiamperes": -100}, {"cells": [NONE] * 10}, {"cells": [0] * 10}),
        {"cells": [NONE] * 10, "ext": [NONE] * 4, "centiamperes": -1, "mah": -1, "hectojoules": -1, "percent": -1},
    ],
)
def test_a_battery_without_volts_or_current_does_not_count_and_is_as_silent(told: dict[str, Any]) -> None:
    status = Vehicle().tell(2, **told)
    assert status is not None and status.batteries is None
    vehicle = Vehicle()
    vehicle.tell(2, number=1)
    for second in range(3, 64):
        vehicle.tell(second, number=1, **told)
        status = vehicle.tell(second)
        assert status is not None and status.batteries is not None
        left = second >= 62
        assert status.batteries.t_ns == (second if left else 2) * S and status.batteries.number == (1 if left else 2)


def test_another_component_or_vehicle_has_other_batteries() -> None:
    vehicle = Vehicle()
    assert vehicle.tell(2, source=(1, 190)) is None and vehicle.tell(2, source=(2, 1)) is None
    status = vehicle.tell(3)
    assert status is not None and status.batteries is not None and status.batteries.number == 1


def test_what_real_autopilots_have_sent_is_read() -> None:
    """As recorded: ArduRover 4.6.3, whose battery gave no current then, and PX4 1.16 without a current sensor."""
    ardurover = {"cells": [12_600, *[NONE] * 9], "centiamperes": 0, "mah": 480, "hectojoules": 211, "percent": 85}
    status = Vehicle().tell(2, **ardurover)
    assert status is not None and status.batteries == BatterySum(
        t_ns=2 * S, number=1, power_w=0.0, used_wh=pytest.approx(5.861, abs=1e-3)
    )
    px4 = {"cells": [15_300, *[NONE] * 9], "centiamperes": -100, "mah": 0, "hectojoules": -1, "percent": 50}
    status = Vehicle().tell(2, **px4)
    assert status is not None and status.batteries is None


@pytest.mark.parametrize(
    ("told", "complaint"),
    [
        *(({"state": state}, "") for state in (0, 1, 7)),  # undefined, well, charging
        ({"state": 2}, "battery 1 low"),
        ({"state": 3}, "battery 1 critical"),
        ({"state": 4}, "battery 1 critical, an emergency"),
        ({"state": 5}, "battery 1 failed"),
        ({"state": 6}, "battery 1 not healthy"),
        ({"state": 6, "centiamperes": -1}, "battery 1 not healthy"),  # without a current sensor too
        ({"faults": 16}, "battery 1 faulty (over temperature)"),
        ({"state": 3, "faults": 1 | 64}, "battery 1 critical (deep discharge, incompatible voltage)"),
        ({"faults": 1 << 31}, "battery 1 faulty (fault 2147483648)"),  # of a later version of MAVLink
        ({"state": 200}, ""),
    ],
)
def test_what_is_wrong_with_a_battery_is_read(told: dict[str, Any], complaint: str) -> None:
    status = Vehicle().tell(2, **told)
    assert status is not None and status.battery_complaint == complaint


def test_complaints_are_of_each_battery_until_it_is_well_or_silent() -> None:
    vehicle = Vehicle()
    vehicle.tell(2, number=1, state=3)
    both = vehicle.tell(3, state=2)
    assert both is not None and both.battery_complaint == "battery 1 low; battery 2 critical"
    well = vehicle.tell(4)
    assert well is not None and well.battery_complaint == "battery 2 critical"
    assert vehicle.tell_sys_status(61, 80).battery_complaint == "battery 2 critical"
    assert vehicle.tell_sys_status(62, 80).battery_complaint == ""
