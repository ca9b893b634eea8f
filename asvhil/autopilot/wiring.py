"""How the two motors of a boat are wired: their outputs, sense and neutral, and the sticks that move them. Pure.

All the rest counts in the pulses of `vehicle.pwm`, as if both motors were alike and plain. A `Wiring` turns those into
what this boat's sticks and outputs need, and what it reports of them back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from asvhil.config import MotorOutputConfig, PwmConfig
from asvhil.types import record

Pulses = tuple[int, int]  # port, starboard (us)
STICKS = (1, 3)  # channels of RCMAP_ROLL and RCMAP_THROTTLE by default
LOW_US, HIGH_US = 1000.0, 2000.0  # ends of a travel that is not known
NEUTRAL_SLACK_US = 100.0  # how far a trim may lie from vehicle.pwm.neutral_us and still be a motor's neutral
LEAST_PULSE_US, GREATEST_PULSE_US = 100.0, 5000.0  # what a parameter can mean; beyond, differences get lost in rounding
LEAST_SPAN_US = 100.0  # from the dead zone to either end of a travel


@record
class Motor:
    """A motor by its pulse widths (us): a reversed one goes ahead by shorter pulses than astern."""

    astern_us: float
    neutral_us: float
    ahead_us: float

    @property
    def reversed(self) -> bool:
        """Whether short pulses go ahead."""
        return self.ahead_us < self.astern_us

    def pulse_us(self, command: float) -> float:
        """Pulse width of a command in [-1, 1]."""
        span_us = self.ahead_us - self.neutral_us if command > 0.0 else self.neutral_us - self.astern_us
        return self.neutral_us + command * span_us

    def command(self, pulse_us: float) -> float:
        """Command of a pulse width, beyond [-1, 1] for one beyond the ends."""
        offset_us, ahead_us = pulse_us - self.neutral_us, self.ahead_us - self.neutral_us
        return offset_us / (ahead_us if offset_us * ahead_us > 0.0 else self.neutral_us - self.astern_us)


@record
class Travel:
    """A stick or an output between its ends, as ArduPilot counts it: a fraction in [-1, 1] about its trim (us).

    `norm_input_dz` of an RC channel, and the scaled output of a throttle, which has no dead zone.
    """

    low_us: float
    trim_us: float
    high_us: float
    dead_zone_us: float = 0.0
    reversed: bool = False

    @property
    def sound(self) -> bool:
        """Whether it leads anywhere on both sides, by pulses that an output can have."""
        if not (self.low_us >= LEAST_PULSE_US and self.high_us <= GREATEST_PULSE_US):
            return False
        low_us, high_us = self.low_us + self.dead_zone_us, self.high_us - self.dead_zone_us
        return low_us + LEAST_SPAN_US <= self.trim_us <= high_us - LEAST_SPAN_US

    def pulse_us(self, fraction: float) -> float:
        """Pulse width at which a fraction stands."""
        share = -fraction if self.reversed else fraction
        if share == 0.0:
            return self.trim_us
        start_us = self.trim_us + self.dead_zone_us if share > 0.0 else self.trim_us - self.dead_zone_us
        return start_us + share * (self.high_us - start_us if share > 0.0 else start_us - self.low_us)

    def fraction(self, pulse_us: float) -> float:
        """Fraction of a pulse width; 0 within the dead zone."""
        offset_us = pulse_us - self.trim_us
        past_us = abs(offset_us) - self.dead_zone_us
        if past_us <= 0.0:
            return 0.0
        end_us = self.high_us if offset_us > 0.0 else self.low_us
        share = past_us / (abs(end_us - self.trim_us) - self.dead_zone_us)
        return -share if (offset_us > 0.0) is self.reversed else share


@record
class Bend:
    """What an ArduRover makes of a paddle's throttle on its way to the motor, which gives less thrust astern.

    `asymmetry` (MOT_THST_ASYM): a throttle astern is multiplied by it. `expo` (MOT_THST_EXPO): the thrust curve that is
    undone after that. What goes in must lie within -1 / asymmetry..1: then the mixer cuts nothing.
    """

    asymmetry: float = 1.0
    expo: float = 0.0

    def throttle(self, paddle: float) -> float:
        """The throttle of a paddle, in [-1, 1]."""
        size = min(abs(paddle) * (self.asymmetry if paddle < 0.0 else 1.0), 1.0)
        if self.expo:
            spread = 1.0 - self.expo
            size = (math.sqrt(spread**2 + 4.0 * self.expo * size) - spread) / (2.0 * self.expo)
        return math.copysign(size, paddle)

    def paddle(self, throttle: float) -> float:
        """The paddle of a throttle: the inverse."""
        size = abs(throttle) * (1.0 - self.expo + self.expo * abs(throttle))
        return math.copysign(size / self.asymmetry if throttle < 0.0 else size, throttle)


STRAIGHT = Bend()


@record
class MotorWiring:
    """One motor: its output (from 1), itself, and how its output turns the autopilot's throttle into pulses."""

    output: int
    motor: Motor
    travel: Travel


