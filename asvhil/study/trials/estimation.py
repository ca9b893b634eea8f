"""Errors of estimates against the truth: the inputs of one recorded run through each estimator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from asvhil.backseat.build import build_backseat, build_controller, build_model
from asvhil.config import Config, load_config
from asvhil.dynamics.arrays import Array
from asvhil.geo import LocalFrame, body_to_ned
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Truth
from asvhil.types import Control, Estimate, Inputs, Outputs, Station, Wind, record

KINDS = ("ekf", "fir", "raw")
ACTIVITIES = ("station", "manoeuvres")
TRACE_S = 0.25  # between two points of a picture
TRUTH_COLUMNS = ("n_m", "e_m", "vn_mps", "ve_mps", "psi_rad", "r_radps", "wn_mps", "we_mps", "u_mps", "v_mps")


@record
class Recorded:
    """A run: the inputs and outputs of the backseat in each tick, and the true state."""

    inputs: list[Inputs]
    outputs: list[Outputs]
    truth: list[Truth]
    origin: LocalFrame


class NoController:
    """A controller for a backseat whose estimates alone are used: always neutral."""

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        return Control(command=(0.0, 0.0), ok=True, iterations=0, cost=0.0)

    def new_station(self) -> None:
        """Nothing to do: it has no state."""

    def reset(self) -> None:
        """Nothing to do: it has no state."""


def record_run(config: Config, activity: str, duration_s: float) -> Recorded:
    """A run in lockstep: `station` keeps the configured one, `manoeuvres` drives the predefined programme about it.

    The filter has the model of the configured controller in either.
    """
    loop = Lockstep(config)
    if activity == "manoeuvres":
        model = build_model(config)
        driver = config.controller.model_copy(update={"name": "manoeuvres"})
        controller = build_controller(config.model_copy(update={"controller": driver}), model)
        loop.backseat = build_backseat(config, model=model, controller=controller)
    inputs, outputs, truth = [], [], []
    for _ in range(round(duration_s * config.daemon.tick_hz)):
        given, made = loop.tick()
        inputs.append(given)
        outputs.append(made)
        truth.append(loop.plant.truth)
    return Recorded(inputs=inputs, outputs=outputs, truth=truth, origin=loop.plant.origin)


def feed(config: Config, kind: str, inputs: Iterable[Inputs]) -> list[Outputs]:
    """The recorded inputs through a fresh backseat with another estimator. Its commands are discarded."""
    estimator = config.estimator.model_copy(update={"kind": kind})
    backseat = build_backseat(config.model_copy(update={"estimator": estimator}), controller=NoController())
    return [backseat.step(one) for one in inputs]


def truth_rows(truth: Sequence[Truth]) -> Array:
    """TRUTH_COLUMNS of each tick."""
    rows = np.empty((len(truth), len(TRUTH_COLUMNS)))
    for row, t in zip(rows, truth, strict=True):
        row[:4] = t.n_m, t.e_m, *body_to_ned(t.psi_rad, t.u_mps, t.v_mps)
        row[4:] = t.psi_rad, t.r_radps, t.wind_n_mps, t.wind_e_mps, t.u_mps, t.v_mps
    return rows


def estimate_rows(outputs: Sequence[Outputs], origin: LocalFrame) -> Array:
    """The same of the estimates of a backseat, relative to the plant's origin; NaN before the first one."""
    rows = np.full((len(outputs), len(TRUTH_COLUMNS)), math.nan)
    for row, made in zip(rows, outputs, strict=True):
        estimate, wind = made.estimate, made.wind
        if estimate is None or made.origin_deg is None:
            continue
        n_m, e_m = origin.to_ned(*made.origin_deg)
        velocity = body_to_ned(estimate.psi_rad, estimate.u_mps, estimate.v_mps)
        row[:6] = (n_m + estimate.n_m, e_m + estimate.e_m, *velocity, estimate.psi_rad, estimate.r_radps)
        row[6:8] = (wind.vn_mps, wind.ve_mps) if wind is not None else (math.nan, math.nan)
        row[8:] = estimate.u_mps, estimate.v_mps
    return rows


def errors(rows: Array, truth: Array) -> dict[str, Any]:
    """Root mean squares over all rows; None where an estimate is missing in any of them.

    Of position and velocity the length of the error vector. `position_spread_m` and `heading_spread_deg` are about the
    mean error of the run: the part that is not a constant offset.
    """
    if not np.isfinite(rows).all():
        return dict.fromkeys(METRICS)
    e = rows - truth
    psi_deg = np.degrees((e[:, 4] + math.pi) % math.tau - math.pi)
    speed = np.hypot(rows[:, 6], rows[:, 7]) - np.hypot(truth[:, 6], truth[:, 7])
    toward = np.arctan2(rows[:, 7], rows[:, 6]) - np.arctan2(truth[:, 7], truth[:, 6])
    toward_deg = np.degrees((toward + math.pi) % math.tau - math.pi)
    about_mean = e[:, :2] - e[:, :2].mean(axis=0)
    return {
        "position_m": rms(np.hypot(e[:, 0], e[:, 1])),
        "position_spread_m": rms(np.hypot(*about_mean.T)),
        "velocity_mps": rms(np.hypot(e[:, 2], e[:, 3])),
        "u_mps": rms(e[:, 8]),
        "v_mps": rms(e[:, 9]),
        "heading_deg": rms(psi_deg),
        "heading_spread_deg": float(psi_deg.std()),
        "yaw_rate_radps": rms(e[:, 5]),
        "wind_vector_mps": rms(np.hypot(e[:, 6], e[:, 7])),
        "wind_speed_mps": rms(speed),
        "wind_direction_deg": rms(toward_deg),
    }


METRICS = (
    *("position_m", "position_spread_m", "velocity_mps", "u_mps", "v_mps", "heading_deg", "heading_spread_deg"),
    *("yaw_rate_radps", "wind_vector_mps", "wind_speed_mps", "wind_direction_deg"),
)


def run_estimation(
    base: str, overrides: tuple[str, ...], activity: str, window_s: tuple[float, float], traces: bool
) -> dict[str, Any]:
    """Errors of each kind over a window of one run, and, where asked for, points of the curves for a picture."""
    config = load_config(base, overrides)
    run = record_run(config, activity, window_s[1])
    first = round(window_s[0] * config.daemon.tick_hz)
    truth = truth_rows(run.truth)
    made = {kind: run.outputs if kind == config.estimator.kind else feed(config, kind, run.inputs) for kind in KINDS}
    rows = {kind: estimate_rows(outputs, run.origin) for kind, outputs in made.items()}
    result: dict[str, Any] = {
        "errors": {kind: errors(rows[kind][first:], truth[first:]) for kind in KINDS},
        "invalid": {kind: share_invalid(outputs[first:]) for kind, outputs in made.items()},
    }
    if traces:
        every = max(1, round(TRACE_S * config.daemon.tick_hz))
        points = slice(first, None, every)
        result["traces"] = {
            "t_s": [round(k / config.daemon.tick_hz, 3) for k in range(len(truth))[points]],
            "truth": _rounded(truth[points]),
            **{kind: _rounded(rows[kind][points]) for kind in KINDS},
        }
    return result


def share_invalid(outputs: Sequence[Outputs]) -> float:
    """The share of ticks without a valid estimate."""
    return sum(made.estimate is None or not made.estimate.valid for made in outputs) / len(outputs)


def _rounded(rows: Array) -> list[list[float | None]]:
    return [[round(x, 4) if math.isfinite(x) else None for x in row] for row in rows.tolist()]


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
