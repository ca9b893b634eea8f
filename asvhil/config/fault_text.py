"""A fault as people give it at the command line: KIND@FROM[:DURATION][:SIZE], such as gnss-jump@60:5s:20m."""

from __future__ import annotations

import difflib
import re
from typing import get_args

from pydantic import ValidationError

from asvhil.config.plant_faults import SIZE_UNITS, FaultConfig, FaultKind, needed_device
from asvhil.config.root import Config
from asvhil.errors import ConfigError

KINDS: tuple[str, ...] = get_args(FaultKind)
FORM = "KIND@FROM[:DURATION][:SIZE], such as gnss-jump@60:5s:20m"
_PART = re.compile(r"(-?\d+(?:\.\d+)?)(s|m|deg/s|deg|V)?")


def parse_fault(text: str) -> FaultConfig:
    """FROM and DURATION in seconds, SIZE bare or in its kind's unit (m, deg, deg/s, V; a share has none).

    ConfigError for others.
    """
    kind, sign, rest = text.partition("@")
    if kind not in KINDS:
        near = difflib.get_close_matches(kind, KINDS, n=1)
        known = f"did you mean {near[0]}?" if near else f"known: {', '.join(KINDS)}"
        raise ConfigError(f"--fault {text}: unknown kind {kind!r} ({known})")
    parts = [_PART.fullmatch(part) for part in rest.split(":")] if sign else [None]
    if not all(parts) or len(parts) > 3:
        raise ConfigError(f"--fault {text}: {FORM} is expected")
    (first, first_unit), *others = [(float(part[1]), part[2]) for part in parts if part is not None]
    if first_unit not in (None, "s"):
        raise ConfigError(f"--fault {text}: the begin is in seconds")
    lasts = [value for value, unit in others if unit == "s"]
    sizes = [(value, unit) for value, unit in others if unit != "s"]
    if len(lasts) > 1 or len(sizes) > 1:
        raise ConfigError(f"--fault {text}: {FORM} is expected; a duration ends in s")
    if first < 0.0:
        raise ConfigError(f"--fault {text}: a begin of 0 s or more is expected, not {first:g}")
    if lasts and lasts[0] <= 0.0:
        raise ConfigError(f"--fault {text}: a duration above 0 s is expected, not {lasts[0]:g}")
    for value, unit in sizes:
        known_units = SIZE_UNITS.get(kind)
        if unit and known_units is not None and unit not in known_units:
            wanted = f"is in {' or '.join(known_units)}" if known_units else "is a share, which has no unit"
            raise ConfigError(f"--fault {text}: the size of {kind} {wanted}, not {value:g}{unit}")
    try:
        return FaultConfig.model_validate(
            {
                "kind": kind,
                "from_s": first,
                "until_s": first + lasts[0] if lasts else None,
                "size": sizes[0][0] if sizes else None,
            }
        )
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise ConfigError(f"--fault {text}: {reason}") from None


def with_faults(config: Config, texts: list[str], ends_s: float | None = None) -> Config:
    """The config with faults of the simulated boat added to its own.

    ConfigError where the boat cannot have one, and where one begins when the run has ended: at `ends_s` after power-on,
    None of a run that goes on until it is interrupted.
    """
    if not texts:
        return config
    added = [parse_fault(text) for text in texts]
    for text, fault in zip(texts, added, strict=True):
        problem = config.why_no_fault(fault.kind, needed_device(fault))
        if problem:
            raise ConfigError(f"--fault {text}: {problem}")
        if ends_s is not None and fault.from_s >= ends_s:
            what = f"begins at {fault.from_s:g} s, and the run ends at {ends_s:g} s"
            raise ConfigError(f"--fault {text}: {what}; an earlier begin or a longer --duration is expected")
    faults = (*config.plant.faults, *added)
    return config.model_copy(update={"plant": config.plant.model_copy(update={"faults": faults})})
