"""A run whose log is split replays exactly across its files, by every command."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from asvhil.commands.cli import app
from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.logs.segments import segment_path
from asvhil.sitl import run_lockstep


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "log.mcap"
    run_lockstep(load_config("sitl", ("recorder.segment_s=10",)), path, 22.0)
    return path


@pytest.mark.parametrize("named", ["first", "folder"])
def test_every_tick_is_exact(log: Path, named: str) -> None:
    assert len(list(log.parent.glob("log*.mcap"))) == 3
    result = replay(log if named == "first" else log.parent)
    assert result.mismatch is None and result.compared == result.ticks == 443 and not result.truncated


def test_a_later_segment_alone_is_not_replayed(log: Path) -> None:
    with pytest.raises(AsvhilError, match=r"log-002.mcap: begins with tick 401; replay the run by its first"):
        replay(segment_path(log, 2))


def test_commands_take_the_folder(log: Path, tmp_path: Path) -> None:
    def run(*words: str) -> str:
        result = CliRunner().invoke(app, list(words))
        assert result.exit_code == 0, result.output
        return result.output

    run("log", "info", str(log.parent), "--json", str(tmp_path / "info.json"))
    told = json.loads((tmp_path / "info.json").read_text())
    assert told["segments"] == 3 and told["whole"] and told["ticks"] == 443
    run("log", "export", str(log.parent), str(tmp_path / "run.csv"))
    assert len((tmp_path / "run.csv").read_text().splitlines()) == 444
    run("log", "recover", str(log.parent), "-o", str(tmp_path / "all.mcap"))
    assert replay(tmp_path / "all.mcap").compared == 443
    assert "443 ticks bit-exact" in " ".join(run("replay", str(log.parent)).split())
    assert read_run(log.parent).ticks == 443


@pytest.mark.parametrize("key", ["segment_mb=0.5", "segment_s=1", "segment_mb=-1"])
def test_segments_that_would_be_all_metadata_are_refused(key: str) -> None:
    with pytest.raises(ConfigError, match="segment_"):
        load_config("sitl", (f"recorder.{key}",))
