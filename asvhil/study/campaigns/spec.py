"""A campaign as its YAML file describes it, checked. Every mistake is one line that names the file and the key."""

from __future__ import annotations

import difflib
import math
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from asvhil.config.base import Section
from asvhil.config.loading import find_shipped
from asvhil.config.told import Lines, told
from asvhil.config.yaml_text import read_yaml
from asvhil.errors import ConfigError
from asvhil.study.campaigns.columns import TAKEN
from asvhil.study.campaigns.shorthands import SHORTHANDS

OWN = {"plant.seed": "`seed` and `repeats` set it"}
ScoreName = Literal[
    "ps",
    "vrx_score",
    "distance_mean_m",
    "distance_max_m",
    "heading_abs_deg",
    "energy_n2",
    "reversals_per_min",
    "saturated_share",
    "change_per_s",
]
MOST_POINTS = 10_000_000
MOST_RUNS = MOST_POINTS  # of which each is a plan in memory
MOST_SEED = 1_000_000_000  # each run counts on from it
LONGEST_S = 86_400.0  # of a run
CONFIG = "config"  # a parameter of this name chooses the config


class ParameterSpec(Section):
    """What one parameter can be: values, or a range."""

    values: list[Any] | dict[str, Any] | None = Field(
        default=None, description="A list of values; or named sets of config keys, as NAME: {KEY: VALUE, ...}."
    )
    low: float | None = Field(default=None, description="Lower end of a range.")
    high: float | None = Field(default=None, description="Upper end of a range.")
    steps: int | None = Field(
        default=None, ge=2, le=10_000, description="Values of a range in a grid, both ends among them."
    )
    scale: Literal["linear", "log"] = Field(default="linear", description="Scale on which a range is even.")
    factor: bool = Field(default=False, description="Whether the values multiply that of the config.")

    @model_validator(mode="before")
    @classmethod
    def _list_is_values(cls, data: Any) -> Any:
        if not isinstance(data, list | dict):
            raise ValueError("a list of values, as [3, 5], or a range, as {low: 3, high: 5}, is expected")
        return {"values": data} if isinstance(data, list) else data

    @model_validator(mode="after")
    def _check(self) -> ParameterSpec:
        ends = (self.low, self.high)
        if self.values is not None and ends != (None, None):
            raise ValueError("either values or low and high are expected, not both")
        if self.values is None:
            if self.low is None or self.high is None:
                raise ValueError("values, or low and high, are expected")
            if not self.low < self.high:
                raise ValueError("low < high must hold")
            if self.scale == "log" and self.low <= 0.0:
                raise ValueError("a range on a log scale begins above 0")
        elif not self.values:
            raise ValueError("at least one value is expected")
        if self.factor and isinstance(self.values, dict):
            raise ValueError("sets of keys have no factor")
        if self.factor and any(isinstance(one, bool) or not isinstance(one, int | float) for one in self.values or ()):
            raise ValueError("factors are numbers")
        if isinstance(self.values, dict) and not all(isinstance(one, dict) for one in self.values.values()):
            raise ValueError("each set is a section of config keys, NAME: {KEY: VALUE, ...}")
        if isinstance(self.values, list) and len({str(one) for one in self.values}) < len(self.values):
            raise ValueError("a value is there twice")
        return self

    @property
    def labels(self) -> list[Any] | None:
        """The values, or the names of the sets; None of a range."""
        return None if self.values is None else list(self.values)

    @property
    def is_number(self) -> bool:
        """Whether all values are numbers, so that they have an order."""
        return isinstance(self.values, list | None) and all(
            isinstance(one, int | float) and not isinstance(one, bool) for one in self.values or ()
        )

    def at(self, share: float) -> Any:
        """The value, or the name of the set, at a share in [0, 1) of the range; numbers to `digits`."""
        labels = self.labels
        if labels is not None:
            return labels[min(int(share * len(labels)), len(labels) - 1)]
        low, high = self.low or 0.0, self.high or 0.0
        value = low * (high / low) ** share if self.scale == "log" else low + (high - low) * share
        return float(f"{value:.{self.digits}g}")

    @property
    def digits(self) -> int:
        """Significant digits of its values: 6, and more where the range is narrow or has many steps."""
        if self.low is None or self.high is None:
            return 6
        size, span = max(abs(self.low), abs(self.high)), self.high - self.low
        finer = max(4, math.ceil(math.log10(self.steps or 2)) + 1)
        return min(max(6, math.ceil(math.log10(size)) - math.floor(math.log10(span)) + finer), 17)

    def levels(self) -> list[Any]:
        """The values of a grid, in order."""
        labels = self.labels
        if labels is not None:
            return labels
        steps = self.steps or 2
        return [self.at(i / (steps - 1)) for i in range(steps)]

    @property
    def count(self) -> int:
        """How many values a grid has of it."""
        labels = self.labels
        return (self.steps or 2) if labels is None else len(labels)

    def ends(self) -> list[Any]:
        """Values that show whether all can be: each, or both ends of the range."""
        labels = self.labels
        return [self.at(0.0), self.at(1.0)] if labels is None else labels


class DesignSpec(Section):
    """How the points of a campaign lie."""

    kind: Literal["grid", "lhs", "sobol"] = Field(
        description="grid: all combinations; lhs: Latin hypercube; sobol: scrambled Sobol sequence."
    )
    points: int | None = Field(default=None, ge=1, le=MOST_POINTS, description="Points of lhs and sobol.")
    seed: int = Field(default=1, ge=0, le=MOST_SEED, description="Seed of the points.")

    @model_validator(mode="after")
    def _check(self) -> DesignSpec:
        if self.kind == "grid" and self.points is not None:
            raise ValueError("points are for lhs and sobol: a grid has all combinations of the values")
        if self.kind != "grid" and self.points is None:
            raise ValueError(f"{self.kind} needs points, the number of them")
        return self


