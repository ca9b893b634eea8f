"""What a PX4's parameters must be for two motors to follow DO_SET_ACTUATOR and to stop when we fall silent. Pure."""

from __future__ import annotations

from asvhil.autopilot.requirements import Requirement
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.types import Cause

ACTUATOR_SET = 300  # PWM_MAIN_FUNCn: 301 is "Peripheral via Actuator Set 1"
DISARM = 7  # COM_OBL_RC_ACT
NEUTRAL_SLACK_US = 5.0


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig) -> tuple[Requirement, ...]:
    """Both outputs, and the fail-safe that is all that bounds a command which outlives us."""
    motors = (
        ("port", pwm.port_channel, link.port_actuator),
        ("starboard", pwm.starboard_channel, link.starboard_actuator),
    )
    outputs = tuple(found for motor in motors for found in _output(*motor, pwm))
    return (*outputs, *_offboard_loss())


def _output(side: str, channel: int, actuator: int, pwm: PwmConfig) -> tuple[Requirement, ...]:
    function = ACTUATOR_SET + actuator
    return (
        Requirement(
            names=(f"PWM_MAIN_FUNC{channel}",),
            least=function,
            most=function,
            wanted=function,
            cause=Cause.STUCK,
            fault=f"no {side} motor",
            why=f"output {channel} must be Peripheral via Actuator Set {actuator}",
        ),
        _end(f"PWM_MAIN_MIN{channel}", pwm.astern_us, "vehicle.pwm.astern_us"),
        _end(f"PWM_MAIN_MAX{channel}", pwm.ahead_us, "vehicle.pwm.ahead_us"),
        Requirement(
            names=(f"PWM_MAIN_DIS{channel}",),
            least=pwm.neutral_us - NEUTRAL_SLACK_US,
            most=pwm.neutral_us + NEUTRAL_SLACK_US,
            wanted=pwm.neutral_us,
            fault="not neutral when disarmed",
            why="the pulse while disarmed must be vehicle.pwm.neutral_us: PX4's default of 1000 is full astern",
        ),
    )


def _end(name: str, pulse_us: int, key: str) -> Requirement:
    return Requirement(
        names=(name,),
        least=pulse_us,
        most=pulse_us,
        wanted=pulse_us,
        cause=Cause.SCALED,
        fault="commands are scaled",
        why=f"-1..1 spans the output's range, whose end must be {key}",
    )


def _offboard_loss() -> tuple[Requirement, ...]:
    return (
        Requirement(
            names=("COM_OBL_RC_ACT",),
            least=6.0,
            most=DISARM,
            wanted=DISARM,
            cause=Cause.UNBOUNDED,
            fault="motors run on after a crash",
            why="DO_SET_ACTUATOR has no time-out: only disarming (7) or terminating (6) stops the motors if we die",
        ),
        Requirement(
            names=("COM_OF_LOSS_T",),
            least=0.3,
            most=2.0,
            wanted=1.0,
            fault="late, or too soon",
            why="seconds of our silence until COM_OBL_RC_ACT; our sign of life comes every 0.1 s",
        ),
    )
