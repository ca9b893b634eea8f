"""Imports between packages point one way, and the core never touches sockets, files, clocks or torch.

A room is a package of `asvhil/`, or one of the few modules at its top. A room never imports one that stands after it in
the list below.
"""

import ast
import functools
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.support.paths import ROOT

PACKAGE = ROOT / "asvhil"
CORE = [
    "errors",
    "types",
    "geo",
    "files",
    "config",
    "supervisor",
    "io",
    "dynamics",
    "motion",
    "estimator",
    "controller",
    "autopilot",
]
CORE += ["operator", "backseat"]
SHELL = [
    "machine_code",
    "links",
    "logs",
    "simplant",
    "sitl",
    "daemon",
    "collect",
    "preflight",
    "train",
    "study",
    "dashboard",
    "commands",
    "__main__",
]
ORDER = CORE + SHELL
LOOSE = {"errors", "types", "geo", "files", "collect", "sitl", "__main__", "__init__"}
MOST_ROOMS = 28
IMPURE = {"asyncio", "socket", "serial", "serial_asyncio_fast", "time", "datetime", "random", "threading", "subprocess"}
EVERYWHERE_FORBIDDEN = {"pymavlink.mavutil"}
MODULES = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in sorted(PACKAGE.rglob("*.py"))}


@functools.cache
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


def own_imports(module: str) -> set[str]:
    """Modules of the package that a module imports, without the leading `asvhil.`."""
    names = {name.removeprefix("asvhil.") for name in imports_of(MODULES[module]) if name.startswith("asvhil.")}
    return {name for name in names if name in MODULES or f"{name}.__init__" in MODULES}


def room(module: str, depth: int = 1) -> str:
    """The package that a module is in, down to a depth; a module at the top is a room of its own."""
    parts = module.split(".")
    return ".".join(parts[: min(depth, len(parts) - 1)]) or parts[0]


def test_the_rooms_are_those_of_the_order() -> None:
    rooms = {room(module) for module in MODULES} - {"__init__"}
    assert rooms == set(ORDER)
    assert len(rooms) <= MOST_ROOMS


def test_no_module_is_loose_at_the_top() -> None:
    assert {path.stem for path in PACKAGE.glob("*.py")} == LOOSE


@pytest.mark.parametrize("module", [name for name in MODULES if name != "__init__"])
def test_imports_point_one_way(module: str) -> None:
    for other in own_imports(module):
        assert ORDER.index(room(other)) <= ORDER.index(room(module)), f"{module} imports {other}"


@pytest.mark.parametrize("depth", [1, 2])
def test_no_circle_between_rooms(depth: int) -> None:
    graph: dict[str, set[str]] = {}
    for module in MODULES:
        mine = room(module, depth)
        others = {room(other, depth) for other in own_imports(module) if other in MODULES}
        graph.setdefault(mine, set()).update(others - {mine})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"a circle: {' imports '.join(reversed(error.args[1]))}")


def test_no_two_classes_have_one_name() -> None:
    homes: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(module)
    assert {name: modules for name, modules in homes.items() if len(modules) > 1} == {}


def test_the_architecture_page_names_the_same_rooms() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text()
    table = text.partition("## Layers")[2].partition("\n## ")[0]
    named = [
        word for line in table.splitlines() if line.startswith("| `") for word in line.split("|")[1].split("`")[1::2]
    ]
    assert [name.rstrip("/") for name in named] == [name for name in ORDER if name != "__main__"]


@pytest.mark.parametrize("module", [name for name in MODULES if room(name) in CORE])
def test_the_core_is_pure(module: str) -> None:
    roots = {name.split(".")[0] for name in imports_of(MODULES[module])}
    assert not roots & IMPURE, f"{module} imports {roots & IMPURE}"


def test_the_core_finds_kinds_by_name_in_one_module_alone() -> None:
    """Imports by name and entry points read files: at start-up, where a config is read and a backseat is built."""
    found = [m for m in MODULES if room(m) in CORE and any(n.startswith("importlib") for n in imports_of(MODULES[m]))]
    assert found == ["config.registry"]


@pytest.mark.parametrize("module", MODULES)
def test_no_mavutil(module: str) -> None:
    assert not imports_of(MODULES[module]) & EVERYWHERE_FORBIDDEN


# Of the command line: each takes a tenth of a second or more, of every `asvhil --help` and of each completed name.
WAITS_FOR_A_COMMAND = ("asyncio", "casadi", "numpy", "pydantic", "yaml", "asvhil.config")
NOT_ON_THE_BOAT = ("torch", "matplotlib", "pymavlink.mavutil", "asvhil.simplant.plant")


@pytest.mark.parametrize(
    ("imported", "left_out"),
    [("asvhil.commands.cli", WAITS_FOR_A_COMMAND), ("asvhil.daemon.daemon, asvhil.commands.cli", NOT_ON_THE_BOAT)],
    ids=["command line", "daemon"],
)
def test_what_is_heavy_is_not_imported_by(imported: str, left_out: tuple[str, ...]) -> None:
    code = f"import sys, {imported}\nsys.exit(', '.join(m for m in {left_out} if m in sys.modules) or 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