class CampaignSpec(Section):
    """A campaign: points of a design, each with every variant, each of these with several seeds."""

    config: str = Field(default="sitl", description="The config, a file or the name of a shipped one.")
    design: DesignSpec = Field(description="How the points lie.")
    parameters: dict[str, ParameterSpec] = Field(description="What varies: config keys, or short names.")
    variants: dict[str, dict[str, Any]] = Field(
        default={}, description="Config keys by name, compared with each other at the same points and seeds."
    )
    set: dict[str, Any] = Field(default={}, description="Config keys of all runs.")
    window_s: tuple[float, float] = Field(
        default=(60.0, 180.0), description="Begin and end of the time that is scored; the run ends with it."
    )
    seed: int = Field(
        default=1, ge=0, le=MOST_SEED, description="plant.seed of the first point's first run; the others count on."
    )
    repeats: int = Field(default=1, ge=1, description="Runs with seeds of their own at each point.")
    score: ScoreName = Field(default="ps", description="The column that the summary is about; less is better.")
    worst: int = Field(default=3, ge=0, description="Worst runs that are run again, with a log.")

    @field_validator("parameters")
    @classmethod
    def _some(cls, value: dict[str, ParameterSpec]) -> dict[str, ParameterSpec]:
        if not value:
            raise ValueError("at least one parameter is expected")
        return value

    @field_validator("variants")
    @classmethod
    def _named(cls, value: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        if "" in value:
            raise ValueError("variants need names")
        return value

    @field_validator("window_s")
    @classmethod
    def _rising(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 0.0 <= value[0] < value[1]:
            raise ValueError(f"two rising times, begin and end in s, are expected, not {value[0]:g} and {value[1]:g}")
        if value[1] > LONGEST_S:
            raise ValueError(f"an end within a day, {LONGEST_S:g} s, is expected, not {value[1]:g}")
        return value


def read_spec(path: Path) -> tuple[CampaignSpec, Path, Lines]:
    """A campaign's file, or one shipped in config/campaigns by its name: its content, path, and the place of each key.

    ConfigError, one line, where it is wrong.
    """
    found = find_shipped(str(path), "campaigns", ".yaml", "campaign file")
    text = read_yaml(found)
    if not isinstance(text.tree, dict):
        raise ConfigError(f"{found}: a mapping of keys is expected at the top level")
    lines: Lines = {place: f"line {line}" for place, line in text.lines.items()}
    try:
        spec = CampaignSpec.model_validate(text.tree)
    except ValidationError as error:
        raise told(error, str(found), lines, CampaignSpec) from None
    for name, parameter in spec.parameters.items():
        fault = _fault_of(name, parameter, spec.design.kind)
        if fault:
            raise wrong(found, lines, ("parameters", name), fault)
    key, fault = _too_many(spec)
    if fault:
        raise wrong(found, lines, (key,), fault)
    return spec, found, lines


def wrong(path: Path, lines: Lines, place: tuple[str, ...], words: str) -> ConfigError:
    """What is wrong at a place of a campaign's file."""
    line = lines.get(place)
    return ConfigError(f"{path}: key {'.'.join(place)}: {words}{f' ({line})' if line else ''}")


def _too_many(spec: CampaignSpec) -> tuple[str, str]:
    """The key that asks for more runs than can be planned, and what to say of it; empty where none does."""
    points = points_in(spec)
    if points > MOST_POINTS:
        return "parameters", f"the grid has {points} points, {MOST_POINTS} at most: fewer values, or lhs or sobol"
    runs, variants = runs_of(spec), len(spec.variants)
    if runs <= MOST_RUNS:
        return "", ""
    parts = [f"{points} points", *([f"{variants} variants"] if variants > 1 else [])]
    parts += [f"{spec.repeats} repeats"] if spec.repeats > 1 else []
    return "repeats" if spec.repeats > 1 else "variants", f"{runs} runs ({', '.join(parts)}), {MOST_RUNS} at most"


def _fault_of(name: str, parameter: ParameterSpec, design: str) -> str:
    """What cannot be of a parameter, beside its values."""
    if name in OWN:
        return f"not a parameter: {OWN[name]}"
    is_set = isinstance(parameter.values, dict)
    if name != CONFIG and not is_set and "." not in name and name not in SHORTHANDS:
        near = difflib.get_close_matches(name, [*SHORTHANDS, CONFIG], n=1)
        meant = f"did you mean {near[0]}?" if near else f"short names are {', '.join([*SHORTHANDS, CONFIG])}"
        return (
            f"neither a config key with its sections, such as plant.weather.wind.speed_mps, nor a short name; {meant}"
        )
    if is_set and ("." in name or name in SHORTHANDS or name == CONFIG):
        return "named sets of config keys need a name of their own"
    if name in TAKEN:
        return "the table has a column of this name already; give another"
    if parameter.values is None and name in (CONFIG, "controller", "fault"):
        return "a list of values is expected"
    if design == "grid" and parameter.values is None and parameter.steps is None:
        return "a range in a grid needs steps"
    if design != "grid" and parameter.steps is not None:
        return f"steps are for grids; {design} draws from the whole range"
    return ""


def runs_of(spec: CampaignSpec) -> int:
    """The number of runs."""
    return points_in(spec) * max(1, len(spec.variants)) * spec.repeats


def points_in(spec: CampaignSpec) -> int:
    """The number of points of the design."""
    if spec.design.points is not None:
        return spec.design.points
    return math.prod(parameter.count for parameter in spec.parameters.values())
