"""What all commands and groups of the command line have in common: help without types of flags, errors in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from asvhil.files import is_folder

# Typer exports only the last of these three; UsageError has the context of the command.
UsageError: Any = typer.BadParameter.__mro__[1]
ClickException: Any = typer.BadParameter.__mro__[2]

HELP = {"help_option_names": ["-h", "--help"]}


class PlainCommand(TyperCommand):
    """A command whose help shows flags without a value, which they do not take."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _plain(super().get_params(ctx))


class PlainGroup(TyperGroup):
    """The same of a group of commands."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _plain(super().get_params(ctx))


def _plain(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if isinstance(parameter, TyperOption) and parameter.is_flag:
            parameter.metavar = ""
    return parameters


def show_flags_plainly(app: typer.Typer) -> None:
    """Apply the classes above to an app, its commands and its sub-apps."""
    app.info.cls = PlainGroup
    for command in app.registered_commands:
        command.cls = PlainCommand
    for group in app.registered_groups:
        if group.typer_instance is not None:
            show_flags_plainly(group.typer_instance)


def one_line(error: Any) -> str:
    """What was wrong with the words of a command line, and where its help is; empty where help was shown instead."""
    if type(error).__name__ == "NoArgsIsHelpError":
        return ""
    _reword(error)
    message = " ".join(error.format_message().split()).rstrip(".")
    message = message[:1].lower() + message[1:]
    context = getattr(error, "ctx", None)
    where = f"; `{context.command_path} -h` tells what it takes" if context is not None else ""
    return f"{message}{where}"


def _reword(error: Any) -> None:
    """Tell a value that an option cannot have in the words of the config's errors."""
    cause = error.__cause__
    if not hasattr(cause, "errors") or not hasattr(error, "message"):
        return
    from asvhil.config.told import option_wanted

    given = str(cause.errors()[0]["input"])
    error.message = option_wanted(cause, given) or error.message


def config_names(incomplete: str) -> list[str]:
    """Shipped configs by name, and YAML files and folders here: what a shell may complete a config to."""
    from asvhil.config.loading import shipped_names

    names = [name for name in shipped_names() if name.startswith(incomplete)]
    folder, _, start = incomplete.rpartition("/")
    place = Path(folder or ("/" if incomplete.startswith("/") else "."))
    prefix = f"{folder}/" if "/" in incomplete else ""
    try:
        files = sorted(path for path in place.iterdir() if path.name.startswith(start))
    except OSError:
        return names
    found = [f"{prefix}{path.name}{'/' if is_folder(path) else ''}" for path in files if _may_be_config(path)]
    return [*names, *found]


def _may_be_config(path: Path) -> bool:
    return is_folder(path) or path.suffix in (".yaml", ".yml")
