"""The interface of every state estimator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from asvhil.geo import LocalFrame
from asvhil.types import Estimate, Measurement, Note


class StateEstimator(Protocol):
    """State estimator: measurements in, the state of the boat out.

    `frame` is the local NED frame, None before the first position with a heading known; before that `estimate` gives
    None.
    """

    @property
    def frame(self) -> LocalFrame | None: ...

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float] | None) -> None:
        """Set what drives the boat from now on: the model's input (2), and the true wind (m/s, NED) if known."""

    def on_measurements(self, measurements: Sequence[Measurement]) -> None:
        """Process the measurements of one frame, as the decoder gives them; unused kinds are ignored."""

    def estimate(self, t_ns: int) -> Estimate | None:
        """The state at a time; not valid while a sensor that it needs is stale."""

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """Notes on sensors with faults."""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of rejected readings."""
