"""The page docs/cli.md, made from the commands themselves: `python -m asvhil.commands.reference` prints it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer

from asvhil.commands.cli import app

INTRODUCTION = """\
# Commands

Every command with its arguments and options. This page is made from the program:
`python -m asvhil.commands.reference > docs/cli.md`. `-h` after a command shows the same on the terminal, and
[operation.md](operation.md#exit-statuses) has the exit statuses. With `--json -` standard output has the
figures alone, and what else a command says goes to standard error.

Where CONFIG is asked for, the path of a YAML file is meant, or the name of a shipped one
([configuration.md](configuration.md)).
"""
WORDS = {"list[Path]": "paths", "list[str]": "texts", "str": "text", "int range": "integer", "float range": "number"}
WORDS |= {"int": "integer", "float": "number"}
LEFT_OUT = ("help", "install_completion", "show_completion")


def reference() -> str:
    """The page as Markdown: a section for each command, in the order of the program's help."""
    return "\n".join([INTRODUCTION, *_sections(typer.main.get_command(app), "asvhil")])


def _sections(command: Any, path: str) -> Iterator[str]:
    inner = getattr(command, "commands", None)
    if inner is None or path == "asvhil":
        yield f"## `{path}`\n"
        yield f"{_text(command.help)}\n"
        rows = [
            _row(parameter, typer.Context(command, info_name=path))
            for parameter in command.params
            if parameter.name not in LEFT_OUT
        ]
        if rows:
            yield "\n".join(["| | values | default | meaning |", "| --- | --- | --- | --- |", *rows]) + "\n"
    for name, part in (inner or {}).items():
        yield from _sections(part, f"{path} {name}")


def _row(parameter: Any, context: Any) -> str:
    """A row of a table: names, values, default and meaning."""
    if parameter.param_type_name == "option":
        names = [*parameter.opts, *parameter.secondary_opts]
        values = "" if parameter.is_flag else _values(parameter, context)
    else:
        names = [parameter.metavar or str(parameter.name).upper()]
        values = _values(parameter, context) if parameter.metavar is None else ""
    default = "required" if parameter.required else _default(parameter)
    cells = (", ".join(f"`{name}`" for name in names), values, default, _text(parameter.help))
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _values(parameter: Any, context: Any) -> str:
    """What a parameter takes: the name of its kind, and its range."""
    if parameter.metavar is not None:
        return str(parameter.metavar)
    kind = _text(str(parameter.display_type(context) or "")).strip("<>")
    kind = re.sub(rf"^({'|'.join(map(re.escape, WORDS))})$", lambda found: WORDS[found[1]], kind)
    limits = parameter._get_number_range_help_str() if hasattr(parameter, "_get_number_range_help_str") else ""
    text = re.sub(r"(\d)\.0\b", r"\1", f"{kind} {limits or ''}".strip())
    return text.replace("<=x<=", " to ").replace("x>=", "≥ ").replace("[", "").replace("]", "")


def _default(parameter: Any) -> str:
    value = parameter.default
    if callable(value) or value in (None, False, "", [], ()) or "default" in (parameter.help or ""):
        return ""
    return "on" if value is True else f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _text(text: str | None) -> str:
    return " ".join((text or "").split())


if __name__ == "__main__":
    print(reference(), end="")
