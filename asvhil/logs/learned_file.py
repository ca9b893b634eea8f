"""The file of what was learned on station: written at the end of a run, and read where the next start is told to.

It holds the factors of `dynamics.corrected.FACTORS` with the boat and the model that they belong to.
"""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from asvhil.backseat.build import model_file
from asvhil.config import Config
from asvhil.dynamics.corrected import FACTORS
from asvhil.errors import AsvhilError, ConfigError
from asvhil.estimator.learned_words import KNOWN_STD, known, learned_text
from asvhil.files import write_text
from asvhil.types import Learned, Outputs, record

FORMAT = 1
ENDED = "%Y-%m-%d %H:%M UTC"
LEAST_S = 60.0  # of learning: what was learned in less is not kept
LEAST_STD, MOST_STD = 1e-3, 3.0  # of a factor: nothing is known for sure, after however long
YEARS = range(1970, 2100)  # a computer without a clock of its own begins in 1970, so that its files are no damaged ones
MOST_S = 1e9  # of learning: more than a life of a boat


@record
class LearnedFile:
    """What a file holds: when it was learned, in words and as factors."""

    ended: str
    learned: Learned

    @property
    def text(self) -> str:
        """Such as "port motor gives 71 % of the model's thrust (12 min, ended 2026-11-29 07:30 UTC)"."""
        return f"{learned_text(self.learned)} ({self.learned.learned_s / 60.0:.0f} min, ended {self.ended})"


def learned_path(config: Config) -> Path:
    """Where a boat's file is: `learning.file`, or beside the logs."""
    if config.learning.file is not None:
        return Path(config.learning.file)
    return Path(config.recorder.directory) / f"learned-{config.vehicle.name}.json"


def model_hash(config: Config) -> str:
    """SHA-256 of the model file, or of the hull where the model is the physics: what the factors correct."""
    file = model_file(config)
    data = config.believed_vessel.canonical_json().encode() if file is None else file.read_bytes()
    return hashlib.sha256(data).hexdigest()


def hull_hash(config: Config) -> str:
    """SHA-256 of the hull that a model stands for, also where that is a network's: its file need not have changed."""
    return hashlib.sha256(config.believed_vessel.canonical_json().encode()).hexdigest()


def is_simulated(config: Config) -> bool:
    """Whether the boat of a config is simulated: nobody engages by itself on the water."""
    return config.supervisor.engage == "auto"


class LearnedKeeper:
    """`see` each tick's outputs, and `save` at the end."""

    def __init__(self, config: Config) -> None:
        self._config = config
        # The model that is learned with: its file may be another one by the end of the run.
        self._model_sha256 = model_hash(config) if config.learning.enabled else ""
        self._last: Learned | None = None
        self._t_ns = 0

    def see(self, outputs: Outputs) -> None:
        """One tick."""
        self._last, self._t_ns = outputs.learned, outputs.t_ns

    def save(self) -> Path | None:
        """Write the file, atomically; None where too little was learned. AsvhilError where it cannot be written."""
        learned = self._last
        if learned is None or not self._config.learning.adapt or learned.learned_s < LEAST_S or not any(known(learned)):
            return None
        tree = {
            "format": FORMAT,
            "boat": self._config.vehicle.name,
            "simulated": is_simulated(self._config),
            "model_sha256": self._model_sha256,
            "hull_sha256": hull_hash(self._config),
            "factors": dict(zip(FACTORS, learned.factors, strict=True)),
            "std": dict(zip(FACTORS, learned.std, strict=True)),
            "learned_s": learned.learned_s,
            "ended": datetime.fromtimestamp(self._t_ns * 1e-9, UTC).strftime(ENDED),
        }
        path = learned_path(self._config)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, json.dumps(tree, indent=2) + "\n", sync=True)
        except OSError as error:
            raise AsvhilError(f"{path}: what was learned cannot be written ({error.strerror})") from None
        return path


