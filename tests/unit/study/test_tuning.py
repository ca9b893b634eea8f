"""The tuner: its search, its record, and search spaces that fit the config."""

import json
import math
import re
import sys

import pytest

from asvhil.commands.cli import main
from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study import rows, tuning
from asvhil.study.rows import trial_job
from asvhil.study.runner import Finished
from asvhil.study.search_spaces import Parameter, overrides_of, spaces
from asvhil.study.trials.trial import NO_SLOW_ERROR
from asvhil.study.tuning import WindSet, candidates_of, tune, typical
from asvhil.study.tuning_report import markdown
from tests.support.paths import ROOT

SPACES = spaces(load_config("sitl"))
RESULTS = ROOT / "docs" / "results" / "tuning"
BASELINES = ("backstepping", "sliding-mode", "loiter")


@pytest.mark.parametrize("name", sorted(SPACES))
def test_every_key_of_a_space_reaches_the_config(name):
    for share in (0.4, 0.6):
        values = {parameter.key: parameter.value(share) for parameter in SPACES[name]}
        config = load_config("sitl", overrides_of(name, values))
        assert config.controller.name == name
        for key, value in values.items():
            node = config
            for part in key.partition("[")[0].split("."):
                node = getattr(node, part)
            if "[" in key:
                assert {node[int(i)] for i in key.partition("[")[2].rstrip("]").split(",")} == {value}
            else:
                assert node == value


def stored(name: str) -> list[dict]:
    """All candidates on record."""
    search = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    assert search["settings"]["base"] == "sitl" and search["settings"]["fixed"] == list(NO_SLOW_ERROR)
    return [one for generation in search["generations"] for one in generation]


def test_the_shipped_gains_are_the_best_on_record():
    for name in BASELINES:
        best = min(stored(name), key=lambda one: one["typical_ps"] or math.inf)
        shipped = load_config("sitl", (f"controller.name={name}",))
        assert load_config("sitl", overrides_of(name, best["values"])) == shipped


def test_every_baseline_had_a_budget_of_three_hundred_candidates_and_whole_generations():
    first = {"backstepping": "backstepping-to-5.5-mps", "sliding-mode": "sliding-mode", "loiter": "loiter"}
    for name, record in first.items():
        assert len(stored(record)) == candidates_of(300, len(SPACES[name])) >= 300


@pytest.mark.parametrize(
    ("name", "first", "then"),
    [
        ("backstepping", "backstepping-to-5.5-mps", "backstepping"),
        ("sliding-mode", "sliding-mode", "sliding-mode-to-6.5-mps"),
    ],
)
def test_a_search_in_stronger_winds_began_with_the_best_of_the_first(name, first, then):
    best = min(stored(first), key=lambda one: one["typical_ps"] or math.inf)
    assert stored(then)[0]["values"] == best["values"]
    assert len(stored(then)) == candidates_of(120, len(SPACES[name]))


def test_winds_of_the_search_and_held_out_mix_as_the_six_tests_do():
    def mix(winds) -> list[float]:
        kinds = [0, 0, 0]  # along, between, across
        for _, toward_deg in winds:
            off_deg = abs(math.degrees(math.asin(math.sin(math.radians(toward_deg)))))
            kinds[0 if off_deg < 22.5 else 1 if off_deg < 67.5 else 2] += 1
        return [count / len(winds) for count in kinds]

    assert mix(rows.ROWS.values()) == mix(tuning.TRAINING.winds) == mix(tuning.HELD_OUT.winds) == [0.4, 0.2, 0.4]
    assert not set(tuning.TRAINING.winds) & set(rows.ROWS.values())


def test_winds_of_the_search_are_stronger_than_those_that_its_gains_are_judged_in():
    def strongest(winds) -> list[float]:
        found = [0.0, 0.0]  # along, and all others
        for speed_mps, toward_deg in winds:
            along = abs(math.sin(math.radians(toward_deg))) < math.sin(math.radians(22.5))
            found[not along] = max(found[not along], speed_mps)
        return found

    judged = strongest([*rows.ROWS.values(), *tuning.HELD_OUT.winds])
    assert all(trained > most for trained, most in zip(strongest(tuning.TRAINING.winds), judged, strict=True))


