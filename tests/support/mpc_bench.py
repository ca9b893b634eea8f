"""Models, states and closed loops for the tests of the station-keeping MPC."""

import numpy as np

from asvhil.config import MpcWeights, load_config
from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.types import Estimate, Station, Wind

MODEL = SimplifiedDynamics(load_config("sitl").vehicle.vessel)
GRID_S = np.concatenate([[0.0], np.cumsum(np.linspace(0.2, 0.8, 20))])
ORIGIN = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
LIGHT = MpcWeights(heading=200.0)  # for tests of how weights are chosen, whatever the shipped ones are
HEAVY = MpcWeights(heading=1500.0, slew=4.0)


class TanhModel:
    """A tiny network without motor states that is trained for forward Euler, as a learnt model would be."""

    name = "tanh"
    n_motor = 0
    input_lower, input_upper = -1.0, 1.0
    max_step_s = 0.2
    euler = True

    def __init__(self) -> None:
        rng = np.random.default_rng(3)
        self._w1, self._b1 = 0.3 * rng.normal(size=(6, 7)), np.zeros(6)
        self._w2, self._b2 = 0.05 * rng.normal(size=(3, 6)), np.zeros(3)

    def derivative(self, x, a, wind):
        xp = namespace_of(x)
        hidden = xp.tanh(xp.affine(self._w1, self._b1, xp.concat([x, a, wind])))
        port, starboard = xp.component(a, 0), xp.component(a, 1)
        drive = xp.stack([0.8 * (port + starboard), 0.0 * port, 0.3 * (port - starboard)])
        return drive - 0.5 * x + xp.affine(self._w2, self._b2, hidden)

    def command_of_input(self, a):
        return a

    def input_of_command(self, command):
        return command


def estimate(s, disturbance=(0.0, 0.0, 0.0)) -> Estimate:
    n_m, e_m, psi_rad, u_mps, v_mps, r_radps, *motor = (float(part) for part in s)
    return Estimate(
        t_ns=0,
        n_m=n_m,
        e_m=e_m,
        psi_rad=psi_rad,
        u_mps=u_mps,
        v_mps=v_mps,
        r_radps=r_radps,
        motor=tuple(motor),
        std=(0.1,) * 6,
        disturbance=disturbance,
        valid=True,
    )


def air(vn_mps: float, ve_mps: float, valid: bool = True) -> Wind:
    return Wind(t_ns=0, vn_mps=vn_mps, ve_mps=ve_mps, std_mps=0.0, valid=valid)


def sail(controller, model, s, wind, station=ORIGIN, seconds=60.0) -> list[np.ndarray]:
    """The states every 0.2 s of a boat that is the model, under the controller."""
    path = [np.array(s, dtype=float)]
    still = np.zeros(3)
    for _ in range(round(seconds / 0.2)):
        control = controller.step(estimate(path[-1]), air(*wind), station)
        assert control.ok
        a = np.array(model.input_of_command(control.command))
        path.append(advance(model, path[-1], a, np.array(wind), still, 0.2, 1 if model.euler else 4))
    return path
