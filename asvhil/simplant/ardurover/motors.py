"""What an ArduRover makes of the pilot's two sticks: steering and throttle, their limits, and the motors' mixer."""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.simplant.ardurover.parameters import Parameters
from asvhil.types import record

TWO_PADDLES = 1  # PILOT_STEER_TYPE: a stick for each motor
STEERING_NOT_FLIPPED = 3  # PILOT_STEER_TYPE: steering keeps its sense when going astern
SPEED_SCALING = 1  # bit of MANUAL_OPTIONS


@record
class SteeringSettings:
    """What the parameters say of sticks and motors. `step`: of the throttle from loop to loop, None: any."""

    two_paddles: bool
    flips_astern: bool
    step: float | None
    stick_expo: float
    largest: float
    scaled_by_speed: bool
    speed_base_mps: float
    asymmetry: float
    mix: float
    least: float
    thrust_expo: float

    @classmethod
    def of(cls, parameters: Parameters, loop_hz: float) -> SteeringSettings:
        """As the parameters are now."""
        slew = parameters["MOT_SLEWRATE"]  # percent per second
        return cls(
            two_paddles=parameters["PILOT_STEER_TYPE"] == TWO_PADDLES,
            flips_astern=parameters["PILOT_STEER_TYPE"] != STEERING_NOT_FLIPPED,
            step=0.01 * slew / loop_hz if slew > 0.0 else None,
            stick_expo=parameters["MANUAL_STR_EXPO"],
            largest=0.01 * parameters["MOT_THR_MAX"],
            scaled_by_speed=bool(int(parameters["MANUAL_OPTIONS"]) & SPEED_SCALING),
            speed_base_mps=parameters["MOT_SPD_SCA_BASE"],
            asymmetry=max(parameters["MOT_THST_ASYM"], 1.0),
            mix=parameters["MOT_STR_THR_MIX"],
            least=0.01 * parameters["MOT_THR_MIN"],
            thrust_expo=parameters["MOT_THST_EXPO"],
        )


class SkidSteering:
    """From the sticks to the throttles of both motors. It keeps the last throttle, whose change MOT_SLEWRATE limits."""

    def __init__(self, parameters: Parameters, loop_hz: float) -> None:
        self._parameters = parameters
        self._loop_hz = loop_hz
        self._throttle = 0.0
        self._changes, self._settings = parameters.changes, SteeringSettings.of(parameters, loop_hz)
        # The last sticks with their throttles, where these depend on nothing else; a loop is shorter than they stand.
        self._last: tuple[tuple[float, float], tuple[float, float]] | None = None

    def stop(self) -> None:
        """The motors are not driven: the next throttle starts from zero."""
        self._throttle = 0.0
        self._last = None

    def throttles(self, first: float, second: float, speed_mps: Callable[[], float]) -> tuple[float, float]:
        """Port and starboard in [-1, 1], from two sticks in [-1, 1] and the speed ahead over ground, if it counts."""
        if self._changes != self._parameters.changes:
            self._changes = self._parameters.changes
            self._settings = SteeringSettings.of(self._parameters, self._loop_hz)
            self._last = None
        if self._last is not None and self._last[0] == (first, second):
            return self._last[1]
        throttles = self._throttles(first, second, speed_mps)
        if self._settings.step is None and not self._settings.scaled_by_speed:
            self._last = (first, second), throttles
        return throttles

    def _throttles(self, first: float, second: float, speed_mps: Callable[[], float]) -> tuple[float, float]:
        settings = self._settings
        if settings.two_paddles:
            throttle, steering = 0.5 * (first + second), 0.5 * (first - second)
        else:
            throttle, steering = second, first
            asked = abs(throttle) + abs(steering)
            if asked > 1.0:  # of a boat with two motors, both are lessened alike
                throttle, steering = throttle / asked, steering / asked
            if throttle < 0.0 and settings.flips_astern:
                steering = -steering
        step = settings.step
        if step is not None:  # of the throttle alone
            throttle = max(self._throttle - step, min(self._throttle + step, throttle))
        self._throttle = throttle
        expo = settings.stick_expo
        if expo < 0.95:
            steering = (1.0 - expo) * steering / (1.0 - expo * abs(steering))
        largest = settings.largest
        throttle = max(-largest, min(largest, throttle))
        if settings.scaled_by_speed:
            steering = _scaled_by_speed(steering, speed_mps(), settings.speed_base_mps)
        port, starboard = _mix(steering, throttle, settings.asymmetry, settings.mix)
        least, thrust_expo = settings.least, settings.thrust_expo
        return _thrust_curve(port, least, thrust_expo), _thrust_curve(starboard, least, thrust_expo)


def _scaled_by_speed(steering: float, speed_mps: float, base_mps: float) -> float:
    """MANUAL_OPTIONS: steering lessens above MOT_SPD_SCA_BASE, and changes its sense with the boat's way."""
    if 0.0 < base_mps < abs(speed_mps):
        steering *= base_mps / abs(speed_mps)
    return -steering if speed_mps < 0.0 else steering


def _mix(steering: float, throttle: float, asymmetry: float, mix: float) -> tuple[float, float]:
    """The mixer of ArduPilot's AR_Motors for two motors that give less thrust astern, by MOT_THST_ASYM.

    `mix` is MOT_STR_THR_MIX: at 1 steering goes before throttle where both do not fit.
    """
    least = -1.0 / asymmetry
    best = 0.5 * (1.0 + least)
    reach = max(throttle, 0.0) - least if throttle < best else 1.0 - best
    steering = max(-reach, min(reach, steering))
    throttle = max(least, min(1.0, throttle))
    excess = max(throttle + abs(steering), (throttle - abs(steering)) / least)
    if excess > 1.0:
        fair = 1.0 / excess
        if mix >= 0.5:
            steering *= fair + (1.0 - fair) * (mix - 0.5) / 0.5
            throttle = 1.0 - abs(steering) if throttle >= best else abs(steering) + least
        else:
            throttle *= fair + (1.0 - fair) * (0.5 - mix) / 0.5
            left = 1.0 - throttle if throttle >= best else throttle - least
            steering = math.copysign(left, steering)
    port, starboard = throttle + steering, throttle - steering
    return (port * asymmetry if port < 0.0 else port), (starboard * asymmetry if starboard < 0.0 else starboard)


def _thrust_curve(fraction: float, least: float, expo: float) -> float:
    """MOT_THR_MIN (a fraction here), then MOT_THST_EXPO, as ArduPilot's AR_Motors scales a throttle."""
    size = abs(fraction)
    if size == 0.0:
        return 0.0
    size = least + size * (1.0 - least)
    if expo != 0.0:
        size = (expo - 1.0 + math.sqrt((1.0 - expo) ** 2 + 4.0 * expo * size)) / (2.0 * expo)
    return math.copysign(size, fraction)
