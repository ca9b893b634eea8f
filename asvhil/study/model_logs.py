"""The logs of the model study, made by `asvhil collect` in lockstep; logs in the folder are checked and used again."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asvhil.collect import TRAINING_SEED
from asvhil.config import Config, load_config
from asvhil.config.mean_wind import parse_wind, wind_keys
from asvhil.errors import LogError
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.types import record

# The same in surge and in sway whatever the heading: a light, confused chop.
WAVES = {"orbital_std_mps": 0.07, "spreading": 1.0, "yaw_std_radps": 0.02, "peak_hz": 0.3}
FLOOR_OF_STD = math.sqrt(2.0 / math.pi)  # mean absolute value over standard deviation of a Gaussian

Drive = Callable[[Config, float, list[str], Path], list[Path]]  # config, duration (s), winds, log; the logs written
Tell = Callable[[str, float], None]  # what is being done, and its share done


@record
class Programme:
    """The runs: for each training seed a data set of `train_s` in each wind, and the test runs."""

    train_seeds: tuple[int, ...] = (100, 200, 300)
    train_winds: tuple[str, ...] = ("3@0", "6@180")
    train_s: float = 300.0
    test_winds: tuple[str, ...] = ("6@0", "6@90", "6@180")
    test_seed: int = 9000
    test_s: float = 130.0


@record
class Logs:
    """Training logs by data set, and test logs."""

    train: tuple[tuple[Path, ...], ...]
    test: tuple[Path, ...]


PROGRAMME = Programme()


def wave_figures() -> dict[str, Any]:
    """The waves of the study, and the mean absolute error of a model that is perfect except for them."""
    orbital, yaw = WAVES["orbital_std_mps"], WAVES["yaw_std_radps"]
    floor = {
        f"mae_{axis}": round(FLOOR_OF_STD * std, 4) for axis, std in zip("uvr", (orbital, orbital, yaw), strict=True)
    }
    return {**WAVES, "floor": floor}


def collect_logs(
    folder: Path,
    drive: Drive,
    config: str = "sitl",
    tell: Tell | None = None,
    *,
    programme: Programme = PROGRAMME,
    waves: bool = False,
) -> Logs:
    """The logs of one sea; logs that are in the folder are not made again.

    LogError where one of these has other settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    sea = tuple(f"plant.weather.waves.{key}={value}" for key, value in WAVES.items()) if waves else ()
    prefix = "waves-" if waves else ""

    def run(stem: str, seed: int, duration_s: float, wind: str) -> Path:
        name = f"{prefix}{stem}"
        path = folder / f"{name}.mcap"
        settings = load_config(config, (f"plant.seed={seed}", f"controller.manoeuvres.seed={seed}", *sea))
        if path.exists():
            _check(path, settings, duration_s, wind)
            return path
        if tell is not None:
            tell(f"collecting {name}", 0.0)
        partial = folder / f"{name}.part.mcap"
        partial.unlink(missing_ok=True)  # left by an interrupted study; a recorder never overwrites a log
        (log,) = drive(settings, duration_s, [wind], partial)
        log.replace(path)
        return path

    train = tuple(
        tuple(
            run(f"train{seed}-{i}", seed + i, programme.train_s, wind) for i, wind in enumerate(programme.train_winds)
        )
        for seed in programme.train_seeds
    )
    test = tuple(
        run(f"test{i}", programme.test_seed + i, programme.test_s, wind) for i, wind in enumerate(programme.test_winds)
    )
    return Logs(train=train, test=test)


def _check(path: Path, settings: Config, duration_s: float, wind: str) -> None:
    """LogError where a log does not come from the same boat, sea and manoeuvres; the estimator may have changed."""
    wanted = settings.model_dump(mode="json")
    wanted["plant"]["weather"]["wind"] |= wind_keys(parse_wind(wind), settings)
    wanted["controller"]["manoeuvres"]["duration_s"] = duration_s
    wanted["plant"]["seed"] += TRAINING_SEED
    found = config_of(LogFile(path), path, known_only=True).model_dump(mode="json")
    for tree in (wanted, found):
        tree["controller"]["manoeuvres"].pop("note")
        tree["plant"].pop("links")  # the wiring of one run
    for section, of_wanted, of_found in (
        ("vehicle", wanted["vehicle"], found["vehicle"]),
        ("plant", wanted["plant"], found["plant"]),
        ("controller.manoeuvres", wanted["controller"]["manoeuvres"], found["controller"]["manoeuvres"]),
    ):
        difference = _difference(of_wanted, of_found, section)
        if difference is not None:
            raise LogError(f"{path}: {difference}; remove the log to drive it anew")


def _difference(wanted: Any, found: Any, key: str) -> str | None:
    """The first value that differs, as text."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        for name in wanted:
            difference = _difference(wanted[name], found.get(name), f"{key}.{name}")
            if difference is not None:
                return difference
        return None
    return None if wanted == found else f"driven with {key} {found}, this study asks for {wanted}"
