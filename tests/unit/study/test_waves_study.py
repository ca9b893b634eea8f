"""The study in waves: what it runs, and what it tells of a boat that was let go."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.study import waves
from asvhil.study.runner import Finished, Job, run_into
from asvhil.study.waves import CALM, CHOP, DOUBLE, SEAS, WITH, WITHOUT, markdown, sea_overrides, study_waves

KEYS = ("controller.name=lagnet-mpc",)


def told(scores: dict[str, float], held: dict[str, float] | None = None, rows: tuple[str, ...] = ("3", "5")) -> dict:
    """The study of runs whose score, and share of the window with the motors, is that of their group; seeds 1, 2."""

    def run(function: object, jobs: list[Job]) -> Finished:
        results = [
            {"truth": {"penalty_score": scores[job.group]}, "held": (held or {}).get(job.group, 1.0)} for job in jobs
        ]
        return Finished(results=results, group_s={}, processes=1, outdated=0, errors={})

    return json.loads(json.dumps(study_waves(run, controller=KEYS, rows=rows, seeds=(1, 2))))


def scores_of(value: float, **others: float) -> dict[str, float]:
    return {f"{sea}, {which}": value for sea in SEAS for which in (WITH, WITHOUT)} | others


def test_each_sea_is_what_its_name_says_for_the_plant_and_the_filter_is_off_in_half_of_the_runs() -> None:
    seen: dict[str, set[tuple]] = {}

    def run(function: object, jobs: list[Job]) -> Finished:
        for job in jobs:
            base, overrides, window_s = job.arguments
            config = load_config(base, overrides)
            of = config.plant.weather.waves
            known = (of.orbital_std_mps, of.yaw_std_radps, config.estimator.waves.mode, window_s)
            seen.setdefault(job.group, set()).add(known)
        done = {"truth": {"penalty_score": 1.0}, "held": 1.0}
        return Finished(results=[done] * len(jobs), group_s={}, processes=1, outdated=0, errors={})

    study_waves(run, controller=KEYS, rows=("1", "6"), seeds=(1,))
    assert seen == {
        f"{sea}, {which}": {(*SEAS[sea], mode, (60.0, 360.0))}
        for sea in SEAS
        for which, mode in ((WITH, "auto"), (WITHOUT, "off"))
    }
    assert load_config("sitl", sea_overrides(DOUBLE)).plant.weather.waves.spreading == 1.0


def test_rows_across_the_wind_are_run_in_calm_water_alone() -> None:
    found = told(scores_of(1.0))["seas"]
    assert list(found[CALM]) == ["3", "5"] and list(found[CHOP]) == list(found[DOUBLE]) == ["3"]
    assert "###" in markdown(told(scores_of(1.0), rows=("5",))) and "chop" not in markdown(
        told(scores_of(1.0), rows=("5",))
    )


def test_what_is_asked_and_missed_is_in_bold_and_a_boat_that_was_let_go_has_no_mean() -> None:
    study = told(scores_of(1.0, **{f"{CHOP}, {WITH}": 1.31, f"{DOUBLE}, {WITH}": 2.5}), {f"{DOUBLE}, {WITHOUT}": 0.99})
    assert study["seas"][DOUBLE]["3"][WITHOUT]["ps"] is None and study["seas"][DOUBLE]["3"]["difference"] is None
    text = markdown(study)
    assert "| 3 (3 m/s toward 180°) | **1.31 ± 0.00** | 1.00 ± 0.00 | 0.31 ± 0.00 |" in text
    assert "| 3 (3 m/s toward 180°) | 2.50 ± 0.00 | **let go** | - |" in text
    assert "asked, at most 1.3" in text and "at most 0.05 worse" in text


def test_keys_that_the_study_sets_are_refused() -> None:
    for key in ("plant.weather.waves.peak_hz=0.2", "estimator.waves.mode=on", "plant.seed=3"):
        with pytest.raises(ConfigError, match="is set by the study itself"):
            study_waves(lambda *_: None, controller=(*KEYS, key), rows=("1",), seeds=(1,))


@pytest.mark.thorough
def test_the_study_in_short_is_of_the_plant_with_its_waves(tmp_path: Path) -> None:
    keys = {"controller": KEYS, "rows": ("3",), "seeds": (1,), "window_s": (20.0, 30.0)}
    run = run_into(tmp_path / "trials.jsonl", workers=0)
    found = study_waves(run, **keys)
    scores = [found["seas"][sea]["3"][which]["by_seed"][0] for sea in SEAS for which in (WITH, WITHOUT)]
    assert scores[0] == scores[1] and len(set(scores)) > 3  # in calm water the filter does nothing
    assert study_waves(run, **keys) == found and markdown(found).count("###") == len(waves.SEAS)
