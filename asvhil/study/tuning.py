"""Tunes a controller in lockstep: a seeded search with the same budget for each, on winds that are not in the tests."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config, load_config
from asvhil.config.registry import CONTROLLERS
from asvhil.errors import AsvhilError, ConfigError
from asvhil.machine_code.compiler import use_compiler
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_trial
from asvhil.types import record

WINDS = ((4.0, 10.0), (5.0, 170.0), (4.0, 30.0), (5.0, 60.0), (4.0, 105.0))  # m/s, blowing toward degrees
PLANT_SEED = 101
FROM_S, TO_S = 60.0, 180.0
BATCH = 4  # candidates drawn from the same best: constant, so that the result does not depend on the workers
WIDE_SHARE = 0.25  # of the budget: draws all over the ranges; the rest steps off the best so far
FIRST_STEP, LAST_STEP = 0.25, 0.08  # standard deviation of such a step, in shares of the range
MOVE_SHARE = 0.4  # of the coordinates, in one step


@record
class Parameter:
    """One number to tune: its place (a config key, with `[i]` or `[i,j]` for parts of a tuple), start, and range.

    It is searched on a logarithmic scale between start / factor and start * factor.
    """

    key: str
    start: float
    factor: float = 4.0

    def value(self, share: float) -> float:
        """The value at a share of the range in [0, 1], to 4 digits; the start is at a half."""
        return float(f"{self.start * self.factor ** (2.0 * share - 1.0):.4g}")

    def share(self, value: float) -> float:
        return 0.5 + 0.5 * math.log(value / self.start) / math.log(self.factor)


def spaces() -> dict[str, tuple[Parameter, ...]]:
    """The search space of each controller that has one, by `controller.name`."""
    return {
        kind.name: tuple(
            Parameter(key=f"controller.{kind.settings_key}.{part.key}", start=part.start, factor=part.factor)
            for part in kind.search
        )
        for kind in CONTROLLERS
        if kind.search
    }


def overrides_of(name: str, values: Mapping[str, float]) -> tuple[str, ...]:
    """The `KEY=VALUE` overrides of a config that set a controller and its tuned values."""
    plain: dict[str, Any] = {}
    for key, value in values.items():
        base, bracket, index = key.partition("[")
        if bracket:
            for part in index.rstrip("]").split(","):
                plain.setdefault(base, {})[int(part)] = value
        else:
            plain[key] = value
    return (
        f"controller.name={name}",
        *(
            f"{key}={[value[i] for i in sorted(value)] if isinstance(value, dict) else value}"
            for key, value in plain.items()
        ),
    )


def settled_score(config: Config, from_s: float = FROM_S, to_s: float = TO_S) -> dict[str, Any]:
    """`metrics.score` of the truth in one lockstep run, over [from_s, to_s] since its first tick."""
    truth: dict[str, Any] = run_trial(config, from_s, to_s)["truth"]
    return truth


TuningRun = tuple[str, tuple[str, ...], tuple[float, float], tuple[float, float]]


def evaluate(run: TuningRun) -> float:
    """ps of one run: (config, overrides, wind as m/s and degrees toward, scoring window)."""
    base, overrides, (speed_mps, toward_deg), window = run
    wind = (f"plant.weather.wind.speed_mps={speed_mps}", f"plant.weather.wind.toward_deg={toward_deg}")
    return float(settled_score(load_config(base, (*overrides, *wind)), *window)["penalty_score"])


def typical(scores: Sequence[float]) -> float:
    """The geometric mean of 1 + ps, less 1: so that a wind that is hard for every controller does not dominate."""
    return math.expm1(float(np.mean(np.log1p(scores))))


def tune(
    name: str,
    budget: int,
    seed: int,
    progress: Callable[[int, float], None] | None = None,
    *,
    path: Path | None = None,
    workers: int = 2,
    winds: tuple[tuple[float, float], ...] = WINDS,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    score: Callable[[TuningRun], float] = evaluate,
) -> dict[str, Any]:
    """Search the values of `spaces()[name]` with the lowest typical ps over the winds; `budget` counts candidates.

    With a path every batch is saved there, and a search there with the same settings is resumed.
    `progress` is called after each batch with the candidates that are done and the lowest typical ps so far. `score`
    gives the ps of one run, in any process.
    The result depends on neither workers (0: none but this process) nor interruptions. KeyError where the controller
    has no space, ConfigError for a wrong budget, seed or number of workers, AsvhilError where the file at the path is
    of another search: it is not changed.
    """
    space = spaces()[name]
    for option, value, least in (("--budget", budget, 1), ("--seed", seed, 0), ("--workers", workers, 0)):
        if value < least:
            raise ConfigError(f"{option} {value}: at least {least} is expected")
    result: dict[str, Any] = {
        "controller": name,
        "command": f"asvhil study tune {name} --budget {budget} --seed {seed}",
        "settings": {
            "budget": budget,
            "seed": seed,
            "plant_seed": PLANT_SEED,
            "winds_mps_toward_deg": [list(wind) for wind in winds],
            "window_s": list(window_s),
            "base": base,
            "fixed": list(NO_SLOW_ERROR),
            "ranges": {p.key: [p.value(0.0), p.value(1.0)] for p in space},
        },
        "evaluations": [],
        "best": None,
    }
    done: list[dict[str, Any]] = result["evaluations"]
    if path is not None and path.exists():
        done += _stored(path, result)
    with _mapper(workers) as map_:
        while len(done) < budget:
            batch = candidates(space, budget, seed, done)
            runs = [
                (base, (*NO_SLOW_ERROR, f"plant.seed={PLANT_SEED}", *overrides_of(name, values)), wind, window_s)
                for values in batch
                for wind in winds
            ]
            scores = [round(ps, 4) for ps in map_(score, runs)]
            for i, values in enumerate(batch):
                own = scores[i * len(winds) : (i + 1) * len(winds)]
                done.append({"values": values, "ps": own, "typical_ps": round(typical(own), 4)})
            result["best"] = min(done, key=_typical_ps)
            if path is not None:
                _save(path, result)
            if progress is not None:
                progress(len(done), _typical_ps(result["best"]))
    result["best"] = min(done, key=_typical_ps)
    return result


def candidates(
    space: tuple[Parameter, ...], budget: int, seed: int, done: list[dict[str, Any]]
) -> list[dict[str, float]]:
    """The next batch, from the seed and what has been evaluated: the start, random draws, then steps from the best."""
    rng = np.random.default_rng((seed, len(done)))
    batch = []
    for index in range(len(done), min(len(done) + BATCH, budget)):
        if index == 0:
            shares = np.full(len(space), 0.5)
        elif index < WIDE_SHARE * budget:
            shares = rng.uniform(0.0, 1.0, len(space))
        else:
            best = min(done, key=_typical_ps)["values"] if done else {}
            shares = np.array([p.share(best.get(p.key, p.start)) for p in space])
            moved = rng.random(len(space)) < MOVE_SHARE
            moved[rng.integers(len(space))] = True
            step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (index / budget)
            shares = np.clip(shares + moved * rng.normal(0.0, step, len(space)), 0.0, 1.0)
        batch.append({p.key: p.value(float(share)) for p, share in zip(space, shares, strict=True)})
    return batch


def _stored(path: Path, result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The stored evaluations of a search. AsvhilError where the file is damaged or of other settings."""
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        had = {"controller": stored["controller"], **stored["settings"]}
        done = [
            {"values": dict(row["values"]), "ps": list(row["ps"]), "typical_ps": float(row["typical_ps"])}
            for row in stored["evaluations"]
        ]
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError):
        raise AsvhilError(f"{path}: not a whole record of a search; move it away to begin anew") from None
    asked = {"controller": result["controller"], **result["settings"]}
    for key in [*asked, *had]:
        if had.get(key) != asked.get(key):
            words = f"its search had {key} {json.dumps(had.get(key))}, and this one has {json.dumps(asked.get(key))}"
            raise AsvhilError(f"{path}: {words}; move it away to begin anew")
    return done


def _typical_ps(evaluation: dict[str, Any]) -> float:
    return float(evaluation["typical_ps"])


@contextmanager
def _mapper(workers: int) -> Iterator[Callable[[Callable[[TuningRun], float], Sequence[TuningRun]], Iterable[float]]]:
    """`map` over processes, in the order of the runs; in this process where there are no workers."""
    if workers == 0:
        yield map
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), use_compiler) as pool:
        yield pool.map


def _save(path: Path, result: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".part")
    beside.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    os.replace(beside, path)
