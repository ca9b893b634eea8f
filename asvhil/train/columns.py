"""Column maps: which column of a CSV file is which quantity, in which unit and with which sign. YAML, validated."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, model_validator

from asvhil.config import Section, find_shipped
from asvhil.config.told import told
from asvhil.config.yaml_text import read_yaml
from asvhil.errors import ConfigError

_SPEED = {"m/s": 1.0, "cm/s": 0.01, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0}


class TimeColumn(Section):
    column: str
    unit: Literal["s", "ms", "us", "ns"]

    @property
    def factor(self) -> float:
        """Seconds per unit."""
        return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[self.unit]


class SpeedColumn(Section):
    column: str
    unit: Literal["m/s", "cm/s", "km/h", "kn"]
    sign: Literal[-1, 1] = 1

    @property
    def factor(self) -> float:
        """m/s per unit, with the sign."""
        return self.sign * _SPEED[self.unit]


class RateColumn(Section):
    column: str
    unit: Literal["rad/s", "deg/s"]
    sign: Literal[-1, 1] = 1

    @property
    def factor(self) -> float:
        """rad/s per unit, with the sign."""
        return self.sign * (1.0 if self.unit == "rad/s" else math.pi / 180.0)


class AngleColumn(Section):
    column: str
    unit: Literal["rad", "deg"]
    sign: Literal[-1, 1] = 1

    @property
    def factor(self) -> float:
        """rad per unit, with the sign."""
        return self.sign * (1.0 if self.unit == "rad" else math.pi / 180.0)


class HeadingColumn(AngleColumn):
    """The heading, by a compass. With `settle_s`, u and v are assumed to come from the track by that compass, and are
    computed again by a heading that integrates the yaw rate and converges to the compass with that time constant (s):
    the current of the motors deflects a compass while they run.
    """

    settle_s: Annotated[float, Field(ge=1.0, le=3600.0)] | None = None


class MotorColumn(Section):
    """A command in [-1, 1], in percent, or as a pulse width; sign -1 negates the command."""

    column: str
    unit: Literal["1", "%", "us"]
    sign: Literal[-1, 1] = 1
    astern_us: Annotated[float, Field(ge=500.0, le=2500.0)] | None = None
    neutral_us: Annotated[float, Field(ge=500.0, le=2500.0)] | None = None
    ahead_us: Annotated[float, Field(ge=500.0, le=2500.0)] | None = None

    @model_validator(mode="after")
    def _check_pulses(self) -> MotorColumn:
        levels = (self.astern_us, self.neutral_us, self.ahead_us)
        if self.unit != "us":
            if levels != (None, None, None):
                raise ValueError("astern_us, neutral_us and ahead_us go with unit us only")
        elif None in levels:
            raise ValueError("unit us needs astern_us, neutral_us and ahead_us")
        elif not levels[0] < levels[1] < levels[2]:  # type: ignore[operator]  # none is None here
            raise ValueError("astern_us < neutral_us < ahead_us must hold (sign: -1 turns a motor round)")
        return self


class ColumnMap(Section):
    """All columns of one kind of file. Without any wind column the wind is taken as zero.

    The wind comes as the true wind in body axes (wind_u, wind_v), the true wind in NED (wind_n, wind_e; needs psi),
    or the apparent wind (wind_speed, wind_from: where it comes FROM, clockwise from the bow).
    """

    delimiter: Annotated[str, Field(min_length=1, max_length=1)] = ","
    time: TimeColumn
    u: SpeedColumn
    v: SpeedColumn
    r: RateColumn
    psi: HeadingColumn | None = None
    port: MotorColumn
    starboard: MotorColumn
    wind_u: SpeedColumn | None = None
    wind_v: SpeedColumn | None = None
    wind_n: SpeedColumn | None = None
    wind_e: SpeedColumn | None = None
    wind_speed: SpeedColumn | None = None
    wind_from: AngleColumn | None = None

    @model_validator(mode="after")
    def _check_wind(self) -> ColumnMap:
        pairs = {name: (getattr(self, name[0]), getattr(self, name[1])) for name in _WIND_PAIRS}
        for (first, second), columns in pairs.items():
            if (columns[0] is None) != (columns[1] is None):
                raise ValueError(f"{first} and {second} go together")
        if sum(columns[0] is not None for columns in pairs.values()) > 1:
            raise ValueError("the wind is given twice: keep one pair of its columns")
        if self.wind_n is not None and self.psi is None:
            raise ValueError("wind_n and wind_e need psi, to be turned into body axes")
        used: dict[str, str] = {}
        for name in type(self).model_fields:
            column = getattr(getattr(self, name), "column", None)
            if column is not None and used.setdefault(column, name) != name:
                raise ValueError(f"{used[column]} and {name} are both column {column!r}: each quantity has its own")
        return self


_WIND_PAIRS = (("wind_u", "wind_v"), ("wind_n", "wind_e"), ("wind_speed", "wind_from"))


def find_columns(name: str) -> Path:
    """The path of a column map: as given, else one of the shipped ones by its name. ConfigError."""
    return find_shipped(name, "columns", ".yaml", "column map")


def load_columns(path: Path) -> ColumnMap:
    """Read a column map. ConfigError, one line with the file and the key, where it is wrong."""
    found = read_yaml(path)
    if not isinstance(found.tree, dict):
        raise ConfigError(f"{path}: a mapping of quantities to columns is expected")
    try:
        return ColumnMap.model_validate(found.tree)
    except ValidationError as error:
        lines = {place: f"line {line}" for place, line in found.lines.items()}
        raise told(error, str(path), lines, ColumnMap) from None
