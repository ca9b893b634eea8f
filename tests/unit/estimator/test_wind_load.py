"""The wind that explains a disturbance: inverse of the load of a known wind, and never marked valid."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.wind_load import WindFromLoad
from asvhil.geo import body_to_ned, ned_to_body
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Estimate

VESSEL = load_config("sitl").vehicle.vessel


def boat(wind: tuple[float, float], psi: float, nu: tuple[float, float, float]) -> Estimate:
    """A boat whose disturbance is the load of a wind that its prediction does not know."""
    model = SimplifiedDynamics(VESSEL)
    x, idle = np.array([*nu, 0.0, 0.0]), np.zeros(2)
    blown = np.asarray(model.derivative(x, idle, np.array(ned_to_body(psi, *wind))))
    load = blown[:3] - np.asarray(model.derivative(x, idle, np.zeros(2)))[:3]
    return Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=psi, u_mps=nu[0], v_mps=nu[1], r_radps=nu[2], motor=(), std=(),
        disturbance=(*body_to_ned(psi, float(load[0]), float(load[1])), float(load[2])), valid=True,
    )  # fmt: skip


@pytest.mark.parametrize("toward_deg", [0.0, 50.0, 90.0, 200.0, 315.0])
@pytest.mark.parametrize("nu", [(0.0, 0.0, 0.0), (0.8, -0.2, 0.1)])
def test_the_load_of_a_wind_gives_that_wind_back(toward_deg: float, nu: tuple[float, float, float]) -> None:
    toward = math.radians(toward_deg)
    wind = 5.0 * math.cos(toward), 5.0 * math.sin(toward)
    load = WindFromLoad(VESSEL)
    for _ in range(200):
        found = load.wind(boat(wind, 0.3, nu))
    assert math.hypot(found.vn_mps - wind[0], found.ve_mps - wind[1]) < 0.3
    assert not found.valid and found.origin == "disturbance"


def test_a_calm_stays_a_calm() -> None:
    load = WindFromLoad(VESSEL)
    found = [load.wind(boat((0.0, 0.0), 0.3, (0.0, 0.0, 0.0))) for _ in range(50)][-1]
    assert (found.vn_mps, found.ve_mps) == (0.0, 0.0)


def test_without_an_anemometer_the_loop_shows_it_and_flags_it_and_with_one_it_does_not() -> None:
    loop = Lockstep(load_config("sitl", ("plant.faults=[{kind: anemometer, from_s: 8}]", "controller.name=sd-mpc")))
    for tick in range(1, 60 * 20 + 1):
        _, outputs = loop.tick()
        if tick == 7 * 20:
            assert outputs.wind is not None and outputs.wind.origin == "sensor" and outputs.health.wind_ok
    wind = outputs.wind
    assert wind is not None and wind.origin == "disturbance" and not wind.valid and not outputs.health.wind_ok
    assert wind.vn_mps == pytest.approx(3.0, abs=1.0) and abs(wind.ve_mps) < 1.0