class _Law(dict[int, int]):
    """A conversion of pulse widths (us), worked out once for each; 0, no signal, stays 0."""

    def __init__(self, law: Callable[[int], float]) -> None:
        super().__init__({0: 0})
        self._law = law

    def __missing__(self, pulse_us: int) -> int:
        converted_us = self[pulse_us] = round(self._law(pulse_us))
        return converted_us


class Wiring:
    """Both motors, port first, and the channels (from 1) of their sticks with the travel of these.

    Conversions are to whole microseconds, as the autopilot counts.
    """

    def __init__(
        self,
        pwm: PwmConfig,
        motors: tuple[MotorWiring, MotorWiring],
        channels: Pulses = STICKS,
        sticks: tuple[Travel, Travel] | None = None,
        bend: Bend = STRAIGHT,
    ) -> None:
        """Without `sticks` they have the travel of their motors' outputs."""
        self.bend = bend
        self.motors = motors
        self.outputs = (motors[0].output, motors[1].output)
        self.channels = channels
        self.sticks = sticks or (motors[0].travel, motors[1].travel)
        self.centres_us = (round(self.sticks[0].trim_us), round(self.sticks[1].trim_us))
        self._plain = Motor(astern_us=pwm.astern_us, neutral_us=pwm.neutral_us, ahead_us=pwm.ahead_us)
        self._to_outputs, self._to_sticks, self._of_outputs, self._of_sticks = (
            (_Law(partial(law, 0)), _Law(partial(law, 1)))
            for law in (self._to_output, self._to_stick, self._of_output, self._of_stick)
        )

    # --- to the boat ---------------------------------------------------------------------------------------

    def throttle(self, side: int, pulse_us: float) -> float:
        """The autopilot's throttle of a motor (0: port, 1: starboard), in [-1, 1], for a pulse of `vehicle.pwm`."""
        wired = self.motors[side]
        return min(max(wired.travel.fraction(wired.motor.pulse_us(self._plain.command(pulse_us))), -1.0), 1.0)

    def to_outputs(self, pulses: Pulses) -> Pulses:
        """Pulses of `vehicle.pwm` as pulses at the outputs."""
        port, starboard = self._to_outputs
        return port[pulses[0]], starboard[pulses[1]]

    def to_sticks(self, pulses: Pulses) -> Pulses:
        """Pulses of `vehicle.pwm` as positions of the sticks that command them."""
        port, starboard = self._to_sticks
        return port[pulses[0]], starboard[pulses[1]]

    # --- and back ------------------------------------------------------------------------------------------

    def of_outputs(self, servo_us: Sequence[int]) -> Pulses | None:
        """What the outputs of an autopilot (us, from output 1) mean in pulses of `vehicle.pwm`; 0: no signal.

        None where the motors' outputs are not among those reported.
        """
        port, starboard = self.outputs
        if len(servo_us) < port or len(servo_us) < starboard:
            return None
        of_port, of_starboard = self._of_outputs
        return of_port[servo_us[port - 1]], of_starboard[servo_us[starboard - 1]]

    def of_sticks(self, rc_us: Sequence[int]) -> Pulses | None:
        """What the motors' sticks (us, from channel 1) command in pulses of `vehicle.pwm`, likewise."""
        port, starboard = self.channels
        if len(rc_us) < port or len(rc_us) < starboard:
            return None
        of_port, of_starboard = self._of_sticks
        return of_port[rc_us[port - 1]], of_starboard[rc_us[starboard - 1]]

    # --- the laws ------------------------------------------------------------------------------------------

    def _to_output(self, side: int, pulse_us: int) -> float:
        return self.motors[side].motor.pulse_us(self._plain.command(pulse_us))

    def _to_stick(self, side: int, pulse_us: int) -> float:
        return self.sticks[side].pulse_us(self.bend.paddle(self.throttle(side, pulse_us)))

    def _of_output(self, side: int, pulse_us: int) -> float:
        return self._plain.pulse_us(self.motors[side].motor.command(pulse_us))

    def _of_stick(self, side: int, pulse_us: int) -> float:
        wired = self.motors[side]
        return self._of_output(
            side, round(wired.travel.pulse_us(self.bend.throttle(self.sticks[side].fraction(pulse_us))))
        )


