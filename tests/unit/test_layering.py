"""Imports point up the layout only, and the core never touches sockets, files, clocks or torch."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "asvhil"

# Lower layers may import higher ones of this list, never the other way round.
CORE = [
    ["types", "errors"],
    ["geo", "io.endpoints.spec"],
    ["config"],
    ["dynamics"],
    ["io.mavlink", "io.nmea", "io.nmea_sentences", "io.vectornav", "io.firmware"],
    ["io.streams", "io.mavlink_sensors", "io.signing", "io.timesync", "io.gate", "io.router"],
    ["io.outputs", "io.parameters", "io.requirements", "io.rover_parameters", "io.px4_parameters", "io.protocol"],
    ["io.autopilot", "io.ardurover", "io.px4", "io.goto", "io.parameter_server"],
    ["io.operator_reports"],
    ["io.operator"],
    ["estimator"],
    ["controller"],
    ["output_models", "mode_keeper", "pilot_watch", "stations", "known", "tunables"],
    ["supervisor", "cadence", "output_watch"],
    ["motor_check", "operations"],
    ["backseat"],
    ["build"],
]
SHELL = [
    ["clock", "io.endpoint", "io.endpoints", "io.encoding", "io.foxglove", "io.recorder", "io.logfile", "io.tlog"],
    ["io.keyfile"],
    ["replay", "operator_client", "status", "hub"],
    ["simplant", "train"],
    ["study"],
    ["daemon"],
    ["sitl"],
    ["collect", "preflight"],
    ["commands"],
    ["cli"],
    ["__main__"],
]
LAYERS = CORE + SHELL
IMPURE = {"asyncio", "socket", "serial", "serial_asyncio_fast", "time", "datetime", "random", "threading", "subprocess"}
EVERYWHERE_FORBIDDEN = {"pymavlink.mavutil"}


def modules() -> dict[str, Path]:
    found = {}
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        if name.endswith("__init__"):
            continue
        found[name] = path
    return found


def layer_of(module: str) -> int:
    for number, names in enumerate(LAYERS):
        if any(module == name or module.startswith(f"{name}.") for name in names):
            return number
    raise AssertionError(f"{module} has no layer: give it one in this test")


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module or "")
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


@pytest.mark.parametrize("module", sorted(modules()))
def test_imports_point_up(module: str) -> None:
    mine = layer_of(module)
    known = modules()
    for name in imports_of(modules()[module]):
        if name.startswith("asvhil.") and name.removeprefix("asvhil.") in known:
            other = name.removeprefix("asvhil.")
            same_package = module.split(".")[0] == other.split(".")[0]
            assert layer_of(other) < mine or (layer_of(other) == mine and same_package), f"{module} imports {other}"


@pytest.mark.parametrize("module", [name for name in sorted(modules()) if layer_of(name) < len(CORE)])
def test_the_core_is_pure(module: str) -> None:
    roots = {name.split(".")[0] for name in imports_of(modules()[module])}
    assert not roots & IMPURE, f"{module} imports {roots & IMPURE}"


@pytest.mark.parametrize("module", sorted(modules()))
def test_no_mavutil(module: str) -> None:
    assert not imports_of(modules()[module]) & EVERYWHERE_FORBIDDEN


def test_the_daemon_imports_neither_torch_nor_matplotlib_nor_mavutil() -> None:
    code = (
        "import sys, asvhil.daemon, asvhil.cli\n"
        "bad = [m for m in ('torch', 'matplotlib', 'pymavlink.mavutil', 'asvhil.simplant.plant') if m in sys.modules]\n"
        "sys.exit(', '.join(bad) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
