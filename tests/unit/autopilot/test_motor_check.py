"""Faults of the motors as lines: what ends a hold, and what is only told because its cause is tolerated."""

from types import SimpleNamespace
from typing import Any

import pytest

from asvhil.autopilot.ardurover_parameters import requirements
from asvhil.autopilot.motor_check import MotorCheck
from asvhil.autopilot.readback import Readback
from asvhil.autopilot.requirements import judge
from asvhil.config import ReadbackConfig, load_config
from asvhil.supervisor.reasons import describe
from asvhil.types import Cause, FrontseatStatus

MS = 1_000_000
CONFIG = load_config("sitl")
RIGHT = {
    **{f"SERVO{n}_{name}": value for n in (1, 3) for name, value in (("REVERSED", 0), ("TRIM", 1500))},
    **{f"{pin}{n}_{end}": us for pin in ("RC", "SERVO") for n in (1, 3) for end, us in (("MIN", 1000), ("MAX", 2000))},
    **{f"RC{n}_{name}": value for n in (1, 3) for name, value in (("REVERSED", 0), ("TRIM", 1500), ("DZ", 0))},
    "SYSID_MYGCS": 1, "RC_OPTIONS": 32, "RC_OVERRIDE_TIME": 3, "PILOT_STEER_TYPE": 1, "MOT_SLEWRATE": 0,
    "MOT_THR_MIN": 0, "MOT_THST_EXPO": 0, "SERVO1_FUNCTION": 73, "SERVO3_FUNCTION": 74, "RCMAP_ROLL": 1,
    "RCMAP_THROTTLE": 3, "FS_THR_ENABLE": 1, "FS_ACTION": 2, "FS_GCS_ENABLE": 0, "FS_GCS_TIMEOUT": 5,
    "ARMING_CHECK": 1, "ARMING_SKIPCHK": 0, "BRD_SAFETY_DEFLT": 0, "FS_THR_VALUE": 910, "ARMING_RUDDER": 0,
    "MOT_THR_MAX": 100, "MOT_THST_ASYM": 1, "MOT_PWM_TYPE": 0, "MANUAL_STR_EXPO": 0, "MANUAL_OPTIONS": 0,
}  # fmt: skip


class Drive:
    """Motors that are driven for 2.5 s by an autopilot that makes something else of the commands."""

    def __init__(self, values: dict[str, float], *tolerate: Cause, beats_until_ns: int = 2**62) -> None:
        pwm = CONFIG.vehicle.pwm
        findings = judge(requirements(CONFIG.links.autopilot, pwm, values), values)
        self.autopilot: Any = SimpleNamespace(findings=findings, unbounded="", unread_wiring="", way_fault=None)
        self.beats_until_ns = beats_until_ns
        self.check = MotorCheck(self.autopilot, Readback(ReadbackConfig(), pwm.neutral_us), tolerate)

    def run(self, gain: float) -> str | None:
        for tick in range(1, 51):
            t_ns = tick * 50 * MS
            sent = (1500 + 8 * tick, 1500 + 3 * tick)
            motors_us = (1500 + round(gain * 8 * tick), 1500 + round(gain * 3 * tick))
            self.check.on_status(
                FrontseatStatus(
                    t_ns=t_ns,
                    armed=True,
                    mode="MANUAL",
                    ready=True,
                    rc_us=(),
                    sticks_us=sent,
                    rc_ns=t_ns,
                    outputs_us=(),
                    motors_us=motors_us,
                    outputs_ns=t_ns,
                )
            )
            self.autopilot.autopilot_heartbeat_ns = min(t_ns, self.beats_until_ns)
            self.check.step(t_ns)
            if self.check.fault is not None:
                return describe(self.check.fault)
            self.check.note_output(t_ns, sent)
        return None

    @property
    def said(self) -> list[str]:
        return [note.text for note in self.check.notes if note.subject == "outputs"]


def test_outputs_that_follow_are_said_to() -> None:
    drive = Drive(RIGHT)
    assert drive.run(1.0) is None and drive.said == ["follow the commands"]


def test_outputs_that_do_not_follow_end_the_hold_and_name_what_was_not_read() -> None:
    assert Drive(RIGHT).run(0.5) == "outputs do not follow the commands"
    assert Drive({}).run(0.5) == "outputs do not follow the commands (asvhil check)"
    assert Drive({}).run(-1.0) == "reversed output: both (SERVO1/3_REVERSED)"
    assert Drive(RIGHT).run(-1.0) == "reversed output: both (SERVO1/3_REVERSED)"


def test_outputs_at_rest_are_stuck_only_once_a_heartbeat_since_tells_nothing_of_a_disarming() -> None:
    """On a link that loses heartbeats, an autopilot that has disarmed itself looks the same."""
    assert str(Drive(RIGHT).run(0.0)).startswith("stuck output: both")
    assert Drive(RIGHT, beats_until_ns=300 * MS).run(0.0) is None
    assert str(Drive(RIGHT, beats_until_ns=300 * MS).run(-1.0)).startswith("reversed output: both")


@pytest.mark.parametrize(
    ("cause", "name", "wrong", "text"),
    [
        (Cause.SLEW, "MOT_SLEWRATE", 100.0, "outputs lag behind (MOT_SLEWRATE)"),
        (Cause.DEAD_ZONE, "RC3_DZ", 30.0, "dead zone bends commands (RC3_DZ)"),
        (Cause.SCALED, "MOT_THR_MIN", 10.0, "commands are bent (MOT_THR_MIN)"),
    ],
)
def test_a_bend_that_is_tolerated_ends_no_hold_where_its_parameter_is_wrong_or_unread(
    cause: Cause, name: str, wrong: float, text: str
) -> None:
    unread = {key: value for key, value in RIGHT.items() if key != name}
    for values in (unread, {**RIGHT, name: wrong}):
        drive = Drive(values, cause)
        assert drive.run(0.5) is None and drive.said == [text]


def test_what_no_tolerated_parameter_explains_ends_the_hold_all_the_same() -> None:
    tolerated = (Cause.SLEW, Cause.DEAD_ZONE, Cause.SCALED)
    assert Drive(RIGHT, *tolerated).run(0.5) == "outputs do not follow the commands"
    assert Drive({}, *tolerated).run(-1.0) == "reversed output: both (SERVO1/3_REVERSED)"


def test_a_motor_without_reports_is_unverified() -> None:
    drive = Drive(RIGHT)
    for tick in range(80):
        drive.check.step(tick * 50 * MS)
        assert drive.check.fault is None
        drive.check.note_output(tick * 50 * MS, (1600, 1600))
    assert drive.said == ["not reported by the autopilot: unverified"]
    assert drive.check.unverified is not None and describe(drive.check.unverified) == "overrides are ignored"
