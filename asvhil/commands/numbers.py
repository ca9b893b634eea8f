"""Numbers on the command line: parsed in the usual notations, or refused in one line."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable
from typing import Any

import typer

from asvhil.errors import ConfigError

_DEGREES = re.compile(
    r"\s*([NSEW]?)\s*([+-]?[0-9]{1,3}(?:\.[0-9]*)?|[+-]?\.[0-9]+)\s*[\u00b0\u00ba]?\s*([NSEW]?)\s*", re.ASCII
)
AT_FORM = "LAT,LON in degrees is expected, such as 40.4237,-86.9212"


def lat_lon(option: str, text: str) -> tuple[float, float]:
    """(latitude, longitude) of LAT,LON in degrees; blanks, degree signs, N, S, E and W are allowed. ConfigError."""
    parts = text.strip().upper().replace("DEG", "\u00b0").split(",")
    if len(parts) in (3, 4):
        raise ConfigError(f"{option} {text}: {AT_FORM}, with points for decimals")
    found = [_DEGREES.fullmatch(part) for part in parts]
    if len(found) != 2 or found[0] is None or found[1] is None:
        raise ConfigError(f"{option} {text}: {AT_FORM}")
    lat_deg, lon_deg = (_signed(match, *letters) for match, letters in zip(found, ("NS", "EW"), strict=True) if match)
    if lat_deg is None or lon_deg is None:
        raise ConfigError(f"{option} {text}: {AT_FORM}")
    for name, value_deg, most_deg in (("latitude", lat_deg, 90.0), ("longitude", lon_deg, 180.0)):
        if abs(value_deg) > most_deg:
            limits = f"-{most_deg:g} to {most_deg:g} degrees"
            raise ConfigError(f"{option} {text}: a {name} of {limits} is expected, not {value_deg:g}")
    return lat_deg, lon_deg


def _signed(match: re.Match[str], positive: str, negative: str) -> float | None:
    """Signed degrees. None with a letter of the other axis, two letters, or both a sign and a letter."""
    letter, value = match[1] or match[3], float(match[2])
    if (match[1] and match[3]) or letter not in ("", positive, negative) or (letter and match[2][0] in "+-"):
        return None
    return -value if letter == negative else value


def finite(command: Callable[..., Any]) -> Callable[..., Any]:
    """A command's function that refuses NaN and infinite options, since typer's ranges accept NaN."""

    @functools.wraps(command)
    def checked(**values: Any) -> Any:
        for name, value in values.items():
            for number in value if isinstance(value, list | tuple) else (value,):
                if isinstance(number, float) and not math.isfinite(number):
                    option = name.strip("_").replace("_", "-")
                    raise ConfigError(f"--{option} {number:g}: a finite number is expected")
        return command(**values)

    return checked


def refuse_odd_numbers(app: typer.Typer) -> None:
    """Apply `finite` to all commands of an app and of its sub-apps."""
    for group in app.registered_groups:
        if group.typer_instance is not None:
            refuse_odd_numbers(group.typer_instance)
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = finite(command.callback)
