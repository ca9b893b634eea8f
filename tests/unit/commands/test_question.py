"""A question while an event loop runs, at a real pty: every way to answer it, and to leave it."""

import asyncio
import os
import pty
from collections.abc import Iterator

import pytest
import typer

from asvhil.commands import question
from asvhil.commands.question import agreed


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The keyboard's end of a terminal that is the standard input."""
    keyboard, screen = pty.openpty()
    with open(screen, encoding="utf-8") as terminal:
        monkeypatch.setattr(question.sys, "stdin", terminal)
        yield keyboard
    os.close(keyboard)


@pytest.mark.parametrize(
    ("typed", "answer"), [(b"y\n", True), (b"YES\n", True), (b"n\n", False), (b"\n", False), (b"\xff\ny\n", True)]
)
def test_it_is_asked_until_the_answer_is_yes_or_no(keys: int, typed: bytes, answer: bool) -> None:
    os.write(keys, typed)
    assert asyncio.run(agreed("Write it?")) is answer


def test_the_end_of_the_input_leaves_it_unanswered(keys: int) -> None:
    os.write(keys, b"\x04")
    with pytest.raises(typer.Abort):
        asyncio.run(agreed("Write it?"))


def test_it_can_be_given_up_and_the_loop_goes_on_meanwhile(keys: int) -> None:
    async def give_up() -> str:
        try:
            await asyncio.wait_for(agreed("Write it?"), 0.05)
        except TimeoutError:
            return "given up"
        return "answered"

    assert asyncio.run(give_up()) == "given up"
