"""Station keeping metrics of series: errors, scores, circular statistics, docking windows, the work of the motors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from asvhil.dynamics.arrays import Array
from asvhil.supervisor.docking import (
    DOCKING_RADIUS_M,
    DOCKING_RATE_RADPS,
    DOCKING_SECTOR_DEG,
    DOCKING_SPEED_MPS,
)
from asvhil.supervisor.energy import CURVE, MEASURED
from asvhil.supervisor.heading_policy import LEAST_CHANGE_RAD
from asvhil.supervisor.stations import LEAP_M, TURN_M
from asvhil.types import record

SETTLED_FROM_S = 60.0  # the score is of station keeping, not of the way to the station
VRX_BASE = 0.75  # per metre: how fast the heading loses its weight with the distance

DOCKING_LEAST_S = 10.0  # shorter ones are of no use, and not counted
GAP_S = 1.0  # samples farther apart are not of one window

SATURATED_FROM = 0.99  # of full thrust
REVERSAL_BEYOND = 0.05  # of full command: nearer to neutral a motor stands still


@record
class PoseErrors:
    """Errors to the station over time: t_s since the start of the run, distance (m), heading error (deg, signed)."""

    t_s: Array
    distance_m: Array
    heading_deg: Array


@record
class MotionTrack:
    """A boat's motion by one way of knowing it: k samples, and the station and the hold of each.

    t_s since the first tick (k,); pose (k, 3) n, e (m), psi (rad); speed over ground (m/s), relative to a station that
    moves; yaw rate (rad/s); station (k, 3) as the pose, NaN where there is none, and whether it moves; number of the
    hold, 0 where the controller had not the motors. `jumps_s`: when the clock jumped, which is no gap in t_s.
    """

    t_s: Array
    pose: Array
    speed_mps: Array
    yaw_rate_radps: Array
    station: Array
    moves: NDArray[np.bool_]
    hold: Array
    jumps_s: tuple[float, ...] = ()

    def of_hold(self, number: int | None = None) -> MotionTrack:
        """The samples of one hold, of all holds where None."""
        return self.where(self.hold > 0 if number is None else self.hold == number)

    def where(self, mask: NDArray[np.bool_]) -> MotionTrack:
        """The samples of a mask (k,)."""
        return MotionTrack(
            t_s=self.t_s[mask],
            pose=self.pose[mask],
            speed_mps=self.speed_mps[mask],
            yaw_rate_radps=self.yaw_rate_radps[mask],
            station=self.station[mask],
            moves=self.moves[mask],
            hold=self.hold[mask],
            jumps_s=self.jumps_s,
        )

    @property
    def errors(self) -> PoseErrors:
        """Errors of each sample to its own station; NaN where there is none."""
        off = self.pose - self.station
        return PoseErrors(
            t_s=self.t_s,
            distance_m=np.hypot(off[:, 0], off[:, 1]),
            heading_deg=np.degrees((off[:, 2] + math.pi) % math.tau - math.pi),
        )


def settled_from_s(duration_s: float) -> float:
    """Start of the scoring window: 60 s, or half of the run where it is shorter than two minutes."""
    return min(SETTLED_FROM_S, 0.5 * duration_s)


def score(errors: PoseErrors, from_s: float) -> dict[str, Any]:
    """Statistics over the window from `from_s` on, ps = e_d + s_d + |e_h| + s_h (m, deg), and VRX's score.

    `max` is over all samples given, `max_settled` over the window. Heading: `mean` and `std` are the arithmetic ones of
    the wrapped errors, as in the paper's ps; `abs_mean` is of the magnitude; `circular_mean` and `circular_std` are
    those of `circular_deg`, which alone mean something where the errors go all round. VRX's score (VRX 2023, task 1) is
    the mean of d + 0.75^d |dpsi| in m and rad. Where the window holds no sample all but `max` are None.
    """
    window = errors.t_s >= from_s
    most = float(errors.distance_m.max()) if len(window) else None
    if not window.any():
        return {
            "distance_m": {"mean": None, "std": None, "max": most, "max_settled": None},
            "heading_deg": dict.fromkeys(("mean", "std", "abs_mean", "circular_mean", "circular_std")),
            "penalty_score": None,
            "vrx_score": None,
        }
    distance, heading = errors.distance_m[window], errors.heading_deg[window]
    e_d, s_d = float(distance.mean()), float(distance.std())
    e_h, s_h = float(heading.mean()), float(heading.std())
    around = circular_deg(np.radians(heading))
    return {
        "distance_m": {
            "mean": e_d,
            "std": s_d,
            "max": most,
            "max_settled": float(distance.max()),
        },
        "heading_deg": {
            "mean": e_h,
            "std": s_h,
            "abs_mean": float(np.abs(heading).mean()),
            "circular_mean": around["mean"],
            "circular_std": around["std"],
        },
        "penalty_score": e_d + s_d + abs(e_h) + s_h,
        "vrx_score": float((distance + _vrx_weight(distance) * np.radians(np.abs(heading))).mean()),
    }


def _vrx_weight(distance_m: Array) -> Array:
    """Of the heading, one value per distance. Not NumPy's power: its last bits depend on the processor."""
    return np.array([math.pow(VRX_BASE, distance) for distance in distance_m.tolist()])


