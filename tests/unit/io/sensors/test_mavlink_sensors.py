"""The autopilot's sensor messages as sources: units, frames, what is not valid, and the name that each comes by."""

import math

import pytest

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.sources import AUTOPILOT_MESSAGES
from asvhil.io.mavlink.frames import dialect as d
from asvhil.io.sensors.levelling import tilted
from asvhil.types import Frame, GroundVelocity, Heading, Measurement, Position, SpecificForce, TrueWind, YawRate

AUTOPILOT = d.MAVLink(None, srcSystem=1, srcComponent=1)
READY = d.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0)
U16 = 65535


def link() -> ArduRoverAutopilot:
    return ArduRoverAutopilot(AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0"), PwmConfig())


def read(ardurover: ArduRoverAutopilot, *messages: object) -> list[tuple[str, Measurement]]:
    data = b"".join(bytes(message.pack(AUTOPILOT)) for message in messages)  # type: ignore[attr-defined]
    return [pair for pair in ardurover.receive(Frame(t_ns=7, port="autopilot", data=data)) if pair[0] in NAMES]


NAMES = set(AUTOPILOT_MESSAGES)


def gps(kind: type, time_us: int, fix: int, vel: int = 250, cog: int = 9000) -> object:
    common = (time_us, fix, 404237000, -869212000, 0, 100, 100, vel, cog, 12)
    if kind is d.MAVLink_gps2_raw_message:
        return kind(*common, 0, 0, 0, 0, 1500, 0, 0, 0)
    return kind(*common, 0, 1500, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("kind", "name"), [(d.MAVLink_gps_raw_int_message, "GPS_RAW_INT"), (d.MAVLink_gps2_raw_message, "GPS2_RAW")]
)
def test_both_receivers(kind: type, name: str) -> None:
    ardurover = link()
    (source, place), (same, velocity) = read(ardurover, gps(kind, 1000, 3))
    assert source == same == name and isinstance(place, Position) and isinstance(velocity, GroundVelocity)
    assert (place.t_ns, place.h_acc_m, velocity.t_ns) == (7, 1.5, 7)
    assert (place.lat_deg, place.lon_deg) == pytest.approx((40.4237, -86.9212))
    assert (velocity.vn_mps, velocity.ve_mps) == pytest.approx((0.0, 2.5), abs=1e-12)
    assert read(ardurover, gps(kind, 1000, 3)) == []  # the same fix, streamed again
    assert read(ardurover, gps(kind, 2000, 2)) == []  # no height, no fix
    ((_, place),) = read(ardurover, gps(kind, 3000, 6, vel=U16))
    assert isinstance(place, Position)


@pytest.mark.parametrize("kind", [d.MAVLink_gps_raw_int_message, d.MAVLink_gps2_raw_message])
@pytest.mark.parametrize("time_us", [0, 1_700_000_000_000_000, 2**64 - 1])
def test_a_fix_is_told_by_its_content_where_its_time_stands_still(kind: type, time_us: int) -> None:
    """Some receivers and bridges never fill it in; a fix that is streamed three times is one all the same."""
    ardurover = link()
    found = [read(ardurover, gps(kind, time_us, 3, vel=speed)) for speed in (250, 250, 250, 251, 251, 250, 249)]
    assert [len(measurements) for measurements in found] == [2, 0, 0, 2, 0, 2, 2]


@pytest.mark.parametrize("kind", [d.MAVLink_gps_raw_int_message, d.MAVLink_gps2_raw_message])
def test_a_fix_has_the_age_that_its_time_tells_but_not_where_that_stands_still(kind: type) -> None:
    ardurover = link()

    def age_ms(at_ms: int, time_ms: int, vel: int) -> float:
        attitude = d.MAVLink_attitude_message(at_ms, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1)
        data = b"".join(bytes(one.pack(AUTOPILOT)) for one in (attitude, gps(kind, 1000 * time_ms, 3, vel=vel)))
        found = ardurover.receive(Frame(t_ns=(at_ms + 30) * 1_000_000, port="autopilot", data=data))
        [velocity] = [m for _, m in found if isinstance(m, GroundVelocity)]
        assert velocity.t_ns == (at_ms + 30) * 1_000_000
        return velocity.age_ns * 1e-6

    fixes = [(1000, 900, 250), (1200, 1100, 250), (1400, 1299, 251), (1600, 1299, 252), (1800, 0, 253), (2000, 1990, 1)]
    assert [age_ms(*fix) for fix in fixes] == [0.0, 100.0, 101.0, 0.0, 0.0, 10.0]


def test_a_boat_that_lies_still_has_a_new_fix_with_each_new_time() -> None:
    ardurover = link()
    times_us = (1000, 1000, 2000, 3000, 3000, 1000)  # the last one after a reboot
    found = [read(ardurover, gps(d.MAVLink_gps_raw_int_message, time_us, 3)) for time_us in times_us]
    assert [len(measurements) for measurements in found] == [2, 0, 2, 2, 0, 2]


@pytest.mark.parametrize("stuck_ms", [0, 40_000])
def test_a_boot_clock_that_stands_still_in_one_message_is_no_reboot(stuck_ms: int) -> None:
    ardurover = link()
    read(ardurover, d.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3), READY)
    for second in range(60, 70):
        clock = d.MAVLink_system_time_message(0, second * 1000)
        attitude = d.MAVLink_attitude_message(stuck_ms, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1)
        assert len(read(ardurover, clock, attitude)) == 2
    assert ardurover.reboots == 0
    read(ardurover, d.MAVLink_system_time_message(0, 3000), d.MAVLink_attitude_message(stuck_ms, *[0.0] * 6))
    assert ardurover.reboots == 1


