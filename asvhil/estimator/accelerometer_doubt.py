"""Whether the accelerometer is doubted: the vessel model and the receiver's velocity agree against it.

The prediction follows the accelerometer, so a wrong one carries the estimate off while it counts as certain, and then
the sound receiver is what is rejected. What makes it wrong is gravity, 0.17 m/s^2 per degree of tilt that nobody takes
out: a person who shifts, a load, a sensor that is not level. A real force shows in it and in the receiver's velocity,
but not in the model; a fault of the receiver in neither of the other two. So two of three decide.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from asvhil.estimator.sensor_health import NEVER

SMOOTH_S = 1.0  # time constant of both means
MEAN_S = 5.0  # time constant of the accelerometer's mean error while it is doubted: its new bias
# At least so far off. In 33 runs of sound simulated boats (winds of 3 to 10 m/s, waves, ways to a station) none came
# beyond 0.84 of both at once, most while the sensor's bias is still being learnt.
LEAST_MPS2 = 0.12
LEAST_SIGMA = 4.0  # standard deviations of a single velocity's innovation
LATE_S = 0.4  # a velocity that comes so late is off by as much of a real acceleration, the other way
FAR_MPS2 = 1.0  # six degrees: more is no tilt that a boat keeps, and no bias
OPPOSED = -0.7  # cosine between the two means: the one comes of the other
FIRST_NS, LONGEST_NS = 10_000_000_000, 320_000_000_000
AGAIN_NS = 60_000_000_000  # after the last doubt: one that comes sooner lasts twice as long

Pair = tuple[float, float]


class Doubt(NamedTuple):
    """Means of the specific force, its innovation (m/s^2) and that of velocity (m/s), body axes; and the last doubt."""

    shown: Pair = (0.0, 0.0)
    force: Pair = (0.0, 0.0)
    velocity: Pair = (0.0, 0.0)
    until_ns: int = NEVER
    lasts_ns: int = 0
    open: bool = False  # begun, and not yet ended with a new bias

    def holds(self, t_ns: int) -> bool:
        """Whether the accelerometer is left out at a time."""
        return t_ns < self.until_ns

    def with_force(self, t_ns: int, shown: Pair, innovation: Pair, interval_s: float) -> Doubt:
        """The same after a specific force, in use or not."""
        share = interval_s / (MEAN_S if self.holds(t_ns) else SMOOTH_S)
        means = _towards(self.shown, shown, share), _towards(self.force, innovation, share)
        return Doubt(*means, self.velocity, self.until_ns, self.lasts_ns, self.open)  # _replace takes twice as long

    def with_velocity(self, innovation: Pair, interval_s: float) -> Doubt:
        """The same after a velocity, accepted or rejected."""
        return self._replace(velocity=_towards(self.velocity, innovation, interval_s / SMOOTH_S))

    def is_due(self, std_mps: float) -> bool:
        """Whether a doubt begins, with the standard deviation of a velocity's innovation."""
        (ax, ay), (u, v) = self.force, self.velocity
        force, velocity = math.hypot(ax, ay), math.hypot(u, v)
        if force < LEAST_MPS2 or velocity < LEAST_SIGMA * std_mps + LATE_S * math.hypot(*self.shown):
            return False
        return ax * u + ay * v <= OPPOSED * force * velocity

    def begun(self, t_ns: int) -> Doubt:
        """The doubt from a time on; of a sensor that is doubted again and again, for longer each time."""
        again = t_ns - self.until_ns < AGAIN_NS
        lasts_ns = min(2 * self.lasts_ns, LONGEST_NS) if again else FIRST_NS
        return self._replace(velocity=(0.0, 0.0), until_ns=t_ns + lasts_ns, lasts_ns=lasts_ns, open=True)

    def is_over(self, t_ns: int) -> bool:
        """Whether the accelerometer comes into use again, with `force` as what its bias has changed by."""
        return self.open and not self.holds(t_ns)

    @property
    def is_bias(self) -> bool:
        """Whether what it has been off by can be a bias, such as of a tilt that lasts."""
        return math.hypot(*self.force) <= FAR_MPS2

    def ended(self) -> Doubt:
        """The same once that is done."""
        return self._replace(force=(0.0, 0.0), open=False)


def _towards(mean: Pair, value: Pair, share: float) -> Pair:
    gain = share / (1.0 + share)
    return mean[0] + gain * (value[0] - mean[0]), mean[1] + gain * (value[1] - mean[1])
