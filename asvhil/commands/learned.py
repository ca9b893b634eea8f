"""Shared by the commands that learn on station: what an earlier run has left, and what this one keeps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from asvhil.commands.outputs import check_writable, writing
from asvhil.errors import AsvhilError

if TYPE_CHECKING:
    from asvhil.config import Config
    from asvhil.logs.learned_file import LearnedKeeper


def with_learned(config: Config, name: str, overrides: Sequence[str], file: Path | None) -> Config:
    """The config, with what a file of --learned holds; without one, a line on stderr on what could be taken."""
    from asvhil.config import load_config
    from asvhil.logs.learned_file import offer, taken

    if file is not None:
        return load_config(name, (*overrides, *taken(file, config)))
    offered = offer(config)
    if offered is not None:
        typer.echo(f"asvhil: learned on station: {offered.text}", err=True)
    return config


def check_kept(config: Config) -> None:
    """AsvhilError before a run where what it learns on station could not be written at its end."""
    from asvhil.logs.learned_file import learned_path

    if not (config.learning.enabled and config.learning.adapt):
        return
    path = learned_path(config)
    with writing(path, "learning.file "):
        path.parent.mkdir(parents=True, exist_ok=True)
    check_writable(path, "learning.file ")


def tell_kept(keeper: LearnedKeeper) -> None:
    """Save what was learned, and say where; or why not, which ends nothing: the run is over."""
    try:
        path = keeper.save()
    except AsvhilError as error:
        typer.echo(f"asvhil: {error}", err=True)
        return
    if path is not None:
        typer.echo(f"asvhil: learned on station: kept in {path}; the next start offers it", err=True)