@pytest.mark.parametrize("place", [(2**31 - 1, 2**31 - 1), (0, 0), (404237000, -1869212000), (-910000000, 0)])
def test_what_is_no_place_on_earth_is_no_fix(place: tuple[int, int]) -> None:
    raw = d.MAVLink_gps_raw_int_message(1, 3, *place, 0, 100, 100, 250, 9000, 12, 0, 1500, 0, 0, 0, 0)
    whole = d.MAVLink_global_position_int_message(0, *place, 0, 0, 0, 0, 0, 0)
    assert read(link(), READY, raw, whole) == []


def test_only_the_component_that_is_the_autopilot_is_heard() -> None:
    """A gimbal has a gyro and a boot clock of its own: neither the boat's yaw nor a reboot of the autopilot."""
    beat = d.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3)
    attitude = d.MAVLink_attitude_message(60_000, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1)
    gimbal = d.MAVLink(None, srcSystem=1, srcComponent=154)
    ardurover = link()
    assert [pair[0] for pair in read(ardurover, beat, READY, attitude)] == ["ATTITUDE"] * 2
    other = d.MAVLink_attitude_message(1_000, 0.0, 0.0, 2.0, 0.0, 0.0, 0.5).pack(gimbal)
    assert ardurover.receive(Frame(t_ns=8, port="autopilot", data=bytes(other))) == []
    assert ardurover.reboots == 0
    assert [pair[0] for pair in read(ardurover, attitude)] == ["ATTITUDE"] * 2


def test_the_two_receivers_do_not_share_their_memory() -> None:
    messages = gps(d.MAVLink_gps_raw_int_message, 1000, 3), gps(d.MAVLink_gps2_raw_message, 1000, 3)
    assert [name for name, _ in read(link(), *messages)] == ["GPS_RAW_INT"] * 2 + ["GPS2_RAW"] * 2


@pytest.mark.parametrize("degrees", [-179.0, -90.0, 0.0, 45.0, 120.0])
@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_a_quaternion_gives_the_yaw_of_its_euler_angles(degrees: float, tilt: float) -> None:
    half, roll = math.radians(degrees) / 2, tilt / 2
    q = (  # yaw, then roll
        math.cos(half) * math.cos(roll),
        math.cos(half) * math.sin(roll),
        math.sin(half) * math.sin(roll),
        math.sin(half) * math.cos(roll),
    )
    message = d.MAVLink_attitude_quaternion_message(1000, *q, 0.0, 0.0, -0.25)
    ardurover = link()
    assert read(ardurover, message) == []  # before the autopilot's own filter is ready
    (name, heading), (same, rate) = read(ardurover, READY, message)
    assert name == same == "ATTITUDE_QUATERNION" and rate == YawRate(t_ns=7, r_radps=-0.25)
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(degrees, abs=1e-4)


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (3.0, 0.0, 0.0, 0.0)])
def test_what_is_no_rotation_gives_none(q: tuple[float, ...]) -> None:
    assert read(link(), READY, d.MAVLink_attitude_quaternion_message(1000, *q, 0.0, 0.0, 0.0)) == []


