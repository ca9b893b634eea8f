"""What every state estimator offers to the backseat."""

from __future__ import annotations

from typing import Protocol

from asvhil.geo import LocalFrame
from asvhil.types import Attitude, Estimate, GnssFix, Imu, Note


class StateEstimator(Protocol):
    """Measurements in, in the order of their times; the state of the boat out.

    A measurement that lacks a part has NaN there. `frame` is the local NED frame, None before the first position with
    a heading known; before that `estimate` gives None.
    """

    @property
    def frame(self) -> LocalFrame | None: ...

    def set_forcing(self, model_input: tuple[float, float], wind_ned: tuple[float, float] | None) -> None:
        """What drives the boat from now on: the model's input, and the true wind (m/s, NED) where it is known."""

    def on_attitude(self, m: Attitude) -> None: ...

    def on_gnss(self, m: GnssFix) -> None: ...

    def on_imu(self, m: Imu) -> None: ...

    def estimate(self, t_ns: int) -> Estimate | None:
        """The state at a time, not valid while what it needs is stale."""

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """Sensors that are not as they should be."""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what was not believed."""
