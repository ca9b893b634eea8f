"""The command line: bad input is one line on stderr and a non-zero exit, never a traceback."""

import json
import math
import subprocess
import sys
from pathlib import Path


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


def test_usage_errors_and_help() -> None:
    assert asvhil("--help").returncode == 0
    assert asvhil("--version").stdout.startswith("asvhil ")
    unknown = asvhil("sail")
    assert unknown.returncode == 2 and "Traceback" not in unknown.stderr


def test_lockstep_leaves_a_log_a_picture_and_figures_and_replays(tmp_path: Path) -> None:
    done = asvhil("sitl", "--lockstep", "--duration", "20", "--wind", "3@90", "--json", "out.json", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    figures = json.loads((tmp_path / "out.json").read_text())
    assert figures["wind"]["configured"]["toward_deg"] == 90.0
    assert math.isfinite(figures["truth"]["penalty_score"])
    (log,) = tmp_path.glob("runs/*-lockstep/log.mcap")
    assert (log.parent / "log.png").read_bytes().startswith(b"\x89PNG")
    exact = asvhil("replay", str(log), "--json", str(tmp_path / "replay.json"))
    assert exact.returncode == 0 and "403 ticks bit-exact" in exact.stdout
    assert json.loads((tmp_path / "replay.json").read_text())["exact"] is True
    report = asvhil("report", str(log), "--picture", str(tmp_path / "run.svg"))
    assert report.returncode == 0 and (tmp_path / "run.svg").exists()
    again = asvhil("sitl", "--lockstep", "--duration", "5", "--log", str(log), cwd=tmp_path)
    assert again.returncode == 2 and again.stderr.count("\n") == 1  # a log is never overwritten


def test_the_wind_turns_with_the_stations_heading(tmp_path: Path) -> None:
    arguments = ["--lockstep", "--duration", "2", "--wind", "3@90", "--set", "supervisor.station.heading_deg=100"]
    asvhil("sitl", *arguments, "--no-picture", "--json", "out.json", cwd=tmp_path)
    figures = json.loads((tmp_path / "out.json").read_text())
    assert figures["wind"]["configured"]["toward_deg"] == 190.0


def test_a_collected_log_without_a_note_ends_its_line_with_the_seconds(tmp_path: Path) -> None:
    done = asvhil("collect", "--duration", "10", "-o", "data.mcap", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[-1] == "data.mcap: 10 s"
    done = asvhil("collect", "--duration", "10", "-o", "noted.mcap", "--note", "lake", cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "noted.mcap: 10 s, lake"
