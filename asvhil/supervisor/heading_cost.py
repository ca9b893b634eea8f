"""What a station's heading costs in the weather: how far a boat without a sideways force will be off, and its thrust.

A steady load to the side can only be borne by swinging: the thrust, ahead and astern by turns, then has a part to the
side. With the thrust F that can be given both ways and a side load Y the heading swings by about asin(Y / F), and the
boat runs up and down by F / m for as long as a swing takes at the yaw moment N of opposite thrusts: by a distance in
proportion to (F / m) / (N / I) times a power of the swing. The factors are fitted to the physical bound of the WAM-V
(`asvhil study bound`), the best that any controller could do in a steady wind. The electrical power of that is what the
thrust takes ahead for half of the time and astern for the other; that of a boat along the weather, the mean thrust's.
Full thrust is no forecast: a controller that works less, as the BlueBoat's, takes less than half, and is farther off.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from asvhil.config import VesselConfig
from asvhil.geo import wrap_rad
from asvhil.types import Note, Station, record

SUBJECT = "heading cost"
PushAt = Callable[[float], tuple[float, float] | None]
# Of the bounds of the WAM-V in 3 and 6 m/s from abeam: their standard deviation of the heading, and mean distance.
SWING = 0.92
DISTANCE, POWER = 3.6, 0.81
STILL_RAD = math.radians(1.5)  # a swing that is lost among gusts and waves
MOST_RAD = math.radians(45.0)  # beyond, the boat is driven off: the WAM-V was held across 11 m/s (41), not 12 (51)
EVERY_NS = 10_000_000_000
TURNED_RAD = math.radians(5.0)  # a station that is turned by more is looked at at once
CHANGED = 0.2  # of what was told last: less is not told anew


@record
class HeadingCost:
    """Of one heading: mean distance (m) and standard deviation of the heading (rad) at the least, mean thrust along the
    boat over what the motors can give (0 to 1), and whether the station can be held at all. `thrusts_n`: of both motors
    together, each for half of the time.
    """

    distance_m: float
    swing_rad: float
    thrust: float
    can_be_held: bool
    thrusts_n: tuple[float, float]

    @property
    def lies_still(self) -> bool:
        """Whether the weather on the side is too little to be seen among gusts and waves."""
        return self.can_be_held and self.swing_rad < STILL_RAD


def heading_cost(vessel: VesselConfig, ahead_mps2: float, abeam_mps2: float) -> HeadingCost:
    """The cost of a heading at which the weather pushes with these accelerations ahead and to starboard, at rest."""
    m_u, m_v = vessel.mass_kg + vessel.added_mass_surge_kg, vessel.mass_kg + vessel.added_mass_sway_kg
    ahead_n, astern_n = vessel.thrust_curve[-1][1], -vessel.thrust_curve[0][1]
    mean_n = -ahead_mps2 * m_u  # of both motors, against the load along
    limit_n = 2.0 * (ahead_n if mean_n >= 0.0 else astern_n)
    both_ways_n = min(2.0 * ahead_n - mean_n, 2.0 * astern_n + mean_n)
    side_n = abs(abeam_mps2) * m_v
    if both_ways_n <= 0.0 or side_n >= both_ways_n * math.sin(MOST_RAD):
        return HeadingCost(
            distance_m=math.inf,
            swing_rad=math.inf,
            thrust=min(abs(mean_n) / limit_n, 1.0),
            can_be_held=False,
            thrusts_n=(mean_n, mean_n),
        )
    swing_rad = math.asin(side_n / both_ways_n)
    turn_radps2 = vessel.motor_arm_m * (ahead_n + astern_n) / (vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2)
    run_m = both_ways_n / m_u / turn_radps2
    swings_n = 0.0 if swing_rad < STILL_RAD else both_ways_n
    return HeadingCost(
        distance_m=DISTANCE * run_m * math.pow(swing_rad, POWER),
        swing_rad=SWING * swing_rad,
        thrust=abs(mean_n) / limit_n,
        can_be_held=True,
        thrusts_n=(mean_n + swings_n, mean_n - swings_n),
    )


class HeadingCostWatch:
    """Tells of a station that is held what its heading costs; nothing where the boat can lie still.

    `power_of` gives the electrical power (W) of the boat at a thrust (N) of both motors together, None where that is
    not known.
    """

    def __init__(self, vessel: VesselConfig, power_of: Callable[[float], float | None] = lambda thrust_n: None) -> None:
        self._vessel = vessel
        self._power_of = power_of
        self._told: HeadingCost | None = None
        self._looked: tuple[int, float] | None = None  # when, at which heading
        self._moved_ns: int | None = None  # when the station did last
        self._notes: tuple[Note, ...] = ()

    def step(
        self, t_ns: int, station: Station | None, push_at: PushAt, push_at_rest: PushAt | None = None
    ) -> tuple[Note, ...]:
        """In each tick what there is to tell, of the station that is held.

        `push_at` gives the push (m/s^2, ahead and to starboard) of the weather, and of the water on a boat that moves
        with its station, at a heading (rad), None where that is not known; `push_at_rest` that of the weather alone,
        which is taken for the same without it. Both are asked when the cost is looked at, which is seldom.
        """
        if station is not None and self._looked is not None:
            then_ns, psi_rad = self._looked
            if station.moves:
                self._moved_ns = t_ns
            # One that waits for its boat, as it often does on a course across, would show nothing of the course.
            waits = not station.moves and self._moved_ns is not None and t_ns - self._moved_ns < EVERY_NS
            if (t_ns - then_ns < EVERY_NS or waits) and abs(wrap_rad(station.psi_rad - psi_rad)) < TURNED_RAD:
                return self._notes
        push_mps2 = None if station is None else push_at(station.psi_rad)
        if station is None or push_mps2 is None:
            self._told = self._looked = self._moved_ns = None
            self._notes = ()
            return ()
        cost = heading_cost(self._vessel, *push_mps2)
        self._looked = t_ns, station.psi_rad
        if self._told is None or _differ(cost, self._told):
            self._told = cost
            along_rad = station.psi_rad + math.atan2(push_mps2[1], push_mps2[0])
            at_rest = push_at_rest(station.psi_rad) if station.moves and push_at_rest is not None else None
            still = None if at_rest is None else heading_cost(self._vessel, *at_rest)
            course_rad = math.atan2(station.ve_mps, station.vn_mps) if _is_of_course(cost, still) else None
            self._notes = self._tell(cost, along_rad, push_at, course_rad)
        return self._notes

    def _tell(self, cost: HeadingCost, along_rad: float, push_at: PushAt, course_rad: float | None) -> tuple[Note, ...]:
        """`along_rad`: where the push is to; `course_rad`: that of the station, where it is the cause."""
        if cost.lies_still:
            return ()
        along = [push_at(wrap_rad(along_rad + turn)) for turn in (0.0, math.pi)]  # stern to it, bow to it
        powers = [self._power_w(heading_cost(self._vessel, push[0], 0.0)) for push in along if push is not None]
        least_w = min((power_w for power_w in powers if power_w is not None), default=None)
        if course_rad is not None:
            return _notes_of_course(cost, math.degrees(course_rad) % 360.0, self._power_w(cost))
        return _notes(cost, self._power_w(cost), least_w)

    def _power_w(self, cost: HeadingCost) -> float | None:
        """Mean power; None where it is not known, or the boat is not held."""
        one, other = (self._power_of(thrust_n) for thrust_n in cost.thrusts_n)
        return None if one is None or other is None or not cost.can_be_held else 0.5 * (one + other)


def _differ(a: HeadingCost, b: HeadingCost) -> bool:
    if a.can_be_held != b.can_be_held or a.lies_still != b.lies_still:
        return True
    return a.can_be_held and abs(a.distance_m - b.distance_m) > CHANGED * b.distance_m


def _is_of_course(cost: HeadingCost, still: HeadingCost | None) -> bool:
    """Whether a cost would not be there, or a station could be held, if it rested; `still`: the cost then."""
    return still is not None and (still.lies_still if cost.can_be_held else still.can_be_held)


def _notes_of_course(cost: HeadingCost, course_deg: float, power_w: float | None) -> tuple[Note, ...]:
    """Of a station whose course is across the boat, and not the weather."""
    cure = f"turn the heading along the course ({course_deg:.0f} deg), or choose a slower one"
    if not cost.can_be_held:
        text = f"the course is across the boat, which cannot follow so at the station's heading; {cure}"
        return (Note(subject=SUBJECT, text=text, ok=False),)
    takes = "" if power_w is None else f", for some {_watts(power_w)} W at full thrust"
    text = (
        f"the course is across the boat: at best {cost.distance_m:.1f} m off, {math.degrees(cost.swing_rad):.0f} deg "
        f"to either side, motors ahead and astern by turns{takes}; {cure}"
    )
    return (Note(subject=SUBJECT, text=text, ok=True),)


def _notes(cost: HeadingCost, power_w: float | None, least_w: float | None) -> tuple[Note, ...]:
    """`power_w`: at the station's heading; `least_w`: along the weather, on the better side."""
    if not cost.can_be_held:
        turned = "" if least_w is None else f" ({_watts(least_w)} W at least)"
        text = "this weather drives the boat off at the station's heading; turn it to the weather"
        text += f"{turned}, or end the hold"
        return (Note(subject=SUBJECT, text=text, ok=False),)
    takes = "" if power_w is None else f", for some {_watts(power_w)} W at full thrust"
    still = "" if least_w is None else f", for {_watts(least_w)} W at least"
    text = (
        f"the weather is on the side: at best {cost.distance_m:.1f} m off, {math.degrees(cost.swing_rad):.0f} deg to "
        f"either side, motors ahead and astern by turns{takes}; turned to it the boat would lie still{still}"
    )
    return (Note(subject=SUBJECT, text=text, ok=True),)


def _watts(power_w: float) -> str:
    """To tens from a hundred on: it is known no better."""
    return f"{round(power_w, -1 if power_w >= 100.0 else 0):.0f}"
