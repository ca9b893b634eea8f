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
FILES = sorted(file for room in CORE for file in (ROOT / room).rglob("*.py"))


def used(file: Path) -> set[str]:
    return {
        node.attr
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "numpy")
    }


def test_every_file_of_the_core_is_looked_at() -> None:
    assert len(FILES) > 100


@pytest.mark.parametrize("room", CORE)
def test_the_core_has_one_order_of_operations(room: str) -> None:
    found = {
        str(file.relative_to(ROOT)): used(file) & DEPENDENT for file in FILES if file.relative_to(ROOT).parts[0] == room
    }
    expected = {name: ALLOWED.get(name, set()) for name in found}
    assert found == expected
