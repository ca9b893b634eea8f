"""Motor commands that reach the wrong motor, or turn it the wrong way: what the outputs would be. Pure, on NumPy.

Pulses are rows of (port, starboard) in us. Dead zones, scaling and slew limits are not here: the outputs still follow
their own command then, and only the parameters tell which of them it is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from asvhil.types import Cause, record

Pulses = npt.NDArray[np.float64]

TRAVELS_US = (500.0, 400.0)  # of sticks and outputs from neutral: 1000 to 2000 us, and ArduPilot's default
SIGNS = ((1, 1), (-1, 1), (1, -1), (-1, -1))
TURNED_MOTOR = {(-1, 1): "port", (1, -1): "starboard"}


@record
class Distortion:
    """A map from the pulses sent to the outputs. `motor` is the only one that it changes, empty for both."""

    cause: Cause
    apply: Callable[[Pulses], Pulses]
    motor: str = ""


def distortions(neutral_us: float) -> tuple[Distortion, ...]:
    """All that are known, the simplest first."""
    reversed_ = [
        Distortion(
            cause=Cause.REVERSED, apply=partial(_turned, neutral_us, False, signs), motor=TURNED_MOTOR.get(signs, "")
        )
        for signs in SIGNS[1:]
    ]
    swapped = [Distortion(cause=Cause.SWAPPED, apply=partial(_turned, neutral_us, True, signs)) for signs in SIGNS]
    mixed = [
        Distortion(cause=Cause.MIXED, apply=partial(_mixed, neutral_us, travel_us, flips))
        for flips in (True, False)
        for travel_us in TRAVELS_US
    ]
    return (*reversed_, *swapped, *mixed)


def _turned(neutral_us: float, swap: bool, signs: tuple[int, int], sent: Pulses) -> Pulses:
    """Each other's pulses, or pulses mirrored about neutral."""
    offset_us = (sent[:, ::-1] if swap else sent) - neutral_us
    return np.asarray(neutral_us + np.array(signs) * offset_us, dtype=np.float64)


def _mixed(neutral_us: float, travel_us: float, flips: bool, sent: Pulses) -> Pulses:
    """Steering and throttle of a rover: the ratio is kept where a motor would have to do more than it can.

    `flips`: steering changes its sense astern, as by any PILOT_STEER_TYPE of a rover but 3.
    """
    steering, throttle = ((sent - neutral_us) / travel_us).T
    if flips:
        steering = np.where(throttle < 0.0, -steering, steering)
    both = np.stack([throttle + steering, throttle - steering], axis=1)
    largest = np.maximum(1.0, np.abs(both).max(axis=1, keepdims=True))
    return np.asarray(neutral_us + travel_us * both / largest, dtype=np.float64)
