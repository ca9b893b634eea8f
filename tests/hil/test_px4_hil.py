"""PX4's simulator interface, sans-IO: when a sample goes out, what it says, and what drives the motors."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.px4 import NEVER_NS, Px4Hil
from asvhil.simplant.hil.px4_messages import standard_pressure_pa
from asvhil.types import Frame

MS = 1_000_000
SECOND = 1000 * MS
FREE = "plant.hil.neutral_first_s=0"
CALM = "plant.weather.wind.speed_mps=0"
FAST = "plant.hil.px4.speed=0"
ARMED = 129
INERTIAL, ALL = 0x3F, 0x1BFF
COMPASS = 0b111000000


class Sitl:
    """A client without a network, on a clock of its own."""

    def __init__(self, *overrides: str, boot: bool = True) -> None:
        self.hil = Px4Hil(load_config("sitl", overrides))
        self.mav = mav.MAVLink(None, srcSystem=1, srcComponent=1)
        self.splitter = FrameSplitter()
        self.t_ns = 5 * SECOND
        self.flags = 1
        self.ports: list[str] = []
        self.hil.connect(self.t_ns)
        if boot:
            self.send(mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))

    def send_bytes(self, data: bytes) -> list[Any]:
        return self.read(self.hil.receive(Frame(t_ns=self.t_ns, port="physics", data=data)))

    def send(self, message: Any) -> list[Any]:
        return self.send_bytes(bytes(message.pack(self.mav)))

    def read(self, frames: list[Frame]) -> list[Any]:
        self.ports += [frame.port for frame in frames]
        data = b"".join(frame.data for frame in frames if frame.port == "physics")
        return [decode(part) for part in self.splitter.receive(data)]

    def wait(self, span_ns: int) -> list[Any]:
        """All that goes out while so much time passes and nothing comes."""
        end_ns, found = self.t_ns + span_ns, []
        while self.hil.next_ns <= end_ns:
            self.t_ns = max(self.t_ns, self.hil.next_ns)
            found += self.read(self.hil.poll(self.t_ns))
        self.t_ns = end_ns
        return found

    def next(self) -> list[Any]:
        """What goes out until the next sample has, which is the last of it."""
        found: list[Any] = []
        while not of(found, "HIL_SENSOR"):
            self.t_ns = max(self.t_ns, self.hil.next_ns)
            found += self.poll()
        return found

    def poll(self) -> list[Any]:
        return self.read(self.hil.poll(self.t_ns))

    def answer(self, time_us: int, port: float = 0.0, starboard: float = 0.0, mode: int = ARMED) -> None:
        controls = [port, starboard, *[0.0] * 14]
        assert self.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, self.flags)) == []

    def lockstep(self, samples: int, port: float = 0.0, starboard: float = 0.0, mode: int = ARMED) -> list[Any]:
        """Answer sample by sample; all that was sent."""
        found: list[Any] = []
        for _ in range(samples):
            new = self.next()
            sample = new[-1]
            found += new
            self.answer(sample.time_usec, port, starboard, mode)
        return found

    def ask(self, msg_id: float, interval_us: float, command: int = 511) -> int:
        (ack,) = self.send(mav.MAVLink_command_long_message(0, 0, command, 0, msg_id, interval_us, 0, 0, 0, 0, 0))
        assert ack.command == command
        return int(ack.result)


def of(messages: list[Any], name: str) -> list[Any]:
    return [message for message in messages if message.get_type() == name]


def samples_us(messages: list[Any]) -> list[int]:
    return [message.time_usec for message in of(messages, "HIL_SENSOR")]


# --- when -------------------------------------------------------------------------------------------------------


def test_nothing_but_heartbeats_until_the_autopilot_has_spoken() -> None:
    sitl = Sitl(boot=False)
    sent = sitl.wait(3 * SECOND)
    assert [message.get_type() for message in sent] == ["HEARTBEAT"] * 4
    assert (sent[0].type, sent[0].autopilot) == (mav.MAV_TYPE_GENERIC, mav.MAV_AUTOPILOT_INVALID)
    sitl.send_bytes(b"\0garbage\xfd\xfe")
    assert samples_us(sitl.wait(SECOND)) == []


def test_real_time_until_the_first_answer() -> None:
    sitl = Sitl()
    assert samples_us(sitl.wait(100 * MS)) == [4000 * k for k in range(1, 27)]
    assert not sitl.hil.lockstep


def test_in_lockstep_each_sample_waits_for_its_answer() -> None:
    sitl = Sitl(FAST)
    (first,) = of(sitl.poll(), "HIL_SENSOR")
    sitl.answer(first.time_usec)
    sitl.t_ns += 4 * MS
    for count in range(2, 100):
        (sample,) = of(sitl.poll(), "HIL_SENSOR")
        assert sample.time_usec == 4000 * count
        assert samples_us(sitl.poll()) == []  # no time has passed and no answer has come
        sitl.answer(sample.time_usec)
    assert (sitl.hil.counters.samples, sitl.hil.counters.unanswered) == (99, 0)


def test_an_answer_that_comes_twice_is_no_answer_to_the_next_sample() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    (sample,) = of(sitl.poll(), "HIL_SENSOR")
    for _ in range(5):
        sitl.answer(sample.time_usec - 4000)
        assert samples_us(sitl.poll()) == []
    assert sitl.hil.counters.duplicates == 5
    sitl.answer(sample.time_usec)
    assert samples_us(sitl.poll()) == [sample.time_usec + 4000]


def test_a_sample_without_answer_holds_nothing_up() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    assert len(samples_us(sitl.wait(0))) == 1
    assert samples_us(sitl.wait(9 * MS)) == []
    assert len(samples_us(sitl.wait(1 * MS))) == 1  # answer_timeout_s is 0.01
    assert sitl.hil.counters.unanswered == 1


def test_a_late_answer_is_to_its_own_sample() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    late, current = samples_us(sitl.wait(10 * MS))
    sitl.answer(late)
    assert samples_us(sitl.wait(9 * MS)) == []
    sitl.answer(current)
    assert samples_us(sitl.poll()) == [current + 4000]


def test_a_rover_that_answers_each_third_sample_is_waited_for_at_the_third() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(5)
    for _ in range(3):
        last_us = sitl.next()[-1].time_usec
    assert sitl.hil.counters.unanswered == 2
    sitl.answer(last_us)
    for k in range(30):
        sent = samples_us(sitl.wait(0))
        assert sent == [last_us + 12_000 * k + 4000 * n for n in (1, 2, 3)]
        assert samples_us(sitl.wait(MS)) == []
        sitl.answer(sent[-1])
    assert sitl.hil.counters.unanswered == 2


def test_a_loop_that_does_not_divide_the_sensor_rate_costs_no_time() -> None:
    """A rover's 100 Hz against 250 samples a second: PX4 answers after 2 and 3 samples by turns."""
    sitl = Sitl(FAST)
    sitl.lockstep(1)
    start_us, start_ns = sitl.hil.plant.t_ns // 1000, sitl.t_ns
    loop_us, in_vain = 0, []
    while sitl.hil.plant.t_ns // 1000 < start_us + 2_000_000:
        sitl.t_ns = max(sitl.t_ns, sitl.hil.next_ns)
        for sample_us in samples_us(sitl.poll()):
            if sample_us >= loop_us + 10_000:
                loop_us = sample_us // 10_000 * 10_000
                sitl.answer(sample_us)
                in_vain.append(sitl.hil.counters.unanswered)
    assert in_vain[10] == in_vain[-1] <= 3
    assert sitl.t_ns - start_ns <= 3 * 10 * MS  # no wait but for those


