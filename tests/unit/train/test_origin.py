"""No log counts twice, and no test is part of what is trained on: segments of a split log, by their own paths too."""

import json
import shutil
from pathlib import Path

import pytest

from asvhil.collect import collect
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.errors import ConfigError
from asvhil.train.dataset import dataset_from_logs
from asvhil.train.origin import once, refuse_shared
from tests.support.command_line import call


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a drive of 75 s in two segments."""
    log = tmp_path_factory.mktemp("split") / "drive.mcap"
    collect(load_config("sitl", ("recorder.segment_s=50",)), "lockstep", 75.0, [parse_wind("3@90")], log)
    assert [path.name for path in sorted(log.parent.glob("*.mcap"))] == ["drive-001.mcap", "drive.mcap"]
    return log.parent


def test_a_later_segment_is_read_once_with_its_first(split: Path) -> None:
    first, later = split / "drive.mcap", split / "drive-001.mcap"
    assert once([later, first]) == once([first, later]) == ([first], [later])
    assert once([later]) == ([later], [])  # by itself it is what was given


def test_a_copy_of_the_first_segment_is_the_same_record(split: Path, tmp_path: Path) -> None:
    copy = shutil.copy(split / "drive.mcap", tmp_path / "copy.mcap")
    shutil.copy(split / "drive-001.mcap", tmp_path / "copy-001.mcap")
    with pytest.raises(ConfigError, match=r"drive\.mcap and .*copy\.mcap are the same record: give it once"):
        once([split / "drive.mcap", copy])


def test_what_was_recovered_of_a_split_log_is_of_the_same_run(split: Path, tmp_path: Path) -> None:
    part = tmp_path / "recovered.mcap"
    assert call("log", "recover", "drive.mcap", "-o", str(part), cwd=split).status == 0
    with pytest.raises(ConfigError, match=r"drive\.mcap and .*recovered\.mcap are the same record: give it once"):
        once([split / "drive.mcap", part])
    with pytest.raises(ConfigError, match="is of the same run as"):
        refuse_shared([part], [split / "drive.mcap"])


def test_a_test_is_no_part_of_the_training(split: Path) -> None:
    first, later = split / "drive.mcap", split / "drive-001.mcap"
    for data, test in (([first], [later]), ([later], [first])):
        with pytest.raises(ConfigError, match="is of the same run as"):
            refuse_shared(data, test)


@pytest.mark.parametrize("made", ["recovered", "cut"])
def test_a_part_of_a_log_in_one_file_is_of_the_same_run(tmp_path: Path, made: str) -> None:
    whole, part = tmp_path / "drive.mcap", tmp_path / f"drive-{made}.mcap"
    settings = load_config("sitl", ("recorder.segment_s=0", "recorder.segment_mb=0"))
    collect(settings, "lockstep", 40.0, [parse_wind("3@90")], whole)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    if made == "recovered":
        assert call("log", "recover", "cut.mcap", "-o", part.name, cwd=tmp_path).status == 3
    else:
        cut.rename(part)
    with pytest.raises(ConfigError, match=rf"drive\.mcap and .*drive-{made}\.mcap are the same record: give it once"):
        once([whole, part])
    with pytest.raises(ConfigError, match=rf"drive-{made}\.mcap is of the same run as .*drive\.mcap"):
        refuse_shared([whole], [part])
    other = tmp_path / "other.mcap"
    collect(settings, "lockstep", 15.0, [parse_wind("3@60")], other)
    assert once([whole, other]) == ([whole, other], [])
    refuse_shared([whole], [other])


def test_training_and_scores_count_a_split_drive_once_and_say_so(split: Path) -> None:
    pytest.importorskip("torch")
    both = ("drive-001.mcap", "drive.mcap")
    said = call("train", "sd", *both, "-o", "sd.npz", "--json", "t.json", cwd=split)
    assert said.status == 0 and "drive-001.mcap: left out: it is read with the first segment" in said.out, said
    figures = json.loads((split / "t.json").read_text())
    assert (figures["data"], figures["left_out"]) == (["drive.mcap"], ["drive-001.mcap"])
    assert figures["data_s"] < 80.0
    scored = [
        call("evaluate", "sd.npz", *data, "--horizon", "10", "--json", "e.json", cwd=split)
        and json.loads((split / "e.json").read_text())["rows"]["sd"]["all"]["windows"]
        for data in (("--data", "drive.mcap"), ("--data", both[0], "--data", both[1]))
    ]
    assert scored[0] == scored[1]
    said = call("evaluate", "sd.npz", "--data", both[0], "--data", both[1], "--horizon", "10", cwd=split)
    assert "drive-001.mcap: left out" in said.out
    (split / "boat.yaml").write_text("base: sitl\n")
    said = call("learn", "boat.yaml", "--yes", "--data", both[1], "--test", both[0], "-o", "new", cwd=split)
    assert said.status != 0 and "drive-001.mcap is of the same run as drive.mcap" in said.err


def test_the_folder_of_a_run_is_its_log(split: Path, tmp_path: Path) -> None:
    pytest.importorskip("torch")
    (tmp_path / "boat.yaml").write_text("base: sitl\n")
    said = call("train", "sd", str(split), "-o", "sd.npz", "--json", "t.json", cwd=tmp_path)
    assert said.status == 0, said
    assert json.loads((tmp_path / "t.json").read_text())["data"] == [str(split / "drive.mcap")]
    said = call("evaluate", "sd.npz", "--data", str(split), "--horizon", "10", cwd=tmp_path)
    assert said.status == 0 and "mean absolute error over 10 s" in said.out, said
    both = ("--data", str(split), "--test", str(split))
    said = call("learn", "boat.yaml", "--yes", *both, "-o", "new", cwd=tmp_path)
    assert "drive.mcap and" in said.err and "are the same record" in said.err, said
    said = call("train", "sd", str(tmp_path), "-o", "sd.npz", "--force", cwd=tmp_path)
    assert said.err.strip().endswith("a folder with no log (.mcap)")


def test_logs_without_wind_beside_others_and_a_silent_wind_sensor_are_told(split: Path, tmp_path: Path) -> None:
    silent, without = tmp_path / "silent.mcap", tmp_path / "without.mcap"
    never_sent = "sources.wind=[{link: autopilot, message: WIND}]"
    no_sensor = ("links.anemometer=null", "plant.links.anemometer=null")
    collect(load_config("sitl", (never_sent,)), "lockstep", 40.0, [], silent)
    collect(load_config("sitl", no_sensor), "lockstep", 40.0, [], without)
    (note,) = dataset_from_logs([silent], 0.2).notes
    assert note == f"{silent}: no wind was measured, though its config has a source of wind: it counts as calm"
    assert dataset_from_logs([without], 0.2).notes == ()
    (note,) = dataset_from_logs([split / "drive.mcap", without], 0.2).notes
    assert note == f"{without}: no wind was measured, which other logs have: it counts as calm"
