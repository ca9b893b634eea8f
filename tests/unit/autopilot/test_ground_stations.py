"""Which senders an ArduRover takes for its ground stations, and what their messages say of the sticks."""

from typing import Any

import pytest

from asvhil.autopilot.ardurover_wiring import wiring_of
from asvhil.autopilot.ground_stations import GroundStations, is_station, station_systems
from asvhil.autopilot.wiring import Wiring
from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect

CONFIG = load_config("sitl")
OWN = (1, 191)


def wiring(values: dict[str, float]) -> Wiring:
    return wiring_of(CONFIG.links.autopilot, CONFIG.vehicle.pwm, values)


def read(message: Any, sender: tuple[int, int] = (255, 190), **values: float) -> Any:
    packed = bytes(message.pack(dialect.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])))
    found = GroundStations((OWN, (255, 191)), 1).read(5, packed, values, wiring(values))
    return None if found is None else (found.sender, dict(found.channels))


@pytest.mark.parametrize(
    ("values", "systems"),
    [
        ({}, (255, 255)),
        ({"SYSID_MYGCS": 1}, (1, 1)),
        ({"SYSID_MYGCS": 254, "SYSID_ENFORCE": 1}, (254, 254)),
        ({"MAV_GCS_SYSID": 255, "MAV_GCS_SYSID_HI": 0}, (255, 255)),
        ({"MAV_GCS_SYSID": 254, "MAV_GCS_SYSID_HI": 255}, (254, 255)),
        ({"MAV_GCS_SYSID": 254, "MAV_GCS_SYSID_HI": 253}, (254, 254)),
    ],
)
def test_the_systems_whose_sticks_are_obeyed(values: dict[str, float], systems: tuple[int, int]) -> None:
    assert station_systems(values) == systems
    obeyed = [system for system in range(256) if is_station(system, values)]
    assert (obeyed[0], obeyed[-1]) == systems and len(obeyed) == systems[1] - systems[0] + 1


def test_axes_are_spread_over_the_travel_of_the_channels_that_drive() -> None:
    message = dialect.MAVLink_manual_control_message(1, 900, 1000, -500, 900, 0)
    assert read(message) == ((255, 190), {1: 2000, 3: 1250})
    mapped = {"RCMAP_ROLL": 5.0, "RCMAP_THROTTLE": 2.0, "RC5_MIN": 1100.0, "RC5_MAX": 1900.0, "RC5_TRIM": 1500.0}
    assert read(message, **mapped) == ((255, 190), {5: 1900, 2: 1250})


def test_axes_without_a_value_and_messages_for_others_say_nothing() -> None:
    axes = dialect.MAVLink_manual_control_message
    assert read(axes(1, 0, 32767, 300, 0, 0)) == ((255, 190), {3: 1650})
    assert read(axes(1, 0, 32767, 32767, 0, 0)) is None
    assert read(axes(0, 0, 500, 500, 0, 0)) is None and read(axes(2, 0, 500, 500, 0, 0)) is None


def test_channels_that_are_set_and_no_others() -> None:
    override = dialect.MAVLink_rc_channels_override_message
    high = {"chan9_raw": 0, "chan10_raw": 65534, "chan11_raw": 1700, "chan17_raw": 1900}
    message = override(1, 1, 1600, 65535, 0, 1400, *[65535] * 4, **high)
    assert read(message) == ((255, 190), {1: 1600, 4: 1400, 11: 1700})
    assert read(override(0, 0, 1600, *[65535] * 7)) == ((255, 190), {1: 1600})
    assert read(override(2, 1, 1600, *[65535] * 7)) is None
    assert read(override(1, 1, 0, *[65535] * 7)) is None


def test_strangers_and_we_ourselves_are_not_the_pilot() -> None:
    message = dialect.MAVLink_manual_control_message(1, 0, 500, 0, 0, 0)
    assert read(message, (254, 190)) is None and read(message, (1, 190)) is None
    assert read(message, (255, 191)) is None and read(message, (255, 240)) is not None
    assert read(message, (1, 191), SYSID_MYGCS=1.0) is None and read(message, (1, 240), SYSID_MYGCS=1.0) is not None
    assert read(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)) is None


@pytest.mark.parametrize(
    ("sender", "kind", "values", "heard"),
    [
        ((255, 240), 6, {}, True),
        ((255, 190), 6, {"SYSID_MYGCS": 255.0}, True),
        ((254, 190), 6, {"SYSID_MYGCS": 255.0}, False),
        ((254, 190), 6, {"MAV_GCS_SYSID": 250.0, "MAV_GCS_SYSID_HI": 255.0}, True),
        ((255, 240), 18, {}, False),  # another kind of program of the same system
        ((1, 191), 18, {"SYSID_MYGCS": 1.0}, False),  # we ourselves, as the autopilot's ground station
        ((255, 191), 6, {}, False),
        ((1, 240), 6, {"SYSID_MYGCS": 1.0}, True),  # one that was given the vehicle's number
        ((255, 190), 6, {"SYSID_MYGCS": 1.0}, True),  # it still sets mode and arming
    ],
)
def test_whose_heartbeat_is_the_pilots(
    sender: tuple[int, int], kind: int, values: dict[str, float], heard: bool
) -> None:
    stations = GroundStations((OWN, (255, 191)), 1)
    beat = bytes(dialect.MAVLink_heartbeat_message(kind, 8, 0, 0, 4, 3).pack(dialect.MAVLink(None, *sender)))
    assert stations.read(7, beat, values, wiring(values)) is None
    assert stations.heard_ns == (7 if heard else None)


def test_sticks_count_as_a_heartbeat_where_they_are_obeyed() -> None:
    stations = GroundStations((OWN,), 1)
    for system, heard_ns in ((254, None), (255, 3)):
        data = bytes(dialect.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0).pack(dialect.MAVLink(None, system, 190)))
        stations.read(3, data, {}, wiring({}))
        assert stations.heard_ns == heard_ns