def test_held_out_winds_are_neither_those_of_the_search_nor_of_the_six_tests():
    held_out = set(tuning.HELD_OUT.winds)
    assert not held_out & {*tuning.TRAINING.winds, *rows.ROWS.values()}
    assert not set(tuning.HELD_OUT.seeds) & set(tuning.TRAINING.seeds)


def test_the_weights_of_an_mpc_are_searched_about_those_of_the_config():
    space = spaces(load_config("sitl", ("controller.mpc.near.heading=77",)))["nnsem-mpc"]
    starts = {parameter.key: parameter.start for parameter in space}
    assert starts["controller.mpc.near.heading"] == 77.0 and "controller.mpc.near.velocity" not in starts
    assert {key.split(".")[2] for key in starts} == {"near", "along", "last_step_s", "unmodelled_lag_s"}
    assert all(start > 0.0 for start in starts.values())
    assert {key.split(".")[2] for key in (p.key for p in SPACES["lagnet-mpc"])} == {
        *("near", "along", "last_step_s", "thrust_slew")
    }


def test_values_span_the_range_on_a_logarithmic_scale():
    parameter = Parameter(key="x", start=2.0, factor=4.0)
    assert [parameter.value(share) for share in (0.0, 0.25, 0.5, 1.0)] == [0.5, 1.0, 2.0, 8.0]
    assert parameter.share(1.0) == pytest.approx(0.25)


def test_one_bad_wind_does_not_outvote_the_others():
    assert typical([3.0, 3.0]) == pytest.approx(3.0)
    assert typical([1.0, 1.0, 1.0, 99.0]) < typical([2.5, 2.5, 2.5, 50.0])


TRAINING = WindSet(winds=((4.0, 30.0),), seeds=(1,))
HELD_OUT = WindSet(winds=((3.0, 20.0),), seeds=(2, 3))
SETS = {"training": TRAINING, "held_out": HELD_OUT, "window_s": (1.0, 2.0)}


class Bowl:
    """A run of jobs that scores by how far the gains are from a goal, and counts the jobs."""

    def __init__(self, goal: float = 1.5, fail: str = "", let_go: float = 0.0) -> None:
        self.jobs = 0
        self._goal, self._fail, self._let_go = goal, fail, let_go

    def __call__(self, function, jobs) -> Finished:
        self.jobs += len(jobs)
        return Finished(results=[self._result(job) for job in jobs], group_s={}, processes=1, outdated=0, errors={})

    def _result(self, job) -> dict:
        loiter = load_config(*job.arguments[:2]).controller.loiter
        if self._fail and loiter.radius_m < 1.0:
            return {}
        off = (loiter.radius_m - self._goal) ** 2 + (loiter.rate_p_s - self._goal) ** 2
        held = 1.0 - self._let_go * (loiter.radius_m > self._goal)
        return {"truth": {"penalty_score": 1.0 + off}, "held": held}


def test_the_search_finds_a_minimum_and_is_judged_on_both_sets(tmp_path):
    bowl, said = Bowl(), []
    found = tune("loiter", 61, 1, bowl, tmp_path / "loiter.json", lambda done, best: said.append((done, best)), **SETS)
    assert found["generations"][0][0]["values"] == {p.key: p.start for p in SPACES["loiter"]}
    assert [len(generation) for generation in found["generations"]] == [1] + [10] * 6
    assert [done for done, _ in said] == [1, *range(11, 62, 10)] and said[-1][0] == candidates_of(61, 9)
    assert [best for _, best in said] == sorted((best for _, best in said), reverse=True)
    start = found["generations"][0][0]["typical_ps"]
    assert found["best"]["typical_ps"] - 1.0 < 0.2 * (start - 1.0)
    assert len(found["tuned"]["training"]["ps"]) == 1 and len(found["tuned"]["held_out"]["ps"]) == 2
    shipped = load_config("sitl").controller.loiter
    assert found["config"]["held_out"]["mean"] == pytest.approx(
        1.0 + (shipped.radius_m - 1.5) ** 2 + (shipped.rate_p_s - 1.5) ** 2, abs=1e-3
    )
    assert bowl.jobs == 61 + 2 + 4
    assert json.loads((tmp_path / "loiter.json").read_text()) == found


