"""The simulated ArduRover: boot, readiness and the contents of its messages, as measured with a real one."""

from __future__ import annotations

import math

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from asvhil.types import Frame
from tests.support.ardurover import ACCEPTED, ATTITUDE, GPS_RAW_INT, HOLD, SIM_STATE, set_parameter
from tests.support.simplant_boat import Boat, of, times

# --- boot and readiness -----------------------------------------------------------------------------------------------


def test_nothing_is_sent_and_no_motor_has_a_signal_before_boot() -> None:
    boat = Boat()
    boat.send(mav.MAVLink_timesync_message(0, 5))
    assert boat.run(0.99) == []
    assert boat.seat.outputs_us == (0, 0)
    first = boat.run(0.02)
    assert [m.get_type() for _, m in first] == ["HEARTBEAT", "STATUSTEXT"]
    assert boat.seat.outputs_us == (1500, 1500)


def test_heartbeat_is_that_of_a_disarmed_boat_in_manual() -> None:
    boat = Boat()
    beat = of(boat.run(1.1), "HEARTBEAT")[0]
    assert (beat.type, beat.autopilot, beat.base_mode, beat.custom_mode, beat.system_status) == (11, 3, 65, 0, 4)
    assert (beat.get_srcSystem(), beat.get_srcComponent(), beat.mavlink_version) == (1, 1, 3)


def test_by_default_every_stream_comes_at_1_hz() -> None:
    boat = Boat().ready()
    log = boat.run(10.0)
    names = {m.get_type() for _, m in log} - {"TIMESYNC"}
    assert names == {
        "HEARTBEAT",
        "ATTITUDE",
        "GLOBAL_POSITION_INT",
        "VFR_HUD",
        "SYS_STATUS",
        "SERVO_OUTPUT_RAW",
        "RC_CHANNELS",
        "RAW_IMU",
        "SCALED_IMU2",
        "GPS_RAW_INT",
        "SYSTEM_TIME",
        "BATTERY_STATUS",
        "EKF_STATUS_REPORT",
        "LOCAL_POSITION_NED",
    }
    for name in names:
        seen = times(log, name)
        assert len(seen) == 10 and seen[-1] - seen[0] == pytest.approx(9.0)


@pytest.mark.parametrize(("sensor", "known"), [("false", False), ("true", True)])
def test_its_battery_is_told_as_recorded(sensor: str, known: bool) -> None:
    boat = Boat(f"plant.frontseat.current_sensor={sensor}", "vehicle.power.hotel_w=1260")
    told = of(boat.run(6.0), "BATTERY_STATUS")[-1]
    assert (told.id, told.battery_function, told.type, told.temperature) == (0, 0, 0, 32767)
    assert told.voltages == [12_600, *[65_535] * 9] and told.voltages_ext == [0] * 4
    assert (told.battery_remaining, told.time_remaining, told.charge_state, told.fault_bitmask) == (-1, 0, 1, 0)
    used = (told.current_battery, told.current_consumed, told.energy_consumed)
    assert used == ((10_000, 167, 76) if known else (-1, -1, -1)), "100 A for 6 s at 12.6 V, in 10 mA, mAh, 100 J"


def test_readiness_is_told_by_the_ekf_flags_and_positions_wait_for_it() -> None:
    boat = Boat("plant.frontseat.ready_after_s=31")
    before = boat.run(30.98)
    flags = [m.flags for m in of(before, "EKF_STATUS_REPORT")]
    assert set(flags) == {1024, 167} and flags == sorted(flags, reverse=True)
    assert {(m.lat, m.lon, m.vx) for m in of(before, "GLOBAL_POSITION_INT")} == {(0, 0, 0)}
    assert {m.fix_type for m in of(before, "GPS_RAW_INT")} == {1}
    assert of(before, "LOCAL_POSITION_NED") == []
    assert {m.time_unix_usec for m in of(before, "SYSTEM_TIME")} == {0}
    after = boat.run(0.5)
    assert {m.flags for m in of(after, "EKF_STATUS_REPORT")} == {831}
    assert {(m.lat, m.lon) for m in of(after, "GLOBAL_POSITION_INT")} == {(404237000, -869212000)}
    assert {m.fix_type for m in of(after, "GPS_RAW_INT")} == {3}
    assert len(of(after, "LOCAL_POSITION_NED")) == 1
    assert of(after, "SYSTEM_TIME")[0].time_unix_usec > 1_700_000_000_000_000


def test_time_since_boot_counts_from_power_on() -> None:
    boat = Boat()
    for t, message in boat.run(5.0):
        if message.get_type() == "ATTITUDE":
            assert message.time_boot_ms == round(1000 * t)


def test_what_is_written_while_it_sets_itself_up_may_be_lost() -> None:
    boat = Boat("plant.frontseat.setup_s=1", "plant.frontseat.rc1_dz_us=30", "plant.frontseat.rc3_dz_us=30")
    beats = of(boat.run(1.5), "HEARTBEAT")
    assert {(m.custom_mode, m.system_status) for m in beats} == {(16, 2)}
    assert set_parameter(boat, "RC1_DZ", 0.0) == 0.0  # as it reads now anyway
    assert set_parameter(boat, "RC3_DZ", 5.0) == 5.0
    boat.run(1.0)
    assert of(boat.log, "HEARTBEAT")[-1].system_status == 4
    assert (boat.seat.rover.parameters["RC1_DZ"], boat.seat.rover.parameters["RC3_DZ"]) == (30.0, 5.0)


# --- contents ---------------------------------------------------------------------------------------------------------


