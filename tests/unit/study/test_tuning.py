"""The tuner: its search, its store, and search spaces that fit the config."""

import functools
import json
import re
import shutil
import sys

import numpy as np
import pytest

from asvhil.commands.cli import main
from asvhil.config import load_config
from asvhil.errors import AsvhilError
from asvhil.study import tuning
from asvhil.study.tuning import Parameter, candidates, overrides_of, spaces, tune, typical
from tests.support.paths import ROOT

SPACES = spaces()
RESULTS = ROOT / "docs" / "results" / "tuning"
SHORT = {"workers": 0, "winds": ((4.0, 30.0),), "window_s": (6.0, 7.0)}


@pytest.mark.parametrize("name", sorted(SPACES))
def test_every_key_of_a_space_reaches_the_config_at_both_ends_of_its_range(name):
    for share in (0.0, 1.0):
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
    """All evaluations on record."""
    search = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    assert search["settings"]["winds_mps_toward_deg"] == [list(wind) for wind in tuning.WINDS]
    assert search["settings"]["plant_seed"] == tuning.PLANT_SEED
    assert search["settings"]["window_s"] == [tuning.FROM_S, tuning.TO_S] and search["settings"]["base"] == "sitl"
    assert search["settings"]["fixed"] == list(tuning.NO_SLOW_ERROR)
    return search["evaluations"]


def test_the_shipped_gains_are_the_best_found():
    for name in SPACES:
        best = min(stored(name), key=lambda evaluation: evaluation["typical_ps"])
        shipped = load_config("sitl", (f"controller.name={name}",))
        assert load_config("sitl", overrides_of(name, best["values"])) == shipped


def test_every_controller_had_the_same_budget():
    assert len({len(stored(name)) for name in SPACES}) == 1


@pytest.mark.parametrize("name", sorted(SPACES))
def test_the_command_takes_up_its_record_and_finds_it_complete(name, tmp_path):
    path = tmp_path / f"{name}.json"
    shutil.copy(RESULTS / f"{name}.json", path)
    said = []
    assert tune(name, 40, 1, lambda done, best: said.append(done), path=path) == json.loads(path.read_text())
    assert not said


def test_values_span_the_range_on_a_logarithmic_scale():
    parameter = Parameter(key="x", start=2.0, factor=4.0)
    assert [parameter.value(share) for share in (0.0, 0.25, 0.5, 1.0)] == [0.5, 1.0, 2.0, 8.0]
    assert parameter.share(1.0) == pytest.approx(0.25)


def test_the_search_begins_with_the_start_draws_wide_and_then_stays_near_the_best():
    space = tuple(Parameter(key=f"x{i}", start=1.0, factor=10.0) for i in range(6))
    first = candidates(space, 40, 1, [])
    assert len(first) == 4 and first[0] == {f"x{i}": 1.0 for i in range(6)}
    assert first == candidates(space, 40, 1, []) != candidates(space, 40, 2, [])
    done = [{"values": values, "typical_ps": 9.0 - i} for i, values in enumerate(first * 9)]
    last = candidates(space, 40, 1, done)
    best = done[-1]["values"]
    for values in last:
        moved = [key for key in values if values[key] != best[key]]
        assert 1 <= len(moved) <= 6
        # Four standard deviations of a late step, in shares of the range of 100.
        assert all(abs(np.log(values[key] / best[key])) < 4 * 0.12 * np.log(100.0) for key in moved)


def test_a_search_without_a_peak_to_miss_finds_it():
    space = tuple(Parameter(key=f"x{i}", start=1.0, factor=10.0) for i in range(4))
    goal = np.log([3.0, 0.4, 1.5, 6.0])
    done = []
    while len(done) < 40:
        for values in candidates(space, 40, 1, done):
            off = float(np.sum((np.log(list(values.values())) - goal) ** 2))
            done.append({"values": values, "typical_ps": off})
    found = min(evaluation["typical_ps"] for evaluation in done)
    assert found < 0.35 * done[0]["typical_ps"]


def test_one_bad_wind_does_not_outvote_the_others():
    assert typical([3.0, 3.0]) == pytest.approx(3.0)
    assert typical([1.0, 1.0, 1.0, 99.0]) < typical([2.5, 2.5, 2.5, 50.0])


