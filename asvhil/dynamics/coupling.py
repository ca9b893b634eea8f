"""The terms of the paper's full equations that couple sway and yaw, beside those of the simplified dynamics."""

from __future__ import annotations

from typing import Any

from asvhil.config import CouplingConfig, VesselConfig


class CoupledBody:
    """M nu_dot + C(nu) nu + D(nu) nu = tau + tau_w with a centre of gravity off the origin, and coupled damping.

    M = [[m - X_udot, 0, -m y_G], [0, m - Y_vdot, m x_G - Y_rdot], [-m y_G, m x_G - N_vdot, I_z - N_rdot]]; C and D are
    the paper's. The paper's M leaves -m y_G out, which its C_RB has: both come from one kinetic energy.
    """

    def __init__(self, vessel: VesselConfig, part: CouplingConfig) -> None:
        self._m_u = vessel.mass_kg + vessel.added_mass_surge_kg
        self._m_v = vessel.mass_kg + vessel.added_mass_sway_kg
        m_r = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
        x_kgm, self._y_kgm = vessel.mass_kg * part.x_g_m, vessel.mass_kg * part.y_g_m
        self._x_kgm = x_kgm + 0.5 * (part.y_rdot_kgm + part.n_vdot_kgm)  # of r in the Coriolis matrix
        sway_yaw, yaw_sway = x_kgm + part.y_rdot_kgm, x_kgm + part.n_vdot_kgm
        # The inverse of M by cofactors: rows of surge, sway, yaw.
        m_u, m_v, y_kgm = self._m_u, self._m_v, self._y_kgm
        whole = m_u * (m_v * m_r - sway_yaw * yaw_sway) - y_kgm * y_kgm * m_v
        self._inverse = (
            ((m_v * m_r - sway_yaw * yaw_sway) / whole, -y_kgm * yaw_sway / whole, y_kgm * m_v / whole),
            (-sway_yaw * y_kgm / whole, (m_u * m_r - y_kgm * y_kgm) / whole, -m_u * sway_yaw / whole),
            (y_kgm * m_v / whole, -m_u * yaw_sway / whole, m_u * m_v / whole),
        )
        self._d_u, self._d_uu = vessel.surge_drag_n_per_mps, vessel.surge_drag_n_per_mps2
        self._d_v, self._d_vv = vessel.sway_drag_n_per_mps, vessel.sway_drag_n_per_mps2
        self._d_r, self._d_rr = vessel.yaw_drag_nm_per_radps, vessel.yaw_drag_nm_per_radps2
        self._part = part

    def acceleration(self, u: Any, v: Any, r: Any, x_n: Any, y_n: Any, n_nm: Any) -> tuple[Any, Any, Any]:
        """nu_dot (m/s^2, m/s^2, rad/s^2) of u, v (m/s), r (rad/s) under forces X, Y (N) and moment N (N m)."""
        part, abs_v, abs_r = self._part, abs(v), abs(r)
        x_kgm, y_kgm = self._x_kgm, self._y_kgm
        surge = x_n + (self._m_v * v + x_kgm * r) * r - (self._d_u + self._d_uu * abs(u)) * u
        sway = (
            y_n
            - (self._m_u * u - y_kgm * r) * r
            - (self._d_v + self._d_vv * abs_v + part.y_v_absr * abs_r) * v
            - (part.y_r_absv * abs_v + part.y_r_absr * abs_r) * r
        )
        yaw = (
            n_nm
            + (self._m_u - self._m_v) * u * v
            - (x_kgm * u + y_kgm * v) * r
            - (part.n_v_absv * abs_v + part.n_v_absr * abs_r) * v
            - (self._d_r + self._d_rr * abs_r + part.n_r_absv * abs_v) * r
        )
        u_dot, v_dot, r_dot = (a * surge + b * sway + c * yaw for a, b, c in self._inverse)
        return u_dot, v_dot, r_dot
