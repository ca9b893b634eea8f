"""A short search, as a process that a test can kill: `python -m tests.support.tuning_runs FOLDER`."""

import sys
from pathlib import Path

from asvhil.study.runner import run_into
from asvhil.study.tuning import WindSet, tune

TRAINING = WindSet(winds=((4.0, 30.0),), seeds=(1,))
HELD_OUT = WindSet(winds=((3.0, 20.0),), seeds=(2,))


def search(folder: Path) -> None:
    """A generation of LOITER's gains in runs of 2 s, with its record and its store in a folder."""
    run = run_into(folder / "tune.jsonl", workers=0, isolate=True)
    sets = {"training": TRAINING, "held_out": HELD_OUT, "window_s": (1.0, 2.0)}
    tune("loiter", 11, 3, run, folder / "loiter.json", **sets)


if __name__ == "__main__":
    search(Path(sys.argv[1]))
