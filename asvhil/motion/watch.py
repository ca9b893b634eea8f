"""The watch over the motion of a held boat: monitor and distance, and what follows from them."""

from __future__ import annotations

from asvhil.config import Config
from asvhil.config.registry import CONTROLLERS
from asvhil.motion.carried import CarriedWatch
from asvhil.motion.distance import DistanceWatch
from asvhil.motion.monitor import MotionMonitor
from asvhil.motion.turning import TurningWatch
from asvhil.supervisor.reasons import Explanation, Reason, describe
from asvhil.types import Estimate, GroundVelocity, Measurement, Note, Position, Station, WaveMotion, Wind, changed

SUBJECT = "motion"
OF_DISTANCE = frozenset({Reason.BEYOND_MOTORS, Reason.DRIFTED_OFF})
ROUGH_SHARE, ROUGH_MPS = 0.5, 0.04  # of the waves that the wave filter takes out, and their size: rough from there on
# After a hold has begun what is likely is told: later chance has had time to make as much of a sound boat.
LIKELY_S = 20.0
# What is wired wrong shows before that. A motor that turns wrong in mid hold, or never stops, has the boat spin, and
# estimate and controller go astray with it: then these resemble each other.
IN_MID_HOLD: dict[Reason, str] = {
    Reason.MOTORS_REVERSED: "or one of them alone, or one is stuck",
    Reason.MOTOR_REVERSED: "or the other one, or stuck",
}
WITHOUT_PLACE = frozenset({Position})
FOUND_AGAIN_NS = 3_000_000_000  # after a receiver has come back the estimate goes to where the boat is
FORGET_S = 20.0  # a fault without enough evidence for this long was a chance


