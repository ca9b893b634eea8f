"""Tunes a controller in lockstep: CMA-ES over its gains or weights, judged on winds and seeds that it did not see."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import is_there
from asvhil.study.rows import trial_job
from asvhil.study.runner import Job, Run
from asvhil.study.search_spaces import Parameter, overrides_of, spaces
from asvhil.study.statistics import mean_ci95
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_named_trial
from asvhil.study.tuning_record import save, stored
from asvhil.types import record

FROM_S, TO_S = 50.0, 130.0
FIRST_STEP = 0.2  # standard deviation of the first generation, in shares of the range
NEVER = math.inf  # the score of a candidate with a run that failed
# What a window without the motors adds to ps: as much as pointing the wrong way. The boat that lets go stops turning,
# and would look better than the one that fights on.
RELEASED_DEG = 180.0


@record
class WindSet:
    """Winds (m/s, blowing toward degrees from north) and seeds of the simulated boat; each wind with each seed."""

    winds: tuple[tuple[float, float], ...]
    seeds: tuple[int, ...]

    @property
    def cases(self) -> list[tuple[tuple[float, float], int]]:
        return [(wind, seed) for wind in self.winds for seed in self.seeds]


# As the six tests with their mirrors and diagonals mix them, and none of their winds: two of five along the station's
# heading, two across it, one between. The strongest of each are stronger than theirs: gains that hold just as far as
# the winds of their search let go in a little more.
WINDS = ((4.0, 10.0), (6.5, 170.0), (3.5, -80.0), (6.3, 100.0), (6.5, -50.0))
PLANT_SEED = 101
TRAINING = WindSet(winds=WINDS, seeds=(PLANT_SEED,))
# The same mix of neither winds of the search nor of the six tests.
HELD_OUT = WindSet(winds=((3.5, -12.0), (6.3, 166.0), (4.5, 82.0), (6.2, -100.0), (6.4, 52.0)), seeds=(201, 202))


def typical(scores: Sequence[float]) -> float:
    """The geometric mean of 1 + ps, less 1: so that a wind that is hard for every controller does not dominate."""
    return math.expm1(float(np.mean(np.log1p(scores))))


def tune(
    name: str,
    budget: int,
    seed: int,
    run: Run,
    path: Path,
    progress: Callable[[int, float], None] = lambda done, best: None,
    *,
    training: WindSet = TRAINING,
    held_out: WindSet = HELD_OUT,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    command: str = "",
) -> dict[str, Any]:
    """Search the values of `spaces(config)[name]` with the lowest typical ps over the training winds.

    `budget` counts candidates: the start, then generations of CMA-ES (Hansen 2016) on the logarithmic scale of the
    ranges, which it may leave: nothing can lie at a bound. A candidate that the config refuses has failed. `run` runs
    the jobs, isolated (`run_into(..., isolate=True)`). Each generation is written to `path`; a search there with the
    same settings is continued, to the same bits on the same machine, and beyond its own budget where this one is
    larger. The best and the controller as the config has it are then run on both sets of winds (`tuned`, `config`).
    `progress` is called after each generation, stored ones too, with the candidates that are done and the lowest
    typical ps.

    `command` is kept in the record: what was typed for it. KeyError where the controller has no space, ConfigError for
    a wrong budget or seed or a config without a station, AsvhilError where the file at the path is of another search,
    which is not changed, where every run fails, or where the package cmaes is not installed.
    """
    config = load_config(base)
    if config.supervisor.station is None:
        raise ConfigError(f"--config {base}: key supervisor.station: a search needs a station to keep")
    space = spaces(config)[name]
    for option, value, least in (("--budget", budget, 1), ("--seed", seed, 0)):
        if value < least:
            raise ConfigError(f"{option} {value}: at least {least} is expected")
    found: dict[str, Any] = {
        "controller": name,
        "command": command or f"asvhil tune {name} --budget {budget} --seed {seed}",
        "settings": {
            "search": "cma-es, unbounded",
            "seed": seed,
            "training": _as_json(training),
            "held_out": _as_json(held_out),
            "window_s": list(window_s),
            "released_deg": RELEASED_DEG,
            "base": base,
            "config": config.content_hash(),
            "fixed": list(NO_SLOW_ERROR),
            "first_ranges": {p.key: [p.value(0.0), p.value(1.0)] for p in space},
        },
        "generations": [],
        "best": None,
    }
    search = _Search(space, seed)
    if is_there(path):
        found["generations"] = stored(path, found, space, search.population)
    errors: list[str] = []

    def scored(candidates: Sequence[Mapping[str, float]], cases: WindSet) -> list[list[float | None]]:
        jobs: list[Job] = []
        refused: list[bool] = []
        for values in candidates:
            own = overrides_of(name, values)
            try:
                jobs += [trial_job(name, base, (*_case_overrides(*case), *own), window_s) for case in cases.cases]
                refused.append(False)
            except ConfigError:
                refused.append(True)
        finished = run(run_named_trial, jobs)
        errors.extend(finished.errors.values())
        results = iter(finished.results)
        return [[None if no else _score(next(results)) for _ in cases.cases] for no in refused]

    generations: list[list[dict[str, Any]]] = found["generations"]
    for number in range(max(len(generations), _generations(budget, search.population))):
        shares = search.ask(number)
        if number == len(generations):
            values = [{p.key: p.value(share) for p, share in zip(space, row, strict=True)} for row in shares]
            generations.append(
                [
                    {"shares": row, "values": one, "ps": ps, "typical_ps": _typical(ps)}
                    for row, one, ps in zip(shares, values, scored(values, training), strict=True)
                ]
            )
            found["best"] = _best(generations)
            save(path, found)
            if number and errors and found["best"]["typical_ps"] is None:
                raise AsvhilError(f"{path}: every run of its first candidates failed: {errors[0]}")
        progress(sum(map(len, generations[: number + 1])), _typical_ps(_best(generations[: number + 1])))
        search.tell(number, generations[number])
    best = found["best"] = _best(generations)
    both = [{}, best["values"]]  # the config as it is, and tuned
    for which, own, others in zip(("config", "tuned"), scored(both, training), scored(both, held_out), strict=True):
        found[which] = _figures(own, others)
    save(path, found)
    return found


class _Search:
    """CMA-ES by asking and telling: its state follows from the seed and from what it was told."""

    def __init__(self, space: Sequence[Parameter], seed: int) -> None:
        try:
            from cmaes import CMA
        except ImportError:
            raise AsvhilError("tuning needs cmaes: install asvhil[campaign]") from None
        self._d = len(space)
        self._cma = CMA(mean=np.full(self._d, 0.5), sigma=FIRST_STEP, seed=seed)
        self.population: int = self._cma.population_size

    def ask(self, number: int) -> list[list[float]]:
        """The candidates of a generation, each as shares of the ranges: of the first one the start, alone."""
        if number == 0:
            return [[0.5] * self._d]
        return [self._cma.ask().tolist() for _ in range(self.population)]

    def tell(self, number: int, generation: Sequence[Mapping[str, Any]]) -> None:
        if number:
            self._cma.tell([(np.array(one["shares"]), _typical_ps(one)) for one in generation])


def _generations(budget: int, population: int) -> int:
    """The start, and so many whole generations that the budget is used up."""
    return 1 + math.ceil((budget - 1) / population)


def candidates_of(budget: int, d: int) -> int:
    """The candidates that a search over d numbers has with a budget: CMA-ES has whole generations only."""
    population = 4 + math.floor(3.0 * math.log(d))
    return 1 + (_generations(budget, population) - 1) * population


def _case_overrides(wind: tuple[float, float], seed: int) -> tuple[str, ...]:
    return (
        *NO_SLOW_ERROR,
        f"plant.seed={seed}",
        f"plant.weather.wind.speed_mps={wind[0]}",
        f"plant.weather.wind.toward_deg={wind[1]}",
    )


def _score(result: Mapping[str, Any]) -> float | None:
    """ps of a run, and what it adds to have let go, to 4 digits after the point; None of one that failed."""
    ps = result["truth"]["penalty_score"] if result else None
    return None if ps is None else round(ps + RELEASED_DEG * (1.0 - result["held"]), 4)


def _typical(scores: Sequence[float | None]) -> float | None:
    known = [score for score in scores if score is not None]
    return round(typical(known), 4) if len(known) == len(scores) else None


def _typical_ps(candidate: Mapping[str, Any]) -> float:
    value = candidate["typical_ps"]
    return NEVER if value is None else float(value)


def _best(generations: Sequence[Sequence[dict[str, Any]]]) -> dict[str, Any]:
    return min((one for generation in generations for one in generation), key=_typical_ps)


def _figures(training: Sequence[float | None], held_out: Sequence[float | None]) -> dict[str, Any]:
    """Typical ps and the mean with its interval on both sets."""
    found = {}
    for name, scores in (("training", training), ("held_out", held_out)):
        known = [score for score in scores if score is not None]
        mean = mean_ci95(known) if known and len(known) == len(scores) else {"mean": None, "ci95": None}
        found[name] = {"typical_ps": _typical(scores), "ps": list(scores), **mean}
    return found


def _as_json(cases: WindSet) -> dict[str, Any]:
    return {"winds_mps_toward_deg": [list(wind) for wind in cases.winds], "seeds": list(cases.seeds)}
