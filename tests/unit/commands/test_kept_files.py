"""What a command reads or keeps is never overwritten by what it writes beside: refused before the work."""

import json
import os
from pathlib import Path

import pytest

from asvhil.commands.outputs import check_apart, check_json
from asvhil.errors import AsvhilError, ConfigError
from tests.support.command_line import call, refused

SPEC = {"config": "sitl", "design": {"kind": "grid"}, "parameters": {"wind_speed": [3, 6]}, "window_s": [5, 15]}
STORE = '{"key": "a", "code": "c", "wall_s": 1.0, "result": {}, "crc": 1}\n'
RECORD = {"controller": "loiter", "settings": {}, "generations": [[{"ps": [1.0]}]]}
JSON_CONFIG = '{"base": "sitl.yaml"}\n'  # which YAML is too

ORDERS = [
    (("campaign", "good.json", "-o", "o", "--json", "o/good.jsonl"), "--json o/good.jsonl: is the store of the runs"),
    (("campaign", "good.json", "-o", "n", "--json", "n/good.jsonl"), "--json n/good.jsonl: is the store of the runs"),
    (("campaign", "good.json", "-o", "n", "--json", "n/good.parquet"), "is the table of the runs; give another name"),
    (("campaign", "good.json", "-o", "n", "--json", "n/good.md"), "is the page of -o; give another name"),
    (("campaign", "good.json", "-o", "n", "--json", "n/good.png"), "is the picture of -o; give another name"),
    (("campaign", "good.json", "-o", "n", "--json", "n/good.json"), "is the figures of -o; give another name"),
    (("campaign", "good.json", "-o", "n", "--json", "good.json"), "--json good.json: is the spec; give another name"),
    (("campaign", "good.json", "-o", "."), "good.json: is the spec; give another name"),
    (("campaign", "loiter.yaml", "-o", "t"), "t/loiter.json: is the record of a search; give another name"),
    (("tune", "loiter", "-o", "t", "--json", "t/loiter.json"), "is the record of the search of loiter; give another"),
    (("tune", "loiter", "--quick", "-o", "t", "--json", "t/loiter-quick.json"), "is the record of the search of"),
    (("tune", "loiter", "-o", "n", "--json", "n/tune.jsonl"), "--json n/tune.jsonl: is the store of the runs"),
    (("tune", "loiter", "-o", "n", "--json", "t/loiter.json"), "--json t/loiter.json: is the record of a search"),
    (("study", "six-tests", "-o", "o", "--json", "o/trials.jsonl"), "is the store of the runs; give another name"),
    (("study", "approach", "-o", "n", "--json", "n/approach.jsonl"), "is the store of the runs; give another name"),
    (("study", "safety", "-o", "n", "--json", "n/safety.jsonl"), "is the store of the runs; give another name"),
    (("study", "estimator", "-o", "n", "--json", "n/estimator.jsonl"), "is the store of the runs; give another name"),
    (("study", "waves", "-o", "n", "--json", "o/trials.jsonl"), "--json o/trials.jsonl: is a store of runs"),
    (("study", "pages", "--json", "o/trials.jsonl"), "--json o/trials.jsonl: is a store of runs; give another name"),
    (("check", "mine.yaml", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another name"),
    (("config", "check", "mine.yaml", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another name"),
    (("config", "show", "top.yaml", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another name"),
    (("collect", "mine.yaml", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another name"),
    (("collect", "mine.yaml", "-o", "new.mcap", "--json", "new.mcap"), "is the file of --output too; give another"),
    (("learn", "mine.yaml", "--yes", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another name"),
    (("sitl", "mine.yaml", "--lockstep", "--json", "mine.yaml"), "--json mine.yaml: is the config; give another"),
    (("sitl", "mine.yaml", "--lockstep", "--log", "a.mcap", "--json", "a.mcap"), "is the file of --log too; give"),
    (("sitl", "mine.yaml", "--lockstep", "--log", "a.mcap", "--json", "a.png"), "is the picture of --log; give"),
    (("log", "recover", "empty.mcap", "-o", "b.mcap", "--json", "b.mcap"), "--json b.mcap: is the new log; give"),
    (("log", "recover", "empty.mcap", "--json", "empty.mcap"), "--json empty.mcap: is the log; give another name"),
    (("evaluate", "m.npz", "--data", "empty.mcap", "--json", "m.npz"), "--json m.npz: is the model; give another"),
    (("train", "sd", "empty.mcap", "-o", "n.npz", "--json", "empty.mcap"), "is the data; give another name"),
    (("train", "sd", "empty.mcap", "-o", "n.npz", "--json", "n.npz"), "is the file of --output too; give another"),
    (("replay", "empty.mcap", "--json", "empty.mcap"), "--json empty.mcap: is the log; give another name"),
    (("report", "empty.mcap", "--json", "empty.mcap"), "--json empty.mcap: is the log; give another name"),
    (("train", "sd", "empty.mcap", "-o", "n.npz", "--columns", "map.yaml", "--json", "map.yaml"), "the column map"),
    (("evaluate", "m.npz", "--data", "empty.mcap", "--columns", "map.yaml", "--json", "map.yaml"), "the column map"),
    (("replay", "--tlog", "a.tlog", "--config", "mine.yaml", "--json", "mine.yaml"), "mine.yaml: is the config; give"),
    (("init", "cat.yaml", "--json", "cat-sim.yaml"), "--json cat-sim.yaml: is the config of the twin; give"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("o", "t", "n"):
        (tmp_path / name).mkdir()
    (tmp_path / "good.json").write_text(json.dumps(SPEC))
    (tmp_path / "loiter.yaml").write_text(json.dumps(SPEC))
    (tmp_path / "o" / "good.jsonl").write_text(STORE * 2)
    (tmp_path / "o" / "trials.jsonl").write_text(STORE)
    for name in ("loiter", "loiter-quick"):
        (tmp_path / "t" / f"{name}.json").write_text(json.dumps(RECORD))
    (tmp_path / "mine.yaml").write_text(JSON_CONFIG)
    (tmp_path / "top.yaml").write_text("base: mine.yaml\n")
    (tmp_path / "map.yaml").write_text('{"time_s": "t"}')
    for name in ("empty.mcap", "m.npz"):
        (tmp_path / name).write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(("order", "words"), ORDERS, ids=lambda value: " ".join(value) if value[0] != "-" else "")
def test_a_file_of_the_command_itself_is_no_place_for_its_figures(
    folder: Path, order: tuple[str, ...], words: str
) -> None:
    def contents() -> dict[str, bytes]:
        return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    before = contents()
    refused(call(*order, cwd=folder), words)
    assert contents() == before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STORE, "is a store of runs; give another name"),
        (STORE * 2, "is a store of runs; give another name"),
        ('{"a": 1}\n{"b": 2}\n', "holds more than one piece of JSON"),
        ("[1]\n[2]\n", "holds more than one piece of JSON"),
        ("{config: sitl}\n", "is not JSON"),
        ("base: sitl.yaml\n", "is not JSON"),
        ("3 m/s\n", "is not JSON"),
        ('{"a": "\udcff"}', "is not JSON"),
        (json.dumps(RECORD), "is the record of a search; give another name"),
    ],
)
def test_only_figures_give_their_place_to_others(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "figures.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(AsvhilError, match=rf"--json .*figures\.json: .*{words}"):
        check_json(path)


@pytest.mark.parametrize("text", ["", "\n", "{}", "[]", '{"ps": NaN}\n', json.dumps({"runs": [1]}, indent=2)])
def test_earlier_figures_give_their_place(tmp_path: Path, text: str) -> None:
    path = tmp_path / "figures.json"
    path.write_text(text)
    check_json(path)


def test_a_file_is_known_by_each_of_its_names(tmp_path: Path) -> None:
    one, link, hard = (tmp_path / name for name in ("one", "link", "hard"))
    one.write_text("{}")
    link.symlink_to(one)
    hard.hardlink_to(one)
    for other in (one, link, hard, tmp_path / "." / "one"):
        with pytest.raises(ConfigError, match="is the config; give another name"):
            check_apart(("the config", one), ("--json", other))
    check_apart(("the config", one), ("the config", link), ("--json", tmp_path / "two"), ("--picture", None))


def test_a_log_of_others_is_refused_from_its_first_bytes(tmp_path: Path) -> None:
    log = tmp_path / "flight.bin"
    with log.open("wb") as file:
        file.write(b"\xa3\x95\x80\x80")
        file.truncate(1 << 40)  # a terabyte, of which the disk holds nothing: reading it would fail
    with pytest.raises(AsvhilError, match="is there already, and is not JSON"):
        check_json(log)


LONG = "a" * 300
UNREACHABLE = (
    ("sitl", "--lockstep", "--log", "PLACE.mcap"),
    ("config", "show", "sitl", "--json", "PLACE.json"),
    ("train", "sd", "empty.mcap", "-o", "PLACE.npz"),
    ("calibrate", "empty.mcap", "-o", "PLACE.yaml"),
    ("report", "PLACE.mcap"),
    ("report", "empty.mcap", "--picture", "PLACE.png"),
    ("replay", "PLACE.mcap"),
    ("log", "info", "PLACE.mcap"),
    ("calibrate", "PLACE.mcap"),
    ("train", "sd", "PLACE.mcap", "-o", "n.npz"),
    ("evaluate", "PLACE.npz", "--data", "empty.mcap"),
    ("config", "show", "PLACE.yaml"),
    ("init", "PLACE.yaml"),
)
PLACES = [LONG, *(["shut/a"] if os.getuid() else [])]  # nothing is shut to root


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("order", UNREACHABLE, ids=" ".join)
def test_a_path_that_cannot_be_looked_at_is_told_in_one_line(folder: Path, order: tuple[str, ...], place: str) -> None:
    (folder / "shut").mkdir(mode=0)
    refused(call(*(part.replace("PLACE", place) for part in order), cwd=folder), place)
