"""Machine code gives the bits of CasADi's own evaluation, and is left out wherever anything about it is in doubt."""

import os
import platform
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from asvhil.backseat.build import build_model
from asvhil.config import load_config
from asvhil.controller.solvers import graphs
from asvhil.controller.solvers.problem import StationProblem
from asvhil.dynamics import buffers
from asvhil.estimator import covariance, measurement_model, monitor, wave_spectrum, weather
from asvhil.estimator.measurement_model import Comparison
from asvhil.estimator.prediction import MotionModel
from asvhil.estimator.states import B_E, D_N, SIZE
from asvhil.estimator.wave_spectrum import WaveSpectrum
from asvhil.machine_code import compiler
from asvhil.machine_code.compiler import SWITCH, Compiler, use_compiler
from asvhil.motion import bank
from asvhil.motion.monitor import MotionMonitor
from asvhil.types import GroundVelocity, Heading, Position, YawRate

pytestmark = pytest.mark.skipif(shutil.which("cc") is None and "CI" not in os.environ, reason="there is no C compiler")


@pytest.fixture(autouse=True)
def no_compiler_afterwards() -> Iterator[None]:
    before = buffers._evaluator
    buffers.evaluate_with(None)
    graphs.over_the_horizon.cache_clear()
    yield
    buffers.evaluate_with(before)
    graphs.over_the_horizon.cache_clear()


def wavy() -> ca.Function:
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y")
    return ca.Function("wavy", [x, y], [ca.tanh(x) * y + ca.sin(3.0 * x), ca.exp(-y) / (y + 0.1)])


def results(function: ca.Function, draw: Callable[[int], np.ndarray]) -> np.ndarray:
    arguments = [draw(function.nnz_in(i)) for i in range(function.n_in())]
    found = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
    buffers.bind(function, arguments, found)()
    return np.concatenate(found)


def assert_same_bits(one: ca.Function, other: ca.Function, spread: float = 0.1) -> None:
    """But for the sign of a zero: a sum that leaves out what is always zero may have the other."""
    for seed in range(10, 30):
        draws = [np.random.default_rng(seed) for _ in range(2)]
        first, second = (
            results(f, lambda n, rng=rng: rng.uniform(0.02, spread, n))  # type: ignore[misc]
            for f, rng in zip((one, other), draws, strict=True)
        )
        np.testing.assert_array_equal(first, second)


class Recorder:
    """An evaluator that remembers what was asked for, beside what it made of it."""

    def __init__(self, folder: Path) -> None:
        self._compiler = Compiler("cc", folder)
        self.made: list[tuple[ca.Function, ca.Function]] = []

    def __call__(self, function: ca.Function) -> ca.Function | None:
        compiled = self._compiler(function)
        assert compiled is not None
        self.made.append((function, compiled))
        return compiled


@pytest.mark.parametrize(
    ("config", "controller"),
    [
        ("sitl", "nnsem-mpc"),
        ("sitl-bream", "sd-mpc"),
        ("sitl-blueboat", "lagnet-mpc"),
    ],
)
def test_the_functions_of_controller_and_estimator_have_the_same_bits(
    tmp_path: Path, config: str, controller: str
) -> None:
    read = load_config(config, [f"controller.name={controller}"])
    model = build_model(read)
    recorder = Recorder(tmp_path)
    buffers.evaluate_with(recorder)
    StationProblem(model, read.controller.mpc)
    MotionModel(model, 60.0, np.ones(SIZE), np.ones(B_E + 1 - D_N))
    for functions in (monitor._functions, weather._function):
        functions.cache_clear()
    monitor.ModelMonitor(read.estimator.monitor, model, 0.2)
    weather.WeatherHeading(model, 60.0)
    for functions in (monitor._functions, weather._function):
        functions.cache_clear()
    made = {function.name(): (function, compiled) for function, compiled in recorder.made}
    of_filters = {"ekf_innovation", "ekf_correct"}  # here, or remembered by another test
    made = {name: each for name, each in made.items() if name not in of_filters}
    assert set(made) == {
        *("rollout", "linearised", "ekf_step", "ekf_specific_force", "monitor", "fold_monitor", "pushes")
    }
    for function, compiled in made.values():
        plain = function.expand() if function.is_a("MXFunction") else function
        assert_same_bits(plain, compiled)


