"""The simulated ArduRover's streams and single messages, against the measured behaviour of a real one."""

from __future__ import annotations

import itertools
import math

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from tests.support.ardurover import (
    ACCEPTED,
    ATTITUDE,
    DENIED,
    FAILED,
    GPS_RAW_INT,
    SERVO_OUTPUT_RAW,
    SIM_STATE,
    intervals,
)
from tests.support.simplant_boat import Boat, of


def test_set_message_interval_changes_one_stream() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 50_000) == ACCEPTED
    assert set(intervals(boat, "ATTITUDE", 2.0)) == {0.06, 0.04}  # 20 Hz on a loop of 50 Hz: 39 to 61 ms, as measured
    assert boat.interval(SERVO_OUTPUT_RAW, 200_000) == ACCEPTED
    log = boat.run(2.0)
    assert len(of(log, "ATTITUDE")) == 40
    assert len(of(log, "SERVO_OUTPUT_RAW")) == 10
    assert len(of(log, "RAW_IMU")) == 2


def test_faster_than_0_8_of_the_loop_is_denied_and_the_old_rate_stays() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 100_000) == ACCEPTED
    assert boat.interval(ATTITUDE, 20_000) == DENIED
    assert set(intervals(boat, "ATTITUDE", 1.0)) == {0.1}
    assert boat.interval(ATTITUDE, 25_000) == ACCEPTED  # 40 Hz is the limit
    assert len(of(boat.run(1.0), "ATTITUDE")) == 40


def test_interval_0_is_the_default_and_minus_1_is_off() -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, 100_000) == ACCEPTED
    assert boat.interval(ATTITUDE, -1) == ACCEPTED
    assert of(boat.run(3.0), "ATTITUDE") == []
    assert boat.interval(ATTITUDE, 0) == ACCEPTED
    assert set(intervals(boat, "ATTITUDE", 3.5)) == {1.0}
    assert boat.interval(SIM_STATE, 100_000) == ACCEPTED
    assert len(of(boat.run(1.0), "SIM_STATE")) == 10
    assert boat.interval(SIM_STATE, 0) == ACCEPTED  # not streamed by default
    assert of(boat.run(2.0), "SIM_STATE") == []


@pytest.mark.parametrize("msg_id", [331, 231, 63, 64, 375, 93, 9999, -5])
def test_unavailable_messages_are_denied(msg_id: int) -> None:
    assert Boat().ready().interval(msg_id, 100_000) == DENIED


@pytest.mark.parametrize("msg_id", [24, 33, 32, 30, 31, 27, 26, 116, 36, 105, 74, 193, 65, 2, 108, 0])
def test_available_messages_arrive_at_the_rate_asked_for(msg_id: int) -> None:
    boat = Boat().ready()
    assert boat.interval(msg_id, 100_000) == ACCEPTED
    assert sum(m.get_msgId() == msg_id for _, m in boat.run(2.0)) == 20


@pytest.mark.parametrize("msg_id", [168, 124])
def test_wind_and_second_gps_are_accepted_and_never_sent(msg_id: int) -> None:
    boat = Boat().ready()
    assert boat.interval(msg_id, 100_000) == ACCEPTED
    assert all(m.get_msgId() != msg_id for _, m in boat.run(3.0))


@pytest.mark.parametrize("interval_us", [math.nan, math.inf])
def test_intervals_that_are_not_finite_are_denied(interval_us: float) -> None:
    boat = Boat().ready()
    assert boat.interval(ATTITUDE, interval_us) == DENIED
    assert boat.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, interval_us, 1e5) == DENIED


def test_get_message_interval() -> None:
    boat = Boat().ready()
    boat.interval(ATTITUDE, 50_000)
    assert boat.command(mav.MAV_CMD_GET_MESSAGE_INTERVAL, ATTITUDE) == ACCEPTED
    assert boat.command(mav.MAV_CMD_GET_MESSAGE_INTERVAL, SIM_STATE) == ACCEPTED
    found = [(m.message_id, m.interval_us) for m in of(boat.log, "MESSAGE_INTERVAL")]
    assert found == [(ATTITUDE, 50_000), (SIM_STATE, -1)]


def test_gnss_fixes_come_at_5_hz_and_repeat_when_streamed_faster() -> None:
    boat = Boat().ready()
    boat.interval(GPS_RAW_INT, 50_000)
    stamps = [m.time_usec for m in of(boat.run(2.0), "GPS_RAW_INT")]
    assert len(stamps) == 40 and len(set(stamps)) in (10, 11)
    assert {b - a for a, b in itertools.pairwise(stamps)} == {0, 200_000}


def test_legacy_data_stream_requests_are_taken_without_an_ack() -> None:
    boat = Boat().ready()
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_EXTRA1, 4, 1))
    boat.run(0.02)
    assert set(intervals(boat, "ATTITUDE", 2.0)) == {0.26, 0.24}
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_ALL, 4, 0))
    boat.run(0.02)
    assert {m.get_type() for _, m in boat.run(3.0)} == {"HEARTBEAT"}
    boat.send(mav.MAVLink_request_data_stream_message(1, 1, mav.MAV_DATA_STREAM_ALL, 100, 1))  # cut to 40 Hz
    boat.run(0.02)
    log = boat.run(1.0)
    assert len(of(log, "ATTITUDE")) == len(of(log, "SERVO_OUTPUT_RAW")) == 40
    assert of(boat.log, "COMMAND_ACK") == []


def test_request_message_answers_the_asker_after_the_ack() -> None:
    boat = Boat().ready()
    boat.peers.clear()
    assert boat.command(mav.MAV_CMD_REQUEST_MESSAGE, 148, peer="ground") == ACCEPTED
    kinds = [m.get_type() for _, m in boat.log]
    assert kinds == ["COMMAND_ACK", "AUTOPILOT_VERSION"]
    assert boat.peers == ["ground", "ground"]
    version = boat.log[1][1]
    assert version.flight_sw_version == 0x040603FF
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    assert boat.command(mav.MAV_CMD_REQUEST_MESSAGE, 331) == FAILED
    assert boat.command(mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == ACCEPTED
    assert len(of(boat.log, "AUTOPILOT_VERSION")) == 2