def circular_deg(angles_rad: Array) -> dict[str, float | None]:
    """Mean direction and standard deviation sqrt(-2 ln R) of angles, in degrees (Mardia and Jupp 2000, 2.2, 2.3).

    R is the length of the mean of the unit vectors. None of no angles; no mean where they cancel out.
    """
    if not len(angles_rad):
        return {"mean": None, "std": None}
    c, s = float(np.cos(angles_rad).mean()), float(np.sin(angles_rad).mean())
    length = min(math.hypot(c, s), 1.0)
    if length < 1e-12:
        return {"mean": None, "std": None}
    return {"mean": math.degrees(math.atan2(s, c)), "std": math.degrees(math.sqrt(-2.0 * math.log(length)))}


def wind_figures(wind: Array) -> dict[str, Any] | None:
    """Speed (m/s) and direction (deg, that it blows toward) of rows (t_s, speed, toward rad); None of no rows."""
    if not len(wind):
        return None
    return {
        "speed_mps": {"mean": float(wind[:, 1].mean()), "std": float(wind[:, 1].std())},
        "toward_deg": circular_deg(wind[:, 2]),
    }


def docking_windows(track: MotionTrack) -> list[dict[str, Any]]:
    """The docking windows (s) of a track, each with the errors in it; at least `DOCKING_LEAST_S` long.

    A window is of one hold and one station, as long as speed, yaw rate, distance and heading error stay in the bounds
    of `asvhil/supervisor/docking.py`.
    """
    errors = track.errors
    inside = (
        (track.hold > 0)
        & (track.speed_mps < DOCKING_SPEED_MPS)
        & (np.abs(track.yaw_rate_radps) < DOCKING_RATE_RADPS)
        & (errors.distance_m < DOCKING_RADIUS_M)
        & (np.abs(errors.heading_deg) < 0.5 * DOCKING_SECTOR_DEG)
    )
    windows = []
    for first, last in _runs(inside, track):
        length_s = float(track.t_s[last] - track.t_s[first])
        if length_s < DOCKING_LEAST_S:
            continue
        distance, heading = (part[first : last + 1] for part in (errors.distance_m, errors.heading_deg))
        windows.append(
            {
                "from_s": float(track.t_s[first]),
                "to_s": float(track.t_s[last]),
                "length_s": length_s,
                "distance_m": {"mean": float(distance.mean()), "max": float(distance.max())},
                "heading_deg": {"mean": float(heading.mean()), "abs_mean": float(np.abs(heading).mean())},
            }
        )
    return windows


def docking_figures(track: MotionTrack) -> dict[str, Any]:
    """The docking windows of a track, the longest one's length, and their share of the time that is held (0 to 1)."""
    windows = docking_windows(track)
    total_s = sum(window["length_s"] for window in windows)
    held_s = sum(
        float(part[-1] - part[0])
        for part in (track.t_s[track.hold == number] for number in np.unique(track.hold) if number > 0)
    )
    return {
        "windows": windows,
        "longest_s": max((window["length_s"] for window in windows), default=0.0),
        "share": total_s / held_s if held_s else None,
    }


