"""The heading of a station that follows the weather: with a dead band, so that it neither hunts nor turns in a gust."""

from __future__ import annotations

import math

from asvhil.config import HeadingConfig
from asvhil.geo import wrap_rad
from asvhil.types import Station, changed

LEAST_CHANGE_RAD = math.radians(1.0)  # of a station's heading from one sample to the next: less is a turn, as here
SETTLES = 1.5  # time constants of the weather in which a new hold follows what becomes known of it,
SETTLES_FASTER = 3.0  # and how many times as fast as later
STRONG_MPS2 = 0.025  # in less weather a turn is slower: where it comes from is known less well, and matters less
FAR = 2.0  # dead bands, from which on it is turned faster again in proportion: what is known badly is not that far off
CALMLY = 0.2  # of the turning rate, within the dead band
HURRIES_ON = 0.4  # of the dead band, down to which a turn that began beyond it is quick
THERE_RAD = math.radians(0.5)  # a turn ends this near to the weather's heading
OTHER_END_RAD = math.radians(110.0)  # off it: a free heading takes the boat's other end, which is then nearer by far


class HeadingPolicy:
    """`begin` with each hold or change of its station; then `turned` gives the station in each tick."""

    def __init__(self, config: HeadingConfig, *, weak_astern: bool = True) -> None:
        """`weak_astern`: a free heading has the weather on the bow, since the motors give less thrust astern."""
        self._config, self._weak_astern = config, weak_astern
        self._deadband_rad = math.radians(config.deadband_deg)
        self.policy: str = config.policy
        self._first = True
        self._turning = self._hurries = False
        self._settled_ns: int | None = None
        self._astern = False
        self._t_ns = 0

    def choose(self, policy: str) -> None:
        """Another policy from now on, also for the station that is held."""
        self.policy = policy
        self.begin()

    def begin(self) -> None:
        """A hold or a course begins, or the station was given a heading: in known weather the first turn is at once."""
        self._first, self._settled_ns = True, None

    def turned(
        self,
        t_ns: int,
        station: Station,
        bow_rad: float | None,
        boat_rad: float | None = None,
        push_mps2: float = math.inf,
    ) -> Station:
        """The station with the heading of this tick.

        `bow_rad`: the heading with the weather on the bow, `boat_rad` that of the boat; None where not known.
        `push_mps2`: how much the weather pushes there.
        """
        elapsed_s, self._t_ns = (t_ns - self._t_ns) * 1e-9, t_ns
        if self._settled_ns is None:
            self._settled_ns = t_ns + round(SETTLES * self._config.time_constant_s * 1e9)
        if self.policy == "fixed":
            return changed(station, of_weather=False) if station.of_weather else station
        if bow_rad is None:
            # Not in each tick: a boat that never has a heading to keep drifts about, and works against that.
            lies_rad = station.psi_rad if boat_rad is None or self.policy != "free" else boat_rad
            off_rad = abs(wrap_rad(lies_rad - station.psi_rad))
            return station if off_rad <= self._deadband_rad else changed(station, psi_rad=lies_rad)
        if self._first:
            self._astern = self._begins_astern(wrap_rad(bow_rad - station.psi_rad))
        wanted_rad = bow_rad + (math.pi if self._astern else 0.0)
        off_rad = wrap_rad(wanted_rad - station.psi_rad)
        if self.policy == "free" and not self._weak_astern and abs(off_rad) > OTHER_END_RAD:
            self._astern = not self._astern
            wanted_rad, off_rad = wanted_rad + math.pi, wrap_rad(off_rad + math.pi)
        if self._first:
            self._first, self._turning = False, True
            if t_ns < self._settled_ns:  # else it has been calm for long, and the boat lies as it was asked to
                return changed(station, psi_rad=wrap_rad(wanted_rad), of_weather=True)
            station = changed(station, of_weather=True)
        if abs(off_rad) > self._deadband_rad:
            self._turning = True
        if not self._turning:
            return station
        settling = t_ns < self._settled_ns
        # The last degrees are turned slowly, so that in steady weather no turn is a quick one.
        self._hurries = abs(off_rad) > (HURRIES_ON if self._hurries else 1.0) * self._deadband_rad
        slowly = push_mps2 / STRONG_MPS2 * max(1.0, abs(off_rad) / (FAR * self._deadband_rad))
        share = SETTLES_FASTER if settling else min(1.0 if self._hurries else CALMLY, slowly)
        most_rad = share * math.radians(self._config.turn_deg_per_min) / 60.0 * elapsed_s
        self._turning = settling or abs(off_rad) > max(THERE_RAD, most_rad)
        turn_rad = min(max(off_rad, -most_rad), most_rad)
        return changed(station, psi_rad=wrap_rad(station.psi_rad + turn_rad))

    def _begins_astern(self, bow_off_rad: float) -> bool:
        """Whether a hold begins with the weather on the stern; `bow_off_rad`: the turn to have it on the bow."""
        nearer_astern = math.cos(bow_off_rad) < 0.0
        match self.policy:
            case "either":
                return nearer_astern
            case "free":
                return nearer_astern and not self._weak_astern
            case _:
                return self.policy == "stern"