def test_a_px4_that_falls_silent_drives_no_motor_and_holds_nothing_up() -> None:
    sitl = Sitl(FREE, FAST, CALM)
    sitl.lockstep(500, 0.5, 0.5)
    answered_ns, start_ns = sitl.hil.plant.t_ns, sitl.t_ns
    while sitl.hil.plant.t_ns < answered_ns + 200 * MS:
        assert sitl.hil.lockstep and sitl.hil.plant.truth.outputs_us == (1700, 1700)
        sitl.next()
    sitl.next()
    assert (sitl.hil.lockstep, sitl.hil.armed, sitl.hil.silent) == (False, False, True)
    assert sitl.hil.plant.truth.outputs_us == (0, 0)
    assert sitl.t_ns - start_ns <= 51 * 10 * MS  # each of 50 samples was waited for
    before_ns = sitl.hil.plant.t_ns
    assert len(samples_us(sitl.wait(SECOND))) == pytest.approx(250, abs=3)  # in real time from there
    assert sitl.hil.plant.t_ns - before_ns == pytest.approx(SECOND, abs=12 * MS)
    waited = sitl.hil.counters.unanswered
    sitl.lockstep(100, 0.25, 0.25)
    assert sitl.hil.lockstep and sitl.hil.outputs_us == (1600, 1600) and not sitl.hil.silent
    assert (sitl.hil.counters.silences, sitl.hil.counters.unanswered) == (1, waited)


