"""The physical bound: how well any controller could keep a station in a steady wind, by periodic optimal control.

Across the wind no boat with two fixed motors can stand still; the optimum is a limit cycle. The bound is the
least penalty score ps = e_d + s_d + |e_h| + s_h (m, degrees) over all periodic motions of the model, without noise.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from asvhil.config import Config, load_config
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.blendermann import Blendermann
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.errors import AsvhilError
from asvhil.types import record

INTERVALS = 60
SUBSTEPS = 2  # of an interval: the motor lag must not gain by the error of the integrator
PERIODS_S = (4.0, 32.0)  # of the free period: a boat with weak motors is best at 20 s in a strong wind
STARTS_S = (5.5, 8.0, 11.5, 15.0)
SWINGS_RAD = (0.06, 0.18)
THRUST = 0.3  # of the first guesses, of full thrust ahead
STARTS = 40  # guesses: the eight of the lists above, the rest drawn
SEED = 1
ALIKE = 1e-3  # of the best score: orbits that near are counted as the same
INTERRUPTED = "NonIpopt_Exception_Thrown"  # of the solver, by Ctrl-C, which CasADi keeps to itself
SMOOTH = 1e-6  # under the roots: the score has corners at zero


@record
class Orbit:
    """A periodic motion about the station: its score, its period, and rows of (x, y, psi, u, v, r, motors ...).

    `starts`, `converged` and `alike` count the searches, those that converged, and those with the same score.
    """

    penalty_score: float
    period_s: float
    distance_m: tuple[float, float]  # mean, standard deviation
    heading_deg: tuple[float, float]
    states: Array
    inputs: Array
    starts: int = 1
    converged: int = 1
    alike: int = 1


@record
class Guess:
    """Start of a search: an oscillating heading, and thrust of the same period, `skew_rad` later."""

    period_s: float
    swing_rad: float
    thrust: float = THRUST
    skew_rad: float = 0.0


def bound(
    model: Dynamics,
    wind_mps: float,
    toward_rad: float,
    starts: int = STARTS,
    on_start: Callable[[int, int], None] = lambda done, of: None,
) -> Orbit:
    """The best orbit found from several starts. `toward_rad` is from the station's heading. RuntimeError if none.

    `on_start(done, of)` is called before each of them.
    """
    solver, lower, upper, size = _problem(model, wind_mps, toward_rad)
    orbits: list[Orbit] = []
    for number, guess in enumerate(guesses(starts)):
        on_start(number, starts)
        first = _first(model, size, wind_mps, toward_rad, guess)
        found = solver(x0=first, lbx=lower, ubx=upper, lbg=0.0, ubg=0.0)
        stats = solver.stats()
        if stats["return_status"] == INTERRUPTED:
            raise KeyboardInterrupt
        if stats["success"]:
            orbits.append(_orbit(np.array(found["x"]).ravel(), size))
    if not orbits:
        raise RuntimeError(f"no periodic motion was found in a wind of {wind_mps:g} m/s")
    best = min(orbits, key=lambda orbit: orbit.penalty_score)
    alike = sum(orbit.penalty_score <= best.penalty_score * (1.0 + ALIKE) for orbit in orbits)
    return dataclasses.replace(best, starts=starts, converged=len(orbits), alike=alike)


def guesses(count: int) -> list[Guess]:
    """The first `count` starts: a grid of periods and swings, then seeded draws of all four numbers."""
    grid = [Guess(period_s=period_s, swing_rad=swing) for period_s in STARTS_S for swing in SWINGS_RAD]
    rng = np.random.default_rng(SEED)
    drawn = [
        Guess(
            period_s=math.exp(rng.uniform(math.log(PERIODS_S[0]), math.log(PERIODS_S[1]))),
            swing_rad=math.exp(rng.uniform(math.log(0.02), math.log(0.5))),
            thrust=rng.uniform(0.1, 0.9),
            skew_rad=rng.uniform(-0.5, 0.5),
        )
        for _ in range(count - len(grid))
    ]
    return (grid + drawn)[:count]


def plant_dynamics(config: Config) -> SimplifiedDynamics:
    """The true physics of the simulated boat, but for what its motors lose for a while (dead time, sagging battery)."""
    load, motors = config.plant.wind_load, config.plant.motors
    shares = (1.0, 1.0) if motors is None else (motors.port_thrust, motors.starboard_thrust)
    return SimplifiedDynamics(config.plant_vessel, None if load is None else Blendermann(load), shares)


def boat_hash(config: Config) -> str:
    """A name for all that decides the bounds of a config's simulated boat."""
    parts = [config.plant_vessel, config.plant.wind_load, config.plant.motors]
    return " ".join(part.content_hash() for part in parts if part is not None)


