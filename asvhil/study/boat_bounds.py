"""The bounds of several boats in several winds, as runs of a study: what regrets are ratios to."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Iterable, Mapping

from asvhil.config import load_config
from asvhil.study.bound import boat_hash, run_named_bound
from asvhil.study.made_of import made_of
from asvhil.study.rows import ROWS, Keys, along_the_wind
from asvhil.study.runner import Job, Run

STARTS = 16  # of each search: of 40 of them at least a third found the same best orbit, of most boats nearly all
Bounds = Mapping[tuple[Keys, str], float | None]


def bounds_of_boats(
    run: Run, boats: Iterable[Keys], rows: Iterable[str], starts: int, base: str = "sitl", overrides: Keys = ()
) -> Bounds:
    """The bound of each boat, by its config keys, in each row; None along the wind, where it is zero."""
    boats, rows = list(boats), list(rows)
    cases = {
        (keys, row): bound_job(base, (*overrides, *keys), *ROWS[row], starts)
        for keys in boats
        for row in rows
        if not along_the_wind(row)
    }
    found = run(run_named_bound, list(cases.values())).results if cases else []
    at_hand = dict(zip(cases, found, strict=True))
    return {
        (keys, row): at_hand[keys, row]["penalty_score"] if (keys, row) in at_hand else None
        for keys in boats
        for row in rows
    }


def bound_job(base: str, overrides: Keys, speed_mps: float, toward_deg: float, starts: int) -> Job:
    """The run of `run_named_bound` for the simulated boat of a config, in a wind from the station's heading on.

    A boat that is the same to port and to starboard has the same bound in a wind and in its mirror image.
    """
    config = load_config(base, overrides)
    coupling, motors = config.plant_vessel.coupling, config.plant.motors
    lopsided = motors is not None or (coupling is not None and coupling.y_g_m != 0.0)
    toward_deg = toward_deg if lopsided else abs(toward_deg)
    key = f"bound {boat_hash(config)} {speed_mps:g}@{toward_deg:g} {starts}"
    arguments = (base, overrides, speed_mps, math.radians(toward_deg), starts)
    return Job(key=key, group="bounds", arguments=arguments, code=bound_version())


@functools.cache
def bound_version() -> str:
    """The digest of the code that decides a bound, which is far less than what decides a run in the loop."""
    return hashlib.sha256(json.dumps(made_of(("study/bound.py",)), sort_keys=True).encode()).hexdigest()[:12]
