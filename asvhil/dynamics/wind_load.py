"""Wind loads on a hull: force and moment of the air's velocity relative to it, in body axes."""

from __future__ import annotations

from typing import Any, Protocol

from asvhil.config import VesselConfig


class WindLoad(Protocol):
    """A law of the wind load, for components of any kind (float, CasADi, NumPy or torch)."""

    def forces(self, u_air: Any, v_air: Any) -> tuple[Any, Any, Any]:
        """Surge and sway force (N) and yaw moment (N m) of the air's velocity relative to the hull, body axes (m/s)."""


class QuadraticWind:
    """The law of VRX's wind plugin: each axis by its own square, and a moment that turns the boat across the wind."""

    def __init__(self, vessel: VesselConfig) -> None:
        self._w_u, self._w_v = vessel.wind_surge_n_per_mps2, vessel.wind_sway_n_per_mps2
        self._w_r = vessel.wind_yaw_nm_per_mps2

    def forces(self, u_air: Any, v_air: Any) -> tuple[Any, Any, Any]:
        return (
            self._w_u * u_air * abs(u_air),
            self._w_v * v_air * abs(v_air),
            -2.0 * self._w_r * u_air * v_air,
        )
