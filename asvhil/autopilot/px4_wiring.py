"""How a PX4's two motors are wired, by its parameters: functions, reversal and travel of the outputs. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from asvhil.autopilot.wiring import MotorWiring, Travel, Wiring, motor_of, motor_outputs
from asvhil.config import AutopilotLinkConfig, MotorOutputConfig, PwmConfig

ACTUATOR_SET = 300  # PWM_MAIN_FUNCn: 301 is "Peripheral via Actuator Set 1"
OUTPUTS = 8  # of PWM MAIN
FUNCTIONS = tuple(f"PWM_MAIN_FUNC{n}" for n in range(1, OUTPUTS + 1))
REVERSED = "PWM_MAIN_REV"  # bit 0 is output 1


def functions(link: AutopilotLinkConfig) -> tuple[int, int]:
    """Functions of the port and the starboard motor's output."""
    return ACTUATOR_SET + link.port_actuator, ACTUATOR_SET + link.starboard_actuator


def wiring_of(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> Wiring:
    """The wiring by what is known of the parameters, some of which PX4's simulation does not have."""
    outputs = motor_outputs(pwm, functions(link), FUNCTIONS, values)
    port, starboard = (
        _motor(pwm, config, output, values) for config, output in zip((pwm.port, pwm.starboard), outputs, strict=True)
    )
    return Wiring(pwm, (port, starboard))


def names_of_wiring(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> Iterator[str]:
    """The parameters that the wiring rests on, as far as is known by now."""
    if None in (pwm.port.output, pwm.starboard.output):
        yield from FUNCTIONS
    for output in motor_outputs(pwm, functions(link), FUNCTIONS, values):
        yield from (f"PWM_MAIN_{part}{output}" for part in ("FUNC", "MIN", "MAX"))
    yield REVERSED


def turns(output: int, values: Mapping[str, float]) -> bool:
    """Whether PX4 reverses an output."""
    return bool(int(values.get(REVERSED, 0.0)) >> (output - 1) & 1)


def _motor(pwm: PwmConfig, config: MotorOutputConfig, output: int, values: Mapping[str, float]) -> MotorWiring:
    """-1..1 spans PWM_MAIN_MINn..MAXn, and has no trim: its middle is half-way."""
    turned = turns(output, values)
    motor = motor_of(pwm, config, turned=turned)
    ends_us = sorted((motor.astern_us, motor.ahead_us))
    low_us = values.get(f"PWM_MAIN_MIN{output}", ends_us[0])
    high_us = values.get(f"PWM_MAIN_MAX{output}", ends_us[1])
    found = Travel(low_us=low_us, trim_us=0.5 * (low_us + high_us), high_us=high_us, reversed=turned)
    plain = Travel(low_us=ends_us[0], trim_us=0.5 * (ends_us[0] + ends_us[1]), high_us=ends_us[1], reversed=turned)
    return MotorWiring(output=output, motor=motor, travel=found if found.sound else plain)
