"""Every way to the motors in the whole loop: the station is kept, and every failure ends in neutral motors."""

import functools
import math
from pathlib import Path

import pytest

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, load_config
from asvhil.io.mavlink.frames import dialect, message_id
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_release
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Frame, Phase
from tests.support.copies import on_a_copy
from tests.support.loop import DEFAULT_CONTROLLER, PLAIN_CONTROLLER
from tests.support.settled import NO_BIAS, settled

FREE = "plant.frontseat.parameters={SERVO1_FUNCTION: 0, SERVO3_FUNCTION: 0, SERVO5_FUNCTION: 94}"
TAKEN = "supervisor.readback.tolerate=[unbounded]"  # the hazard, by name
WAYS = {
    "rc_override": ("sitl",),
    "manual_control": ("sitl", "links.autopilot.output=manual_control"),
    "set_servo": ("sitl", "links.autopilot.output=set_servo", FREE, TAKEN),
    "set_actuator": ("sitl-px4",),
}
NEUTRAL = (1500, 1500)


def config(way: str, *overrides: str) -> Config:
    name, *own = WAYS[way]
    return load_config(name, (PLAIN_CONTROLLER, NO_BIAS, *own, *overrides))


class SeveredLoop(Lockstep):
    """A loop whose backseat can be made deaf to the autopilot, cut off from it both ways, or killed."""

    deaf = cut = False

    def receive(self) -> tuple[Frame, ...]:
        frames = super().receive()
        return () if self.deaf or self.cut else frames

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        if not self.cut:
            super().deliver(frames)

    def driving(self) -> "SeveredLoop":
        """On the way to the station, well away from neutral."""
        for _ in range(400):
            held = self.tick()[1].phase is Phase.HOLD
            if held and min(abs(pulse_us - 1500) for pulse_us in self.plant.frontseat.outputs_us) > 30:
                return self
        raise AssertionError("the motors were not driven")

    def left_alone(self, seconds: float) -> tuple[int, int]:
        """The outputs after a time without a backseat."""
        self.t_ns += round(seconds * 1e9)
        self.plant.advance(self.t_ns)
        return self.plant.frontseat.outputs_us


@pytest.mark.parametrize(
    "way",
    [pytest.param(way, marks=pytest.mark.thorough if way in ("rc_override", "set_servo") else ()) for way in WAYS],
)
def test_the_station_is_kept(way: str) -> None:
    distance_m, heading_mean_deg, _ = settled(SeveredLoop(config(way, DEFAULT_CONTROLLER)), 65.0, 45.0)
    assert distance_m <= 0.6 and abs(heading_mean_deg) <= 1.0


@pytest.mark.thorough
def test_across_the_wind_with_a_px4_too() -> None:
    loop = SeveredLoop(
        config("set_actuator", DEFAULT_CONTROLLER, "plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90")
    )
    distance_m, heading_mean_deg, heading_std_deg = settled(loop, 120.0, 60.0)
    assert distance_m < 3.0 and abs(heading_mean_deg) < 3.0 and 5.0 < heading_std_deg < 16.0


@pytest.mark.parametrize(
    "way", ["set_servo", *(pytest.param(way, marks=pytest.mark.thorough) for way in ("manual_control", "set_actuator"))]
)
def test_a_log_replays_to_the_bit(way: str, tmp_path: Path) -> None:
    run_lockstep(config(way), tmp_path / "log.mcap", 20.0)
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared > 400


def _mode(loop: SeveredLoop) -> None:
    assert loop.plant.frontseat.set_mode({"px4": 0x03040000, "ardurover": 4}[loop.config.plant.autopilot])


def _disarm(loop: SeveredLoop) -> None:
    assert loop.plant.frontseat.arm(False)


def _stick(loop: SeveredLoop) -> None:
    loop.plant.frontseat.set_sticks({4: 1700})


def _operator(loop: SeveredLoop) -> None:
    loop.inject("operator", encode_release(loop.config.links.autopilot))


def _deaf(loop: SeveredLoop) -> None:
    loop.deaf = True


