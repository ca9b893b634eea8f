"""What SYS_STATUS says of the battery, through the conversation with either autopilot."""

from __future__ import annotations

import pytest

from asvhil.backseat.build import build_link
from asvhil.config import load_config
from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Frame, FrontseatStatus


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
