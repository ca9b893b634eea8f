"""Ways in which an autopilot may bend two motor commands: what each makes of the pulses sent. Pure, on NumPy arrays.

Pulses are rows of (port, starboard) in us. A way that follows from the pulses alone is a function of them; where it has
a size (a dead zone, a factor) each size is a way of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from asvhil.types import Cause, record

Pulses = npt.NDArray[np.float64]

TRAVELS_US = (500.0, 400.0)  # of sticks and outputs from neutral: 1000 to 2000 us, and ArduPilot's default
DEAD_ZONES_US = (*range(10, 65, 5), *range(70, 210, 10))
FACTORS = tuple(percent / 100 for percent in (*range(40, 97, 2), *range(104, 180, 4)))
OFFSETS_US = tuple(sign * offset for offset in range(10, 105, 5) for sign in (1, -1))
LEAST_THROTTLES = tuple(percent / 100 for percent in range(2, 22, 2))
MOTORS = {"": (True, True), "port": (True, False), "starboard": (False, True)}


@record
class Distortion:
    """One way. `motor` is the one that it touches, empty for both; `size` in us or as a factor, 0 where it has none."""

    cause: Cause
    apply: Callable[[Pulses], Pulses]
    motor: str = ""
    size: float = 0.0


def ways(neutral_us: float) -> tuple[tuple[Distortion, ...], ...]:
    """All that are known, the plainest first; of a group the one that fits best is meant."""
    groups: list[tuple[Distortion, ...]] = [
        (
            Distortion(
                cause=Cause.SWAPPED if swap else Cause.REVERSED,
                apply=partial(_turned, neutral_us, swap, signs),
                motor="" if swap else {(-1, 1): "port", (1, -1): "starboard"}.get(signs, ""),
            ),
        )
        for swap in (False, True)
        for signs in ((1, 1), (-1, 1), (1, -1), (-1, -1))
        if swap or signs != (1, 1)
    ]
    groups += [
        tuple(Distortion(cause=Cause.MIXED, apply=partial(_mixed, neutral_us, travel, flips)) for travel in TRAVELS_US)
        for flips in (True, False)
    ]
    groups.append(
        tuple(
            Distortion(
                cause=cause,
                apply=partial(_only, np.array(touched), partial(bend, neutral_us, size)),
                motor=m,
                size=size,
            )
            for cause, bend, sizes in (
                (Cause.DEAD_ZONE, _dead_zone, DEAD_ZONES_US),
                (Cause.SCALED, _scaled, FACTORS),
                (Cause.SCALED, _shifted, OFFSETS_US),
                (Cause.SCALED, _raised, LEAST_THROTTLES),
            )
            for m, touched in MOTORS.items()
            for size in sizes
        )
    )
    return tuple(groups)


def slewed(
    t_s: npt.NDArray[np.float64], throttle_us: npt.NDArray[np.float64], rate_us_per_s: float, start_us: float
) -> npt.NDArray[np.float64]:
    """What a limit on the rate of the throttle (mean of both pulses) makes of it, by each time at which it was sent."""
    found = [start_us]
    for wanted_us, elapsed_s in zip(throttle_us[:-1], np.diff(t_s), strict=True):
        reach_us = rate_us_per_s * elapsed_s
        found.append(found[-1] + min(max(wanted_us - found[-1], -reach_us), reach_us))
    return np.array(found)


def _turned(neutral_us: float, swap: bool, signs: tuple[int, int], sent: Pulses) -> Pulses:
    """Each other's pulses, or pulses turned about neutral."""
    offset_us = (sent[:, ::-1] if swap else sent) - neutral_us
    return np.asarray(neutral_us + np.array(signs) * offset_us, dtype=np.float64)


def _mixed(neutral_us: float, travel_us: float, flips: bool, sent: Pulses) -> Pulses:
    """Steering and throttle of a rover: the ratio is kept where a motor would have to do more than it can."""
    steering, throttle = ((sent - neutral_us) / travel_us).T
    if flips:
        steering = np.where(throttle < 0.0, -steering, steering)
    both = np.stack([throttle + steering, throttle - steering], axis=1)
    largest = np.maximum(1.0, np.abs(both).max(axis=1, keepdims=True))
    return np.asarray(neutral_us + travel_us * both / largest, dtype=np.float64)


def _dead_zone(neutral_us: float, zone_us: float, sent: Pulses) -> Pulses:
    offset_us = sent - neutral_us
    beyond_us = np.maximum(np.abs(offset_us) - zone_us, 0.0)
    travel_us = TRAVELS_US[0]
    return neutral_us + np.sign(offset_us) * beyond_us * travel_us / (travel_us - zone_us)


def _scaled(neutral_us: float, factor: float, sent: Pulses) -> Pulses:
    return neutral_us + factor * (sent - neutral_us)


def _shifted(neutral_us: float, offset_us: float, sent: Pulses) -> Pulses:
    return sent + offset_us


def _raised(neutral_us: float, least: float, sent: Pulses) -> Pulses:
    """MOT_THR_MIN: any command but neutral begins at a least throttle."""
    offset_us = sent - neutral_us
    return sent + np.sign(offset_us) * least * (TRAVELS_US[0] - np.abs(offset_us))


def _only(mask: npt.NDArray[np.bool_], bend: Callable[[Pulses], Pulses], sent: Pulses) -> Pulses:
    return np.where(mask, bend(sent), sent)