def test_the_functions_of_filters_have_the_same_bits(tmp_path: Path) -> None:
    config = load_config("sitl")
    recorder = Recorder(tmp_path)
    buffers.evaluate_with(recorder)
    bank._for_all.cache_clear()
    MotionMonitor(config.supervisor.motion, config.estimator.ekf, config.believed_vessel)
    bank._for_all.cache_clear()
    remembered = (covariance._functions, measurement_model._function, wave_spectrum._function)
    for functions in remembered:
        functions.cache_clear()
    before = np.zeros(SIZE), np.zeros(SIZE * SIZE), np.ones(B_E + 1 - D_N)
    Comparison((Position, GroundVelocity), [1.0] * 4, *before)
    Comparison((Heading, YawRate), [1.0] * 2, *before)
    WaveSpectrum(0.2, 1.0)
    for functions in remembered:
        functions.cache_clear()
    names = {function.name() for function, _ in recorder.made}
    assert {"predict", "correct", "ekf_innovation", "ekf_correct", "wave_spectrum"} < names
    assert {"ekf_position_velocity", "ekf_heading_yaw_rate"} < names
    for function, compiled in recorder.made:
        assert_same_bits(function, compiled, spread=2.0)


def test_what_is_not_finite_stays_where_it_is(tmp_path: Path) -> None:
    function = wavy()
    compiled = Compiler("cc", tmp_path)(function)
    assert compiled is not None
    for bad in (np.nan, np.inf, -np.inf, 1e300, -0.0):
        values = [
            np.concatenate([np.array(part).ravel() for part in f([0.1, bad, 0.3], bad)]) for f in (function, compiled)
        ]
        np.testing.assert_array_equal(*values)


def test_it_is_compiled_once_and_found_again(tmp_path: Path) -> None:
    told: list[str] = []
    assert Compiler("cc", tmp_path, told.append)(wavy()) is not None
    (library,) = tmp_path.glob("*.so")
    assert len(told) == 1
    assert Compiler("a compiler that is not there", tmp_path)(wavy()) is None  # another command has another key
    written = library.stat().st_ino
    assert Compiler("cc", tmp_path, told.append)(wavy()) is not None
    assert (library.stat().st_ino, len(told)) == (written, 1)


@pytest.mark.parametrize("content", [b"", b"\x7fELF half of a library", b"no library at all"])
def test_a_damaged_library_is_not_used_and_made_anew_next_time(tmp_path: Path, content: bytes) -> None:
    assert Compiler("cc", tmp_path)(wavy()) is not None
    (library,) = tmp_path.glob("*.so")
    library.unlink()  # a file that is loaded may not be written to
    library.write_bytes(content)
    assert Compiler("cc", tmp_path)(wavy()) is None
    compiled = Compiler("cc", tmp_path)(wavy())
    assert compiled is not None
    assert_same_bits(wavy(), compiled)


def script(path: Path, text: str) -> str:
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.parametrize("text", ["exit 1", "echo nonsense >&2; exit 0", "kill -9 $$"])
def test_a_compiler_that_fails_leaves_all_to_casadi(tmp_path: Path, text: str) -> None:
    command = script(tmp_path / "bad-cc", text)
    (tmp_path / "made").mkdir()
    buffers.evaluate_with(Compiler(command, tmp_path / "made"))
    function = wavy()
    assert buffers.fastest(function) is function
    assert list((tmp_path / "made").iterdir()) == []


def test_a_compiler_that_fails_is_not_asked_again_for_the_same(tmp_path: Path) -> None:
    compiler = Compiler(script(tmp_path / "bad-cc", f"echo asked >> {tmp_path}/asked; exit 1"), tmp_path)
    assert [compiler(wavy()) for _ in range(3)] == [None] * 3
    assert (tmp_path / "asked").read_text() == "asked\n"


