"""ArduPilot's JSON physics interface, sans-IO: what comes, what is answered, and when the boat moves."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import Config, load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.ardupilot_json import ArduPilotJson, ServoFrame, parse_servos
from asvhil.simplant.plant import Plant
from asvhil.types import Frame
from tests.support.hil_clients import NEUTRAL, FixedOutputs, as_ardupilot_reads, servo_frame

FREE = "plant.hil.neutral_first_s=0"
CALM = "plant.weather.wind.speed_mps=0"
AHEAD = (1700, 1700)
FULL_ASTERN = (1000, 1000)


def config(*overrides: str) -> Config:
    return load_config("sitl", overrides)


class Sitl:
    """A client without a network; each call is a millisecond after the last."""

    def __init__(self, *overrides: str, rate_hz: int = 400) -> None:
        self.backend = ArduPilotJson(config(*overrides))
        self.rate_hz = rate_hz
        self.count = -1
        self.t_ns = 0

    def send(self, data: bytes, peer: str = "sitl") -> list[bytes]:
        self.t_ns += 1_000_000
        sent = self.backend.receive(Frame(t_ns=self.t_ns, port="physics", data=data, peer=peer))
        assert all(frame.peer == peer for frame in sent if frame.port == "physics")
        return [frame.data for frame in sent if frame.port == "physics"]

    def frame(self, pulses_us: tuple[int, int] = NEUTRAL) -> dict[str, Any]:
        self.count += 1
        (reply,) = self.send(servo_frame(self.count, pulses_us, self.rate_hz))
        return as_ardupilot_reads(reply)

    def run(self, seconds: float, pulses_us: tuple[int, int] = NEUTRAL) -> dict[str, Any]:
        state = {}
        for _ in range(round(seconds * self.rate_hz)):
            state = self.frame(pulses_us)
        return state


# --- bytes ------------------------------------------------------------------------------------------------------


def test_a_frame_of_16_channels_byte_by_byte() -> None:
    data = bytes.fromhex("1a48 9001 05000000" + "dc05" * 15 + "6c07")
    assert parse_servos(data) == ServoFrame(rate_hz=400, count=5, pwm_us=(1500,) * 15 + (1900,))


def test_a_frame_of_32_channels_byte_by_byte() -> None:
    data = bytes.fromhex("8173 b004 ffffffff" + "e803" * 31 + "d007")
    assert parse_servos(data) == ServoFrame(rate_hz=1200, count=0xFFFFFFFF, pwm_us=(1000,) * 31 + (2000,))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "0 bytes where 40"),
        (servo_frame(0)[:-1], "39 bytes where 40"),
        (servo_frame(0) + b"\0", "41 bytes where 40"),
        (servo_frame(0, channels=32)[:40], "magic number 29569 in 40 bytes"),
        (b"\0" * 72, "magic number 0 in 72 bytes"),
        (servo_frame(0, rate_hz=0), "frame rate 0 where 20 Hz"),
        (servo_frame(0, rate_hz=19), "frame rate 19 where 20 Hz"),
    ],
)
def test_what_is_no_frame_gets_no_answer_and_moves_nothing(data: bytes, words: str) -> None:
    sitl = Sitl(FREE)
    assert sitl.send(data) == []
    assert (sitl.backend.counters.bad, sitl.backend.plant.t_ns) == (1, 0)
    assert words in sitl.backend.counters.why_bad


@given(st.binary(max_size=80) | st.binary(min_size=38, max_size=38).map(lambda rest: b"\x1a\x48" + rest))
def test_any_bytes_are_answered_or_dropped(data: bytes) -> None:
    sitl = FUZZED
    before = sitl.backend.counters.frames + sitl.backend.counters.duplicates
    sent = sitl.send(data)
    assert len(sent) == sitl.backend.counters.frames + sitl.backend.counters.duplicates - before
    for reply in sent:
        as_ardupilot_reads(reply)


FUZZED = Sitl(FREE)


def test_the_answer_byte_by_byte() -> None:
    sitl = Sitl(CALM, "plant.start_n_m=1.5", "plant.start_e_m=-2.25", "plant.hil.ardupilot.windvane=false")
    (reply,) = sitl.send(servo_frame(0))
    assert reply == (
        b'\n{"timestamp":0.002500000,"imu":{"gyro":[0,0,0.000000000],"accel_body":[0.000000000,0.000000000,-9.80665]},'
        b'"position":[1.500000000,-2.250000000,0],"attitude":[0,0,0.000000000],'
        b'"velocity":[0.000000000,0.000000000,0]}\n'
    )


def test_optional_parts() -> None:
    state = Sitl("plant.hil.ardupilot.rc_us=[1500, 1501, 1502]", "plant.hil.ardupilot.battery_v=25.2").frame()
    assert state["rc"] == {"rc_1": 1500, "rc_2": 1501, "rc_3": 1502}
    assert state["battery"] == {"voltage": 25.2, "current": 0.0}


# --- lockstep ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_hz", [50, 400, 1200])
def test_one_step_of_a_frames_length_for_each_new_frame(rate_hz: int) -> None:
    sitl = Sitl(FREE, rate_hz=rate_hz)
    for count in range(1, 30):
        assert sitl.frame()["timestamp"] == pytest.approx(count / rate_hz, abs=count * 1e-9)


def test_a_resent_frame_gets_the_same_answer_and_never_steps() -> None:
    sitl = Sitl(FREE)
    sitl.run(0.5, AHEAD)
    first = sitl.send(servo_frame(sitl.count + 1, AHEAD))
    truth = sitl.backend.plant.truth
    for _ in range(5):
        assert sitl.send(servo_frame(sitl.count + 1, FULL_ASTERN)) == first
    assert sitl.backend.plant.truth == truth
    assert (sitl.backend.counters.duplicates, sitl.backend.counters.frames) == (5, 201)


def test_a_jump_is_a_loss_and_one_step() -> None:
    sitl = Sitl(FREE)
    sitl.run(0.25)
    sitl.count += 7
    assert sitl.frame()["timestamp"] == pytest.approx(101 / 400)
    assert (sitl.backend.counters.lost, sitl.backend.counters.restarts) == (7, 0)


def test_a_count_that_runs_back_is_a_restart_from_the_start() -> None:
    sitl = Sitl(FREE)
    first = [sitl.frame(AHEAD) for _ in range(800)]
    assert math.dist(first[-1]["position"], first[0]["position"]) > 0.5
    for restarts, count in enumerate((-1, 3), 1):  # its first frames may have got lost
        sitl.count = count
        assert [sitl.frame(AHEAD) for _ in range(800)] == first  # the weather too
        assert sitl.backend.counters.restarts == restarts


def test_the_count_wraps_without_a_restart() -> None:
    sitl = Sitl(FREE)
    sitl.count = 2**32 - 3
    for count in (2**32 - 2, 2**32 - 1, 0, 1):
        sitl.send(servo_frame(count))
    assert (sitl.backend.counters.frames, sitl.backend.counters.restarts, sitl.backend.counters.lost) == (4, 0, 0)


def test_the_rate_may_change_while_it_runs() -> None:
    """ArduPilot comes from its default of 1200 Hz to SIM_RATE_HZ one by one."""
    sitl = Sitl(FREE, CALM, rate_hz=1200)
    expected_s = 0.0
    for rate_hz in range(1200, 399, -1):
        sitl.rate_hz = rate_hz
        expected_s += 1.0 / rate_hz
        state = sitl.frame(AHEAD)
    assert state["timestamp"] == pytest.approx(expected_s, abs=1e-6)
    even = Sitl(FREE, CALM, rate_hz=1200)
    for _ in range(round(expected_s * 1200)):
        steady = even.frame(AHEAD)
    assert state["velocity"] == pytest.approx(steady["velocity"], abs=2e-3)


def test_another_autopilot_waits_until_the_first_is_silent() -> None:
    sitl = Sitl(FREE)
    sitl.run(0.1)
    assert sitl.send(servo_frame(0), peer="second") == []
    assert (sitl.backend.counters.strangers, sitl.backend.counters.restarts) == (1, 0)
    sitl.t_ns += 600_000_000
    (reply,) = sitl.send(servo_frame(7), peer="second")
    assert as_ardupilot_reads(reply)["timestamp"] == pytest.approx(1 / 400)
    assert sitl.backend.counters.restarts == 1


# --- the boat ---------------------------------------------------------------------------------------------------


def test_the_boat_is_moored_through_the_boot_transient() -> None:
    """Neutral, full astern near 1.9 s, neutral again: only then, and 5 s later, is it let go."""
    sitl = Sitl("plant.weather.current={speed_mps: 0.4, toward_deg: 90}")
    still = {"position": [-14.0, -3.0, 0.0], "velocity": [0.0, 0.0, 0.0]}
    for seconds, pulses_us in ((1.9, NEUTRAL), (0.1, FULL_ASTERN), (5.0, NEUTRAL)):
        state = sitl.run(seconds, pulses_us)
        assert {key: state[key] for key in still} == still
        assert state["imu"] == {"gyro": [0.0, 0.0, 0.0], "accel_body": [0.0, 0.0, -9.80665]}
    assert state["timestamp"] == pytest.approx(7.0)
    state = sitl.run(1.0)
    assert not sitl.backend.plant.moored
    assert state["velocity"][1] == pytest.approx(0.4, abs=0.01)


@pytest.mark.parametrize("pulses_us", [(1479, 1500), (1500, 1521), (0, 0), FULL_ASTERN])
def test_it_stays_moored_while_an_output_is_not_neutral(pulses_us: tuple[int, int]) -> None:
    sitl = Sitl(rate_hz=50)
    sitl.run(20.0, pulses_us)
    assert sitl.backend.plant.moored


def test_a_restart_moors_it_again() -> None:
    sitl = Sitl(rate_hz=50)
    sitl.run(6.0)
    assert not sitl.backend.plant.moored
    sitl.count = -1
    sitl.frame()
    assert sitl.backend.plant.moored


def test_the_motors_are_on_their_outputs() -> None:
    state = Sitl(FREE, CALM).run(3.0, (1700, 1500))
    assert state["imu"]["gyro"][2] > 0.05 and state["velocity"][0] > 0.1  # port ahead alone: ahead and to starboard
    swapped = Sitl(FREE, CALM, "vehicle.pwm.port.output=3", "vehicle.pwm.starboard.output=1").run(3.0, (1700, 1500))
    assert swapped["imu"]["gyro"][2] == pytest.approx(-state["imu"]["gyro"][2])


def test_specific_force_is_the_change_of_velocity_and_gravity() -> None:
    sitl = Sitl(FREE, CALM, "plant.start_heading_deg=30")
    sitl.run(1.0, (1800, 1600))
    before, after = sitl.frame((1800, 1600)), sitl.frame((1800, 1600))
    psi = after["attitude"][2]
    an, ae = ((a - b) * 400.0 for a, b in zip(after["velocity"], before["velocity"], strict=True) if a != 0.0)
    ax, ay, az = after["imu"]["accel_body"]
    assert (ax, ay) == pytest.approx(
        (an * math.cos(psi) + ae * math.sin(psi), ae * math.cos(psi) - an * math.sin(psi)), abs=5e-3
    )
    assert ax > 0.3 and az == -9.80665


@pytest.mark.parametrize(
    ("toward_deg", "heading_deg", "from_deg"), [(180, 0, 0), (0, 0, 180), (270, 0, 90), (90, 0, 270), (270, 90, 0)]
)
def test_the_vane_is_where_the_wind_comes_from_clockwise_from_the_bow(
    toward_deg: int, heading_deg: int, from_deg: int
) -> None:
    wind = f"plant.weather.wind={{speed_mps: 5, toward_deg: {toward_deg}, gust_along: 0, gust_across: 0}}"
    vane = Sitl(wind, f"plant.start_heading_deg={heading_deg}").frame()["windvane"]
    assert vane["speed"] == pytest.approx(5.0)
    assert math.remainder(vane["direction"] - math.radians(from_deg), math.tau) == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("weather", [[], ["plant.weather.waves={orbital_std_mps: 0.07, yaw_std_radps: 0.02}"]])
def test_it_moves_as_the_loopback_plant_does_from_the_same_outputs(weather: list[str]) -> None:
    """A small autopilot in virtual time holds a heading; the loopback plant gets the same outputs."""
    overrides = [FREE, "plant.step_s=0.01", "plant.weather.current={speed_mps: 0.3, toward_deg: 200}", *weather]
    sitl = Sitl(*overrides, rate_hz=100)
    outputs: list[tuple[int, int]] = []
    path = []
    state = sitl.frame()
    outputs.append(NEUTRAL)
    path.append(state)
    for _ in range(3000):
        error = math.remainder(state["attitude"][2] - math.radians(60.0), math.tau)
        turn = max(-150, min(150, round(400.0 * (-0.8 * error - 1.5 * state["imu"]["gyro"][2]))))
        outputs.append((1650 + turn, 1650 - turn))
        state = sitl.frame(outputs[-1])
        path.append(state)
    assert math.degrees(state["attitude"][2]) == pytest.approx(60.0, abs=10.0)
    assert len(set(outputs)) > 20

    autopilot = FixedOutputs()
    plant = Plant(config(*overrides), 0, autopilot)
    for autopilot.outputs_us, expected in zip(outputs, path, strict=True):
        plant.step()
        truth = plant.truth
        vn, ve = plant.motion.ground_velocity_ned()
        assert (truth.n_m, truth.e_m) == pytest.approx(expected["position"][:2], abs=1e-6)
        assert (vn, ve) == pytest.approx(expected["velocity"][:2], abs=1e-6)
        assert truth.r_radps == pytest.approx(expected["imu"]["gyro"][2], abs=1e-6)
        assert math.remainder(truth.psi_rad - expected["attitude"][2], math.tau) == pytest.approx(0.0, abs=1e-6)


def test_it_moves_as_the_simulated_vehicle_moved_it() -> None:
    """The other way round: outputs of the simulated ArduRover, armed and driven over MAVLink, through the interface."""
    overrides = (FREE, "plant.step_s=0.01", "plant.weather.current={speed_mps: 0.2, toward_deg: 30}")
    plant, sitl = Plant(config(*overrides), 0), Sitl(*overrides, rate_hz=100)
    link = mav.MAVLink(None, srcSystem=1, srcComponent=191)
    arm = mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(link)
    driven = set()
    for step in range(1, 2001):
        if step == 400:
            plant.receive(Frame(t_ns=plant.t_ns, port="autopilot", data=arm, peer="companion"))
        if step > 410 and step % 10 == 0:
            sticks = 1500 + step % 300, 65535, 1800 - step % 500
            message = mav.MAVLink_rc_channels_override_message(1, 1, *sticks, *[65535] * 5)
            plant.receive(Frame(t_ns=plant.t_ns, port="autopilot", data=message.pack(link), peer="companion"))
        outputs_us = plant.truth.outputs_us
        driven.add(outputs_us)
        plant.advance(step * 10_000_000)
        state, truth = sitl.frame(outputs_us), plant.truth
        assert state["timestamp"] == pytest.approx(truth.t_ns * 1e-9, abs=1e-9)
        assert (truth.n_m, truth.e_m) == pytest.approx(state["position"][:2], abs=1e-6)
        assert (truth.psi_rad, truth.r_radps) == pytest.approx(
            (state["attitude"][2], state["imu"]["gyro"][2]), abs=1e-6
        )
    assert len(driven) > 50


# --- faults -----------------------------------------------------------------------------------------------------


def test_a_dead_motor_lets_the_boat_turn() -> None:
    fault = "plant.faults=[{kind: port-motor, from_s: 2, until_s: 6}]"
    sitl = Sitl(FREE, CALM, fault)
    assert sitl.run(2.0, AHEAD)["imu"]["gyro"][2] == pytest.approx(0.0, abs=1e-6)
    assert sitl.run(3.5, AHEAD)["imu"]["gyro"][2] < -0.05  # starboard alone drives it to port
    assert sitl.backend.plant.truth.outputs_us == (0, 1700)
    sitl.run(1.0, AHEAD)
    assert sitl.backend.plant.truth.outputs_us == AHEAD


def test_vane_faults_reach_the_answer_and_the_boats_own_line() -> None:
    faults = "plant.faults=[{kind: vane, from_s: 1, until_s: 4}, {kind: anemometer, from_s: 2, until_s: 3}]"
    sitl = Sitl(FREE, faults)
    sitl.run(1.0, (1500, 1800))
    stuck = {sitl.frame((1500, 1800))["windvane"]["direction"] for _ in range(300)}
    assert len(stuck) == 1
    sitl.run(0.4, (1500, 1800))
    assert "windvane" not in sitl.frame()
    sitl.run(1.0, (1500, 1800))
    assert sitl.frame()["windvane"]["direction"] == stuck.pop()
    sitl.run(1.0, (1500, 1800))
    assert len({sitl.frame((1500, 1800))["windvane"]["direction"] for _ in range(50)}) > 40


def test_a_fault_that_the_interface_cannot_carry_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"plant.faults.1.kind: .* carries the true motion .* take gnss out"):
        ArduPilotJson(config("plant.faults=[{kind: vane}, {kind: gnss, from_s: 3}]"))
    with pytest.raises(ConfigError, match=r"plant.glitches.kinds.0.kind: .* take gnss-jump out"):
        ArduPilotJson(config("plant.glitches={}"))
    with pytest.raises(ConfigError, match="take transmitter out, and use the autopilot's own SIM_RC_FAIL"):
        ArduPilotJson(config("plant.faults=[{kind: transmitter}]"))
    device = "links.gnss={endpoint: 'pty:gnss', declination_deg: 0}"
    ArduPilotJson(config(device, "plant.glitches.kinds=[{kind: gnss-jump, device: nmea}, {kind: anemometer}]"))


def test_the_anemometer_speaks_on_its_own_link_meanwhile() -> None:
    backend = ArduPilotJson(config(FREE))
    ports: list[str] = []
    for count in range(2000):
        frames = backend.receive(Frame(t_ns=count, port="physics", data=servo_frame(count), peer="sitl"))
        assert frames[0].port == "physics"
        ports += [frame.port for frame in frames[1:]]
    assert ports == ["anemometer"] * 25  # 5 Hz in 5 s


def test_frames_hold_what_they_should() -> None:
    assert servo_frame(1, (1100, 1900), 400) == struct.pack("<HHI16H", 18458, 400, 1, 1100, 1000, 1900, *[1000] * 13)
