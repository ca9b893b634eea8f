"""When the motion of the boat tells nothing of its model: why learning on station is frozen."""

from __future__ import annotations

import math

from asvhil.backseat.perception import Perceived
from asvhil.types import Phase, Station

FASTEST_MPS, FASTEST_RADPS = 1.5, 0.6  # beyond what models of station keeping were trained on
ROUGH_SHARE = 0.5  # of the waves that the wave filter takes out, by the model that is to be judged

NO_HOLD = "no station is held"
SENSOR = "a sensor is in doubt"
MOTORS = "the motors are in doubt"
WAY_IN = "on the way to the station"
FAST = "faster than the model knows"
ROUGH = "rough water"


def doubt(
    seen: Perceived, phase: Phase, station: Station | None, *, near_m: float, sensors_ok: bool, motors_ok: bool
) -> str:
    """The reason in words; empty where there is none. `near_m`: how far from the station the boat is on its way."""
    estimate = seen.estimate
    if phase is not Phase.HOLD or station is None or estimate is None:
        return NO_HOLD
    if not (estimate.valid and sensors_ok):
        return SENSOR
    if not motors_ok:
        return MOTORS
    if math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m) > near_m:
        return WAY_IN
    if math.hypot(estimate.u_mps, estimate.v_mps) > FASTEST_MPS or abs(estimate.r_radps) > FASTEST_RADPS:
        return FAST
    if seen.waves is not None and seen.waves.share >= ROUGH_SHARE:
        return ROUGH
    return ""
