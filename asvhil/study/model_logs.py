"""The logs of the model study: driven by `asvhil collect` in lockstep, once; what lies in the folder is checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from asvhil.config import Config, load_config
from asvhil.config.mean_wind import parse_wind, wind_keys
from asvhil.errors import LogError
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.types import record

# The same in surge and in sway whatever the heading: a light, confused chop.
WAVES = {"orbital_std_mps": 0.07, "spreading": 1.0, "yaw_std_radps": 0.02, "peak_hz": 0.3}
FLOOR_OF_STD = math.sqrt(2.0 / math.pi)  # mean absolute value of a Gaussian motion that nothing foretells

Drive = Callable[[Config, float, list[str], Path], list[Path]]  # config, duration (s), winds, log; the logs written
Tell = Callable[[str, float], None]  # what is being done, and its share done


@record
class Programme:
    """What is driven: for each of the training seeds a data set of `train_s` in each wind, and the test runs."""

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
    """What the waves of the study are, and the mean absolute error that remains of a model that is perfect but them."""
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
    """The logs of one sea; those in the folder already are not driven again.

    LogError where one of these was driven with other settings than are asked for.
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
        partial.unlink(missing_ok=True)  # of a study that was interrupted; a recorder never writes over a log
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
    """The first value that is not as wanted, in words."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        for name in wanted:
            difference = _difference(wanted[name], found.get(name), f"{key}.{name}")
            if difference is not None:
                return difference
        return None
    return None if wanted == found else f"driven with {key} {found}, this study asks for {wanted}"
