"""What a page of results was made of: digests of the code and files that decide it, and what has changed since."""

from __future__ import annotations

import ast
import functools
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from asvhil.backseat.build import model_file
from asvhil.config import load_config
from asvhil.config.loading import config_files
from asvhil.study.code_version import PACKAGE, digest_of
from asvhil.study.page import MARKER
from asvhil.types import record

ROOT = PACKAGE.parent
# Reached by the imports of studies, without a say in their figures: kinds of errors, machine code, which gives the same
# bits, and what runs, stores and shows studies.
WITHOUT_SAY = frozenset(
    ["__init__.py", "errors.py", "machine_code", "commands"]
    + [f"study/{name}.py" for name in ("__init__", "runner", "executors", "store", "page", "code_version", "made_of")]
)
BEGIN, END = "<!-- made of ", " -->"
ENOUGH = 20  # runs that came out the same: were one in seven changed, a draw of 20 would miss it once in 20 times

Digests = Mapping[str, str]


@record
class PageState:
    """A page and whether it is as its command would make it now.

    `state` is "fresh"; "confirmed": its runs are of older code, and enough of them, drawn at random, were run again by
    the present code and came out the same; "older", with the parts that have `changed`; "unmarked": made by a command
    that did not yet say of what; or "by people", who wrote all of it. `code` is the digest of all parts.
    """

    page: str
    state: str
    changed: tuple[str, ...] = ()
    code: str = ""

    def figures(self) -> dict[str, Any]:
        """All of it for JSON."""
        return {"page": self.page, "state": self.state, "changed": list(self.changed), "code": self.code}


def made_of(modules: Iterable[str], files: Iterable[Path] = ()) -> dict[str, str]:
    """The digests, by name, of the parts that modules ("study/bound.py") import, directly or not, and of files.

    A part is a package or module of asvhil, or one module of `study`. Packages count as a whole: they load their own
    modules by name too.
    """
    parts = {_part(module) for module in _reached(PACKAGE / module for module in modules)}
    digests = {part: digest_of(PACKAGE / part) for part in sorted(parts) if part not in WITHOUT_SAY}
    return digests | {_name(file): _of_file(file) for file in sorted(set(files))}


def run_files(base: str, *choices: tuple[str, ...]) -> list[Path]:
    """The files behind runs of a config under choices of overrides: it, those below it, plug-ins and models."""
    files = config_files(base)
    for keys in choices or ((),):
        config = load_config(base, keys)
        files += [Path(plugin.file) for plugin in config.plugins]
        model = model_file(config)
        files += [] if model is None else [model]
    return files


def mark_of(parts: Digests, runs_of_other_code: int = 0, again: int = 0, changed: int = 0) -> str:
    """The lines at the top of the figures that say what they were made of.

    `again` runs of other code were run again by this code, of which `changed` came out otherwise.
    """
    tree = {"runs_of_other_code": runs_of_other_code, "again": again, "changed": changed, "parts": dict(parts)}
    words = f"Made by code `{_whole(parts)}`"
    if runs_of_other_code:
        words += f"; {runs_of_other_code} of its runs are of other code"
    if again:
        came = f"{changed} of them came out otherwise" if changed else "each came out the same, to the last digit"
        words += f"; {again} that were of other code, drawn at random, were run again by this one: {came}"
    return f"{BEGIN}{json.dumps(tree)}{END}\n{words}. `asvhil study pages` says whether that is still the code.\n\n"


def state_of(page: Path, name: str) -> PageState:
    """What has changed since a page was made. `name` is what it is called."""
    _, marker, below = page.read_text(encoding="utf-8").partition(MARKER)
    if not marker:
        return PageState(page=name, state="by people")
    mark = next((line for line in below.splitlines() if line.startswith(BEGIN)), None)
    if mark is None:
        return PageState(page=name, state="unmarked")
    try:
        tree = json.loads(mark.removeprefix(BEGIN).removesuffix(END))
        then, others = dict(tree["parts"]), int(tree["runs_of_other_code"])
        again, differ = int(tree.get("again", 0)), int(tree.get("changed", 0))
    except (ValueError, KeyError, TypeError):
        return PageState(page=name, state="unmarked", changed=("its mark cannot be read",))
    changed = [part for part, digest in then.items() if _now(part) != digest]
    if differ and others:  # else every run is of one code by now
        changed.append(f"{differ} of {again} runs of other code came out otherwise when run again")
    elif others and again < ENOUGH:
        changed.append(f"{others} runs of other code")
    state = "older" if changed else "confirmed" if others else "fresh"
    return PageState(page=name, state=state, changed=tuple(changed), code=_whole(then))


def _whole(parts: Digests) -> str:
    return hashlib.sha256(json.dumps(dict(parts), sort_keys=True).encode()).hexdigest()[:12]


def _now(part: str) -> str:
    """The digest of a part as it is; "" where it is gone."""
    inside = PACKAGE / part
    if inside.exists():
        return digest_of(inside)
    file = ROOT / part
    return _of_file(file) if file.is_file() else ""


def _of_file(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:12]


def _name(file: Path) -> str:
    """The path within the checkout; of a file elsewhere its name, under which nothing is found again."""
    path = file.resolve()
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name


def _part(module: Path) -> str:
    inside = module.relative_to(PACKAGE)
    return inside.as_posix() if inside.parts[0] == "study" else inside.parts[0]


def _reached(modules: Iterable[Path]) -> set[Path]:
    """The modules of asvhil that these import, anywhere in them and in what they import."""
    found: set[Path] = set()
    waiting = list(modules)
    while waiting:
        module = waiting.pop()
        if module not in found:
            found.add(module)
            if _part(module) not in WITHOUT_SAY:
                waiting += _imports(module)
    return found


def _imports(module: Path) -> list[Path]:
    names = _imported(module.read_bytes())
    paths = [PACKAGE.joinpath(*name.split(".")[1:]) for name in names if name.split(".")[0] == PACKAGE.name]
    files = [file for path in paths for file in (path.with_suffix(".py"), path / "__init__.py")]
    return [file for file in files if file.is_file()]


@functools.cache
def _imported(source: bytes) -> frozenset[str]:
    """The names that a source imports, anywhere in it."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)
