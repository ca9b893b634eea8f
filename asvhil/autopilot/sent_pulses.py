"""The pulses that were sent, and which of them a report of the outputs may answer. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from asvhil.autopilot.distortions import Pulses


class SentPulses:
    """Pulses sent (rows), and for each report which of them it may be an answer to, by its time and its lag (ns)."""

    def __init__(self, sent: Sequence[tuple[int, tuple[int, int]]], reported_ns: list[int], lags_ns: list[int]) -> None:
        times = np.array([t_ns for t_ns, _ in sent])
        self.pulses: Pulses = np.array([us for _, us in sent], dtype=float)
        self._answers = np.zeros((len(reported_ns), len(times)), dtype=bool)
        for row, (t_ns, lag_ns) in enumerate(zip(reported_ns, lags_ns, strict=True)):
            stood = int(np.searchsorted(times, t_ns - lag_ns, side="right")) - 1
            self._answers[row, max(stood, 0) : int(np.searchsorted(times, t_ns, side="right"))] = True

    def residuals_us(self, expected: Pulses, reported: Pulses) -> npt.NDArray[np.float64]:
        """For each report its least distance to what is expected of the pulses it may answer, the worse motor's.

        Both motors must fit by the same pulses: they went out in one message.
        """
        off_us = np.abs(reported[:, None, :] - expected[None, :, :]).max(axis=2)
        least_us: npt.NDArray[np.float64] = np.where(self._answers, off_us, np.inf).min(axis=1)
        return least_us

    def least(self, values: Pulses) -> Pulses:
        """The least of a value of the pulses among those that a report may answer, by report and motor."""
        found: Pulses = np.where(self._answers[:, :, None], values[None, :, :], np.inf).min(axis=1)
        return found
