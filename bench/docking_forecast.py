"""The forecast of docking windows on simulated field tests: its coefficients, and how good it is on other seeds.

    python -m bench.docking_forecast TRACKS --fit 1101 1105 --seeds 2101 2104 [--json FILE] [--seconds 600]

Runs the nine field tests with each seed, and the WAM-V's twice more: with the weights of its config, which has no soft
limits to keep a window open, and in twice the wind; so there are windows of all lengths. Keeps their tracks in the
folder TRACKS (a run that is there is not made again), fits a logistic regression and its correction on the first seeds,
and tells how good both are on the others, the coefficients fitted and those shipped, in the field tests and in each
group: Brier score, that of climatology (the share of samples that stay open, of the seeds fitted), and reliability in
tenths, with the largest error of those that more than 50 windows are in. A sample is a second of an open window with a
forecast, if the track goes on for as long.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression, minimize

from asvhil.config import load_config
from asvhil.dynamics.arrays import Array
from asvhil.geo import wrap_rad
from asvhil.machine_code.compiler import use_compiler
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.field_tests import BASES, TESTS, overrides_of_test
from asvhil.supervisor.docking import DockingWatch
from asvhil.supervisor.docking_odds import CAME_TRUE, COEFFICIENTS, HORIZONS_S, corrected, probability
from asvhil.types import Estimate, Phase, Station
from bench.ending import end_in_words

PLAIN, WINDY = "wamv, its config's weights", "wamv, twice the wind"
# {name: the field test, and the group in which it is told}
CASES: dict[str, tuple[str, str]] = {
    **{name: (name, test.boat) for name, test in TESTS.items()},
    **{f"{name} plain": (name, PLAIN) for name, test in TESTS.items() if test.boat == "wamv"},
    **{f"{name} windy": (name, WINDY) for name, test in TESTS.items() if test.boat == "wamv"},
}
ORIGIN = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
TENTHS = 10
# Of the coefficients: peaks, ends and a limit nearby close a window, calm keeps it open. Peaks by so much at the least,
# which costs nothing of the Brier scores: a boat that swings near a limit is not to be told as one that lies still.
BOUNDS = ((None, None), (None, -0.25), (None, 0.0), (None, 0.0), (0.0, None), (None, 0.0))
MANY = 50  # windows: a tenth with more of them is looked at
BLOCKS = 20  # of the same number of samples, of which the correction is made
Table = Sequence[tuple[float, float]]


def track_of(folder: Path, name: str, seed: int, seconds: float) -> Array:
    """Rows (t_s, u, v, r, heading error, distance) of each tick, NaN where nothing is held."""
    file = folder / f"{name.replace(' ', '')}-{seed}-{seconds:g}s.npy"
    if file.exists():
        kept: Array = np.load(file)
        return kept
    test, group = CASES[name]
    keys = overrides_of_test(test, seed)
    if group == PLAIN:
        keys = tuple(key for key in keys if not key.startswith("controller.mpc."))
    elif group == WINDY:
        keys = (*keys, f"plant.weather.wind.speed_mps={2.0 * TESTS[test].speed_mps[0]}")
    loop, rows = Lockstep(load_config(BASES[TESTS[test].boat], keys)), []
    for _ in range(round(seconds * loop.config.daemon.tick_hz)):
        _, outputs = loop.tick()
        at, station = outputs.estimate, outputs.station
        row = [outputs.t_ns * 1e-9 % 1e6, *[math.nan] * 5]
        if at is not None and at.valid and station is not None and outputs.phase is Phase.HOLD:
            off_m = math.hypot(at.n_m - station.n_m, at.e_m - station.e_m)
            row[1:] = at.u_mps, at.v_mps, at.r_radps, wrap_rad(at.psi_rad - station.psi_rad), off_m
        rows.append(row)
    track = np.array(rows)
    part = file.with_name(f"part-{file.name}")  # a run that was cut off leaves no track
    np.save(part, track)
    part.replace(file)
    return track


def samples_of(track: Array) -> tuple[Array, Array, Array, Array, int]:
    """Of k samples: features (k, 6), seconds that the window stays open, seconds that the track goes on, its number.

    And how many windows there were.
    """
    watch, features, at_s, windows, ends = DockingWatch(), [], [], [], []
    was_open, second = False, -1
    for row in track:
        t_s = float(row[0])
        estimate = None if math.isnan(row[1]) else _estimate(row)
        window = watch.step(round(t_s * 1e9), estimate, None if estimate is None else ORIGIN)
        is_open = window is not None and window.open_s is not None
        if is_open and not was_open:
            windows.append(t_s)
        if was_open and not is_open:
            ends.append(t_s)
        was_open = is_open
        if is_open and watch.features is not None and int(t_s) != second:
            second = int(t_s)
            features.append(watch.features)
            at_s.append((t_s, len(windows) - 1))
    last_s = float(track[-1, 0])
    until = [ends[number] if number < len(ends) else last_s for _, number in at_s]
    times = np.array([t_s for t_s, _ in at_s])
    numbers = np.array([number for _, number in at_s], dtype=int)
    x = np.array(features).reshape(-1, len(COEFFICIENTS[0]))
    return x, np.array(until) - times, last_s - times, numbers, len(windows)


def _estimate(row: Array) -> Estimate:
    _, u_mps, v_mps, r_radps, psi_rad, off_m = row[:6].tolist()
    return Estimate(
        t_ns=0, n_m=off_m, e_m=0.0, psi_rad=psi_rad, u_mps=u_mps, v_mps=v_mps, r_radps=r_radps,
        motor=(), std=(0.0,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


def fitted(x: Array, y: Array) -> tuple[float, ...]:
    """Coefficients of the logistic regression, with a small ridge and within BOUNDS.

    Over boats of two kinds the likeliest coefficients have some signs the wrong way round, for what tells the boats
    apart, and tell nonsense of a third boat; within these the Brier scores are the same to 0.002.
    """
    scale = np.r_[1.0, x[:, 1:].std(axis=0)]  # of one size each, or the search takes thousands of steps
    z = x / scale

    def cost(w: Array) -> tuple[float, Array]:
        told = z @ w
        ridge = np.r_[0.0, w[1:] / scale[1:] ** 2]
        p = 1.0 / (1.0 + np.exp(-np.clip(told, -50.0, 50.0)))
        return float(np.logaddexp(0.0, told).sum() - y @ told + 0.5 * ridge @ w), z.T @ (p - y) + ridge

    bounds = [(least, most if most is None else most * size) for (least, most), size in zip(BOUNDS, scale, strict=True)]
    found = minimize(cost, np.zeros(x.shape[1]), jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 2000})
    return tuple(float(c) for c in found.x / scale)


def came_true(p: Array, y: Array, windows: Array) -> list[tuple[float, float]]:
    """The correction of probabilities told: means of blocks of them against the share that stayed, made to rise.

    As if each block had seen one window more, which stayed open in half of the cases: nothing is certain.
    """
    order = np.argsort(p, kind="stable")
    blocks = np.array_split(order, BLOCKS)
    seen = [len(set(windows[block].tolist())) for block in blocks]
    shares = [(float(y[block].mean()) * of + 0.5) / (of + 1.0) for block, of in zip(blocks, seen, strict=True)]
    rising = isotonic_regression(shares, weights=[len(b) for b in blocks]).x
    table = [(float(p[block].mean()), float(share)) for block, share in zip(blocks, rising, strict=True)]
    # Of a flat part its two ends are enough.
    inner = [at for k, at in enumerate(table[1:-1], 1) if not table[k - 1][1] == at[1] == table[k + 1][1]]
    return [table[0], *inner, table[-1]]


def told(x: Array, y: Array, windows: Array, rows: Sequence[float], table: Table, base: float) -> dict[str, Any]:
    """Brier score and climatology's; of each tenth its samples, windows, mean forecast and share that stayed open."""
    p = np.array([corrected(probability(rows, row), table) for row in x.tolist()])
    tenths = []
    for k in range(TENTHS):
        here = (p >= k / TENTHS) & (p < (k + 1) / TENTHS + (k == TENTHS - 1))
        if here.any():
            of = len(set(windows[here].tolist()))
            means = {"told": float(p[here].mean()), "stayed": float(y[here].mean())}
            tenths.append({"samples": int(here.sum()), "windows": of, **means})
    brier, climatology = float(np.mean((p - y) ** 2)), float(np.mean((base - y) ** 2))
    off = [abs(tenth["told"] - tenth["stayed"]) for tenth in tenths if tenth["windows"] > MANY]
    better = 1.0 - brier / climatology if climatology else None  # where all stayed open, or none
    return {
        "brier": brier,
        "climatology": climatology,
        "better": better,
        "off": max(off, default=0.0),
        "tenths": tenths,
    }


