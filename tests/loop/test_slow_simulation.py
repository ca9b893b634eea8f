"""A simulation that runs slower than real time for a while: its boat is behind for good, and the estimate with it."""

import dataclasses
import math

import pytest

from asvhil.config import load_config
from asvhil.types import Frame, Outputs
from tests.support.loop import GroundStationLoop
from tests.support.settled import NO_BIAS


class SlowPlant(GroundStationLoop):
    """The boat's time goes at `pace` of ours from one time to another (s)."""

    def __init__(self, from_s: float, until_s: float, pace: float, config: str) -> None:
        super().__init__(load_config(config, (NO_BIAS, "plant.weather.wind.speed_mps=6")))
        self._slow_s = (from_s, until_s)
        self._pace = pace
        self._behind_ns = 0

    def receive(self) -> tuple[Frame, ...]:
        now_ns, from_s, until_s = self.t_ns, *self._slow_s
        if from_s * self.config.daemon.tick_hz <= self.ticks < until_s * self.config.daemon.tick_hz:
            self._behind_ns += round((1.0 - self._pace) * self.period_ns)
        self.t_ns -= self._behind_ns
        frames = super().receive()
        self.t_ns = now_ns
        return tuple(dataclasses.replace(frame, t_ns=frame.t_ns + self._behind_ns) for frame in frames)

    def error_m(self, outputs: Outputs) -> float:
        """How far the estimate is from the true boat."""
        assert outputs.estimate is not None and outputs.origin_deg is not None
        truth = self.plant.truth
        n_m, e_m = self.plant.origin.to_ned(*outputs.origin_deg)
        return math.hypot(n_m + outputs.estimate.n_m - truth.n_m, e_m + outputs.estimate.e_m - truth.e_m)


@pytest.mark.parametrize(
    ("from_s", "until_s", "pace", "config"),
    [
        pytest.param(13.0, 18.0, 0.6, "sitl", marks=pytest.mark.thorough),
        (15.0, 16.5, 0.05, "sitl-px4"),
        *(
            pytest.param(*cell, marks=pytest.mark.thorough)
            for cell in (
                (14.0, 17.0, 0.45, "sitl"),
                (14.0, 17.0, 0.45, "sitl-px4"),
                (13.0, 18.0, 0.6, "sitl-px4"),
                (15.0, 16.5, 0.05, "sitl"),
            )
        ),
    ],
)
def test_what_it_loses_while_the_boat_approaches_is_not_taken_for_the_receivers_error(
    from_s: float, until_s: float, pace: float, config: str
) -> None:
    loop = SlowPlant(from_s, until_s, pace, config)
    outputs = loop.wait(until_s + 7.0)
    assert "has fallen behind" in {n.subject: n.text for n in outputs.health.notes}["autopilot's clock"]
    loop.wait(9.0)
    errors_m = [loop.error_m(loop.step()) for _ in range(200)]
    assert sum(errors_m) / len(errors_m) < 0.4, "0.5 to 1.0 where it is"
    outputs = loop.wait(15.0)
    assert "autopilot's clock" not in {n.subject for n in outputs.health.notes}