def test_a_board_that_falls_silent_drives_no_motor() -> None:
    sitl = Sitl(FREE)
    sitl.flags = 0
    sitl.answer(1, 0.5, 0.5)
    sitl.wait(190 * MS)
    assert sitl.hil.plant.truth.outputs_us == (1700, 1700)
    sitl.wait(30 * MS)
    assert sitl.hil.plant.truth.outputs_us == (0, 0)


def test_the_pace_is_real_time_and_a_stall_is_not_made_up_for() -> None:
    sitl = Sitl()
    sitl.lockstep(5)
    sitl.answer(sitl.next()[-1].time_usec)
    assert samples_us(sitl.wait(3 * MS)) == []  # answered at once, but the next is due 4 ms after it
    assert len(samples_us(sitl.wait(1 * MS))) == 1
    sitl.t_ns += 10 * SECOND
    for _ in range(3):
        sitl.answer(sitl.hil.plant.t_ns // 1000)
        (sample_us,) = samples_us(sitl.poll())
        sitl.answer(sample_us)
        assert samples_us(sitl.wait(3 * MS)) == []
        assert len(samples_us(sitl.wait(1 * MS))) == 1
        sitl.wait(4 * MS)


def test_twice_real_time() -> None:
    sitl = Sitl("plant.hil.px4.speed=2")
    sitl.lockstep(1)
    start_us, start_ns = sitl.hil.plant.t_ns // 1000, sitl.t_ns
    for _ in range(100):
        sample = sitl.next()[-1]
        sitl.answer(sample.time_usec)
    assert sample.time_usec - start_us == 2 * (sitl.t_ns - start_ns) // 1000


def test_a_board_without_lockstep_is_fed_in_real_time() -> None:
    sitl = Sitl(FAST)
    sitl.flags = 0
    sitl.answer(1)
    assert len(samples_us(sitl.wait(SECOND))) == 251
    assert sitl.hil.counters.unanswered == 0


def test_a_client_that_comes_back_finds_the_boat_at_its_start() -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(500, 0.6, 0.6)
    moved = sitl.hil.plant.truth
    sitl.hil.disconnect()
    assert sitl.hil.next_ns == NEVER_NS and sitl.poll() == []
    sitl.hil.connect(sitl.t_ns)
    assert sitl.hil.counters.restarts == 1 and not sitl.hil.armed
    truth = sitl.hil.plant.truth
    assert (truth.t_ns, truth.n_m, truth.e_m) == (0, -14.0, -3.0) and moved.n_m > -13.9
    sitl.send(mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))
    assert samples_us(sitl.lockstep(3)) == [4000, 8000, 12000]


def test_a_clock_that_runs_back_is_a_restart() -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(500, 0.6, 0.6)
    sitl.answer(10)
    assert (sitl.hil.counters.restarts, sitl.hil.plant.t_ns) == (1, 0)


# --- what -------------------------------------------------------------------------------------------------------


