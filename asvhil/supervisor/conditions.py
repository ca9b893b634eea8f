"""What must be so for a station to be taken up and held: link, mode, arming, pilot's stations, estimate and fence."""

from __future__ import annotations

import math

from asvhil.config import SupervisorConfig
from asvhil.geo import LocalFrame
from asvhil.supervisor.geofence import Geofence
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.stations import place_of_point, station_of_origin
from asvhil.types import Estimate, FrontseatStatus, Radio, Station

PLANE_M = 20_000.0  # from the first position: as far as a degree of longitude is as long as there, to 0.3 %
STICKS_OLD_NS = 3_000_000_000  # a pilot who moves a stick must have been seen by then


class Conditions:
    """Judges a situation by the config alone: without memory, and without a say in what follows from it."""

    def __init__(self, config: SupervisorConfig) -> None:
        self._config = config
        self._fence = Geofence(config.geofence)

    def why_not(self, situation: Situation, fault: Explanation | None, hidden_stick: int | None) -> Explanation | None:
        """Why a hold cannot begin. `fault`: of the motors; `hidden_stick`: a channel that is not seen."""
        status = situation.status
        if situation.stranger is not None:
            return situation.stranger
        if status is None or not self.link_ok(situation):
            return explain(Reason.NO_HEARTBEAT)
        if not _mode_known(situation, self._config.heartbeat_timeout_s):
            return explain(Reason.MODE_UNKNOWN)
        if fault is not None:
            return fault
        if hidden_stick is not None:
            return explain(Reason.STICK_HIDDEN, channel=hidden_stick)
        if _are_sticks_unseen(situation.t_ns, status):
            return explain(Reason.STICKS_UNSEEN)
        if not status.armed:
            return explain(Reason.NOT_ARMED, hint=status.arming_fault)
        if self.is_transmitter_lost(status):
            return explain(Reason.TRANSMITTER_LOST)
        lost = self.lost_station(situation)
        if lost is not None:
            return lost
        if status.mode != self._config.control_mode and not self._config.take_mode:
            return explain(Reason.WRONG_MODE, mode=status.mode, needed=self._config.control_mode)
        if situation.estimate is None or not situation.estimate.valid:
            return explain(Reason.NO_ESTIMATE)
        away_m = math.hypot(situation.estimate.n_m, situation.estimate.e_m)
        if away_m > PLANE_M:
            return explain(Reason.FAR_FROM_ORIGIN, distance_km=away_m / 1000.0)
        return self.left_fence(situation)

    def link_ok(self, situation: Situation) -> bool:
        """Whether the autopilot was heard lately."""
        age_s = situation.heartbeat_age_s if situation.heard_age_s is None else situation.heard_age_s
        return age_s is not None and age_s <= self._config.heartbeat_timeout_s

    def unheard(self, situation: Situation) -> Explanation | None:
        """What the autopilot no longer tells, without which nobody knows whether the motors are still ours."""
        if not self.link_ok(situation):
            return explain(Reason.HEARTBEAT_LOST)
        if not _mode_known(situation, self._config.mode_timeout_s):
            return explain(Reason.MODE_UNKNOWN)
        if situation.status is not None and _are_sticks_unseen(situation.t_ns, situation.status):
            return explain(Reason.STICKS_UNSEEN)
        return None

    def is_transmitter_lost(self, status: FrontseatStatus) -> bool:
        """Whether the pilot's transmitter is lost, where that ends a hold."""
        return status.radio is Radio.LOST and self._config.transmitter_lost == "release"

    def lost_station(self, situation: Situation) -> Explanation | None:
        """The ground station of a pilot without a transmitter, once it was heard and is silent.

        One that was never heard is lost by nobody: an autopilot need not pass on the heartbeats of other links.
        """
        timeout_s, status = self._config.ground_station_timeout_s, situation.status
        if timeout_s is None or situation.station_age_s is None or situation.station_age_s <= timeout_s:
            return None
        if status is not None and status.has_transmitter:
            return None
        return explain(Reason.STATION_LOST, seconds=timeout_s)

    def place(self, situation: Situation) -> Estimate | None:
        """The estimate, with the place of the point of the boat that is kept at the station."""
        return None if situation.estimate is None else place_of_point(situation.estimate, self._config.point_m)

    def outside(self, station: Station, frame: LocalFrame) -> Explanation | None:
        """Why the point of the boat, or its origin, would not be where it may be."""
        origin = station_of_origin(station, self._config.point_m)
        places = dict.fromkeys(((station.n_m, station.e_m), (origin.n_m, origin.e_m)))
        refusals = (self._fence.refusal("station", place, frame) for place in places)
        return next((refusal for refusal in refusals if refusal is not None), None)

    def left_fence(self, situation: Situation) -> Explanation | None:
        """Why the boat is not where it may be. Where it is unknown, other watches have the word."""
        estimate, frame = situation.estimate, situation.frame
        if estimate is None or frame is None or not estimate.valid:
            return None
        return self._fence.refusal("boat", (estimate.n_m, estimate.e_m), frame)


def _mode_known(situation: Situation, timeout_s: float) -> bool:
    """Whether the autopilot has told its mode and arming lately."""
    return situation.heartbeat_age_s is not None and situation.heartbeat_age_s <= timeout_s


def _are_sticks_unseen(t_ns: int, status: FrontseatStatus) -> bool:
    """Whether the pilot has a transmitter, as far as is known, and the autopilot does not tell where its sticks are.

    Without a receiver PX4 tells of no sticks, and a transmitter that is lost is for `is_transmitter_lost`.
    """
    if not status.rc_us:
        return status.radio is Radio.HEARD
    return status.radio in (Radio.HEARD, Radio.UNKNOWN) and status.rc_ns > 0 and t_ns - status.rc_ns > STICKS_OLD_NS
