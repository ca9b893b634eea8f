"""The state of an interrupted training in an npz file, which resumes it to the same weights. No torch, no pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.dynamics.weights import read_arrays
from asvhil.errors import ModelError, OtherTrainingError
from asvhil.files import replacement
from asvhil.types import record


@record
class Checkpoint:
    """The state of a training. `key` identifies it; `curve` has rows of (iteration, loss, validation)."""

    key: str
    iteration: int
    curve: list[list[float]]
    arrays: Mapping[str, Array]


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint atomically. ModelError if it cannot be written."""
    head = json.dumps({"key": checkpoint.key, "iteration": checkpoint.iteration, "curve": checkpoint.curve})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacement(path) as part, part.open("wb") as file:
            arrays: dict[str, Any] = dict(checkpoint.arrays)
            np.savez(file, head=np.array(head), **arrays)
    except OSError as error:
        raise ModelError(f"{path}: cannot be written ({error.strerror})") from None


def read_checkpoint(path: Path, key: str) -> Checkpoint:
    """The checkpoint of a file. ModelError if it is damaged, OtherTrainingError if of other data, options or seeds."""
    arrays = dict(read_arrays(path))
    try:
        head = json.loads(str(arrays.pop("head")))
        found = Checkpoint(key=head["key"], iteration=int(head["iteration"]), curve=head["curve"], arrays=arrays)
    except (KeyError, TypeError, ValueError):
        raise ModelError(f"{path}: not the checkpoint of a training") from None
    if found.key != key:
        raise OtherTrainingError(
            f"{path}: belongs to a training with other data, options or seed; remove it to start anew"
        )
    return found
