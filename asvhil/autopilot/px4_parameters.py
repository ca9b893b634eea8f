"""What a PX4's parameters must be for two motors to follow DO_SET_ACTUATOR and to stop when we fall silent. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from asvhil.autopilot.px4_wiring import FUNCTIONS, REVERSED, functions, turns, wiring_of
from asvhil.autopilot.requirements import Requirement, exactly, within
from asvhil.autopilot.wiring import MotorWiring
from asvhil.autopilot.wiring_requirements import function_row, travel_rows
from asvhil.config import AutopilotLinkConfig, MotorOutputConfig, PwmConfig
from asvhil.types import Cause, changed

TERMINATE, DISARM = 6, 7  # COM_OBL_RC_ACT
NEUTRAL_SLACK_US = 5
MOVING_CHECKS = 32 | 64 | 128 | 256  # of EKF2_GPS_CHECK: drift and speed, horizontal and vertical


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> tuple[Requirement, ...]:
    """Both outputs, the fail-safe that is all that bounds a command which outlives us, and what a boat adrift needs.

    How the boat is wired is followed: only what contradicts the config, or leads nowhere, will not do.
    """
    motors = zip(
        ("port", "starboard"),
        (pwm.port, pwm.starboard),
        functions(link),
        (link.port_actuator, link.starboard_actuator),
        wiring_of(link, pwm, values).motors,
        strict=True,
    )
    outputs = (
        changed(row, motor=side, wiring=True)
        for side, config, function, actuator, wired in motors
        for row in (
            function_row(
                side,
                config,
                function,
                wired.output,
                FUNCTIONS,
                values,
                f"one output must be Peripheral via Actuator Set {actuator}",
            ),
            *_sense(side, config, wired.output, values),
            *_travel(wired),
        )
    )
    return (*outputs, *_offboard_loss(), _adrift())


def _sense(side: str, config: MotorOutputConfig, output: int, values: Mapping[str, float]) -> tuple[Requirement, ...]:
    """Followed, unless the config says what it must be."""
    if config.reversed is None or REVERSED not in values:
        return ()
    value = int(values[REVERSED])
    bit = 1 << (output - 1)
    wanted = value | bit if config.reversed else value & ~bit
    if turns(output, values) is config.reversed:
        wanted = value
    why = f"vehicle.pwm.{side} says otherwise by its ends (bit {output - 1})"
    return (exactly(REVERSED, wanted, "another sense", why, Cause.REVERSED),)


def _travel(wired: MotorWiring) -> tuple[Requirement, ...]:
    n, motor = wired.output, wired.motor
    neutral_us = (motor.neutral_us - NEUTRAL_SLACK_US, motor.neutral_us + NEUTRAL_SLACK_US)
    disarmed = "the pulse while disarmed must be the motor's neutral: PX4's default of 1000 is full astern"
    return (
        *travel_rows(f"PWM_MAIN_MIN{n}", f"PWM_MAIN_MAX{n}", motor),
        within(f"PWM_MAIN_DIS{n}", neutral_us, motor.neutral_us, "not neutral when disarmed", disarmed),
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
