"""Whether a place and its rate, which two sensors measure, agree: the place less the integrated rate stays where it is.

A receiver measures positions by ranges and velocities by Doppler shifts; a compass measures the heading and a gyro its
rate. A place that jumps leaves the integral of the rate, and a wrong rate leaves the places. Where neither does, both
are right about the motion, however far it is from what the vessel model predicts: aground, in a current, with a motor
that turns the wrong way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

MEAN_S = 5.0  # time constant of what they agree on: a receiver's slow error moves it by decimetres meanwhile
SHARE = 0.3  # of what a wrong rate would have moved it by: less clears the rate

Pair = tuple[float, float]


class Agreement(NamedTuple):
    """The mean of the places less the integrated rate, the last one, and how far that was off. In m, NED, or rad."""

    mean: Pair | None = None
    last: Pair = (0.0, 0.0)
    off: float = 0.0

    def with_place(self, place: Pair, integral: Pair, elapsed_s: float, *, accepted: bool) -> Agreement:
        """The same after a place, so long after the one before; the mean moves while both sensors are `accepted`."""
        apart = place[0] - integral[0], place[1] - integral[1]
        mean = apart if self.mean is None else self.mean
        off = apart[0] - mean[0], apart[1] - mean[1]
        if accepted:
            gain = elapsed_s / (MEAN_S + elapsed_s)
            mean = mean[0] + gain * off[0], mean[1] + gain * off[1]
        return Agreement(mean, apart, math.hypot(*off))

    def clears_place(self, slack: float) -> bool:
        """Whether the last place has not jumped by more than a slack."""
        return self.mean is not None and self.off <= slack

    def clears_rate(self, off_per_s: float, span_s: float, slack: float) -> bool:
        """Whether a rate that has been so far off the prediction for so long is borne out by the places.

        It is not while what it would have moved them by is within a slack.
        """
        moved = off_per_s * span_s
        return self.mean is not None and moved > slack and self.off <= SHARE * moved
