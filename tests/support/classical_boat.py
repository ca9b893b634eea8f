"""A boat with round numbers, so that the classical laws can be worked by hand."""

import math

from asvhil.config import VesselConfig
from asvhil.dynamics.rigid_body import ThrustCurve
from asvhil.types import Estimate, Station, Wind

VESSEL = VesselConfig(
    mass_kg=80.0,
    added_mass_surge_kg=20.0,  # m_u 100
    added_mass_sway_kg=70.0,  # m_v 150
    inertia_yaw_kgm2=120.0,
    added_inertia_yaw_kgm2=80.0,  # m_r 200
    surge_drag_n_per_mps=10.0,
    surge_drag_n_per_mps2=7.0,  # quadratic drag is no part of D1
    sway_drag_n_per_mps=20.0,
    sway_drag_n_per_mps2=7.0,
    yaw_drag_nm_per_radps=30.0,
    yaw_drag_nm_per_radps2=7.0,
    motor_arm_m=1.0,
    motor_lag_s=0.3,
    thrust_curve=((-1.0, -100.0), (-0.1, 0.0), (0.1, 0.0), (1.0, 200.0)),
    wind_surge_n_per_mps2=0.5,
    wind_sway_n_per_mps2=1.0,
    wind_yaw_nm_per_mps2=0.25,
)
CURVE = ThrustCurve(VESSEL.thrust_curve)
ORIGIN = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)


def boat(n_m=0.0, e_m=0.0, psi_deg=0.0, nu=(0.0, 0.0, 0.0), t_s=0.0) -> Estimate:
    return Estimate(
        t_ns=round(t_s * 1e9),
        n_m=n_m,
        e_m=e_m,
        psi_rad=math.radians(psi_deg),
        u_mps=nu[0],
        v_mps=nu[1],
        r_radps=nu[2],
        motor=(0.0, 0.0),
        std=(0.1,) * 6,
        disturbance=(0.0, 0.0, 0.0),
        valid=True,
    )


def air(vn_mps: float, ve_mps: float) -> Wind:
    return Wind(t_ns=0, vn_mps=vn_mps, ve_mps=ve_mps, std_mps=0.0, valid=True)


def forces(command: tuple[float, float]) -> tuple[float, float]:
    """(X, N) that a command makes on this boat."""
    port_n, starboard_n = (CURVE.thrust_n(part) for part in command)
    return port_n + starboard_n, port_n - starboard_n