def run_named_bound(
    base: str, overrides: tuple[str, ...], wind_mps: float, toward_rad: float, starts: int
) -> dict[str, Any]:
    """`figures` of the bound of a config's simulated boat, for other processes."""
    return figures(bound(plant_dynamics(load_config(base, overrides)), wind_mps, toward_rad, starts))


def bounds_tree(config: Config, winds: Mapping[str, Any]) -> dict[str, Any]:
    """The content of bound.json: the boat, and `figures` by wind as SPEED@DEG."""
    return {"vehicle": config.vehicle.name, "vessel_hash": boat_hash(config), "winds": dict(winds)}


def figures(orbit: Orbit) -> dict[str, Any]:
    """A bound as a JSON-ready tree."""
    (e_d, s_d), (e_h, s_h) = orbit.distance_m, orbit.heading_deg
    return {
        "penalty_score": orbit.penalty_score,
        "period_s": orbit.period_s,
        "distance_m": {"mean": e_d, "std": s_d},
        "heading_deg": {"mean": e_h, "std": s_h},
        "starts": orbit.starts,
        "converged": orbit.converged,
        "alike": orbit.alike,
    }


def markdown(study: Mapping[str, Any]) -> str:
    """The bounds of `study bound` as a table, with an explanation."""
    lines = [
        f"The least penalty score ps (m, degrees) that any controller could reach with the {study['vehicle']} in a "
        "steady wind, without noise: the best periodic motion of the true model with its motor lag and thrust limits, "
        "free in its period. `starts` searches began at different motions, `converged` of them ended at a local best, "
        f"and `alike` of these within {100.0 * ALIKE:g} % of the best one. The wind is in m/s, toward degrees from the "
        "station's heading; mirrored winds have the same bound, and along the wind it is zero.",
        "",
        "| wind | ps | period (s) | e_d (m) | s_d (m) | e_h (°) | s_h (°) | starts | converged | alike |",
        "|" + " --- |" * 10,
    ]
    for wind, row in study["winds"].items():
        distance, heading = row["distance_m"], row["heading_deg"]
        cells = (distance["mean"], distance["std"], abs(heading["mean"]), heading["std"])
        counts = f"{row['starts']} | {row['converged']} | {row['alike']}"
        texts = " | ".join(f"{value:.3f}" for value in cells)
        lines.append(f"| {wind} | {row['penalty_score']:.3f} | {row['period_s']:.2f} | {texts} | {counts} |")
    return "\n".join(lines) + "\n"


def read_bounds(path: Path, config: Config) -> dict[str, float]:
    """{wind as SPEED@DEG: ps} of a file of `asvhil study bound`. AsvhilError where it is damaged or of another boat.

    Another boat has another name, or other values of the plant's vessel, wind load or motors.
    """
    vehicle, vessel_hash = config.vehicle.name, boat_hash(config)
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
        bounds = {str(wind): float(row["penalty_score"]) for wind, row in tree["winds"].items()}
        of = str(tree["vehicle"])
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise AsvhilError(f"{path}: not what `asvhil study bound -o` writes") from None
    if of != vehicle:
        raise AsvhilError(f"{path}: holds the bounds of {of}, not of {vehicle}")
    if tree.get("vessel_hash") != vessel_hash:
        held = f"vessel_hash {tree['vessel_hash']}" if "vessel_hash" in tree else "no vessel_hash"
        words = f"{held}, but the plant's vessel has {vessel_hash}; `asvhil study bound -o DIR` finds its bounds"
        raise AsvhilError(f"{path}: {words}")
    return bounds


