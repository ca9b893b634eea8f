"""How an ArduRover's two motors are wired, by its parameters: functions, senses, trims, travel, channel map. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from asvhil.autopilot.wiring import (
    HIGH_US,
    LOW_US,
    STICKS,
    Bend,
    MotorWiring,
    Travel,
    Wiring,
    motor_of,
    motor_outputs,
    wiring_of_config,
)
from asvhil.config import AutopilotLinkConfig, MotorOutputConfig, PwmConfig

MOTORS = (73, 74)  # SERVOn_FUNCTION: throttle left and right
OUTPUTS = 16
FUNCTIONS = tuple(f"SERVO{n}_FUNCTION" for n in range(1, OUTPUTS + 1))
CHANNEL_MAP = ("RCMAP_ROLL", "RCMAP_THROTTLE")
MOST_CHANNELS = 16
BENDS = ("MOT_THST_ASYM", "MOT_THST_EXPO")
# Beyond these a stick that moves by whole microseconds is too coarse for its output.
MOST_ASYMMETRY, MOST_EXPO = 3.0, 0.5
OUTPUT_PARTS = ("REVERSED", "TRIM", "MIN", "MAX")
STICK_PARTS = ("REVERSED", "TRIM", "MIN", "MAX", "DZ")


def stick_channels(values: Mapping[str, float]) -> tuple[int, int]:
    """The channels of the port and the starboard motor's stick; the usual ones where the map makes no sense."""
    port, starboard = (round(values.get(name, usual)) for name, usual in zip(CHANNEL_MAP, STICKS, strict=True))
    sound = port != starboard and all(1 <= channel <= MOST_CHANNELS for channel in (port, starboard))
    return (port, starboard) if sound else STICKS


def wiring_of(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> Wiring:
    """The wiring by what is known of the parameters; an output without a function, as for `set_servo`, is the config's.

    What is not known is as on a plain boat, and a stick whose travel is not known has that of its output.
    """
    if link.output == "set_servo":
        return wiring_of_config(pwm)
    outputs, channels = motor_outputs(pwm, MOTORS, FUNCTIONS, values), stick_channels(values)
    port, starboard = (
        _motor(pwm, config, output, values) for config, output in zip((pwm.port, pwm.starboard), outputs, strict=True)
    )
    sticks = _stick(channels[0], port.travel, values), _stick(channels[1], starboard.travel, values)
    asymmetry, expo = (values.get(name, usual) for name, usual in zip(BENDS, (1.0, 0.0), strict=True))
    bend = Bend(asymmetry=min(max(asymmetry, 1.0), MOST_ASYMMETRY), expo=min(max(expo, -MOST_EXPO), MOST_EXPO))
    return Wiring(pwm, (port, starboard), channels, sticks, bend)


def names_of_wiring(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> Iterator[str]:
    """The parameters that the wiring rests on, as far as is known by now."""
    if link.output == "set_servo":
        return
    if None in (pwm.port.output, pwm.starboard.output):
        yield from FUNCTIONS
    if link.output != "script":
        yield from (*CHANNEL_MAP, *BENDS)
    for output in motor_outputs(pwm, MOTORS, FUNCTIONS, values):
        yield from (f"SERVO{output}_{part}" for part in OUTPUT_PARTS)
    for channel in stick_channels(values) if link.output != "script" else ():
        yield from (f"RC{channel}_{part}" for part in STICK_PARTS)


def _motor(pwm: PwmConfig, config: MotorOutputConfig, output: int, values: Mapping[str, float]) -> MotorWiring:
    turns, trim_us, low_us, high_us = (values.get(f"SERVO{output}_{part}") for part in OUTPUT_PARTS)
    motor = motor_of(pwm, config, trim_us=trim_us, turned=bool(turns))
    found = Travel(
        low_us=LOW_US if low_us is None else low_us,
        trim_us=motor.neutral_us if trim_us is None else trim_us,
        high_us=HIGH_US if high_us is None else high_us,
        reversed=motor.reversed if turns is None else bool(turns),
    )
    plain = Travel(low_us=LOW_US, trim_us=motor.neutral_us, high_us=HIGH_US, reversed=found.reversed)
    return MotorWiring(output=output, motor=motor, travel=found if found.sound else plain)


def _stick(channel: int, output: Travel, values: Mapping[str, float]) -> Travel:
    turned, trim_us, low_us, high_us, dead_zone_us = (values.get(f"RC{channel}_{part}") for part in STICK_PARTS)
    found = Travel(
        low_us=output.low_us if low_us is None else low_us,
        trim_us=output.trim_us if trim_us is None else trim_us,
        high_us=output.high_us if high_us is None else high_us,
        dead_zone_us=dead_zone_us or 0.0,
        reversed=bool(turned),
    )
    return found if found.sound else Travel(low_us=output.low_us, trim_us=output.trim_us, high_us=output.high_us)
