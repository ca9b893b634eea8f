"""The wind that would explain the disturbance, where no sensor measures it. For display only: control does not use it.

Without a known wind the disturbance contains the wind's load. It is inverted by the physics model, since a network is
only as good as the winds in its training data. Current, and other errors of the model, appear as wind too.
"""

from __future__ import annotations

import functools
import math

import casadi as ca
import numpy as np

from asvhil.config import VesselConfig
from asvhil.dynamics import ordered
from asvhil.dynamics.buffers import bind
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.prediction import REMEMBERED
from asvhil.geo import ned_to_body
from asvhil.types import Estimate, Wind

FIRST_MPS = 2.0  # start value: a quadratic load has no gradient at zero
DAMPING = 1e-5  # (m/s^2 per m/s)^2: a component without effect on the boat stays unchanged
LONGEST_STEP_MPS = 1.0
LEAST_LOAD_MPS2 = 1e-4


class WindFromLoad:
    """Estimates the wind by one damped Gauss-Newton step at each call."""

    def __init__(self, vessel: VesselConfig) -> None:
        self._nu, self._psi, self._wind = np.zeros(3), np.zeros(1), np.zeros(2)
        self._load, columns = np.zeros(3), np.zeros(6)
        self._slope = columns.reshape(3, 2, order="F")
        self._run = bind(_function(vessel), [self._nu, self._psi, self._wind], [self._load, columns])

    def wind(self, estimate: Estimate) -> Wind:
        """The present estimate of the wind: marked not valid, of origin "disturbance"."""
        d_n, d_e, d_r = estimate.disturbance
        load = math.hypot(d_n, d_e)
        if not self._wind.any() and load > LEAST_LOAD_MPS2:
            self._wind[:] = FIRST_MPS * d_n / load, FIRST_MPS * d_e / load
        self._nu[:] = estimate.u_mps, estimate.v_mps, estimate.r_radps
        self._psi[0] = estimate.psi_rad
        self._run()
        missing = np.array([*ned_to_body(estimate.psi_rad, d_n, d_e), d_r]) - self._load
        slope = self._slope.T
        step = ordered.solve(ordered.product(slope, slope.T) + DAMPING * np.eye(2), ordered.product(slope, missing))
        length = math.hypot(*step.tolist())
        if math.isfinite(length):
            self._wind += step * min(1.0, LONGEST_STEP_MPS / max(length, 1e-12))
        vn, ve = self._wind.tolist()
        return Wind(t_ns=estimate.t_ns, vn_mps=vn, ve_mps=ve, std_mps=0.0, valid=False, origin="disturbance")


@functools.lru_cache(maxsize=REMEMBERED)
def _function(vessel: VesselConfig) -> ca.Function:
    """(nu, heading, wind) -> the wind's load and its slope by the wind; remembered as those of `prediction.py`."""
    model = SimplifiedDynamics(vessel)
    nu, psi, wind = ca.SX.sym("nu", 3), ca.SX.sym("psi"), ca.SX.sym("w", 2)
    c, s = ca.cos(psi), ca.sin(psi)
    x = ca.vertcat(nu, ca.SX.zeros(model.n_motor))  # the motors add the same to both
    body = ca.vertcat(c * wind[0] + s * wind[1], -s * wind[0] + c * wind[1])
    idle = ca.SX.zeros(2)
    load = model.derivative(x, idle, body)[:3] - model.derivative(x, idle, ca.SX.zeros(2))[:3]
    slope = ca.densify(ca.jacobian(load, wind))
    return ca.Function("wind_load", [nu, psi, wind], [load, slope], {"cse": True})