def test_what_a_boat_at_rest_measures() -> None:
    sitl = Sitl(CALM, "plant.start_heading_deg=90")
    samples = of(sitl.lockstep(1500), "HIL_SENSOR")
    full = [sample for sample in samples if sample.fields_updated == ALL]
    assert {sample.fields_updated for sample in samples} == {INERTIAL, ALL}
    assert len(full) == 301  # compass and barometer in the first, then at 50 Hz

    def mean(name: str, of_: list[Any] = samples) -> float:
        return sum(getattr(sample, name) for sample in of_) / len(of_)

    assert (mean("xacc"), mean("yacc"), mean("zacc")) == pytest.approx((0.0, 0.0, -9.80665), abs=0.13)
    assert mean("zacc") == pytest.approx(-9.80665, abs=0.002)
    assert (mean("xgyro"), mean("ygyro"), mean("zgyro")) == pytest.approx((0.0, 0.0, 0.0), abs=1.5e-3)
    # At 40.4 N 86.9 W the field points 0.20 gauss north, 0.016 west, 0.48 down; the bow is east.
    assert (mean("xmag", full), mean("ymag", full), mean("zmag", full)) == pytest.approx(
        (-0.0158, -0.2002, 0.4800), abs=3e-4
    )
    assert mean("abs_pressure", full) == pytest.approx(1013.25, abs=0.01)
    assert mean("pressure_alt", full) == pytest.approx(0.0, abs=0.05)


def test_no_sensor_repeats_itself() -> None:
    """PX4 takes one that does for dead. (Pressure comes in steps of 0.006 Pa, so two may be alike now and then.)"""
    sitl = Sitl(CALM)
    samples = of(sitl.lockstep(300), "HIL_SENSOR")
    full = [sample for sample in samples if sample.fields_updated == ALL]
    for name in ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"):
        assert len({getattr(sample, name) for sample in samples}) == len(samples), name
    for name in ("xmag", "ymag", "zmag", "abs_pressure", "pressure_alt"):
        assert len({getattr(sample, name) for sample in full}) > 0.8 * len(full), name


def test_two_runs_are_alike() -> None:
    runs = [[message.to_dict() for message in Sitl(FREE).lockstep(200, 0.5, 0.2)] for _ in range(2)]
    assert runs[0] == runs[1]
    other = [message.to_dict() for message in Sitl(FREE, "plant.seed=2").lockstep(200, 0.5, 0.2)]
    assert other != runs[0]


def test_fixes_at_their_rate_and_place() -> None:
    sitl = Sitl(CALM, "plant.sensors.gnss={slow_bias_m: 0, white_m: 0.001, velocity_white_mps: 0}")
    fixes = of(sitl.lockstep(1000), "HIL_GPS")
    assert len(fixes) == 21  # the first at once
    fix = fixes[-1]
    assert (fix.fix_type, fix.id, fix.yaw, fix.alt) == (3, 0, 0, 0)
    assert fix.lat * 1e-7 == pytest.approx(40.4237 - 14.0 / 111_030.0, abs=2e-7)
    assert fix.lon * 1e-7 == pytest.approx(-86.9212 - 3.0 / 84_900.0, abs=2e-7)
    assert {b.time_usec - a.time_usec for a, b in pairwise(fixes[1:])} == {200_000}
    assert (fix.vn, fix.ve, fix.vd, fix.vel) == (0, 0, 0, 0)
    ten = Sitl("plant.sensors.gnss.rate_hz=10")
    assert len(of(ten.lockstep(500), "HIL_GPS")) == 21


def test_a_receiver_without_fix_says_nothing() -> None:
    sitl = Sitl("plant.faults=[{kind: gnss, from_s: 1, until_s: 2}]")
    fixes = of(sitl.lockstep(750), "HIL_GPS")
    times_s = [fix.time_usec * 1e-6 % 100.0 for fix in fixes]
    assert len(times_s) == 11
    assert not any(1.0 <= t_s < 2.0 for t_s in times_s)