def test_a_minimum_outside_of_the_first_range_is_found_and_told(tmp_path):
    start = load_config("sitl").controller.loiter.radius_m
    found = tune("loiter", 201, 1, Bowl(goal=9.0), tmp_path / "loiter.json", **SETS)
    assert found["settings"]["first_ranges"]["controller.loiter.radius_m"] == pytest.approx(
        [start / 4.0, start * 4.0], rel=1e-3
    )
    assert found["best"]["values"]["controller.loiter.radius_m"] > 7.0
    text = markdown({"controllers": {"loiter": found}})
    assert re.search(r"\| controller\.loiter\.radius_m \| [.\d]+ \| [789][.\d]* \| [.\d]+ to [.\d]+ \| no \|", text)


def test_a_candidate_that_the_config_refuses_has_failed_and_is_not_run(tmp_path, monkeypatch):
    def job(name, base, overrides, window_s):
        if any("radius_m" in key and float(key.partition("=")[2]) > 1.4 for key in overrides):
            raise ConfigError("key controller.loiter.radius_m: too large")
        return trial_job(name, base, overrides, window_s)

    monkeypatch.setattr(tuning, "trial_job", job)
    bowl = Bowl()
    found = tune("loiter", 21, 1, bowl, tmp_path / "loiter.json", **SETS)
    scores = [one["typical_ps"] for generation in found["generations"] for one in generation]
    assert 0 < scores.count(None) < 21 and bowl.jobs == 21 - scores.count(None) + 6
    assert found["best"]["values"]["controller.loiter.radius_m"] <= 1.4


def test_a_search_that_was_cut_goes_on_to_the_same_bits(tmp_path):
    path = tmp_path / "loiter.json"
    whole = tune("loiter", 21, 3, Bowl(), path, **SETS)
    text = path.read_text()
    for kept in (1, 2):
        cut = {key: value for key, value in whole.items() if key not in ("config", "tuned")}
        path.write_text(json.dumps({**cut, "generations": whole["generations"][:kept]}))
        bowl = Bowl()
        assert tune("loiter", 21, 3, bowl, path, **SETS) == whole and path.read_text() == text
        assert bowl.jobs == sum(map(len, whole["generations"][kept:])) + 6
    with pytest.raises(AsvhilError, match=r"its search had seed 3, this one has 4; move it away"):
        tune("loiter", 21, 4, Bowl(), path, **SETS)
    assert path.read_text() == text


def test_a_search_goes_on_beyond_the_budget_that_it_had_to_the_same_bits(tmp_path):
    whole = tune("loiter", 31, 3, Bowl(), tmp_path / "whole.json", **SETS)
    path = tmp_path / "loiter.json"
    tune("loiter", 11, 3, Bowl(), path, **SETS)
    bowl = Bowl()
    assert tune("loiter", 31, 3, bowl, path, **SETS) == whole
    assert bowl.jobs == 20 + 6
    done = []
    shorter = tune("loiter", 11, 3, Bowl(), path, lambda count, best: done.append(count), **SETS)
    assert shorter["generations"] == whole["generations"] and done == [1, 11, 21, 31]


def test_a_run_that_let_go_counts_as_much_as_one_that_points_the_wrong_way(tmp_path):
    share = 0.25
    plain, counted = (
        tune("loiter", 1, 1, Bowl(goal=0.5, let_go=let_go), tmp_path / f"{let_go}.json", **SETS)["config"]["held_out"]
        for let_go in (0.0, share)
    )
    assert counted["mean"] - plain["mean"] == pytest.approx(share * 180.0, abs=1e-3)


def test_a_candidate_with_a_run_that_failed_is_never_the_best(tmp_path):
    found = tune("loiter", 21, 1, Bowl(goal=0.9, fail="yes"), tmp_path / "loiter.json", **SETS)
    scores = [one["typical_ps"] for generation in found["generations"] for one in generation]
    assert None in scores and found["best"]["typical_ps"] == min(score for score in scores if score is not None)
    assert found["best"]["values"]["controller.loiter.radius_m"] >= 1.0


def broken(record: dict, how: str) -> str:
    """The record of a search after somebody has edited it."""
    first = record["generations"][1]
    match how:
        case "a generation without candidates":
            record["generations"][1] = []
        case "a candidate is missing":
            first.pop()
        case "too few shares":
            first[0]["shares"].pop()
        case "another key":
            first[0]["values"] = {"controller.loiter.radius": 1.0}
        case "no numbers":
            first[0]["values"] = dict.fromkeys(first[0]["values"], "wide")
    return json.dumps(record)