def motor_figures(command: Array) -> dict[str, float | None]:
    """The work of the motors, of rows (t_s, port, starboard, hold) in [-1, 1], one per solution.

    `energy`: mean squared command, a measure that needs no power curve of a motor. `reversals_per_min` and
    `change_per_s` (mean |change of command|) are of one motor, the mean of both, and leave out the time between holds.
    A motor reverses where it goes from beyond 5 % ahead to beyond 5 % astern, or back. `reversals_per_min_most` is of
    the motor that reverses more, `saturated_share` the share of solutions of the one that is at its limit more often.
    None of no rows.
    """
    if not len(command):
        return dict.fromkeys(
            ("energy", "reversals_per_min", "reversals_per_min_most", "change_per_s", "saturated_share")
        )
    elapsed_s, change, reversals = 0.0, 0.0, [0, 0]
    for number in np.unique(command[:, 3]):
        part = command[command[:, 3] == number]
        elapsed_s += float(part[-1, 0] - part[0, 0])
        change += float(np.abs(np.diff(part[:, 1:3], axis=0)).sum())
        for side, motor in enumerate((part[:, 1], part[:, 2])):
            turning = np.sign(motor[np.abs(motor) > REVERSAL_BEYOND])
            reversals[side] += int((turning[1:] != turning[:-1]).sum())
    minutes = elapsed_s / 60.0
    return {
        "energy": float((command[:, 1:3] ** 2).mean()),
        "reversals_per_min": 0.5 * sum(reversals) / minutes if elapsed_s else None,
        "reversals_per_min_most": max(reversals) / minutes if elapsed_s else None,
        "change_per_s": 0.5 * change / elapsed_s if elapsed_s else None,
        "saturated_share": float((np.abs(command[:, 1:3]) >= SATURATED_FROM).mean(axis=0).max()),
    }


def energy_figures(energy: Array) -> dict[str, Any]:
    """Energy from the battery, of rows (t_s, Wh of the hold so far, 1 measured or 0 by the curve, hold), NaN: unknown.

    `energy_wh` is of all the holds together, None where it is not known of one; `energy_by` tells how the power was
    known, None where it never was.
    """
    last = [energy[energy[:, 3] == number][-1, 1] for number in np.unique(energy[:, 3])]
    by = [name for name, value in ((CURVE, 0.0), (MEASURED, 1.0)) if (energy[:, 2] == value).any()]
    known = len(last) > 0 and bool(np.isfinite(last).all())
    return {"energy_wh": float(np.sum(last)) if known else None, "energy_by": " and ".join(by) or None}


def _runs(inside: NDArray[np.bool_], track: MotionTrack) -> list[tuple[int, int]]:
    """First and last index of each run of samples inside, cut at gaps and where hold or station change."""
    if not len(inside):
        return []
    step = np.diff(track.station, axis=0)
    # One that turns a little from sample to sample follows the weather, and is the same.
    # So is one that moves on its course.
    course = track.moves[1:] | track.moves[:-1]
    leapt = np.hypot(step[:, 0], step[:, 1]) > np.where(course, LEAP_M, TURN_M)
    moved = leapt | (np.abs(np.sin(0.5 * step[:, 2])) > 0.5 * LEAST_CHANGE_RAD)
    cut = (np.diff(track.t_s) > GAP_S) | (track.hold[1:] != track.hold[:-1]) | moved
    for at_s in track.jumps_s:  # how long the boat was not seen is not known
        cut |= (track.t_s[:-1] < at_s) & (track.t_s[1:] >= at_s)
    first, last = inside.copy(), inside.copy()
    first[1:] &= cut | np.logical_not(inside[:-1])
    last[:-1] &= cut | np.logical_not(inside[1:])
    return list(zip(np.flatnonzero(first).tolist(), np.flatnonzero(last).tolist(), strict=True))
