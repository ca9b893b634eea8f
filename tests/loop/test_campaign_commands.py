"""`asvhil campaign` and `asvhil tune` as people run them: killed, on a cluster, and with mistakes."""

import contextlib
import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from asvhil.commands.cli import main
from asvhil.study import rows, tuning
from asvhil.study.made_of import BEGIN, END
from asvhil.study.tuning import WindSet
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.waiting import wait_until

pytestmark = pytest.mark.real_time

SPEC = """
design: {kind: sobol, points: 3, seed: 3}
parameters:
  wind_speed: {low: 2, high: 8}
  plant.vessel.mass_kg: {low: 0.8, high: 1.2, factor: true}
variants:
  LOITER: {controller.name: loiter}
  backstepping: {controller.name: backstepping}
window_s: [2, 3]
worst: 1
"""
RUNS = 6


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "asvhil", "campaign", "winds.yaml", *arguments]


def campaign(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*arguments), cwd=folder, capture_output=True, text=True, check=False, timeout=200)


def lines(store: Path) -> int:
    return store.read_text().count("\n") if store.exists() else 0


def shown(folder: Path) -> tuple[bytes, str, dict]:
    """The table, the page without its costs, and the figures without them."""
    figures = json.loads((folder / "winds.json").read_text())
    figures.pop("cost")
    return (folder / "winds.parquet").read_bytes(), (folder / "winds.md").read_text().partition("### Cost")[0], figures


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign that nothing disturbed."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "winds.yaml").write_text(SPEC)
    done = campaign(folder, "-o", "whole", "--workers", "2", "--json", "figures.json")
    assert (done.returncode, done.stderr) == (0, "")
    assert "winds.yaml: 6 runs" in done.stdout and "runs per core-hour" in done.stdout
    assert lines(folder / "whole" / "winds.jsonl") == RUNS
    return folder


def test_a_campaign_leaves_table_summary_figure_and_a_log_that_replays(whole):
    figures = json.loads((whole / "figures.json").read_text())
    assert figures["failed"] == 0 and figures["all"]["runs"] == RUNS and len(figures["worst"]) == 1
    assert set(figures["sensitivity"]) == {"wind_speed", "plant.vessel.mass_kg", "variant"}
    assert figures["cost"]["runs_per_core_hour"] > 0.0 and figures["cost"]["logs_of_other_bits"] == 0
    folder = whole / "whole"
    assert (folder / "winds.png").read_bytes().startswith(b"\x89PNG")
    [mark] = [line for line in (folder / "winds.md").read_text().splitlines() if line.startswith(BEGIN)]
    parts = json.loads(mark.removeprefix(BEGIN).removesuffix(END))["parts"]
    assert {"winds.yaml", "config/sitl.yaml", "controller", "study/campaigns/campaign.py"} <= set(parts)
    # No run but the worst one has a log, and that one replays.
    [log] = folder.rglob("*.mcap")
    done = subprocess.run([sys.executable, "-m", "asvhil", "replay", str(log)], capture_output=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.thorough
def test_a_campaign_that_is_killed_twice_ends_like_one_that_was_not(whole):
    store = whole / "cut" / "winds.jsonl"
    for least in (1, 3):
        running = subprocess.Popen(
            command("-o", "cut", "--workers", "2"), cwd=whole, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            wait_until(lambda least=least: lines(store) >= least, 100.0)
        finally:
            running.send_signal(signal.SIGKILL)
            running.wait()
        assert least <= lines(store) < RUNS
    done = campaign(whole, "-o", "cut", "--workers", "2")
    assert (done.returncode, done.stderr) == (0, "")
    keys = [json.loads(line)["key"] for line in store.read_text().splitlines()]
    assert len(keys) == len(set(keys)) == RUNS
    assert shown(whole / "cut") == shown(whole / "whole")


@contextlib.contextmanager
def dask(*arguments: str) -> Iterator[subprocess.Popen]:
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def test_on_a_cluster_that_loses_a_worker_it_is_the_same(whole):
    port = free_port(socket.SOCK_STREAM)
    address = f"tcp://127.0.0.1:{port}"
    worker = ("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    store = whole / "cluster" / "winds.jsonl"
    with (
        dask("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"),
        dask(*worker) as first,
        dask(*worker),
    ):
        running = subprocess.Popen(
            command("-o", "cluster", "--scheduler", address),
            cwd=whole,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            wait_until(lambda: lines(store) >= 2 or running.poll() is not None, 100.0)
            first.send_signal(signal.SIGKILL)
            words, _ = running.communicate(timeout=150.0)
        finally:
            running.kill()
            running.wait()
        assert running.returncode == 0, words
        assert lines(store) == RUNS
        assert shown(whole / "cluster") == shown(whole / "whole")


@pytest.mark.thorough
def test_a_search_that_is_killed_goes_on_to_the_same_bits(tmp_path):
    def start(folder: Path) -> subprocess.Popen:
        return subprocess.Popen([sys.executable, "-m", "tests.support.tuning_runs", str(folder)], cwd=ROOT)

    store = tmp_path / "cut" / "tune.jsonl"
    for least in (1, 5):  # after the start, which is a generation of its own, and within the next
        running = start(tmp_path / "cut")
        try:
            wait_until(lambda least=least: lines(store) >= least, 100.0)
        finally:
            running.kill()
            running.wait()
        assert lines(store) < 11
    for folder in ("cut", "whole"):
        assert start(tmp_path / folder).wait(timeout=100.0) == 0
    assert (tmp_path / "cut" / "loiter.json").read_bytes() == (tmp_path / "whole" / "loiter.json").read_bytes()
    # Each candidate once; the shipped gains, the first and the best of so few, once more in the held-out wind.
    assert lines(store) == lines(tmp_path / "whole" / "tune.jsonl") == 11 + 1


@pytest.mark.thorough
def test_tuning_tells_both_sets_of_winds_and_leaves_the_search(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(tuning, "TRAINING", WindSet(winds=((4.0, 30.0), (5.0, 60.0)), seeds=(1,)))
    monkeypatch.setattr(tuning, "HELD_OUT", WindSet(winds=((3.0, 20.0), (3.0, 40.0)), seeds=(2,)))
    monkeypatch.setattr(rows, "QUICK_S", (0.5, 1.0))
    arguments = ["loiter", "--quick", "--budget", "1", "--workers", "1", "-o", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["asvhil", "tune", *arguments, "--json", str(tmp_path / "found.json")])
    with pytest.raises(SystemExit, match=r"^0$"):
        main()
    said = capsys.readouterr().out
    assert "winds and seeds that the search did not see" in said and "| controller.loiter.radius_m | 1.258 |" in said
    found = json.loads((tmp_path / "found.json").read_text())["controllers"]["loiter"]
    assert found == json.loads((tmp_path / "loiter-quick.json").read_text())
    assert [len(found["tuned"][which]["ps"]) for which in ("training", "held_out")] == [2, 2]
    assert (tmp_path / "tune-quick.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.yaml"], "nowhere.yaml: no such campaign file"),
        (["winds.yaml", "--scheduler", "tcp//here"], "--scheduler tcp//here: no Dask scheduler answers"),
        (["winds.yaml", "-o", "taken"], "-o taken: is a file; the name of a folder is expected"),
    ],
)
def test_a_mistake_is_one_line(arguments, words, tmp_path, monkeypatch, capsys):
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "winds.yaml").write_text(SPEC)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["asvhil", "campaign", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
