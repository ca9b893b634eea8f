"""How well any filter can know where a boat is while its receiver drifts: `python -m bench.drift_bound`.

The receiver's position has a first-order Gauss-Markov error and white noise, its Doppler velocity white noise, at 5 Hz.
The Kalman filter of these, with the very statistics they are drawn from, is the best estimate there is from them; a
boat, wind and controller do not come in, since none of them tells a slow velocity from standing still. The station is
where the boat is at the hold; the figure is the error of the way it has made since, as the filter has it: nobody can
stay nearer. Times are those of docs/results/real-ardurover.md.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np

from bench.ending import end_in_words

RATE_HZ = 5.0
HOLD_S = 60.0  # after the first fix
FROM_S, TO_S = 60.0, 240.0  # after the hold
UNKNOWN_M = 100.0


def errors_m(draws: int, seed: int, drift_m: float, drift_s: float, noise_m: float, velocity_mps: float) -> np.ndarray:
    """Mean error (m) of each draw in the way the boat has made since the hold."""
    rng = np.random.default_rng(seed)
    dt_s = 1.0 / RATE_HZ
    keep = math.exp(-dt_s / drift_s)
    kick = drift_m * math.sqrt(1.0 - keep * keep)
    walk = np.zeros((draws, 2))
    drift = drift_m * rng.standard_normal((draws, 2))
    # What is measured is the position less the integrated velocity: drift - walk + where the boat was at first. The
    # filter's state, for both axes of all draws at once: the walk of the integrated velocity, the drift, that first
    # place, of which nothing is known, and the walk at the hold.
    estimate = np.zeros((draws, 2, 4))
    p = np.diag([0.0, drift_m**2, UNKNOWN_M**2, 0.0])
    f = np.diag([1.0, keep, 1.0, 1.0])
    q = np.diag([(velocity_mps * dt_s) ** 2, kick**2, 0.0, 0.0])
    h = np.array([-1.0, 1.0, 1.0, 0.0])
    total = np.zeros(draws)
    count = 0
    for step in range(round((HOLD_S + TO_S) * RATE_HZ)):
        measured = drift - walk + noise_m * rng.standard_normal((draws, 2))
        gain = p @ h / (h @ p @ h + noise_m**2)
        estimate += (measured - estimate @ h)[..., None] * gain
        p -= np.outer(gain, h @ p)
        t_s = step * dt_s
        if abs(t_s - HOLD_S) < 0.5 * dt_s:
            held = walk.copy()
            estimate[..., 3] = estimate[..., 0]
            p[3], p[:, 3] = p[0], p[:, 0]
            p[3, 3] = p[0, 0]
        if t_s > HOLD_S + FROM_S:
            off = (walk - held) - (estimate[..., 0] - estimate[..., 3])
            total += np.hypot(*off.T)
            count += 1
        drift = keep * drift + kick * rng.standard_normal((draws, 2))
        walk += velocity_mps * dt_s * rng.standard_normal((draws, 2))
        estimate = estimate @ f.T
        p = f @ p @ f.T + q
    return total / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drift", type=float, nargs=2, default=(1.0, 90.0), metavar=("M", "S"))
    parser.add_argument("--noise", type=float, default=0.3, help="of the position, each axis (m)")
    parser.add_argument("--velocity", type=float, default=0.1, help="noise of the velocity, each axis (m/s)")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    found = np.sort(errors_m(args.draws, args.seed, *args.drift, args.noise, args.velocity))
    figures = {
        "mean_m": float(found.mean()),
        "quantiles_m": {str(part): float(np.quantile(found, part)) for part in (0.05, 0.5, 0.95)},
        "at_most_0.6_m": float((found <= 0.6).mean()),
    }
    if args.json is not None:
        args.json.write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    end_in_words(main)
