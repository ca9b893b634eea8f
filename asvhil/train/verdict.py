"""Whether a trained model is good enough to keep a station with: by its horizon errors and by the check at rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from asvhil.train.at_rest import AtRest
from asvhil.train.choice import TOLERANCE_MPS2
from asvhil.train.evaluate import AXES, HOLD
from asvhil.types import record

HORIZON_S = 10.0  # of the rollouts: about what the MPC looks ahead
EVERY_S = 2.0
LEAST_WINDOWS = 10  # in motion: fewer tell nothing
KNOWS = 0.5  # of the error of a constant velocity, which knows nothing
NOT_WORSE = 1.1  # times the error of the fitted physics
FITTED = "sd"
UNITS = {"u": "m/s", "v": "m/s", "r": "rad/s"}

Rows = Mapping[str, Mapping[str, Any]]


@record
class ModelVerdict:
    """`good`: hold with it. Else `faults` say why not, one line each; `passed` what is right about it."""

    passed: tuple[str, ...]
    faults: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.faults


def judge(name: str, rows: Rows, check: AtRest) -> ModelVerdict:
    """The verdict on the model `name` among the rows of `evaluate.evaluate`, which has those of FITTED and HOLD too.

    Errors are means over windows in motion that the model was not trained on. Those of surge and yaw are at most half
    of a constant velocity's, and none of the three is beyond 1.1 times that of the physics fitted to the same data. At
    rest in still air the boat stays, more wind is more load, and the thrust has no dip.
    """
    own, still = rows[name]["moving"], rows[HOLD]["moving"]
    if own["windows"] < LEAST_WINDOWS:
        found = f"{own['windows']} stretches of {HORIZON_S:g} s in motion"
        fault = f"the test has {found}, and {LEAST_WINDOWS} or more are needed"
        return ModelVerdict(passed=(), faults=(fault,))
    said: list[tuple[bool, str]] = []
    for axis in AXES:
        error, constant = own[f"mae_{axis}"], still[f"mae_{axis}"]
        words = f"{axis} is off by {error:.3f} {UNITS[axis]} over {HORIZON_S:g} s"
        if axis != "v":
            share = 100.0 * error / constant if constant > 0.0 else 100.0
            said.append((share <= 100.0 * KNOWS, f"{words}, {share:.0f} % of what a constant velocity would be"))
        fitted = rows[FITTED]["moving"][f"mae_{axis}"]
        said.append((error <= NOT_WORSE * fitted, f"{words}; the fitted physics by {fitted:.3f}"))
    stays = "stays where it is" if check.stays else "starts to move by itself"
    said.append((check.stays, f"at rest in still air the boat {stays}"))
    rises = "more wind is more load" if check.rising else f"more wind is less load, by {check.fall_mps2:.3f} m/s^2"
    said.append((check.rising, f"at rest {rises}"))
    dip = check.thrust_dip_mps2 > TOLERANCE_MPS2
    said.append((not dip, "the thrust falls where the command rises" if dip else "the thrust rises with the command"))
    return ModelVerdict(
        passed=tuple(words for right, words in said if right), faults=tuple(words for right, words in said if not right)
    )