@pytest.mark.parametrize("wrong", ["-Dtanh=sin", "-Dexp=expm1"])
def test_a_compiler_that_makes_other_numbers_is_found_out(tmp_path: Path, wrong: str) -> None:
    command = script(tmp_path / "wrong-cc", f'exec cc {wrong} "$@"')
    (tmp_path / "made").mkdir()
    assert Compiler(command, tmp_path / "made")(wavy()) is None


def sums_of_products() -> ca.Function:
    a, b = ca.SX.sym("a", 6, 6), ca.SX.sym("b", 6)
    return ca.Function("sums_of_products", [a, b], [a @ b + b])


@pytest.fixture
def fusing(tmp_path: Path) -> str:
    """A compiler that fuses products with sums where it may, as GCC does on aarch64 from -O2 on."""
    if platform.machine() == "x86_64" and "fma" not in Path("/proc/cpuinfo").read_text().split():
        pytest.skip("this processor has no fused multiply-add")
    (tmp_path / "made").mkdir()
    fma = "-mfma" if platform.machine() == "x86_64" else ""
    return script(tmp_path / "fusing-cc", f'exec cc {fma} -fexpensive-optimizations "$@"')


def test_products_are_not_fused_with_sums(tmp_path: Path, fusing: str) -> None:
    compiled = Compiler(fusing, tmp_path / "made")(sums_of_products())
    assert compiled is not None
    assert_same_bits(sums_of_products(), compiled)


def test_a_compiler_that_fuses_in_spite_of_that_is_found_out(
    tmp_path: Path, fusing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    flags = tuple(flag.replace("-ffp-contract=off", "-ffp-contract=fast") for flag in compiler.FLAGS)
    monkeypatch.setattr(compiler, "FLAGS", flags)
    assert Compiler(fusing, tmp_path / "made")(sums_of_products()) is None
    assert len(list((tmp_path / "made").glob("*.so"))) == 1


def test_the_oldest_libraries_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("asvhil.machine_code.compiler.KEPT", 2)
    for age in range(3):
        old = tmp_path / f"old-{age}.so"
        old.touch()
        os.utime(old, (1000.0 - age, 1000.0 - age))
    assert Compiler("cc", tmp_path)(wavy()) is not None
    assert {path.name.partition("-")[0] for path in tmp_path.glob("*.so")} == {"old", "wavy"}
    assert (tmp_path / "old-0.so").exists()


def test_without_a_compiler_what_was_composed_is_scalar_operations() -> None:
    x = ca.MX.sym("x", 3)
    composed = ca.Function("composed", [x], [wavy()(x, 2.0)[0]])
    assert buffers.fastest(composed).is_a("SXFunction")


class TestUse:
    def test_it_is_used_from_then_on(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv(SWITCH, str(tmp_path / "made"))
        assert use_compiler()
        assert not buffers.fastest(wavy()).is_a("SXFunction")
        assert (tmp_path / "made").stat().st_mode & 0o777 == 0o700

    def test_the_users_cache_is_the_folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv(SWITCH, raising=False)
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        assert use_compiler()
        buffers.fastest(wavy())
        assert len(list((tmp_path / "asvhil" / "machine-code").glob("wavy-*.so"))) == 1

    def test_off_is_off(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv(SWITCH, "off")
        assert not use_compiler()
        assert buffers.fastest(wavy()).is_a("SXFunction")

    def test_no_compiler(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv(SWITCH, str(tmp_path))
        monkeypatch.setenv("CC", "a compiler that is not there")
        assert not use_compiler()

    @pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
    def test_a_folder_in_which_others_may_write_is_not_used(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
    ) -> None:
        monkeypatch.setenv(SWITCH, str(tmp_path / "open"))
        (tmp_path / "open").mkdir()
        (tmp_path / "open").chmod(mode)
        assert not use_compiler()

    def test_a_folder_that_cannot_be_made(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "file").touch()
        monkeypatch.setenv(SWITCH, str(tmp_path / "file" / "folder"))
        assert not use_compiler()
