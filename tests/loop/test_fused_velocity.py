"""Station keeping with the velocity of an autopilot's filter, which is off by centimetres a second for minutes."""

from collections.abc import Callable
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.io.sensors import mavlink_sensors
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import GroundVelocity
from tests.support.settled import NO_BIAS, settled

# As measured on a real ArduRover, which has it for 5 minutes to one side and then to the other.
LASTING = "plant.sensors.fused_velocity={slow_bias_mps: 0.02, slow_bias_time_s: 600}"
FUSED = "links.autopilot.position_source=GLOBAL_POSITION_INT"


def distance_m(*overrides: str, seed: int = 1) -> float:
    """Mean distance of the true position to the station, from 70 to 120 s."""
    loop = Lockstep(load_config("sitl", (NO_BIAS, LASTING, f"plant.seed={seed}", *overrides)))
    return settled(loop, 120.0, 70.0)[0]


@pytest.fixture
def trusting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the filter take the velocity for one that is independent of the position."""
    honest: Callable[..., GroundVelocity] = GroundVelocity

    def independent(fused: bool = False, **fields: Any) -> GroundVelocity:
        return honest(**fields)

    monkeypatch.setattr(mavlink_sensors, "GroundVelocity", independent)


@pytest.mark.usefixtures("trusting")
@pytest.mark.thorough
def test_a_filter_that_takes_it_for_independent_leaves_the_station() -> None:
    assert distance_m(FUSED) > 1.0


@pytest.mark.thorough
def test_the_filter_as_shipped_keeps_the_station() -> None:
    assert distance_m(FUSED) < 0.4


@pytest.mark.thorough
def test_the_receiver_s_velocity_is_used_as_shipped_and_has_no_such_error() -> None:
    assert distance_m() < 0.5  # what is left is the white noise of that velocity, added up
