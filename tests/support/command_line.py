"""The command line in this process: what it says, and its exit status, without the start of another interpreter."""

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest

from asvhil.commands.cli import main


class Said(NamedTuple):
    status: int
    out: str
    err: str


class Terminal(io.StringIO):
    """Standard input with somebody typing."""

    def isatty(self) -> bool:
        return True


def call(*arguments: str, cwd: Path, typed: str | None = None) -> Said:
    """Run `asvhil ARGUMENTS` in a folder; `typed`: what a person at the terminal enters, None: there is no terminal."""
    out, err = io.StringIO(), io.StringIO()
    status = 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.chdir(cwd)
        patch.setattr(sys, "argv", ["asvhil", *arguments])
        patch.setattr(sys, "stdin", io.StringIO() if typed is None else Terminal(typed))
        try:
            main()
        except SystemExit as end:
            status = int(end.code or 0)
    return Said(status, out.getvalue(), err.getvalue())


def refused(said: Said, words: str) -> None:
    """One line on stderr that holds the words, no traceback, and an exit status other than 0."""
    assert said.status != 0, said
    assert said.err.startswith("asvhil: ") and said.err.count("\n") == 1, said.err
    assert words in said.err, said.err
