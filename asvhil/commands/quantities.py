"""Quantities that people type, with or without a unit: `2`, `2 m/s`, `4 kn`, `30 kgf`, `85 cm`."""

from __future__ import annotations

import math
import re

from asvhil.errors import ConfigError

UNITS: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048},
    "kg": {"kg": 1.0, "g": 0.001, "t": 1000.0, "lb": 0.45359237},
    "m/s": {"m/s": 1.0, "kn": 1852.0 / 3600.0, "kt": 1852.0 / 3600.0, "km/h": 1.0 / 3.6, "mph": 0.44704},
    "deg/s": {"deg/s": 1.0, "rad/s": math.degrees(1.0), "rpm": 6.0},
    "N": {"n": 1.0, "kgf": 9.80665, "lbf": 4.4482216},
}
_FORM = re.compile(r"\s*([0-9.,+-]+(?:[eE][0-9+-]+)?)\s*(\S*)\s*")


def quantity(name: str, text: str, unit: str) -> float:
    """The value in `unit`. ConfigError, one line, for what is no number, or has a unit of something else."""
    from asvhil.config.yaml_text import scalar

    known = UNITS[unit]
    found = _FORM.fullmatch(text)
    number = scalar(found[1]) if found else None
    if found is None or isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
        hint = ", with a point for decimals" if "," in text else ""
        raise ConfigError(f"{name} {text}: a number in {unit} is expected{hint}")
    given = found[2].lower() or unit.lower()
    if given not in known:
        raise ConfigError(f"{name} {text}: the unit {found[2]} is none of {', '.join(known)}")
    return float(number) * known[given]
