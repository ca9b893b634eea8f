"""`asvhil log` at the command line: exit status, one line for bad input, what is left in the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.sitl import run_lockstep
from tests.support.command_line import Said, call
from tests.support.log_damage import chunk_spans
from tests.support.log_samples import make_recorder, record_ticks
from tests.support.loop import PLAIN_CONTROLLER

TICKS = 80


def asvhil(folder: Path, *arguments: str) -> Said:
    return call("log", *arguments, cwd=folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A whole log, one that is cut off, and a file that is no log."""
    recorder = make_recorder(tmp_path / "whole.mcap")
    record_ticks(recorder, range(TICKS))
    recorder.close()
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: chunk_spans(data)[1][1] + 20])
    (tmp_path / "text.mcap").write_text("no log")
    return tmp_path


def test_recover_ends_with_3_where_something_was_lost(folder: Path) -> None:
    whole = asvhil(folder, "recover", "whole.mcap", "-o", "copy.mcap")
    assert whole.status == 0 and "80 ticks" in whole.out and "lost" not in whole.out
    cut = asvhil(folder, "recover", "cut.mcap", "--json", "cut.json")
    assert cut.status == 3 and "lost: no end: cut off" in cut.out
    assert json.loads((folder / "cut.json").read_text())["lost"]
    assert asvhil(folder, "info", "cut-recovered.mcap").status == 0
    again = asvhil(folder, "recover", "cut.mcap")
    assert again.status == 2 and "cut-recovered.mcap: exists already" in again.err


def test_info_leaves_out_what_a_recovered_log_does_not_know(tmp_path: Path) -> None:
    run_lockstep(load_config("sitl", (PLAIN_CONTROLLER,)), tmp_path / "run.mcap", 1.0)
    data = (tmp_path / "run.mcap").read_bytes()
    for name, text in (("config", b'"tick_hz": 20'), ("versions", b"python"), ("run", b"lockstep")):
        at = data.index(text, data.index(name.encode())) + len(text) - 1
        (tmp_path / f"{name}.mcap").write_bytes(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        asvhil(tmp_path, "recover", f"{name}.mcap")
        shown = asvhil(tmp_path, "info", f"{name}-recovered.mcap")
        assert shown.status == 0 and "None" not in shown.out, shown.out
        assert ("lockstep, wamv16" if name != "run" else "\nbackstepping\n") in shown.out


def test_info_of_a_log_without_its_end_says_that_nothing_has_to_be_done(folder: Path) -> None:
    shown = asvhil(folder, "info", "cut.mcap", "--json", "info.json")
    assert shown.status == 0
    assert "without its end" in shown.out and "still being written, or was cut off" in shown.out
    figures = json.loads((folder / "info.json").read_text())
    assert not figures["whole"] and 0 < figures["ticks"] < TICKS


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("info", "text.mcap"), "text.mcap: not a log"),
        (("recover", "text.mcap"), "text.mcap: not a log"),
        (("export", "text.mcap", "out.csv"), "text.mcap: not a log"),
        (("info", "none.mcap"), "none.mcap: cannot be read (No such file or directory)"),
        (("recover", "none.mcap"), "none.mcap: cannot be read (No such file or directory)"),
        (("export", "whole.mcap", "out.doc"), "out.doc: a file that ends in .tlog, .csv, .parquet is expected"),
        (("info", "."), ".: a folder with several logs: cut.mcap, text.mcap, whole.mcap; name one"),
    ],
)
def test_bad_input_is_one_line(folder: Path, arguments: tuple[str, ...], words: str) -> None:
    before = sorted(folder.iterdir())
    done = asvhil(folder, *arguments)
    assert done.status == 2
    assert words in done.err and len(done.err.strip().splitlines()) == 1
    assert sorted(folder.iterdir()) == before
