"""What decides outputs uses no function of NumPy whose last bits depend on the processor (docs/architecture.md)."""

import ast
from pathlib import Path

import pytest

import asvhil

ROOT = Path(asvhil.__file__).parent
CORE = ("autopilot", "backseat", "controller", "dynamics", "estimator", "io", "motion", "operator", "supervisor")
DEPENDENT = {
    *("linalg", "dot", "matmul", "vdot", "inner", "einsum", "tensordot", "convolve", "polynomial"),
    *(
        "exp",
        "expm1",
        "log",
        "log1p",
        "log2",
        "log10",
        "sin",
        "cos",
        "tan",
        "tanh",
        "arctan2",
        "arcsin",
        "arccos",
        "power",
    ),
}
# The QP, whose answer is rounded; a solver that has no promise; models in NumPy, which only plant and training use.
ALLOWED = {
    "controller/solvers/sqp.py": {"dot"},
    "controller/solvers/torch_lqr.py": {"linalg"},
    "dynamics/arrays.py": {"tanh"},
    "dynamics/integrate.py": {"cos", "sin"},
}
# Of whole numbers: `sum` of floats is another one from Python 3.12 on, `math.fsum` the same everywhere.
SUMS = {
    "autopilot/batteries.py": 1,
    "autopilot/readback.py": 3,
    "dynamics/weights.py": 1,
    "io/mavlink/frames.py": 1,
    "io/mavlink/messages.py": 1,
    "io/sensors/nmea.py": 1,
    "io/sensors/vectornav/binary.py": 1,
    "motion/distance.py": 1,
    "operator/encoding.py": 1,
}
FILES = sorted(file for room in CORE for file in (ROOT / room).rglob("*.py"))


def used(file: Path) -> set[str]:
    return {
        node.attr
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy")
    }


def sums_in(tree: ast.Module) -> int:
    """How often the builtin `sum` is called."""
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return sum(isinstance(called, ast.Name) and called.id == "sum" for called in calls)


def test_every_file_of_the_core_is_looked_at() -> None:
    assert len(FILES) > 100


@pytest.mark.parametrize("room", CORE)
def test_the_core_has_one_order_of_operations(room: str) -> None:
    found = {
        str(file.relative_to(ROOT)): used(file) & DEPENDENT for file in FILES if file.relative_to(ROOT).parts[0] == room
    }
    expected = {name: ALLOWED.get(name, set()) for name in found}
    assert found == expected


def test_the_core_sums_floats_the_same_in_every_python() -> None:
    found = {str(file.relative_to(ROOT)): sums_in(ast.parse(file.read_text())) for file in FILES}
    assert {name: count for name, count in found.items() if count} == SUMS
