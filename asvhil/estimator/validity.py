"""Validity of the estimate: all sensors, or enough of them to bridge a missing one."""

from __future__ import annotations

import math

from asvhil.config import TrustConfig
from asvhil.estimator.states import PSI, E, FilterState, N


def is_valid(state: FilterState, t_ns: int, stale_ns: int, config: TrustConfig) -> bool:
    """True with position and heading fresh; or with one of the two missing, for a time, while the others can bridge it.

    Position is bridged on heading and yaw rate (with velocity and acceleration where there are any), heading on
    position and yaw rate, within `dead_reckoning_s` and the limits of the predicted standard deviations.
    """
    if not all(map(math.isfinite, state.x.tolist())):
        return False
    tracks = state.tracks
    position_ns, heading_ns = t_ns - tracks["position"].accepted_ns, t_ns - tracks["heading"].accepted_ns
    if position_ns <= stale_ns and heading_ns <= stale_ns:
        return True
    bridge_ns = config.dead_reckoning_s * 1e9
    if max(position_ns, heading_ns) > bridge_ns or min(position_ns, heading_ns) > stale_ns:
        return False
    yaw_rate = tracks.get("yaw_rate")
    if yaw_rate is None or t_ns - yaw_rate.accepted_ns > stale_ns:
        return False
    variance = state.p
    position_std_m = math.sqrt(max(variance[N, N], variance[E, E]))
    heading_std_rad = math.sqrt(variance[PSI, PSI])
    return position_std_m <= config.position_std_max_m and heading_std_rad <= math.radians(config.heading_std_max_deg)