def test_an_interrupted_search_goes_on_where_it_was_and_ends_alike(tmp_path):
    path = tmp_path / "loiter.json"
    said = []

    def note(done: int, best: float) -> None:
        said.append((done, best))

    whole = tune("loiter", 6, 3, note, path=path, **SHORT)
    lowest = [min(row["typical_ps"] for row in whole["evaluations"][:done]) for done in (4, 6)]
    assert said == list(zip((4, 6), lowest, strict=True))
    assert json.loads(path.read_text()) == whole
    cut = {**whole, "evaluations": whole["evaluations"][:4]}
    path.write_text(json.dumps(cut))
    said.clear()
    assert tune("loiter", 6, 3, note, path=path, **SHORT) == whole
    assert len(said) == 1  # only the second batch was run
    # A finished one runs nothing; a search with another seed leaves it alone.
    said.clear()
    assert tune("loiter", 6, 3, note, path=path, **SHORT) == whole and not said
    with pytest.raises(AsvhilError, match=r"its search had seed 3, and this one has 4; move it away"):
        tune("loiter", 6, 4, None, path=path, **SHORT)
    assert json.loads(path.read_text()) == whole


def refused(monkeypatch, capsys, *arguments: str) -> str:
    """The one line with which the command ends, before any run."""
    monkeypatch.setattr(sys, "argv", ["asvhil", "study", "tune", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return lines[0]


def test_a_record_of_other_settings_is_named_and_left_as_it_is(tmp_path, monkeypatch, capsys):
    record = json.loads((RESULTS / "loiter.json").read_text())
    record["settings"]["fixed"] = record["settings"]["fixed"][:-1]
    before = json.dumps(record).encode()
    path = tmp_path / "loiter.json"
    path.write_bytes(before)
    line = refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path))
    assert line.startswith(f"asvhil: {path}: its search had ") and line.endswith("move it away to begin anew")
    assert path.read_bytes() == before


@pytest.mark.parametrize("text", ['{"controller": "loiter", "settings"', "[]", "{}", "\x00", '{"settings": 1}'])
def test_a_damaged_record_is_one_line_and_left_as_it_is(tmp_path, monkeypatch, capsys, text):
    path = tmp_path / "loiter.json"
    path.write_text(text)
    line = refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path))
    assert re.fullmatch(r"asvhil: .*loiter\.json: not a whole record of a search; .*", line)
    assert path.read_text() == text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("--budget", "0"), "--budget 0: at least 1"), (("--seed=-1",), "--seed -1"), (("--workers=-1",), "--workers -1")],
)
def test_a_number_that_cannot_be_is_one_line(tmp_path, monkeypatch, capsys, arguments, words):
    assert words in refused(monkeypatch, capsys, "loiter", "-o", str(tmp_path), *arguments)


def test_an_unknown_controller_is_one_line_that_names_those_that_can_be(tmp_path, monkeypatch, capsys):
    line = refused(monkeypatch, capsys, "loter", "-o", str(tmp_path))
    assert line == "asvhil: NAME loter: unknown (known: backstepping, sliding-mode, loiter)"


def test_the_command_tells_the_gains_and_leaves_the_search(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tuning, "tune", functools.partial(tune, winds=((4.0, 30.0),), score=lambda run: 3.0))
    arguments = [
        "loiter",
        "--workers",
        "0",
        "-o",
        str(tmp_path),
        "--budget",
        "5",
        "--json",
        str(tmp_path / "found.json"),
    ]
    monkeypatch.setattr(sys, "argv", ["asvhil", "study", "tune", *arguments])
    with pytest.raises(SystemExit, match=r"^0$"):
        main()
    said = capsys.readouterr().out
    assert "loiter: 5 of 5, best typical ps 3.00" in said and "controller.loiter.radius_m = 1\n" in said
    search = json.loads((tmp_path / "loiter.json").read_text())
    assert len(search["evaluations"]) == 5
    assert json.loads((tmp_path / "found.json").read_text()) == {"loiter": search["best"]}


def test_a_controller_without_a_space_is_an_error():
    with pytest.raises(KeyError):
        tune("manoeuvres", 1, 1)
