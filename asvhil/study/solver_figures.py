"""Figures of the solver study: times of a step, gaps to the optimum, and the cost of the closed loop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from asvhil.config import Config, MpcWeights
from asvhil.dynamics.arrays import Array
from asvhil.study.solver_runs import Step

SETTLED_STEPS = 50  # at the end of the run


def figures(config: Config, run: list[Step], costs: Array, optima: Array) -> dict[str, Any]:
    """Times, gaps and the closed loop of one run."""
    known = np.isfinite(optima)
    settled = [step.truth for step in run[-SETTLED_STEPS:]]
    return {
        "step_ms": time_figures(np.array([step.wall_ms for step in run])),
        "step_cpu_ms": time_figures(np.array([step.cpu_ms for step in run])),
        "failed": sum(not step.ok for step in run),
        "gap": gap_figures(costs[known] / optima[known] - 1.0) | {"problems": int(known.sum())},
        "closed_loop_cost": _closed_loop_cost(run, config.controller.mpc.far, 1.0 / config.daemon.control_hz),
        "distance_end_m": float(np.mean([math.hypot(truth.n_m, truth.e_m) for truth in settled])),
    }


def _closed_loop_cost(run: list[Step], weights: MpcWeights, period_s: float) -> float:
    """The stage cost of the truth over the run, with the weights of the approach; the station is the plant's origin."""
    total = 0.0
    for step in run:
        truth = step.truth
        total += weights.position * (truth.n_m**2 + truth.e_m**2) + weights.heading * truth.psi_rad**2
        total += weights.velocity * (truth.u_mps**2 + truth.v_mps**2 + truth.r_radps**2)
    return period_s * total


def time_figures(values: Array) -> dict[str, float]:
    """Of the steps of one run (ms), in their order."""
    return {
        "first": float(values[0]),
        "median": float(np.median(values)),
        "p99": float(np.percentile(values, 99)),
        "max": float(values.max()),
    }


def gap_figures(gaps: Array) -> dict[str, float]:
    """Of costs over their optima less 1; NaN where there are none."""
    if not gaps.size:
        return {"mean": math.nan, "median": math.nan, "p95": math.nan, "max": math.nan}
    return {
        "mean": float(gaps.mean()),
        "median": float(np.median(gaps)),
        "p95": float(np.percentile(gaps, 95)),
        "max": float(gaps.max()),
    }