SCALED = (100, -200, -1000, 0, 0, 250, 0, 0, 0)  # milli-g, mrad/s


@pytest.mark.parametrize(
    "message",
    [
        d.MAVLink_raw_imu_message(1000, *SCALED),
        d.MAVLink_scaled_imu_message(1000, *SCALED),
        d.MAVLink_scaled_imu2_message(1000, *SCALED),
        d.MAVLink_scaled_imu3_message(1000, *SCALED),
    ],
)
def test_inertial_messages_in_milli_g(message: object) -> None:
    (name, rate), (same, force) = read(link(), message)
    assert name == same == type(message).msgname  # type: ignore[attr-defined]
    assert isinstance(rate, YawRate) and isinstance(force, SpecificForce)
    assert (force.ax_mps2, force.ay_mps2, rate.r_radps) == pytest.approx((0.980665, -1.96133, 0.25))


ROLL, PITCH = math.radians(10.0), math.radians(-5.0)
TURN = d.MAVLink_attitude_quaternion_message(
    1000,
    math.cos(ROLL / 2) * math.cos(PITCH / 2),
    math.sin(ROLL / 2) * math.cos(PITCH / 2),
    math.cos(ROLL / 2) * math.sin(PITCH / 2),
    -math.sin(ROLL / 2) * math.sin(PITCH / 2),
    0.0,
    0.0,
    0.0,
)


@pytest.mark.parametrize("attitude", [d.MAVLink_attitude_message(1000, ROLL, PITCH, 0.0, 0.0, 0.0, 0.0), TURN])
@pytest.mark.parametrize("highres", [False, True])
def test_gravity_is_taken_out_by_the_attitude(attitude: object, highres: bool) -> None:
    ahead_mps2, starboard_mps2 = 0.4, -0.3
    shown = tilted(ahead_mps2, starboard_mps2, ROLL, PITCH)
    message: object = d.MAVLink_highres_imu_message(1, *shown, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x3F)
    if not highres:
        message = d.MAVLink_raw_imu_message(1, *(round(part / 9.80665e-3) for part in shown), *[0] * 6)
    found = [m for _, m in read(link(), READY, attitude, message) if isinstance(m, SpecificForce)]
    assert (found[0].ax_mps2, found[0].ay_mps2) == pytest.approx((ahead_mps2, starboard_mps2), abs=0.01)


@pytest.mark.parametrize(
    ("updated", "accel", "rate"),
    [(0x3F, True, True), (0x03, True, False), (0x20, False, True), (0x01, False, False), (0x1C, False, False)],
)
def test_highres_imu_gives_what_was_updated(updated: int, accel: bool, rate: bool) -> None:
    message = d.MAVLink_highres_imu_message(1, 0.5, -0.25, -9.75, 0, 0, 0.125, 0, 0, 0, 0, 0, 0, 0, updated)
    found = read(link(), message)
    expected: list[Measurement] = [YawRate(t_ns=7, r_radps=0.125)] if rate else []
    expected += [SpecificForce(t_ns=7, ax_mps2=0.5, ay_mps2=-0.25)] if accel else []
    assert found == [("HIGHRES_IMU", m) for m in expected]


