"""Result pages: text above a marker line is written by people, text below it by commands."""

from __future__ import annotations

from pathlib import Path

from asvhil.errors import AsvhilError
from asvhil.files import replacement, shown

MARKER = "<!-- figures: everything below is written by the command -->"


def head_of(page: Path) -> bytes:
    """The bytes above the marker. AsvhilError for a page without one, which may be written by people as a whole."""
    if not page.exists():
        return b""
    lines = page.read_bytes().splitlines(keepends=True)
    for number, line in enumerate(lines):
        if line.strip() == MARKER.encode():
            return b"".join(lines[:number])
    raise AsvhilError(f"{page}: would be overwritten; add the line {MARKER} below what is to stay, or move the page")


def write_page(page: Path, text: str, mark: str = "") -> None:
    """Replace the text below the marker, atomically, by the mark of what it was made of and the text.

    The bytes above the marker are kept.
    """
    content = head_of(page) + shown(f"{MARKER}\n\n{mark}{text}").encode()
    with replacement(page) as part:
        part.write_bytes(content)
