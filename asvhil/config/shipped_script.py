"""The script for an ArduRover that comes with this program, and where scripts are."""

from __future__ import annotations

from pathlib import Path

from asvhil.errors import ConfigError

NAME = "asvhil.lua"
CARD_FOLDER = "/APM/scripts"  # of a board with a memory card


def shipped_script() -> str:
    """Its text. Raises ConfigError where it is missing."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "shipped_script", package.parent / "firmware" / "ardupilot_script"):
        if (folder / NAME).is_file():
            return (folder / NAME).read_text(encoding="ascii")
    raise ConfigError(f"{NAME}: it is missing from this installation of asvhil")