@pytest.mark.parametrize(
    "how",
    [
        *("a generation without candidates", "a candidate is missing", "too few shares", "another key", "no numbers"),
    ],
)
def test_a_record_that_was_edited_is_refused_and_left_as_it_is(how, tmp_path):
    path = tmp_path / "loiter.json"
    text = broken(tune("loiter", 11, 1, Bowl(), path, **SETS), how)
    path.write_text(text)
    with pytest.raises(AsvhilError, match=r"loiter\.json: not a whole record of a search; move it away"):
        tune("loiter", 11, 1, Bowl(), path, **SETS)
    assert path.read_text() == text


def test_a_search_whose_runs_all_fail_ends_with_the_first_error(tmp_path):
    def fails(function, jobs) -> Finished:
        results = [{}] * len(jobs)
        errors = {job.key: "key controller.model: no such file" for job in jobs}
        return Finished(results=results, group_s={}, processes=1, outdated=0, errors=errors)

    with pytest.raises(AsvhilError, match=r"every run of its first candidates failed: key controller\.model: no such"):
        tune("loiter", 51, 1, fails, tmp_path / "loiter.json", **SETS)


def test_a_config_without_a_station_is_refused_before_the_first_run(tmp_path):
    with pytest.raises(ConfigError, match=r"--config field: key supervisor\.station: a search needs a station to keep"):
        tune("loiter", 51, 1, Bowl(), tmp_path / "loiter.json", base="field", **SETS)


def test_a_budget_is_the_start_and_whole_generations():
    assert [candidates_of(budget, 9) for budget in (1, 2, 11, 20, 21, 100, 300)] == [1, 11, 11, 21, 21, 101, 301]


def refused(monkeypatch, capsys, *arguments: str) -> str:
    """The one line with which the command ends, before any run."""
    monkeypatch.setattr(sys, "argv", ["asvhil", "tune", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_record_of_the_earlier_search_is_named_and_left_as_it_is(tmp_path, monkeypatch, capsys):
    path = tmp_path / "loiter.json"
    record = json.loads((RESULTS / "loiter.json").read_text(encoding="utf-8"))
    del record["settings"]["search"]  # it was a random one, and had no name
    path.write_text(json.dumps(record))
    line = refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path))
    assert line.startswith(f"asvhil: {path}: its search had search null") and line.endswith(
        "move it away to begin anew"
    )
    assert json.loads(path.read_text()) == record


@pytest.mark.parametrize("text", ['{"controller": "loiter", "settings"', "[]", "{}", "\x00", '{"settings": 1}'])
def test_a_damaged_record_is_one_line_and_left_as_it_is(tmp_path, monkeypatch, capsys, text):
    path = tmp_path / "loiter.json"
    path.write_text(text)
    line = refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path))
    assert re.fullmatch(r"asvhil: .*loiter\.json: not a whole record of a search; .*", line)
    assert path.read_text() == text


@pytest.mark.parametrize(("arguments", "words"), [(("--budget", "0"), "'--budget'"), (("--seed=-1",), "'--seed'")])
def test_a_number_that_cannot_be_is_one_line(tmp_path, monkeypatch, capsys, arguments, words):
    assert words in refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path), *arguments)


def test_an_unknown_controller_is_one_line_that_names_those_that_can_be(tmp_path, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "loter", "-o", str(tmp_path))
    assert line.startswith(
        "asvhil: NAME loter: unknown, did you mean loiter? (known: backstepping, sliding-mode, loiter, nnsem-mpc"
    )


def test_a_controller_without_a_space_is_an_error(tmp_path):
    with pytest.raises(KeyError):
        tune("manoeuvres", 1, 1, Bowl(), tmp_path / "record.json")


def test_the_record_of_the_default_mpc_says_that_its_weights_are_already_there():
    """What docs/results/tuning tells: asked were 10 % less in held-out winds, or that."""
    search = json.loads((RESULTS / "lagnet-mpc.json").read_text(encoding="utf-8"))
    space = {parameter.key: parameter.start for parameter in SPACES["lagnet-mpc"]}
    assert search["generations"][0][0]["values"] == space, "the search began with the weights that are shipped"
    old, new = (search[which]["held_out"]["typical_ps"] for which in ("config", "tuned"))
    assert 0.9 * old < new < old and len(search["tuned"]["held_out"]["ps"]) == 10
