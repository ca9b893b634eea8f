"""What every state estimator offers to the backseat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from asvhil.geo import LocalFrame
from asvhil.types import Estimate, Measurement, Note


class StateEstimator(Protocol):
    """Measurements in, the state of the boat out.

    `frame` is the local NED frame, None before the first position with a heading known; before that `estimate` gives
    None.
    """

    @property
    def frame(self) -> LocalFrame | None: ...

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float] | None) -> None:
        """What drives the boat from now on: the model's input, and the true wind (m/s, NED) where it is known."""

    def on_measurements(self, measurements: Sequence[Measurement]) -> None:
        """Take in the measurements of one frame, as the decoder gives them; kinds that it does not use are ignored."""

    def estimate(self, t_ns: int) -> Estimate | None:
        """The state at a time, not valid while what it needs is stale."""

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """Sensors that are not as they should be."""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what was not believed."""
