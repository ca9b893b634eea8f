"""Station keeping metrics: the paper's errors and penalty score, from series of pose errors."""

from __future__ import annotations

from typing import Any

from asvhil.dynamics.arrays import Array
from asvhil.types import record

SETTLED_FROM_S = 60.0  # the score is of station keeping, not of the way to the station


@record
class PoseErrors:
    """Errors to the station over time: t_s since the start of the run, distance (m), heading error (deg, signed)."""

    t_s: Array
    distance_m: Array
    heading_deg: Array


def settled_from_s(duration_s: float) -> float:
    """Start of the scoring window: 60 s, or half of the run where it is shorter than two minutes."""
    return min(SETTLED_FROM_S, 0.5 * duration_s)


def score(errors: PoseErrors, from_s: float) -> dict[str, Any]:
    """Mean and standard deviation over the window from `from_s` on, and ps = e_d + s_d + |e_h| + s_h (m, deg).

    `max` is over all samples given, `max_settled` over the window. None where the window holds no sample.
    """
    window = errors.t_s >= from_s
    if not window.any():
        return {
            "distance_m": {"mean": None, "std": None, "max": None, "max_settled": None},
            "heading_deg": {"mean": None, "std": None},
            "penalty_score": None,
        }
    distance, heading = errors.distance_m[window], errors.heading_deg[window]
    e_d, s_d = float(distance.mean()), float(distance.std())
    e_h, s_h = float(heading.mean()), float(heading.std())
    return {
        "distance_m": {
            "mean": e_d,
            "std": s_d,
            "max": float(errors.distance_m.max()),
            "max_settled": float(distance.max()),
        },
        "heading_deg": {"mean": e_h, "std": s_h},
        "penalty_score": e_d + s_d + abs(e_h) + s_h,
    }
