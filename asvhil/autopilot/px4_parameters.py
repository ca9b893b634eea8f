"""What a PX4's parameters must be for two motors to follow DO_SET_ACTUATOR and to stop when we fall silent. Pure."""

from __future__ import annotations

from dataclasses import replace

from asvhil.autopilot.requirements import Requirement, exactly, within
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.types import Cause

ACTUATOR_SET = 300  # PWM_MAIN_FUNCn: 301 is "Peripheral via Actuator Set 1"
TERMINATE, DISARM = 6, 7  # COM_OBL_RC_ACT
NEUTRAL_SLACK_US = 5
MOVING_CHECKS = 32 | 64 | 128 | 256  # of EKF2_GPS_CHECK: drift and speed, horizontal and vertical


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig) -> tuple[Requirement, ...]:
    """Both outputs, the fail-safe that is all that bounds a command which outlives us, and what a boat adrift needs."""
    motors = (
        ("port", pwm.port_channel, link.port_actuator),
        ("starboard", pwm.starboard_channel, link.starboard_actuator),
    )
    outputs = (replace(row, motor=motor[0], wiring=True) for motor in motors for row in _output(*motor, pwm))
    return (*outputs, *_offboard_loss(), _adrift())


def _output(side: str, channel: int, actuator: int, pwm: PwmConfig) -> tuple[Requirement, ...]:
    neutral_us = (pwm.neutral_us - NEUTRAL_SLACK_US, pwm.neutral_us + NEUTRAL_SLACK_US)
    function = f"output {channel} must be Peripheral via Actuator Set {actuator}"
    end = "-1..1 spans the output's range, whose end must be vehicle.pwm."
    disarmed = "the pulse while disarmed must be vehicle.pwm.neutral_us: PX4's default of 1000 is full astern"
    scaled = "commands are scaled"
    return (
        exactly(f"PWM_MAIN_FUNC{channel}", ACTUATOR_SET + actuator, f"no {side} motor", function, Cause.STUCK),
        exactly(f"PWM_MAIN_MIN{channel}", pwm.astern_us, scaled, f"{end}astern_us", Cause.SCALED),
        exactly(f"PWM_MAIN_MAX{channel}", pwm.ahead_us, scaled, f"{end}ahead_us", Cause.SCALED),
        within(f"PWM_MAIN_DIS{channel}", neutral_us, pwm.neutral_us, "not neutral when disarmed", disarmed),
    )


def _offboard_loss() -> tuple[Requirement, ...]:
    stops = "DO_SET_ACTUATOR has no time-out: only disarming (7) or terminating (6) stops the motors if we die"
    silence = "seconds of our silence until COM_OBL_RC_ACT; our sign of life comes every 0.1 s"
    return (
        within("COM_OBL_RC_ACT", (TERMINATE, DISARM), DISARM, "motors run on after a crash", stops, Cause.UNBOUNDED),
        within("COM_OF_LOSS_T", (0.3, 2), 1, "late, or too soon", silence),
    )


def _adrift() -> Requirement:
    """PX4 takes a disarmed boat for one that lies on land, where a receiver that moves is a bad one."""
    moves = (
        "while disarmed, a receiver that moves by more than EKF2_REQ_HDRIFT (0.1 m/s) is dropped; 21 checks "
        "satellites and accuracies alone"
    )
    lost = "a boat adrift has no position until it is armed"
    return within("EKF2_GPS_CHECK", (0, 0xFFFF), None, lost, moves, must=False, clear=MOVING_CHECKS)