def _samples(folder: Path, seeds: Iterable[int], seconds: float) -> tuple[tuple[Array, ...], dict[str, int]]:
    """Features, seconds that the window stays open, seconds that the track goes on, window and group of all samples;
    and how many windows each group had.
    """
    parts, groups, windows = [], list[str](), Counter[str]()
    for seed in seeds:
        print(f"seed {seed}", file=sys.stderr)
        for name, (_, group) in CASES.items():
            x, stays_s, goes_on_s, numbers, count = samples_of(track_of(folder, name, seed, seconds))
            parts.append((x, stays_s, goes_on_s, numbers + windows.total()))
            groups += [group] * len(x)
            windows[group] += count
    return (*(np.concatenate(column) for column in zip(*parts, strict=True)), np.array(groups)), dict(windows)


@dataclass(frozen=True)
class Outcomes:
    """Of k samples: features (k, 6), whether the window stayed open (k,), number of the window, group."""

    x: Array
    stayed: Array
    windows: Array
    groups: Array

    def where(self, of: NDArray[np.bool_]) -> Outcomes:
        return Outcomes(self.x[of], self.stayed[of], self.windows[of], self.groups[of])

    def told(self, rows: Sequence[float], table: Table, base: float) -> dict[str, Any]:
        return told(self.x, self.stayed, self.windows, rows, table, base)