def read_learned(path: Path, config: Config) -> LearnedFile:
    """What a file holds. ConfigError where it cannot be read, is damaged, or is of another boat or model."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_no_key_twice)
    except _KeyTwiceError as error:
        raise ConfigError(f"{path}: damaged: {error} stands there twice; once is right") from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise ConfigError(f"{path}: damaged: not JSON; take the file that a run has left, or learn anew") from None
    if not isinstance(tree, dict) or type(tree.get("format")) is not int or tree["format"] != FORMAT:
        raise ConfigError(f"{path}: not a file of what was learned on station, format {FORMAT}")
    boat, own = tree.get("boat"), config.vehicle.name
    if boat != own:
        raise ConfigError(f"{path}: learned on the boat {boat!r:.60}, and this is {own!r}")
    if tree.get("simulated") is not is_simulated(config):
        where = "the simulated boat" if tree.get("simulated") else "the boat itself"
        raise ConfigError(f"{path}: learned on {where}, which this start is not of")
    if tree.get("model_sha256") != model_hash(config):
        raise ConfigError(f"{path}: learned with another model than the one in use; learn anew with this one")
    _check_hull(tree, path, config)
    learned = Learned(
        factors=_numbers(tree, "factors", path, config.learning.least, config.learning.most),
        std=_numbers(tree, "std", path, LEAST_STD, MOST_STD),
        learned_s=_number(tree.get("learned_s"), "learned_s", path, LEAST_S, MOST_S),
    )
    ended = tree.get("ended")
    if not isinstance(ended, str) or not _is_time(ended):
        raise ConfigError(f"{path}: damaged: ended is {ended!r:.40}, a date as 2026-11-29 07:30 UTC is needed")
    if not any(known(learned)):
        raise ConfigError(
            f"{path}: std: nothing is known yet, {KNOWN_STD:g} or less of a factor is needed; learn longer"
        )
    return LearnedFile(ended=ended, learned=learned)


def _check_hull(tree: dict[str, Any], path: Path, config: Config) -> None:
    """ConfigError where a file's model was not of the hull of this config, or nobody knows."""
    own = hull_hash(config)
    if "hull_sha256" not in tree:
        if tree["model_sha256"] == own:  # of the physics, which is checked by now: it is the hull's
            return
        words = "of an older version, without hull_sha256: nobody knows which hull it was learned with; learn anew"
        raise ConfigError(f"{path}: {words}")
    if tree["hull_sha256"] != own:
        raise ConfigError(
            f"{path}: hull_sha256: learned with another hull than vehicle.vessel is now; take that back, or learn anew"
        )


class _KeyTwiceError(Exception):
    """A key that an object has twice: nobody knows which is meant."""


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise _KeyTwiceError(f"{key!r:.40}")
        found[key] = value
    return found


def _is_time(text: str) -> bool:
    try:
        time = datetime.strptime(text, ENDED)
    except ValueError:
        return False
    return time.year in YEARS and time.strftime(ENDED) == text  # by the format alone a newline passes for a space


@record
class Offer:
    """The file that is there and not taken, in one line: what it holds and how to take it, or why it is not usable."""

    text: str
    usable: bool


def offer(config: Config) -> Offer | None:
    """What an earlier run has left; None where there is nothing, or it is in use."""
    path = learned_path(config)
    try:
        if not path.is_file():
            return None
        found = read_learned(path, config)
    except ConfigError as error:
        return Offer(text=str(error), usable=False)
    except OSError as error:  # a name that no file can have
        return Offer(text=f"learning.file {path}: cannot be read ({error.strerror})", usable=False)
    if config.learning.enabled and config.learning.start == _start(found, config):
        return None
    return Offer(text=f"{found.text}; not in use: take it by --learned {path}", usable=True)


def taken(path: Path, config: Config) -> tuple[str, ...]:
    """The config keys that begin with what a file holds: in the config they are in the log too, so a replay has them.

    ConfigError as `read_learned`.
    """
    return ("learning.enabled=true", f"learning.start={list(_start(read_learned(path, config), config))}")


def _start(found: LearnedFile, config: Config) -> tuple[float, ...]:
    """Its factors to three digits, within the bounds of the config; 1 for those that are not known: as it is told."""
    least, most = config.learning.least, config.learning.most
    pairs = zip(found.learned.factors, known(found.learned), strict=True)
    return tuple(min(max(round(factor, 3), least), most) if is_known else 1.0 for factor, is_known in pairs)


def _numbers(tree: dict[str, Any], name: str, path: Path, least: float, most: float) -> tuple[float, ...]:
    part = tree.get(name)
    if not isinstance(part, dict) or set(part) != set(FACTORS):
        raise ConfigError(f"{path}: damaged: {name} must have {', '.join(FACTORS)}")
    return tuple(_number(part[key], f"{name}.{key}", path, least, most) for key in FACTORS)


def _number(value: Any, name: str, path: Path, least: float, most: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ConfigError(f"{path}: damaged: {name} is {value!r:.40}, a number from {least:g} to {most:g} is needed")
    return float(value)