@functools.cache
def driven(way: str) -> SeveredLoop:
    """A boat that is driving: for copies."""
    return SeveredLoop(config(way)).driving()


@pytest.mark.parametrize("end", [_mode, _disarm, _stick, _operator, _deaf])
@pytest.mark.parametrize("way", WAYS)
def test_however_it_ends_the_motors_are_neutral(way: str, end: object) -> None:
    loop = driven(way)
    # PX4 tells of its mode once a second; a lost heartbeat is believed after 2.5 s.
    limit_s = {"_deaf": 2.8}.get(end.__name__, 1.3 if way == "set_actuator" else 0.5)  # type: ignore[attr-defined]

    def body() -> None:
        end(loop)  # type: ignore[operator]
        outputs = [loop.tick()[1] for _ in range(round(20 * limit_s))][-1]
        assert outputs.phase in (Phase.STANDBY, Phase.FAILSAFE)
        for _ in range(100):
            assert loop.plant.frontseat.outputs_us == NEUTRAL
            outputs = loop.tick()[1]
        assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None

    on_a_copy(body)


@pytest.mark.parametrize("way", ["set_servo", "set_actuator"])
def test_where_the_sticks_are_the_pilots_own_any_of_them_takes_the_boat(way: str) -> None:
    loop = SeveredLoop(config(way)).driving()
    loop.plant.frontseat.set_sticks({1: 1620})
    outputs = [loop.tick()[1] for _ in range(8)][-1]
    assert outputs.phase is Phase.STANDBY and outputs.health.reason == describe(explain(Reason.STICK_MOVED, channel=1))


@pytest.mark.parametrize("way", ["rc_override", "manual_control"])
def test_after_a_crash_sticks_are_given_back_by_the_autopilot(way: str) -> None:
    loop = SeveredLoop(config(way)).driving()
    assert loop.left_alone(2.8) != NEUTRAL
    assert loop.left_alone(0.3) == NEUTRAL


def test_after_a_crash_px4_disarms_when_offboard_is_lost() -> None:
    loop = SeveredLoop(config("set_actuator")).driving()
    assert loop.left_alone(0.8) != NEUTRAL
    assert loop.left_alone(0.4) == NEUTRAL


def test_after_a_crash_a_servo_command_stands_until_the_daemon_is_back() -> None:
    loop = SeveredLoop(config("set_servo")).driving()
    standing = loop.left_alone(0.1)
    assert loop.left_alone(120.0) == standing != NEUTRAL  # the hazard, as a real ArduRover shows it
    loop.backseat = build_backseat(loop.config.model_copy(update={"supervisor": _by_command(loop.config)}))
    for _ in range(20):
        loop.tick()
    assert loop.plant.frontseat.outputs_us == NEUTRAL


def test_arming_again_after_a_crash_starts_no_motor_once_the_daemon_is_back() -> None:
    loop = SeveredLoop(config("set_actuator")).driving()
    at_the_end = loop.plant.frontseat.outputs_us
    assert loop.left_alone(1.5) == NEUTRAL  # PX4 has disarmed
    assert _arm_in_manual(loop)
    assert loop.left_alone(0.1) == at_the_end  # the hazard, as on a real PX4: the last command stands
    assert loop.plant.frontseat.arm(False) and loop.left_alone(5.0) == NEUTRAL
    loop.backseat = build_backseat(loop.config.model_copy(update={"supervisor": _by_command(loop.config)}))
    for _ in range(30):
        loop.tick()
    assert _arm_in_manual(loop)
    assert {loop.tick() and loop.plant.frontseat.outputs_us for _ in range(200)} == {NEUTRAL}


@pytest.mark.parametrize("way", ["set_servo", "set_actuator"])
def test_a_command_that_stood_through_a_broken_link_ends_when_the_link_is_back(way: str) -> None:
    loop = SeveredLoop(config(way)).driving()
    standing = loop.plant.frontseat.outputs_us
    loop.cut = True
    for _ in range(200):  # the hold has ended, and the neutral that was said then is lost
        loop.tick()
    assert _arm_in_manual(loop)
    assert loop.left_alone(0.1) == standing != NEUTRAL
    loop.cut = False
    outputs = [loop.tick() and loop.plant.frontseat.outputs_us for _ in range(100)]
    assert set(outputs[30:]) == {NEUTRAL}


