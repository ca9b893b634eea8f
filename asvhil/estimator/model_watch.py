"""The watch over the vessel model: whether it fits the boat, what is told of it, and when a hold is to end for it."""

from __future__ import annotations

import math

from asvhil.config import MonitorConfig
from asvhil.estimator.monitor import ModelMonitor
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Estimate, Note, PredictionError, Wind

SUBJECT = "model"
# So much of a steady push (m/s^2) may be a current. Held with half the thrust, twice the mass or slow motors, WAM-V,
# BREAM and BlueBoat had 0.11 at the most in three quarters of the time; a current of 0.4 m/s gives 0.14 and more.
CURRENT_MPS2 = 0.12
# And the current by the watch over the motion is at least this, within its standard deviation. With a weak motor in 6
# and 8 m/s of wind it was below 0.26, across and against currents of 0.5 m/s and more above 0.5.
CURRENT_MPS = 0.3
REPLACED = Note(
    subject=SUBJECT, text="of another hull than vehicle.vessel, whose physics stand in for it (on_other_hull)", ok=False
)


class ModelWatch:
    """`step` in each control tick, then `note_held`. A mismatch that lasts is told, and stands until the hold ends.

    In a strong current it cannot be told from the current's own effects: then both are told, and no hold ends for it.
    Whether there is one, `note_current` says.

    `replaced`: the physics stand in for a learned model of another hull, which is told all the time.
    """

    def __init__(self, config: MonitorConfig, monitor: ModelMonitor, *, replaced: bool = False) -> None:
        self._config = config
        self._monitor = monitor
        self._replaced = (REPLACED,) if replaced else ()
        self._bad_ns: int | None = None  # since when errors are beyond a limit
        self._certain_ns: int | None = None  # since when they are, and no current can be why
        self._found: Explanation | None = None
        self._current_mps = math.inf  # the most that it can be; not known
        self.ok = True

    def note_current(self, current_mps: tuple[float, float], std_mps: float) -> None:
        """The current (north, east) by the watch over the motion, and its standard deviation."""
        self._current_mps = math.hypot(*current_mps) + std_mps

    def step(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None) -> PredictionError | None:
        """The errors of the model's prediction, once its horizon is filled (see `ModelMonitor.step`)."""
        error = self._monitor.step(estimate, model_input, wind)
        self.ok = error is None or error.ok
        if error is None or error.ok:
            self._bad_ns = self._certain_ns = None
            return error
        if self._bad_ns is None:
            self._bad_ns = estimate.t_ns
        if self._current_mps >= CURRENT_MPS and self._monitor.push_mps2 >= CURRENT_MPS2:
            self._certain_ns = None
        elif self._certain_ns is None:
            self._certain_ns = estimate.t_ns
        lasting_ns = estimate.t_ns - round(self._config.mismatch_s * 1e9)
        if self._certain_ns is not None and self._certain_ns <= lasting_ns:
            if self._found is None or self._found.reason is not Reason.MODEL_MISMATCH:
                self._found = self._worst(error, Reason.MODEL_MISMATCH)
        elif self._found is None and self._bad_ns <= lasting_ns:
            self._found = self._worst(error, Reason.MODEL_OR_CURRENT)
        return error

    def note_held(self, *, held: bool) -> None:
        """Whether a station is held from now on."""
        if not held:
            self._bad_ns = self._certain_ns = self._found = None

    @property
    def fault(self) -> Explanation | None:
        """Why a hold is to end, where the config asks for that."""
        if self._config.on_mismatch != "release" or self._found is None:
            return None
        return self._found if self._found.reason is Reason.MODEL_MISMATCH else None

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is wrong with the model."""
        found = () if self._found is None else (Note(subject=SUBJECT, text=describe(self._found), ok=False),)
        return (*self._replaced, *found)

    def _worst(self, error: PredictionError, reason: Reason) -> Explanation:
        """The velocity that is farthest beyond its limit."""
        config = self._config
        limits = (config.max_u_mps, config.max_v_mps, config.max_r_radps)
        names = (("surge", "m/s"), ("sway", "m/s"), ("yaw rate", "rad/s"))
        errors = self._monitor.unexplained
        i = max(range(3), key=lambda i: errors[i] / limits[i])
        what, unit = names[i]
        return explain(reason, what=what, error=f"{errors[i]:.2g} {unit}", horizon_s=error.horizon_s)