def outputs_with(function: int, names: Sequence[str], values: Mapping[str, float]) -> tuple[int, ...]:
    """The outputs that are known to have a function; `names` are the parameters of their functions, from output 1."""
    return tuple(n for n, name in enumerate(names, start=1) if values.get(name) == function)


def motor_outputs(pwm: PwmConfig, functions: Pulses, names: Sequence[str], values: Mapping[str, float]) -> Pulses:
    """The outputs (port, starboard): the config's, else the first that has the function, else the usual one."""
    port, starboard = (
        config.output or next(iter(outputs_with(function, names, values)), None)
        for config, function in zip((pwm.port, pwm.starboard), functions, strict=True)
    )
    return port or (3 if starboard == 1 else 1), starboard or (1 if port == 3 else 3)


def motor_of(pwm: PwmConfig, config: MotorOutputConfig, *, trim_us: float | None = None, turned: bool = False) -> Motor:
    """A motor as the config says, and where it does not by its output: its trim, and whether the autopilot turns it.

    A trim that is no neutral of such a motor is left out; the requirements refuse a hold for it.
    """
    ends_us: tuple[float, float] = (pwm.astern_us, pwm.ahead_us)
    if config.astern_us is not None and config.ahead_us is not None:
        ends_us = (config.astern_us, config.ahead_us)
    elif turned:
        ends_us = (pwm.ahead_us, pwm.astern_us)
    neutral_us: float = pwm.neutral_us if config.neutral_us is None else config.neutral_us
    if config.neutral_us is None and trim_us is not None and abs(trim_us - neutral_us) <= NEUTRAL_SLACK_US:
        neutral_us = trim_us
    if not min(ends_us) < neutral_us < max(ends_us):
        neutral_us = 0.5 * (ends_us[0] + ends_us[1])
    return Motor(astern_us=ends_us[0], neutral_us=neutral_us, ahead_us=ends_us[1])


def wiring_of_config(pwm: PwmConfig) -> Wiring:
    """The wiring that the config tells, where the autopilot tells nothing."""
    port, starboard = (
        MotorWiring(
            output=output,
            motor=motor_of(pwm, config),
            travel=Travel(low_us=LOW_US, trim_us=pwm.neutral_us, high_us=HIGH_US),
        )
        for output, config in zip(pwm.outputs, (pwm.port, pwm.starboard), strict=True)
    )
    return Wiring(pwm, (port, starboard))