def outcomes(samples: tuple[Array, ...], horizon_s: float) -> Outcomes:
    """Of the samples whose track goes on for so long."""
    x, stays_s, goes_on_s, windows, groups = samples
    on = goes_on_s > horizon_s
    return Outcomes(x[on], (stays_s[on] > horizon_s).astype(float), windows[on], groups[on])


def judged(fit: Outcomes, others: Outcomes, number: int) -> dict[str, Any]:
    """How good the forecast of a horizon is, as fitted and as shipped, in the field tests and in each group.

    In a group beside its own climatology: the boats differ by more than a boat's weathers do.
    """
    rows = fitted(fit.x, fit.stayed)
    table = came_true(np.array([probability(rows, row) for row in fit.x.tolist()]), fit.stayed, fit.windows)
    shipped = COEFFICIENTS[number], CAME_TRUE[number]
    fields = tuple(BASES)
    tests = others.where(np.isin(others.groups, fields))
    base = float(fit.stayed[np.isin(fit.groups, fields)].mean())
    groups = {}
    for group in dict.fromkeys(group for _, group in CASES.values()):
        of_group = float(fit.stayed[fit.groups == group].mean())
        groups[group] = {"base": of_group, **others.where(others.groups == group).told(*shipped, of_group)}
    return {
        "samples": len(tests.stayed),
        "base": base,
        "coefficients": rows,
        "came_true": table,
        "fitted": tests.told(rows, table, base),
        "shipped": tests.told(*shipped, base),
        "groups": groups,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tracks", type=Path)
    parser.add_argument("--fit", type=int, nargs=2, required=True, metavar=("FIRST", "LAST"))
    parser.add_argument("--seeds", type=int, nargs=2, required=True, metavar=("FIRST", "LAST"))
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    asked.tracks.mkdir(parents=True, exist_ok=True)
    use_compiler()
    sets = [_samples(asked.tracks, range(first, last + 1), asked.seconds) for first, last in (asked.fit, asked.seeds)]
    found: dict[str, Any] = {"windows": [windows for _, windows in sets], "horizons": {}}
    for number, horizon_s in enumerate(HORIZONS_S):
        fit, others = (outcomes(samples, horizon_s) for samples, _ in sets)
        found["horizons"][f"{horizon_s:g}"] = judged(fit, others, number)
    text = json.dumps(found, indent=1)
    print(text)
    if asked.json is not None:
        asked.json.write_text(text + "\n")


if __name__ == "__main__":
    end_in_words(main)
