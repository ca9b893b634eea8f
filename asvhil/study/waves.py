"""The default controller in waves: calm water, a light chop and twice that, with and without the wave filter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from asvhil.config import load_config
from asvhil.config.mean_wind import station_heading_deg
from asvhil.study.rows import FROM_S, ROWS, TO_S, Keys, along_the_wind, refuse_own, row_overrides, title, trial_job
from asvhil.study.runner import Run
from asvhil.study.six_tests import MAIN, cost_figures
from asvhil.study.statistics import count_of_seeds, in_digits, mean_ci95, other_code, plus_minus
from asvhil.study.trials.trial import NO_SLOW_ERROR, run_named_trial

CALM, CHOP, DOUBLE = "calm", "light chop", "twice the chop"
SEAS = {CALM: (0.0, 0.0), CHOP: (0.07, 0.02), DOUBLE: (0.15, 0.04)}  # m/s along each axis, rad/s in yaw
PEAK_HZ = 0.3
ASKED = {CHOP: 1.3, DOUBLE: 2.5}  # of the mean score in each row
ASKED_WORSE = 0.05  # at most, of the filter in calm water
WITH, WITHOUT = "with the filter", "without it"
FILTER: dict[str, Keys] = {WITH: (), WITHOUT: ("estimator.waves.mode=off",)}


def sea_overrides(sea: str) -> Keys:
    """The config keys of a sea. It is confused: it moves the boat across the wind as much as along it."""
    orbital_mps, yaw_radps = SEAS[sea]
    if not orbital_mps:
        return ()
    keys = {"orbital_std_mps": orbital_mps, "yaw_std_radps": yaw_radps, "peak_hz": PEAK_HZ, "spreading": 1}
    return tuple(f"plant.weather.waves.{key}={value}" for key, value in keys.items())


def study_waves(
    run: Run,
    *,
    controller: Keys,
    rows: Iterable[str],
    seeds: Iterable[int],
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
) -> dict[str, Any]:
    """Scores of a controller, given by its config keys: of all rows in calm water, of those along the wind in waves.

    A score is against the truth, so it has the boat's motion with the waves in it. A row in which the boat was not held
    for the whole window with some seed has no mean. ConfigError where the keys set what the study sets itself.
    """
    rows, seeds = list(rows), list(seeds)
    own = (*row_overrides(next(iter(ROWS)), 1), *sea_overrides(CHOP), *FILTER[WITHOUT])
    refuse_own(controller, (text for text in own if text not in NO_SLOW_ERROR))
    heading_deg = station_heading_deg(load_config(base, controller))
    cases = [
        (sea, row, which, seed)
        for seed in seeds
        for sea in SEAS
        for row in rows
        if sea == CALM or along_the_wind(row)
        for which in FILTER
    ]
    jobs = [
        trial_job(
            f"{sea}, {which}",
            base,
            (*row_overrides(row, seed, heading_deg=heading_deg), *controller, *sea_overrides(sea), *FILTER[which]),
            window_s,
        )
        for sea, row, which, seed in cases
    ]
    finished = run(run_named_trial, jobs)
    seas: dict[str, Any] = {sea: {} for sea in SEAS}
    for (sea, row, which, _), result in zip(cases, finished.results, strict=True):
        held = result["held"] >= 1.0
        scores = seas[sea].setdefault(row, {}).setdefault(which, {"by_seed": []})["by_seed"]
        scores.append(result["truth"]["penalty_score"] if held else None)
    for row_cells in seas.values():
        for cell in row_cells.values():
            for one in cell.values():
                one["ps"] = _mean(one["by_seed"])
            pairs = zip(cell[WITH]["by_seed"], cell[WITHOUT]["by_seed"], strict=True)
            cell["difference"] = _mean([None if None in pair else pair[0] - pair[1] for pair in pairs])
    return {
        "window_s": list(window_s),
        "seeds": seeds,
        "vehicle": load_config(base, controller).vehicle.name,
        "seas": seas,
        "cost": cost_figures(finished),
    }


def _mean(values: Sequence[float | None]) -> dict[str, Any] | None:
    return None if None in values else mean_ci95([value for value in values if value is not None])


def markdown(study: Mapping[str, Any]) -> str:
    """A table for each sea."""
    from_s, to_s = study["window_s"]
    about = (
        f"{MAIN}, {count_of_seeds(study['seeds'])}: mean penalty scores against the truth, waves included, over "
        f"[{from_s:g}, {to_s:g}] s, with half of their 95 % interval; no slow receiver error. Let go: the boat was not "
        "held to the end with some seed; in brackets the scores with the others."
    )
    parts = [about, *other_code(study["cost"]["runs_of_other_code"])]
    for sea, rows in study["seas"].items():
        if not rows:
            continue
        orbital_mps, yaw_radps = SEAS[sea]
        asked = ASKED.get(sea)
        if asked is None:
            head = f"### Calm: asked of the filter, at most {ASKED_WORSE:g} worse"
        else:
            head = f"### {sea.capitalize()}, {orbital_mps:g} m/s and {yaw_radps:g} rad/s: asked, at most {asked:g}"
        heads = ["test", *FILTER, "difference"]
        lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
        for row, cell in rows.items():
            texts = [_score(cell[which], asked if which == WITH else None) for which in FILTER]
            difference = "-" if cell["difference"] is None else plus_minus(cell["difference"])
            lines.append("| " + " | ".join([title(row), *texts, difference]) + " |")
        parts += [head, "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def _score(figures: Mapping[str, Any], asked: float | None) -> str:
    """A mean, in bold where it is more than what is asked."""
    if figures["ps"] is None:
        known = [in_digits(value) for value in figures["by_seed"] if value is not None]
        return "**let go**" + (f" ({', '.join(known)})" if known else "")
    text = plus_minus(figures["ps"])
    return text if asked is None or figures["ps"]["mean"] <= asked else f"**{text}**"
