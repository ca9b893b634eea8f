"""Boats that have changed: models trained on each, kept by name, and how the default controller is judged on them."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.dynamics.weights import read_model
from asvhil.errors import ConfigError
from asvhil.study import boat_bounds, boat_model, changed_boats
from asvhil.study.boat_model import BOATS, WINDS, model_of_boat, train_boats
from asvhil.study.changed_boats import OWN, UNCHANGED, markdown, study_changed_boats, worst_regrets
from asvhil.study.circumstances import circumstances
from asvhil.study.rows import ROWS
from asvhil.study.runner import Finished, Job, run_into
from tests.support.paths import ROOT

SHIPPED = ROOT / "config" / "models" / "wamv16-lagnet.npz"
KEYS = ("controller.name=lagnet-mpc",)


def test_the_winds_that_models_are_trained_in_are_in_no_test() -> None:
    assert not {tuple(map(float, wind.split("@"))) for wind in WINDS} & {
        (speed, abs(toward)) for speed, toward in ROWS.values()
    }
    assert "@-90" not in " ".join(WINDS) and "@-45" not in " ".join(WINDS)


def test_a_boat_without_a_model_is_told_with_what_makes_one(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"wamv16-mass-40-lagnet\.npz: no model of this boat; `asvhil study boat-models"
    ):
        model_of_boat(tmp_path, "mass + 40 %")
    names = set()
    for boat in BOATS:
        with pytest.raises(ConfigError) as error:
            model_of_boat(tmp_path, boat)
        names.add(str(error.value))
    assert len(names) == len(BOATS)


@pytest.mark.thorough
def test_a_model_is_trained_on_the_boat_that_it_is_named_by_and_kept(tmp_path: Path) -> None:
    run = run_into(tmp_path / "models.jsonl", workers=0)
    found = train_boats(run, ["motor lag 0.6 s", "second boat"], tmp_path / "models", quick=True)
    with pytest.raises(ConfigError, match="no model of this boat"):
        model_of_boat(tmp_path / "models", "motor lag 0.6 s")  # a quick training is none to judge by
    path = model_of_boat(tmp_path / "models", "motor lag 0.6 s", quick=True)
    model, second = read_model(path), read_model(model_of_boat(tmp_path / "models", "second boat", quick=True))
    assert (model.kind, model.vehicle) == ("lagnet", "wamv16")
    assert model.figures["options"]["mirror"] and not second.figures["options"]["mirror"]
    assert model.data_hash != second.data_hash
    assert f"| motor lag 0.6 s | {path.name} |" in boat_model.markdown(json.loads(json.dumps(found)))
    written = path.read_bytes()
    again = train_boats(
        run_into(tmp_path / "other.jsonl", workers=0), ["motor lag 0.6 s"], tmp_path / "models", quick=True
    )
    assert path.read_bytes() == written and again["boats"]["motor lag 0.6 s"] == found["boats"]["motor lag 0.6 s"]


@pytest.mark.thorough
def test_changed_boats_in_short(tmp_path: Path) -> None:
    run = run_into(tmp_path / "trials.jsonl", workers=0)
    keys = {"rows": ["3", "5"], "seeds": (1,), "starts": 1, "window_s": (3.5, 4.5)}
    found = study_changed_boats(run, unchanged=KEYS, own={"motor lag 0.6 s": SHIPPED}, **keys)
    rows = found["boats"]["motor lag 0.6 s"]
    assert rows["3"]["bound"] is None and rows["3"]["models"][OWN]["regret"] is None
    one = rows["5"]["models"]
    assert one[OWN]["regret"] == one[OWN]["ps"]["mean"] / rows["5"]["bound"]
    assert one[OWN]["by_seed"] == one[UNCHANGED]["by_seed"]  # the same model by either way: the same run
    text = markdown(json.loads(json.dumps(found)))
    assert "### Motor lag 0.6 s" in text and "asked: 1.15" in text and "| 5 (3 m/s toward 90°) |" in text
    assert study_changed_boats(run, unchanged=KEYS, own={"motor lag 0.6 s": SHIPPED}, **keys) == found


def test_the_worst_regret_is_of_the_winds_across_and_of_boats_that_were_held() -> None:
    def cell(bound: float | None, ps: float, held: float = 1.0) -> dict:
        return {
            "bound": bound,
            "models": {name: changed_boats._figures([ps, ps], held, bound) for name in (UNCHANGED, OWN)},
        }

    study = {
        "boats": {
            "a": {"1": cell(None, 90.0), "5": cell(2.0, 2.2), "6": cell(10.0, 14.0)},
            "b": {"5": cell(2.0, 2.0, 0.9)},
        },
        "seeds": [1, 2],
        "window_s": [60, 360],
        "cost": {"runs_of_other_code": 0},
    }
    assert worst_regrets(study, OWN) == {"a": 1.4, "b": None}
    along = {**study, "boats": {"c": {"1": cell(None, 90.0)}}}
    assert "| c | - | - |" in markdown(along), "no row across the wind"
    text = markdown(study)
    assert "| a | **1.40** | **1.40** |" in text and "| b | **let go** | **let go** |" in text
    assert "| 5 (3 m/s toward 90°) | 2.00 | let go | - | let go | - |" in text


def test_mirror_images_have_one_bound_but_on_a_lopsided_boat_and_a_bound_has_code_of_its_own() -> None:
    asked: list[Job] = []

    def counting(function: object, jobs: list[Job]) -> Finished:
        asked.extend(jobs)
        return Finished(results=[{"penalty_score": 1.0}] * len(jobs), group_s={}, processes=1, outdated=0, errors={})

    known = circumstances("sitl")
    found = boat_bounds.bounds_of_boats(counting, [known["mass + 40 %"], known["second boat"]], ROWS, 4)
    assert len({job.key for job in asked}) == 3 + 6 and {job.code for job in asked} == {boat_bounds.bound_version()}
    assert sum(bound is None for bound in found.values()) == 2 * 4
    assert load_config("sitl", known["second boat"]).plant.motors is not None