def test_wind_comes_from_and_wind_cov_goes_to() -> None:
    west = d.MAVLink_wind_message(270.0, 5.0, 0.0)
    north_east = d.MAVLink_wind_cov_message(0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    (one, first), (two, second) = read(link(), west, north_east)
    assert (one, two) == ("WIND", "WIND_COV") and isinstance(first, TrueWind) and isinstance(second, TrueWind)
    assert (first.vn_mps, first.ve_mps) == pytest.approx((0.0, 5.0), abs=1e-12)
    assert (second.vn_mps, second.ve_mps) == (3.0, 4.0)


def test_wind_that_is_not_known_gives_none() -> None:
    nan = math.nan
    assert read(link(), d.MAVLink_wind_message(nan, 5.0, 0.0), d.MAVLink_wind_message(1.0, -1.0, 0.0)) == []
    assert read(link(), d.MAVLink_wind_cov_message(0, nan, 4.0, 0, 0, 0, 0, 0, 0)) == []


@pytest.mark.parametrize("fix", [0, 1, 2, 7, 9, 200])  # 7: static, a base station; there is no 9
def test_what_is_no_fix_of_a_boat_gives_none(fix: int) -> None:
    assert read(link(), gps(d.MAVLink_gps_raw_int_message, 1000, fix)) == []


def test_a_course_beyond_the_circle_is_not_known() -> None:
    ((_, place),) = read(link(), gps(d.MAVLink_gps_raw_int_message, 1000, 3, cog=40000))
    assert isinstance(place, Position)
    assert len(read(link(), gps(d.MAVLink_gps_raw_int_message, 1000, 3, cog=36000))) == 2


def test_several_inertial_units_are_not_one_source() -> None:
    ardurover = link()

    def imu(number: int, zgyro: int) -> object:
        return d.MAVLink_raw_imu_message(1, 0, 0, -1000, 0, 0, zgyro, 0, 0, 0, id=number, temperature=0)

    rates = [m.r_radps for _, m in read(ardurover, imu(1, 100), imu(0, 300), imu(1, 200)) if isinstance(m, YawRate)]
    assert rates == pytest.approx([0.1, 0.2])


@pytest.mark.parametrize("levels", [True, False])
def test_the_trim_of_an_ardupilots_attitude_is_none_of_its_accelerometers(levels: bool) -> None:
    """AHRS_TRIM_X and _Y are taken off ATTITUDE, and not off RAW_IMU: 0.05 rad are 0.5 m/s^2."""
    config = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0")
    ardurover = ArduRoverAutopilot(config, PwmConfig(), levels=levels)
    read(ardurover, d.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3), READY)
    board = tilted(0.3, -0.2, 0.15, -0.085)
    milli_g = [round(a / 9.80665e-3) for a in board]
    imu = d.MAVLink_raw_imu_message(1, *milli_g, 0, 0, 0, 0, 0, 0, id=0, temperature=0)

    def off(roll_rad: float, pitch_rad: float) -> float:
        attitude = d.MAVLink_attitude_message(1000, roll_rad, pitch_rad, 1.0, 0.0, 0.0, 0.0)
        [force] = [m for _, m in read(ardurover, attitude, imu) if isinstance(m, SpecificForce)]
        return math.hypot(force.ax_mps2 - 0.3, force.ay_mps2 + 0.2)

    assert off(0.15, -0.085) < 0.02, "without a trim"
    for name, value in ((b"AHRS_TRIM_X", 0.05), (b"AHRS_TRIM_Y", -0.035)):
        read(ardurover, d.MAVLink_param_value_message(name, value, d.MAV_PARAM_TYPE_REAL32, 900, 1))
    assert (off(0.10, -0.05) < 0.02) is levels


def test_tilt_and_inertial_unit_of_before_a_reboot_are_forgotten() -> None:
    """It may have been mounted otherwise while it was off, and its first unit have failed."""
    ardurover = link()

    def forces(*messages: object) -> list[float]:
        return [m.ay_mps2 for _, m in read(ardurover, *messages) if isinstance(m, SpecificForce)]

    def imu(number: int) -> object:
        return d.MAVLink_raw_imu_message(1, 0, 100, -1000, 0, 0, 0, 0, 0, 0, id=number, temperature=0)

    read(ardurover, d.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3), READY)
    read(ardurover, d.MAVLink_attitude_message(60_000, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0))
    [levelled] = forces(imu(0))
    assert levelled == pytest.approx(9.80665 * (0.1 * math.cos(0.5) + math.sin(0.5))) and forces(imu(1)) == []
    attitude = d.MAVLink_attitude_message(1_000, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    assert forces(attitude, imu(1)) == pytest.approx([0.980665]) and ardurover.reboots == 1
    assert forces(imu(0)) == []