def _arm_in_manual(loop: SeveredLoop) -> bool:
    """The pilot, with a transmitter."""
    seat = loop.plant.frontseat
    return seat.set_mode({"px4": 0x00010000, "ardurover": 0}[loop.config.plant.autopilot]) and seat.arm(True)


def _by_command(whole: Config) -> object:
    return whole.supervisor.model_copy(update={"engage": "command"})


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("{PWM_MAIN_FUNC1: 101}", "PWM_MAIN_FUNC1 is 101, not 301: no port motor"),
        ("{PWM_MAIN_FUNC1: 0, PWM_MAIN_FUNC3: 301}", "PWM_MAIN_FUNC1 is 0, not 302: no starboard motor"),
        ("{PWM_MAIN_MAX3: 1800}", "PWM_MAIN_MAX3 is 1800, not 1900: full ahead cut off"),
        ("{COM_OBL_RC_ACT: 0}", "COM_OBL_RC_ACT is 0, not 7: motors run on after a crash"),
    ],
)
def test_a_px4_that_is_set_wrong_is_not_driven_and_the_parameter_is_named(parameters: str, words: str) -> None:
    loop = SeveredLoop(config("set_actuator", f"plant.frontseat.parameters={parameters}"))
    for _ in range(200):
        outputs = loop.tick()[1]
        assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None
    assert (outputs.health.code, outputs.health.reason) == (Reason.AUTOPILOT_PARAMETER, words)
    tolerant = SeveredLoop(
        config("set_actuator", f"plant.frontseat.parameters={parameters}", "supervisor.readback.tolerate=[unbounded]")
    )
    for _ in range(200):
        outputs = tolerant.tick()[1]
    assert outputs.phase is (Phase.HOLD if "COM_OBL" in parameters else Phase.STANDBY)


def test_px4_streams_are_asked_for_again_after_a_reboot_and_when_another_station_slowed_them() -> None:
    loop = SeveredLoop(config("set_actuator", "supervisor.engage=command"))

    def attitudes(seconds: float) -> int:
        frames = [frame for _ in range(round(20 * seconds)) for frame in loop.tick()[0].frames]
        return sum(message_id(frame.data) == 30 for frame in frames if frame.port == "autopilot")

    attitudes(5.0)
    assert attitudes(2.0) == pytest.approx(40, abs=3)
    station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    slow = dialect.MAVLink_command_long_message(1, 1, 511, 0, 30, 1e6, 0, 0, 0, 0, 0)
    loop.plant.receive(Frame(t_ns=loop.t_ns, port="autopilot", data=bytes(slow.pack(station)), peer="ground"))
    assert attitudes(2.0) < 8
    attitudes(10.0)
    assert attitudes(2.0) == pytest.approx(40, abs=3)
    loop.plant.frontseat.reboot(loop.t_ns)
    attitudes(8.0)
    assert attitudes(2.0) == pytest.approx(40, abs=3)


def test_with_manual_as_the_control_mode_the_px4_is_driven_there() -> None:
    loop = SeveredLoop(config("set_actuator", "supervisor.control_mode=MANUAL", TAKEN)).driving()
    assert loop.left_alone(60.0) != NEUTRAL  # nothing bounds a crash then: docs/autopilots.md


def test_a_refused_servo_command_is_told_in_words() -> None:
    loop = SeveredLoop(config("set_servo", "plant.frontseat.parameters={SERVO1_FUNCTION: 0, SERVO3_FUNCTION: 74}"))
    notes = [note.text for _ in range(200) for note in loop.tick()[1].health.notes]
    assert any("refuses DO_SET_SERVO (FAILED)" in text for text in notes)
    assert math.isclose(loop.plant.truth.thrust_n[1], 0.0)
