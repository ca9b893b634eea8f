"""Result pages: people write above a marker line, commands below it."""

from __future__ import annotations

import os
from pathlib import Path

from asvhil.errors import AsvhilError

MARKER = "<!-- figures: everything below is written by the command -->"


def head_of(page: Path) -> bytes:
    """What is above the marker, byte for byte. AsvhilError where there is none: all may be someone's words."""
    if not page.exists():
        return b""
    lines = page.read_bytes().splitlines(keepends=True)
    for number, line in enumerate(lines):
        if line.strip() == MARKER.encode():
            return b"".join(lines[:number])
    raise AsvhilError(f"{page}: would be overwritten; add the line {MARKER} below what is to stay, or move the page")


def write_page(page: Path, text: str) -> None:
    """The text below the marker, and what stood above it as it was, whatever happens in writing."""
    content = head_of(page) + f"{MARKER}\n\n{text}".encode()
    target = page.resolve()
    draft = target.with_name(f".{target.name}.tmp")
    try:
        draft.write_bytes(content)
        os.replace(draft, target)
    finally:
        draft.unlink(missing_ok=True)
