"""Which code made a run: a digest of the sources that determine its result."""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

QUOTES = '"' * 3
PACKAGE = Path(__file__).resolve().parents[1]
# Packages that determine the result of a run. How studies count, draw and show their runs does not.
DECISIVE = (
    *("types.py", "geo.py", "config", "io", "dynamics", "estimator", "controller", "autopilot", "supervisor", "motion"),
    *("operator", "backseat", "simplant", "logs", "study/trials"),
)


@functools.cache
def code_version() -> str:
    """The digest of the sources that determine the result of a run."""
    return digest_of(*(PACKAGE / name for name in DECISIVE))


def digest_of(*paths: Path) -> str:
    """First 12 hex digits of the SHA-256 over Python files and folders of them, without comments and docstrings."""
    digest = hashlib.sha256()
    for path in paths:
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(effective(source.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()[:12]


@functools.cache
def effective(source: str) -> str:
    """A source without docstrings, lines that are comments alone, and empty lines: what is left decides what it does.

    By line numbers, which are the same for every Python; the lines of other texts stay as they are.
    """
    tree = ast.parse(source)
    docs = [doc for node in _statements(tree) if (doc := _docstring(node)) is not None]
    without = {line for doc in docs for line in range(doc.lineno, (doc.end_lineno or 0) + 1)}
    texts: set[int] = set()
    if source.count(QUOTES) > 2 * len(docs):  # a text of several lines among them, as few modules have
        for node in ast.walk(tree):
            if isinstance(node, (ast.Constant, ast.JoinedStr)):
                texts |= set(range(node.lineno + 1, (node.end_lineno or 0) + 1))
    kept = []
    for number, line in enumerate(source.split("\n"), 1):
        bare = line.strip()
        if number not in without and (number in texts or (bare and not bare.startswith("#"))):
            kept.append(line)
    return "\n".join(kept)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """A node and the statements in it, however deep."""
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield from _statements(child)


def _docstring(node: ast.AST) -> ast.Constant | None:
    """The docstring of a definition, where it has lines of its own."""
    if not isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) or not node.body:
        return None
    first = node.body[0]
    if not isinstance(first, ast.Expr) or not isinstance(first.value, ast.Constant):
        return None
    alone = isinstance(node, ast.Module) or first.lineno > node.lineno
    return first.value if alone and isinstance(first.value.value, str) else None