def _problem(model: Dynamics, wind_mps: float, toward_rad: float) -> tuple[ca.Function, Array, Array, int]:
    """Multiple shooting over one period: (solver, lower and upper bounds of the variables, state size)."""
    size = 6 + model.n_motor
    s, a, period = ca.SX.sym("s", size), ca.SX.sym("a", 2), ca.SX.sym("period")
    wind = ca.DM([wind_mps * math.cos(toward_rad), wind_mps * math.sin(toward_rad)])
    after = advance(model, s, a, ca.SX(wind), ca.SX.zeros(3), period / INTERVALS, SUBSTEPS)
    step = ca.Function("step", [s, a, period], [after])
    states, inputs = ca.SX.sym("states", size, INTERVALS), ca.SX.sym("inputs", 2, INTERVALS)
    closed = ca.horzcat(states[:, 1:], states[:, :1])  # the last interval ends where the first one starts
    gaps = ca.vec(step.map(INTERVALS)(states, inputs, ca.repmat(period, 1, INTERVALS)) - closed)
    distance = ca.sqrt(states[0, :] ** 2 + states[1, :] ** 2 + SMOOTH)
    heading_deg = states[2, :] * (180.0 / math.pi)
    objective = _mean(distance) + _deviation(distance) + ca.sqrt(_mean(heading_deg) ** 2 + SMOOTH)
    objective += _deviation(heading_deg)
    variables = ca.vertcat(ca.vec(states), ca.vec(inputs), period)
    ipopt = {"max_iter": 800, "tol": 1e-6, "print_level": 0, "sb": "yes"}
    options: dict[str, Any] = {"ipopt": ipopt, "print_time": False}
    solver = ca.nlpsol("bound", "ipopt", {"x": variables, "f": objective, "g": gaps}, options)
    lower = np.full(variables.shape[0], -np.inf)
    upper = np.full(variables.shape[0], np.inf)
    first_input = size * INTERVALS
    lower[first_input:-1], upper[first_input:-1] = model.input_lower, model.input_upper
    lower[-1], upper[-1] = PERIODS_S
    return solver, lower, upper, size


def _first(model: Dynamics, size: int, wind_mps: float, toward_rad: float, guess: Guess) -> Array:
    """The variables of a guess: the heading oscillates, and thrust with it, ahead and astern."""
    phase = 2.0 * math.pi * np.arange(INTERVALS) / INTERVALS
    side = -math.copysign(1.0, math.sin(toward_rad))  # the side force wanted is against the wind
    states = np.zeros((INTERVALS, size))
    states[:, 2] = side * guess.swing_rad * np.sin(phase)
    states[:, 5] = side * guess.swing_rad * 2.0 * math.pi / guess.period_s * np.cos(phase)
    thrust = np.clip(guess.thrust * np.sin(phase - guess.skew_rad), model.input_lower, model.input_upper)
    states[:, 0] = -0.05 * wind_mps * np.sin(phase)
    if model.n_motor >= 2:
        states[:, 6] = states[:, 7] = thrust
    return np.concatenate([states.ravel(), np.repeat(thrust, 2), [guess.period_s]])


def _orbit(variables: Array, size: int) -> Orbit:
    states = variables[: size * INTERVALS].reshape(INTERVALS, size)
    distance = np.hypot(states[:, 0], states[:, 1])
    heading_deg = np.degrees(states[:, 2])
    parts = float(distance.mean()), float(distance.std()), float(heading_deg.mean()), float(heading_deg.std())
    return Orbit(
        penalty_score=parts[0] + parts[1] + abs(parts[2]) + parts[3],
        period_s=float(variables[-1]),
        distance_m=parts[:2],
        heading_deg=parts[2:],
        states=states,
        inputs=variables[size * INTERVALS : -1].reshape(INTERVALS, 2),
    )


def _mean(row: Any) -> Any:
    return ca.sum2(row) / INTERVALS


def _deviation(row: Any) -> Any:
    return ca.sqrt(_mean((row - _mean(row)) ** 2) + SMOOTH)
