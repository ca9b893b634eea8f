"""A short run of the fuzzers: codecs by coverage-guided bytes, configs by random edits. Long: docs/results/fuzz.md."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

from bench.fuzz_targets import TARGETS
from tests.support.damage import odd
from tests.support.paths import ROOT

# The codecs of the sensors are given random bytes in tests/unit/io/test_hostile_bytes.py too.
CODECS = ("signatures", "backseat_script", "log_files", "outputs_records")


@pytest.mark.parametrize("target", CODECS)
def test_no_edit_of_good_bytes_raises(target: str) -> None:
    run, seeds = TARGETS[target]()
    noise = random.Random(target)
    for data in seeds:
        for number in range(14):
            run(odd(data, noise, number))


@pytest.mark.thorough  # what instruments the code takes seconds to begin
@pytest.mark.parametrize(
    ("target", "size"),
    [("vectornav", 8_000), *((name, 15_000) for name in CODECS)],
)
def test_no_bytes_raise_hang_or_leak(target: str, size: int, tmp_path: Path) -> None:
    figures = tmp_path / "fuzz.json"
    command = [sys.executable, "-m", "bench.fuzz", "--target", target, "--bytes", str(size), "--seed", "7"]
    command += ["--crashes", str(tmp_path / "crashes"), "--json", str(figures)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, timeout=200)
    assert done.returncode == 0, done.stdout
    (row,) = json.loads(figures.read_text())["targets"]
    assert row["bytes"] >= size and row["inputs"] > 2
    early_kb, late_kb = row["resident_kb"]
    assert late_kb - early_kb < 4000


def test_edited_configs_load_or_are_refused_in_one_line(tmp_path: Path) -> None:
    figures = tmp_path / "edits.json"
    command = [sys.executable, "-m", "bench.yaml_edits", "--edits", "250", "--jobs", "1", "--seed", "7"]
    done = subprocess.run(
        [*command, "--json", str(figures)], capture_output=True, text=True, check=False, cwd=ROOT, timeout=200
    )
    told = json.loads(figures.read_text())
    assert done.returncode == 0 and told["faults"] == [], told["faults"]
    assert told["refused"] > 120 and told["loaded"] > 12
