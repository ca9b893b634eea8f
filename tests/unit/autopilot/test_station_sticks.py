"""What is kept of the sticks of ground stations, what they command, and which parameters tell it."""

from __future__ import annotations

from typing import Any

import pytest

from asvhil.autopilot.ardurover_wiring import wiring_of
from asvhil.autopilot.ground_stations import SHARED_NS, GroundStations, names_of_stations, station_systems
from asvhil.config import AutopilotLinkConfig, load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.supervisor.situation import StationSticks

CONFIG = load_config("sitl")
T_NS = 1_000_000_000_000


def heard(stations: GroundStations, message: Any, t_ns: int = T_NS, **values: float) -> tuple[StationSticks, ...]:
    """What is kept of a message of 255/190."""
    packed = bytes(message.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=190)))
    stations.receive(t_ns, packed, values, wiring_of(CONFIG.links.autopilot, CONFIG.vehicle.pwm, values))
    return stations.take_sticks()


def channels(*us: int, **high: int) -> Any:
    """RC_CHANNELS_OVERRIDE of channels 1 to 8, those that are left out as they are."""
    return dialect.MAVLink_rc_channels_override_message(1, 1, *us, *[65535] * (8 - len(us)), **high)


def test_sticks_are_kept_until_they_are_taken_and_told_to_people_for_2_s() -> None:
    stations = GroundStations((), 1)
    assert stations.take_sticks() == () and stations.shared_text(T_NS) == ""
    assert heard(stations, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)) == ()
    assert stations.shared_text(T_NS) == ""
    (sticks,) = heard(stations, channels(1600))
    assert (sticks.t_ns, sticks.sender, sticks.channels) == (T_NS, (255, 190), ((1, 1600),))
    assert stations.take_sticks() == ()
    words = "255/190 sends its sticks too: the motors get our commands and its in turn"
    assert stations.shared_text(T_NS + SHARED_NS) == words
    assert stations.shared_text(T_NS + SHARED_NS + 1) == ""


@pytest.mark.parametrize(("port", "starboard"), [(1, 3), (3, 1), (2, 16), (16, 5)])
def test_both_motors_sticks_are_what_they_command_and_one_alone_is_not(port: int, starboard: int) -> None:
    values = {"RCMAP_ROLL": float(port), "RCMAP_THROTTLE": float(starboard)}

    def override(set_us: dict[int, int]) -> Any:
        low = [set_us.get(n, 65535) for n in range(1, 9)]
        return channels(*low, **{f"chan{n}_raw": us for n, us in set_us.items() if n > 8})

    stations = GroundStations((), 1)
    (both,) = heard(stations, override({port: 1600, starboard: 1350}), **values)
    assert both.motors_us == (1600, 1350)
    for alone in (port, starboard):
        (one,) = heard(stations, override({alone: 1600}), **values)
        assert one.motors_us is None and one.channels == ((alone, 1600),)


def test_channels_that_the_autopilot_does_not_obey_are_none() -> None:
    high = {"chan15_raw": 1700, "chan16_raw": 1800, "chan17_raw": 1900}
    (sticks,) = heard(GroundStations((), 1), channels(**high))
    assert sticks.channels == ((15, 1700), (16, 1800)) and sticks.motors_us is None


def test_the_parameters_that_tell_it() -> None:
    plain = CONFIG.links.autopilot
    script = AutopilotLinkConfig.model_validate({**plain.model_dump(), "output": "script"})
    first = ("SYSID_MYGCS", "MAV_GCS_SYSID")
    assert list(names_of_stations(plain, {"SYSID_MYGCS": 255.0})) == [first, ("RC_OPTIONS",)]
    newer = {"MAV_GCS_SYSID": 255.0, "RCMAP_ROLL": 4.0}
    assert list(names_of_stations(plain, newer)) == [first, ("MAV_GCS_SYSID_HI",), ("RC_OPTIONS",)]
    travel = [(f"RC{channel}_{part}",) for channel in (4, 3) for part in ("MIN", "TRIM", "MAX")]
    assert list(names_of_stations(script, newer))[3:] == [("RCMAP_ROLL",), ("RCMAP_THROTTLE",), *travel]
    assert station_systems({"SYSID_MYGCS": 0.0}) == (0, 0)
