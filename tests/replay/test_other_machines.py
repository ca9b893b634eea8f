"""Logs of other machines: exact where only BLAS and daqp differ, followed where the C library's functions do."""

import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.controller.solvers import sqp
from asvhil.logs.following import follow
from asvhil.logs.machine import arithmetic_digest, differences, machine
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of, recorded_model, replay
from asvhil.sitl import run_lockstep
from tests.replay.test_replay import rewrite

# Kernels that OpenBLAS has for other processors of the same kind.
KERNELS = {"x86_64": ("Nehalem", "Haswell"), "aarch64": ("ARMV8", "CORTEXA57")}
PLAIN_LOOPS = {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"}  # of NumPy, for the oldest processors that it has
WAVES = ("plant.weather.waves.orbital_std_mps=0.1", "plant.weather.waves.yaw_std_radps=0.03")
WITHOUT_FMA = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA_Usable,-AVX2_Usable"}
WIND = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90", "plant.seed=3")
BLAS = """
import hashlib, numpy
a = numpy.random.default_rng(0).normal(size=(120, 40))
print(hashlib.sha256((a.T @ a).tobytes()).hexdigest())
"""


RECORD = """
import sys
from pathlib import Path
from asvhil.config import load_config
from asvhil.sitl import run_lockstep
run_lockstep(load_config('sitl', tuple(sys.argv[2:])), Path(sys.argv[1]), 25.0)
"""


def python(code: str, *arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120.0,
    )
    return done.stdout.strip()


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("machines") / "log.mcap"
    # An NNSEM has tanh functions in each step; a LagNet's run is the same without fused multiply-add to the bit.
    run_lockstep(load_config("sitl", (*WIND, "controller.name=nnsem-mpc")), path, 12.0)
    return path


@pytest.fixture(scope="module")
def without_fma() -> dict[str, str]:
    """What makes the C library take its functions for a processor without fused multiply-add."""
    code = "from asvhil.logs.machine import arithmetic_digest; print(arithmetic_digest())"
    if platform.machine() != "x86_64" or python(code, **WITHOUT_FMA) == arithmetic_digest():
        pytest.skip("this processor has no fused multiply-add that could be hidden from the C library")
    return WITHOUT_FMA


@pytest.mark.thorough
def test_a_log_of_another_blas_replays_to_the_byte(tmp_path: Path) -> None:
    a = np.random.default_rng(0).normal(size=(120, 40))
    here = hashlib.sha256((a.T @ a).tobytes()).hexdigest()
    kernel = next((one for one in KERNELS[platform.machine()] if python(BLAS, OPENBLAS_CORETYPE=one) != here), None)
    assert kernel is not None, "no other kernel gives other bits, so this test would show nothing"
    python(RECORD, str(tmp_path / "log.mcap"), *WIND, OPENBLAS_CORETYPE=kernel)
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == 503
    assert result.other_machine == ()


@pytest.mark.parametrize(("of_matrix", "of_step", "exact"), [(1e-14, 1e-11, True), (0.0, 1e-5, False)])
def test_whatever_the_last_bits_of_blas_and_daqp_are(
    log: Path, monkeypatch: pytest.MonkeyPatch, of_matrix: float, of_step: float, exact: bool
) -> None:
    """As a kernel would give them that no machine at hand has: the QP's matrix and its answer are off at random.

    By as much as has been seen between kernels nothing changes; by a hundredth of a pulse it does, and is found.
    """
    noise, solve = np.random.default_rng(5), sqp.daqp.solve

    def off(hessian: np.ndarray, *others: Any) -> Any:
        bent = 1.0 + of_matrix * noise.uniform(-1.0, 1.0, hessian.shape)
        step, *rest = solve(hessian * np.sqrt(bent * bent.T), *others)
        return step + of_step * noise.uniform(-1.0, 1.0, step.shape), *rest

    monkeypatch.setattr(sqp.daqp, "solve", off)
    result = replay(log)
    assert (result.mismatch is None) is exact


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the features that are switched off are those of x86-64")
@pytest.mark.thorough
def test_a_log_of_plain_loops_in_waves_replays_to_the_byte(tmp_path: Path) -> None:
    python(RECORD, str(tmp_path / "log.mcap"), *WIND, *WAVES, **PLAIN_LOOPS)
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == 503


@pytest.mark.thorough
def test_a_processor_without_fma_follows_the_record(log: Path, without_fma: dict[str, str], tmp_path: Path) -> None:
    code = "from asvhil.commands.cli import main; main()"
    out = python(code, "replay", str(log), "--json", str(tmp_path / "out.json"), **without_fma)
    figures = json.loads((tmp_path / "out.json").read_text())
    followed = figures["followed"]
    assert figures["compared"] == 243 and not figures["exact"]
    assert followed["differing"] > 10 and followed["beyond"] is None
    assert 0.0 < followed["largest"]["size"] < 1e-9
    assert "the same within 1e-06 on a machine of other arithmetic" in " ".join(out.split())
    assert any(line.startswith("arithmetic: ") for line in figures["other_machine"])


def test_there_a_flipped_bit_is_still_found(log: Path, without_fma: dict[str, str], tmp_path: Path) -> None:
    tick = next(
        number
        for number, (inputs, _) in enumerate(LogFile(log).ticks())
        if number > 150 and any(frame.port == "anemometer" for frame in inputs.frames)
    )
    rewrite(log, tmp_path / "flipped.mcap", tick, ("anemometer", 9, 0))
    code = (
        "import sys\nfrom pathlib import Path\nfrom asvhil.logs.replay import replay\n"
        "print(replay(Path(sys.argv[1])).followed.beyond.tick)"
    )
    assert int(python(code, str(tmp_path / "flipped.mcap"), **without_fma)) == tick


def test_what_follows_a_log_of_this_machine_finds_nothing(log: Path) -> None:
    file = LogFile(log)
    with recorded_model(file, log) as model:
        followed = follow(file, config_of(file, log), model, lambda ticks: None)
    assert (followed.compared, followed.differing, followed.beyond, followed.largest) == (243, 0, None, None)


def test_a_log_tells_its_machine_and_what_is_another_is_named() -> None:
    here = machine()
    assert here["machine"] == platform.machine() and here["cpu"] and here["libc"] and len(here["arithmetic"]) == 12
    assert differences(dict(here)) == []
    assert differences({**here, "libc": "musl 1.2"}) == [f"libc: musl 1.2 recorded, {here['libc']} here"]
    assert any(line.startswith("arithmetic: unknown recorded") for line in differences({}))
