"""Forces that no vessel model knows, a current across and the ground, in the closed loop: where the boat is."""

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Outputs
from tests.support.loop import place_error_m

HZ = 20
STEADY_RECEIVER = "plant.sensors.gnss.slow_bias_m=0"


class Measured(Lockstep):
    """A loop that keeps by how much (m) the valid estimate has been off at most."""

    def __init__(self, base: str, *overrides: str) -> None:
        super().__init__(load_config(base, overrides))
        self.off_m = 0.0

    def go_on(self, seconds: float, *, aground: bool = False) -> Outputs:
        for _ in range(round(seconds * HZ)):
            _, outputs = self.tick()
            vessel, off_m = self.plant._vessel, place_error_m(self, outputs)
            if aground:
                vessel.u_mps = vessel.v_mps = vessel.r_radps = 0.0
            self.off_m = max(self.off_m, off_m or 0.0)
        return outputs


@pytest.mark.parametrize(("base", "current_mps"), [("sitl-blueboat", 0.5), ("sitl-bream", 0.3)])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_current_across_does_not_carry_the_estimate_away(base: str, current_mps: float, seed: int) -> None:
    loop = Measured(
        base,
        STEADY_RECEIVER,
        f"plant.weather.current.speed_mps={current_mps}",
        "plant.weather.current.toward_deg=90",
        f"plant.seed={seed}",
    )
    loop.go_on(20.0)
    loop.off_m = 0.0
    assert loop.go_on(70.0).phase == "hold"
    assert loop.off_m < 2.2


@pytest.mark.parametrize("seed", [1, 2])
def test_a_boat_that_runs_aground_is_known_to_lie_where_it_does(seed: int) -> None:
    loop = Measured("sitl", STEADY_RECEIVER, f"plant.seed={seed}")
    loop.go_on(8.0)
    loop.go_on(6.0, aground=True)
    loop.off_m = 0.0
    outputs = loop.go_on(6.0, aground=True)
    assert loop.off_m < 1.0, "though neither motors nor accelerometer say that it has stopped"
    for _ in range(3):
        if outputs.phase == "hold":
            outputs = loop.go_on(5.0, aground=True)
    assert outputs.phase == "standby"
