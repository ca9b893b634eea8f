"""The rows of the six tests: the paper's winds, their mirrors and diagonals, and config keys of all runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from typing import Any

from asvhil.config import load_config, override_value
from asvhil.config.mean_wind import from_north_deg
from asvhil.errors import ConfigError, meant
from asvhil.study.runner import Job
from asvhil.study.trials.trial import NO_NOISE, NO_SLOW_ERROR, run_key

Keys = tuple[str, ...]  # of a config, as KEY=VALUE
FROM_S, TO_S = 60.0, 360.0
QUICK_S = (10.0, 16.0)  # to see that it works
ROWS: dict[str, tuple[float, float]] = {  # m/s, blowing toward degrees from the station's heading
    "1": (3.0, 0.0),
    "2": (6.0, 0.0),
    "3": (3.0, 180.0),
    "4": (6.0, 180.0),
    "5": (3.0, 90.0),
    "5 mirrored": (3.0, -90.0),
    "6": (6.0, 90.0),
    "6 mirrored": (6.0, -90.0),
    "diagonal": (6.0, 45.0),
    "diagonal mirrored": (6.0, -45.0),
}


def along_the_wind(row: str) -> bool:
    """Whether the station's heading is along or against the wind, where a boat can stand still."""
    return ROWS[row][1] % 180.0 == 0.0


def title(row: str) -> str:
    speed_mps, toward_deg = ROWS[row]
    return f"{row} ({speed_mps:g} m/s toward {toward_deg:g}°)"


def wind_of(row: str) -> str:
    """The wind of a row up to its mirror image, as `SPEED@DEG`: what its physical bound depends on."""
    speed_mps, toward_deg = ROWS[row]
    return f"{speed_mps:g}@{abs(toward_deg):g}"


def row_overrides(
    row: str, seed: int, *, noise: bool = True, heading_deg: float = 0.0, slow_error: bool = False
) -> tuple[str, ...]:
    """The config keys of one run of a row at a station of that heading; without `noise` no gusts, no sensor noise.

    With `slow_error` the receiver has its slow error, and the filter looks for it, as the config has both.
    """
    speed_mps, toward_deg = ROWS[row]
    if heading_deg:  # at none the direction stays as the row has it: stored runs are known by it
        toward_deg = from_north_deg(toward_deg, heading_deg)
    return (
        *(() if slow_error else NO_SLOW_ERROR),
        f"plant.seed={seed}",
        f"plant.weather.wind.speed_mps={speed_mps}",
        f"plant.weather.wind.toward_deg={toward_deg}",
        *(() if noise else NO_NOISE),
    )


def refuse_own(overrides: Iterable[str], own: Iterable[str]) -> None:
    """ConfigError where an override sets a key that the study sets itself; both as KEY=VALUE."""
    keys = {text.partition("=")[0] for text in own}
    for override in overrides:
        for leaf in _leaves(*override_value(override)):
            if leaf in keys:
                raise ConfigError(f"--set {override}: key {leaf} is set by the study itself; leave it out")


def _leaves(key: str, value: Any) -> Iterator[str]:
    """The keys that a value sets; of a section, all below it."""
    if not isinstance(value, dict):
        yield key
        return
    for name, part in value.items():
        yield from _leaves(f"{key}.{name}", part)


def checked(names: list[str], known: Collection[str], option: str) -> list[str]:
    """The given names in the order of the known ones, or all if none is given. ConfigError for an unknown one."""
    for name in names:
        if name not in known:
            raise ConfigError(f"{option} {name}: unknown{meant(name, known)}")
    return [name for name in known if name in names or not names]


def trial_job(group: str, base: str, overrides: tuple[str, ...], window_s: tuple[float, float]) -> Job:
    """A trial for `runner.run_jobs` with `run_named_trial`: the same config, model file and window are the same run."""
    key = f"trial {run_key(load_config(base, overrides))} {window_s[0]:g}-{window_s[1]:g}"
    return Job(key=key, group=group, arguments=(base, overrides, window_s))