def test_message_contents_agree_with_the_truth() -> None:
    boat = Boat("plant.start_heading_deg=-90", "plant.start_n_m=100", "plant.start_e_m=-50").ready()
    boat.seat.arm(True)
    boat.hold(1700, 1680, 8.0)
    for msg_id in (ATTITUDE, 31, 33, 32, GPS_RAW_INT, 74, 27, 26, 116, 105, SIM_STATE):
        boat.interval(msg_id, 100_000)
    boat.run(0.5)
    while boat.t_ns % 200_000_000:  # to the instant of a fix
        boat.run(0.02)
    log = dict((m.get_type(), m) for _, m in boat.run(0.2))
    truth = boat.plant.truth
    psi = truth.psi_rad
    vn = math.cos(psi) * truth.u_mps - math.sin(psi) * truth.v_mps
    ve = math.sin(psi) * truth.u_mps + math.cos(psi) * truth.v_mps
    assert truth.u_mps > 0.8 and abs(truth.r_radps) > 0.005  # something to see
    near = {"abs": 0.06}  # the messages are up to 0.1 s old
    attitude = log["ATTITUDE"]
    assert (attitude.yaw, attitude.yawspeed, attitude.roll) == (
        pytest.approx(psi, **near),
        pytest.approx(truth.r_radps, abs=0.01),
        0.0,
    )
    quaternion = log["ATTITUDE_QUATERNION"]
    assert 2.0 * math.atan2(quaternion.q4, quaternion.q1) == pytest.approx(psi, **near)
    position = log["GLOBAL_POSITION_INT"]
    n, e = boat.plant.origin.to_ned(position.lat * 1e-7, position.lon * 1e-7)
    assert (n, e) == pytest.approx((truth.n_m, truth.e_m), abs=0.2)
    assert (position.vx / 100, position.vy / 100) == pytest.approx((vn, ve), **near)
    assert position.hdg / 100 == pytest.approx(math.degrees(psi) % 360.0, abs=3.0)
    local = log["LOCAL_POSITION_NED"]
    assert (local.x, local.y, local.vx, local.vy) == pytest.approx((truth.n_m, truth.e_m, vn, ve), abs=0.2)
    gnss = log["GPS_RAW_INT"]
    assert boat.plant.origin.to_ned(gnss.lat * 1e-7, gnss.lon * 1e-7) == pytest.approx((n, e), abs=0.3)
    assert gnss.vel / 100 == pytest.approx(math.hypot(vn, ve), **near)
    assert gnss.cog / 100 == pytest.approx(math.degrees(math.atan2(ve, vn)) % 360.0, abs=4.0)
    hud = log["VFR_HUD"]
    assert hud.groundspeed == pytest.approx(math.hypot(vn, ve), **near)
    assert hud.heading == pytest.approx(math.degrees(psi) % 360.0, abs=4.0)
    sim = log["SIM_STATE"]
    assert (sim.yaw, sim.zgyro, sim.vn, sim.ve) == pytest.approx((psi, truth.r_radps, vn, ve), **near)
    assert boat.plant.origin.to_ned(sim.lat_int * 1e-7, sim.lon_int * 1e-7) == pytest.approx((n, e), abs=0.2)
    for name in ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2"):
        assert log[name].zgyro == pytest.approx(1000.0 * truth.r_radps, abs=10)
        assert log[name].zacc == -1000
    # 0.1 g is 0.980665 m/s^2: the raw messages count in thousandths of g
    assert log["RAW_IMU"].xacc == pytest.approx(log["HIGHRES_IMU"].xacc / 9.80665e-3, abs=2)


def test_garbage_between_frames_costs_nothing_and_peers_do_not_mix() -> None:
    boat = Boat().ready()
    command = mav.MAVLink_command_long_message(1, 1, 176, 0, 1, HOLD, 0, 0, 0, 0, 0)
    data = command.pack(mav.MAVLink(None, srcSystem=255, srcComponent=190))
    for peer, part in (
        ("a", b"\xfd\x09garbage"),
        ("b", b"\xfe" * 300),
        ("", data[:7]),
        ("a", data[:20]),
        ("", data[7:]),
    ):
        boat.plant.receive(Frame(t_ns=boat.t_ns, port="autopilot", data=part, peer=peer))
    assert [m.result for m in of(boat.run(0.02), "COMMAND_ACK")] == [ACCEPTED]


@pytest.mark.parametrize(
    ("firmware", "expected", "absent"),
    [
        ("4.6", {"SYSID_MYGCS": 255, "FS_ACTION": 4, "ARMING_CHECK": 4124, "SYSID_ENFORCE": 0}, "MAV_GCS_SYSID"),
        ("4.7", {"MAV_GCS_SYSID": 255, "MAV_GCS_SYSID_HI": 0, "FS_ACTION": 6, "MOT_REV_DELAY": 0}, "SYSID_MYGCS"),
    ],
)
def test_a_blueboat_has_its_makers_parameters(firmware: str, expected: dict[str, float], absent: str) -> None:
    """And a parameter of the config goes before them."""
    given = f"plant.frontseat.firmware='{firmware}'", "plant.frontseat.parameters={MOT_SLEWRATE: 100}"
    parameters = Boat("plant.frontseat.delivered=blueboat", *given).seat.rover.parameters
    common = {
        **{"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73, "SERVO3_REVERSED": 1, "SERVO1_TRIM": 1510, "RC1_MAX": 1901},
        **{"RC3_DZ": 30, "PILOT_STEER_TYPE": 3, "MOT_THST_ASYM": 1.6, "RC_OPTIONS": 37, "FS_THR_ENABLE": 0},
        **{"WNDVN_TYPE": 4, "MOT_SLEWRATE": 100},
    }
    found = {name: parameters[name] for name in (*common, *expected)}
    assert found == pytest.approx({**common, **expected})
    assert absent not in parameters.names
