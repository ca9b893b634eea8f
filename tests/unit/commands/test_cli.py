"""The command line: bad input is one line on stderr and a non-zero exit, never a traceback."""

import json
import math
import subprocess
import sys
from pathlib import Path

from tests.support.command_line import call


def asvhil(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "asvhil", *arguments],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
    )


def test_bad_input_is_one_line_of_the_program_too(tmp_path: Path) -> None:
    """As it is installed; `test_mistakes.py` has the mistakes."""
    done = asvhil("run", "nowhere.yaml", cwd=tmp_path)
    assert done.returncode == 2
    assert "nowhere.yaml: no such config file" in done.stderr and done.stderr.count("\n") == 1


def test_usage_errors_and_help(tmp_path: Path) -> None:
    assert call("--help", cwd=tmp_path).status == 0
    assert call("--version", cwd=tmp_path).out.startswith("asvhil ")
    unknown = call("sail", cwd=tmp_path)
    assert unknown.status == 2 and "Traceback" not in unknown.err


def test_lockstep_leaves_a_log_a_picture_and_figures_and_replays(tmp_path: Path) -> None:
    done = asvhil("sitl", "--lockstep", "--duration", "20", "--wind", "3@90", "--json", "out.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads((tmp_path / "out.json").read_text())
    assert figures["wind"]["configured"]["toward_deg"] == 90.0
    assert math.isfinite(figures["truth"]["penalty_score"])
    (log,) = tmp_path.glob("runs/*-lockstep/log.mcap")
    assert (log.parent / "log.png").read_bytes().startswith(b"\x89PNG")
    exact = call("replay", str(log), "--json", "replay.json", cwd=tmp_path)
    assert exact.status == 0 and "403 ticks bit-exact" in exact.out
    assert json.loads((tmp_path / "replay.json").read_text())["exact"] is True
    report = call("report", str(log), "--picture", "run.svg", cwd=tmp_path)
    assert report.status == 0 and (tmp_path / "run.svg").exists()
    again = call("sitl", "--lockstep", "--duration", "5", "--log", str(log), cwd=tmp_path)
    assert again.status == 2 and again.err.count("\n") == 1  # a log is never overwritten


def test_the_wind_turns_with_the_stations_heading(tmp_path: Path) -> None:
    arguments = ["--lockstep", "--duration", "2", "--wind", "3@90", "--set", "supervisor.station.heading_deg=100"]
    call("sitl", *arguments, "--no-picture", "--json", "out.json", cwd=tmp_path)
    figures = json.loads((tmp_path / "out.json").read_text())
    assert figures["wind"]["configured"]["toward_deg"] == 190.0


def test_a_collected_log_without_a_note_ends_its_line_with_the_seconds(tmp_path: Path) -> None:
    done = call("collect", "--duration", "10", "-o", "data.mcap", cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines()[-1] == "data.mcap: 10 s"
    done = call("collect", "--duration", "10", "-o", "noted.mcap", "--note", "lake", cwd=tmp_path)
    assert done.out.splitlines()[-1] == "noted.mcap: 10 s, lake"