def test_faults_of_compass_and_imu_reach_the_samples() -> None:
    turned = "{kind: heading-jump, size: 90, from_s: 1, until_s: 2}"
    silent = "{kind: heading-silent, from_s: 2, until_s: 3}, {kind: imu-silent, from_s: 2.5, until_s: 3}"
    sitl = Sitl(CALM, f"plant.faults=[{turned}, {silent}]")
    seconds: list[list[Any]] = [[] for _ in range(4)]
    for sample in of(sitl.lockstep(1000), "HIL_SENSOR"):
        seconds[min(3, (sample.time_usec - 1) // 1_000_000)].append(sample)
    compass = [[s for s in second if s.fields_updated & COMPASS] for second in seconds]
    assert [round(mean_of(second, "xmag"), 2) for second in compass[:2]] == [0.2, -0.02]
    assert [round(mean_of(second, "ymag"), 2) for second in compass[:2]] == [-0.02, -0.2]  # the field comes from port
    assert len(compass[2]) <= 1 and len(compass[3]) > 40
    without = [s for s in seconds[2] if not s.fields_updated & INERTIAL]
    assert len(without) == pytest.approx(125, abs=1)


def mean_of(samples: list[Any], name: str) -> float:
    return sum(getattr(sample, name) for sample in samples) / len(samples)


def test_velocity_over_ground_in_fix_and_truth() -> None:
    current = "plant.weather.current={speed_mps: 0.5, toward_deg: 270}"
    sitl = Sitl(FREE, CALM, current, "plant.sensors.gnss.velocity_white_mps=0")
    assert sitl.ask(115, 5000) == 0
    sent = sitl.lockstep(250)
    fix, truth = of(sent, "HIL_GPS")[-1], of(sent, "HIL_STATE_QUATERNION")[-1]
    assert (fix.vn, fix.ve, fix.vel, fix.cog) == (0, -50, 50, 27000)
    assert (truth.vx, truth.vy, truth.vz) == (0, -50, 0)


def test_the_truth_comes_when_it_is_asked_for() -> None:
    sitl = Sitl(FREE, CALM, "plant.start_heading_deg=60")
    assert of(sitl.lockstep(50), "HIL_STATE_QUATERNION") == []
    assert sitl.ask(115, 20_000) == 0
    states = of(sitl.lockstep(250, 0.5, 0.5), "HIL_STATE_QUATERNION")
    assert len(states) == 51  # the first at once
    state = states[-1]
    q = state.attitude_quaternion
    assert 2.0 * math.atan2(q[3], q[0]) == pytest.approx(math.radians(60.0), abs=1e-3)
    motion = sitl.hil.plant.motion
    assert state.xacc == pytest.approx(motion.ax_mps2 / 9.80665 * 1000.0, abs=15)
    assert state.lat == pytest.approx(sitl.hil.plant.lat_lon_e7(motion.n_m, motion.e_m)[0], abs=3)
    assert sitl.ask(115, -1.0) == 0
    assert of(sitl.lockstep(50), "HIL_STATE_QUATERNION") == []


def test_the_sensor_rate_can_be_asked_for() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(5)
    assert sitl.ask(107, 2000) == 0
    now_us = sitl.hil.plant.t_ns // 1000
    sent = []
    for _ in range(100):
        new = sitl.wait(2 * MS)
        sent += samples_us(new)
        sitl.answer(sent[-1])
    assert sent == [now_us + 2000 * k for k in range(1, 101)]
    assert len({sample.xacc for sample in of(new, "HIL_SENSOR")}) == 1
    assert (sitl.ask(107, 0.0), sitl.ask(107, 100.0), sitl.ask(107, math.nan), sitl.ask(113, 1e5)) == (0, 2, 2, 2)
    assert sitl.ask(1, 0, command=400) == mav.MAV_RESULT_UNSUPPORTED


# --- motors -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("port", "starboard", "mode", "pulses_us"),
    [
        (0.0, 0.0, ARMED, (1500, 1500)),
        (1.0, -1.0, ARMED, (1900, 1100)),
        (0.5, -0.25, ARMED, (1700, 1400)),
        (7.0, -9.0, ARMED, (1900, 1100)),
        (math.nan, 0.1, ARMED, (1500, 1540)),
        (-1.8, -1.8, ARMED, (1500, 1500)),  # terminated, as PX4 1.16 says it
        (math.inf, -math.inf, ARMED, (1900, 1100)),
        (1.0, 1.0, 1, (0, 0)),  # disarmed
    ],
)
def test_controls_become_pulse_widths(port: float, starboard: float, mode: int, pulses_us: tuple[int, int]) -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(2, port, starboard, mode)
    sitl.wait(4 * MS)
    assert sitl.hil.plant.truth.outputs_us == pulses_us


def test_any_two_controls_can_be_the_motors() -> None:
    sitl = Sitl(FREE, "plant.hil.px4={port_control: 2, starboard_control: 1}")
    sitl.lockstep(2, 0.5, 0.0)
    assert sitl.hil.outputs_us == (1500, 1700)
    with pytest.raises(ConfigError, match="port_control and starboard_control must differ"):
        load_config("sitl", ("plant.hil.px4.port_control=2",))


def test_moored_until_the_controls_have_been_neutral_for_a_while() -> None:
    sitl = Sitl()
    sitl.lockstep(1000, 0.5, 0.5)
    sitl.lockstep(1000)
    assert sitl.hil.plant.moored
    sitl.lockstep(200, 0.5, 0.5)
    sitl.lockstep(1250)
    assert sitl.hil.plant.moored and sitl.hil.plant.truth.n_m == -14.0
    sitl.lockstep(3)
    assert not sitl.hil.plant.moored


def test_time_without_controls_and_time_disarmed_count_as_neutral() -> None:
    """PX4 1.16 sends none while a rover is disarmed: the boat is free by the time that it is armed and driven."""
    sitl = Sitl()
    sitl.wait(4 * SECOND)
    assert sitl.hil.plant.moored
    sitl.wait(2 * SECOND)
    assert not sitl.hil.plant.moored
    sitl = Sitl()
    sitl.lockstep(50, 0.5, 0.5)
    sitl.wait(3 * SECOND)  # silent
    sitl.lockstep(700, mode=1)
    assert not sitl.hil.plant.moored


def test_the_boat_drives() -> None:
    sitl = Sitl(FREE, CALM)
    sitl.lockstep(1000, 0.6, 0.5)
    truth = sitl.hil.plant.truth
    assert truth.n_m > -12.0 and truth.r_radps > 0.02


def test_the_anemometer_speaks_on_its_own_link_meanwhile() -> None:
    sitl = Sitl()
    sitl.lockstep(250)
    assert sitl.ports.count("anemometer") == 5


# --- hostile bytes ----------------------------------------------------------------------------------------------


def test_frames_may_come_in_pieces_and_with_garbage_between() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(3)
    (sample,) = of(sitl.poll(), "HIL_SENSOR")
    message = mav.MAVLink_hil_actuator_controls_message(sample.time_usec, [0.5] * 16, ARMED, 1)
    data = b"\xfd\x00garbage" + bytes(message.pack(sitl.mav))
    for byte in data[:-1]:
        sitl.send_bytes(bytes([byte]))
    assert samples_us(sitl.poll()) == []
    sitl.send_bytes(data[-1:])
    assert samples_us(sitl.poll()) == [sample.time_usec + 4000]
    assert sitl.hil.outputs_us == (1700, 1700)
    assert sitl.hil.counters.garbage_bytes > 0


FUZZED = Sitl(FREE)


@given(st.binary(max_size=200))
def test_random_bytes_never_raise(data: bytes) -> None:
    FUZZED.send_bytes(data)
    FUZZED.wait(4 * MS)


@given(
    st.integers(0, 2**64 - 1),
    st.lists(st.floats(width=32), min_size=16, max_size=16),
    st.integers(0, 255),
    st.integers(0, 2**64 - 1),
)
def test_any_controls_never_raise(time_us: int, controls: list[float], mode: int, flags: int) -> None:
    FUZZED.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, flags))
    FUZZED.wait(4 * MS)
    assert all(us in (0, *range(1100, 1901)) for us in FUZZED.hil.outputs_us)


@given(st.lists(st.floats(width=32), min_size=7, max_size=7), st.sampled_from((511, 400)) | st.integers(0, 65535))
def test_commands_with_any_numbers_never_raise(params: list[float], command: int) -> None:
    FUZZED.send(mav.MAVLink_command_long_message(0, 0, command, 0, *params))
    FUZZED.wait(4 * MS)


def test_the_standard_atmosphere() -> None:
    assert standard_pressure_pa(0.0) == 101_325.0
    assert standard_pressure_pa(1000.0) == pytest.approx(89_875.0, abs=10.0)
