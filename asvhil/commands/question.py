"""A question at the terminal while an event loop runs: its links go on, and Ctrl-C ends it at once."""

from __future__ import annotations

import asyncio
import os
import sys

import typer

ANSWERS = {"y": True, "yes": True, "n": False, "no": False, "": False}


async def agreed(question: str) -> bool:
    """Yes or no, asked again for anything else; Enter alone is no. Raises typer.Abort at the end of the input.

    A thread that waits in `typer.confirm` could not be ended: asyncio would wait for it after Ctrl-C, for ever.
    """
    while True:
        typer.echo(f"{question} [y/N]: ", nl=False)
        answer = ANSWERS.get((await _typed_line()).strip().lower())
        if answer is not None:
            return answer
        typer.echo("y or n is expected")


async def _typed_line() -> str:
    """What is typed, once Enter has been pressed: only then has a terminal anything to read."""
    loop, typed, terminal = asyncio.get_running_loop(), asyncio.Event(), sys.stdin.fileno()
    loop.add_reader(terminal, typed.set)
    try:
        await typed.wait()
    finally:
        loop.remove_reader(terminal)
    line = os.read(terminal, 1024)
    if not line:
        raise typer.Abort
    return line.decode(errors="replace")