class MotionWatch:
    """In each tick: `step` with what is known, then `note_station` once it is decided whether one is held.

    A controller that keeps no station, as for manoeuvres, may go where it likes, and its holds go on: what is found is
    told alone.
    """

    def __init__(self, config: Config) -> None:
        self._config = config.supervisor.motion
        vessel = config.believed_vessel
        self._keeps_station = CONTROLLERS.find(config.controller.name).keeps_station
        self._monitor = MotionMonitor(self._config, config.estimator.ekf, vessel)
        procedure = config.controller.procedure
        self._distance = DistanceWatch(self._config, vessel, procedure if procedure.enabled else None)
        self._carried, self._turning = CarriedWatch(), TurningWatch()
        self._velocity: GroundVelocity | None = None
        self._station: Station | None = None
        self._point: Station | None = None
        self._follows = False  # the station's heading: what a policy says
        self._found: Explanation | None = None
        self._is_sure = False  # or is it told alone
        self._ended = False
        self._begin_ns: int | None = None
        self._placeless_ns: int | None = None  # when the receiver was silent or frozen last
        self._seen_ns = 0  # when there was enough evidence last, or the boat was too far off

    def step(
        self,
        t_ns: int,
        measurements: tuple[Measurement, ...],
        command: tuple[float, float],
        wind: Wind | None,
        estimate: Estimate | None,
        ailing: frozenset[type],
        waves: WaveMotion | None = None,
    ) -> Explanation | None:
        """Why a hold is to end, from what came in this tick and the commands that the motors got before it.

        What was found stands until the hold ends, or until there has been too little evidence for a while.
        """
        if self._config.on_fault == "off":
            return None
        for measurement in measurements:
            self._monitor.on_measurement(measurement)
            if isinstance(measurement, GroundVelocity):
                self._velocity = measurement
        wind_ned = None if wind is None else (wind.vn_mps, wind.ve_mps)
        station = self._station
        # What is wired wrong shows at once. Later gusts and waves alone may look like a fault, by chance, and in waves
        # they may from the first; but a boat that has one does not stay where it is.
        rough = waves is not None and waves.share >= ROUGH_SHARE and waves.velocity_std_mps >= ROUGH_MPS
        since_s = 0.0 if self._begin_ns is None else (t_ns - self._begin_ns) * 1e-9
        early = not rough and since_s <= self._config.sense_s and not self._monitor.doubtful
        ails = ailing - WITHOUT_PLACE if ailing else ailing  # which the monitor does without
        fault = self._monitor.step(t_ns, command, wind_ned, ails, holding=station is not None, late=not early)
        place = None
        if estimate is not None and estimate.valid:
            place = self._carried.step(t_ns, None if GroundVelocity in ailing else self._velocity, estimate)
        else:
            self._carried.reset()
            self._turning.begin()
        if station is None:
            return None
        away = None
        if self._receiver_is_back(t_ns, ailing):
            self._distance.begin()  # how far off the boat has got meanwhile says nothing of the motors
        if self._keeps_station and place is not None:
            current, doubt_m = self._monitor.current_ned, self._carried.off_m
            away = self._distance.step(t_ns, place, station, command, current, doubt_m, self._point)
            away = away or self._turning.step(t_ns, place, station, follows=self._follows)
        if self._begin_ns is None:
            self._begin_ns = t_ns
        likely = self._monitor.likely if early and since_s <= LIKELY_S else None
        found = fault if fault is None or since_s <= LIKELY_S else _widened(fault)
        self._note(t_ns, found or away, likely)
        confirmed = (fault is not None and early) or away is not None
        confirmed = confirmed or (self._is_sure and self._distance.farther_m >= self._config.confirm_m)
        ends = confirmed and self._keeps_station and self._config.on_fault == "release"
        if ends and self._found is not None:
            self._ended = True
        return self._found if self._ended else None

    @property
    def current(self) -> tuple[tuple[float, float], float]:
        """The current (m/s, NED) that carries the boat, as far as it has shown, and its standard deviation (m/s)."""
        return self._monitor.current_ned, self._monitor.current_std_mps

    def _receiver_is_back(self, t_ns: int, ailing: frozenset[type]) -> bool:
        """Whether the boat's place is known again, and has been for no more than a moment."""
        if Position in ailing:
            self._placeless_ns = t_ns
            return False
        return self._placeless_ns is not None and t_ns - self._placeless_ns <= FOUND_AGAIN_NS

    def _note(self, t_ns: int, sure: Explanation | None, likely: Explanation | None) -> None:
        """Keep what was found first; what is sure takes the place of what is likely. No evidence for long: a chance."""
        if sure is not None or likely is not None:
            self._seen_ns = t_ns
        if (t_ns - self._seen_ns) * 1e-9 > FORGET_S and not self._ended:
            self._found, self._is_sure = None, False
        if sure is not None and not self._is_sure:
            self._found, self._is_sure = self._cause(sure), True
        elif self._found is None:
            self._found = likely

    def _cause(self, sure: Explanation) -> Explanation:
        """What is sure; but where it is the distance alone, a fault that was told as likely, and still is, is why.

        One that was told a while ago may have been chance: it is a hint.
        """
        likely = self._found
        if likely is None or sure.reason not in OF_DISTANCE:
            return sure
        if self._monitor.likely == likely:
            return _hinted(likely, f"{self._distance.farther_m:.0f} m farther off")
        return _hinted(sure, f"before that: {describe(likely)}")

    def note_station(
        self, station: Station | None, point: Station | None = None, heading_policy: str = "fixed"
    ) -> None:
        """The station that is held from now on, None where none is; `point`: that of the point that is kept there.

        `heading_policy`: what turns its heading.
        """
        if station is not None and self._station is None:
            self._monitor.begin()
            self._distance.begin()
            self._turning.begin()
            self._found, self._is_sure, self._ended, self._begin_ns = None, False, False, None
        self._station, self._point, self._follows = station, point, heading_policy != "fixed"

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was found, while the hold goes on."""
        if self._found is None or self._station is None:
            return ()
        return (Note(subject=SUBJECT, text=describe(self._found), ok=False),)


def _widened(fault: Explanation) -> Explanation:
    """A fault that was found in mid hold, with what it may be as well."""
    hint = IN_MID_HOLD.get(fault.reason)
    return fault if hint is None else _hinted(fault, hint)


def _hinted(why: Explanation, hint: str) -> Explanation:
    """A reason with a hint, unless it has one."""
    return changed(why, detail=tuple(sorted({"hint": hint, **dict(why.detail)}.items())))
