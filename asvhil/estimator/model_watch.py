"""The watch over the vessel model: whether it fits the boat, what is told of it, and when a hold is to end for it."""

from __future__ import annotations

from asvhil.config import MonitorConfig
from asvhil.estimator.monitor import ModelMonitor
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Estimate, Note, PredictionError, Wind

SUBJECT = "model"
REPLACED = Note(
    subject=SUBJECT, text="of another hull than vehicle.vessel, whose physics stand in for it (on_other_hull)", ok=False
)


class ModelWatch:
    """`step` in each control tick, then `note_held`. A mismatch that lasts is told, and stands until the hold ends.

    `replaced`: the physics stand in for a learned model of another hull, which is told all the time.
    """

    def __init__(self, config: MonitorConfig, monitor: ModelMonitor, *, replaced: bool = False) -> None:
        self._config = config
        self._monitor = monitor
        self._replaced = (REPLACED,) if replaced else ()
        self._bad_ns: int | None = None
        self._found: Explanation | None = None
        self.ok = True

    def step(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None) -> PredictionError | None:
        """The errors of the model's prediction, once its horizon is filled (see `ModelMonitor.step`)."""
        error = self._monitor.step(estimate, model_input, wind)
        self.ok = error is None or error.ok
        if error is None or error.ok:
            self._bad_ns = None
            return error
        if self._bad_ns is None:
            self._bad_ns = estimate.t_ns
        if self._found is None and (estimate.t_ns - self._bad_ns) * 1e-9 >= self._config.mismatch_s:
            self._found = self._worst(error)
        return error

    def note_held(self, *, held: bool) -> None:
        """Whether a station is held from now on."""
        if not held:
            self._bad_ns = self._found = None

    @property
    def fault(self) -> Explanation | None:
        """Why a hold is to end, where the config asks for that."""
        return self._found if self._config.on_mismatch == "release" else None

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is wrong with the model."""
        found = () if self._found is None else (Note(subject=SUBJECT, text=describe(self._found), ok=False),)
        return (*self._replaced, *found)

    def _worst(self, error: PredictionError) -> Explanation:
        """The velocity that is farthest beyond its limit."""
        config = self._config
        limits = (config.max_u_mps, config.max_v_mps, config.max_r_radps)
        names = (("surge", "m/s"), ("sway", "m/s"), ("yaw rate", "rad/s"))
        i = max(range(3), key=lambda i: error.horizon[i] / limits[i])
        what, unit = names[i]
        return explain(
            Reason.MODEL_MISMATCH, what=what, error=f"{error.horizon[i]:.2g} {unit}", horizon_s=error.horizon_s
        )
