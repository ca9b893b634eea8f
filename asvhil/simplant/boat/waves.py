"""First-order wave motion of the simulated boat, in surge, sway and yaw: coloured noise about a peak frequency.

It is superposed on the motion from thrust, wind and current (Fossen 2011, sec. 8.2: eta = eta_LF + eta_WF). A boat
that is short compared with the waves follows the orbital motion of the water: with the Froude-Krylov force on its
displacement, its equations of motion are those in still water for the velocity relative to the water, as in a current.
"""

from __future__ import annotations

import math

import numpy as np

from asvhil.config import WavesConfig
from asvhil.dynamics import shaping
from asvhil.dynamics.arrays import Array

BLOCK = 512  # steps whose random numbers are drawn at once


class Waves:
    """Position, velocity and acceleration of the wave motion, NED, stationary from the start.

    Along the direction of the waves, across it, and in yaw, the velocity is white noise through the filter of
    `dynamics/shaping.py`.
    """

    __slots__ = (
        "_a",
        "_at",
        "_block",
        "_mixing",
        "_peak_radps",
        "_rng",
        "_state",
        "ae_mps2",
        "an_mps2",
        "e_m",
        "n_m",
        "noise_factor",
        "output",
        "psi_rad",
        "r_radps",
        "tilt",
        "transition",
        "ve_mps",
        "vn_mps",
    )

    def __init__(self, config: WavesConfig, toward_deg: float, step_s: float, seed: np.random.SeedSequence) -> None:
        """`toward_deg` is the direction of the waves if `config.toward_deg` is None; any `step_s` is exact."""
        peak_radps = math.tau * config.peak_hz
        a = shaping.shaping_dynamics(config.damping)
        stationary = shaping.stationary_covariance(a)
        unit = 1.0 / math.sqrt(stationary[3, 3])
        self._a, self._peak_radps = a, peak_radps
        self.set_step(step_s)
        # The second filter's states are position and velocity in the time unit 1 / w0; a's last row is acceleration.
        self.output = unit * np.stack([np.eye(4)[2] / peak_radps, np.eye(4)[3], peak_radps * a[3]])
        self.tilt = config.tilt
        way = math.radians(toward_deg if config.toward_deg is None else config.toward_deg)
        along, across = config.orbital_std_mps, config.spreading * config.orbital_std_mps
        self._mixing = np.array(
            [
                [along * math.cos(way), along * math.sin(way), 0.0],
                [-across * math.sin(way), across * math.cos(way), 0.0],
                [0.0, 0.0, config.yaw_std_radps],
            ]
        )
        self._rng = np.random.Generator(np.random.PCG64(seed))
        self._state: Array = np.linalg.cholesky(stationary) @ self._rng.standard_normal((4, 3)) @ self._mixing
        self._read()

    def set_step(self, step_s: float) -> None:
        """Steps of another length from now on; numbers that were drawn for the old length are discarded."""
        phase = self._peak_radps * step_s
        self.transition = shaping.transition(self._a, phase)
        self.noise_factor = shaping.noise_factor(self._a, phase)
        self._block: Array = np.empty((0, 4, 3))
        self._at = 0

    def advance(self) -> None:
        """Advance by one step."""
        if self._at == len(self._block):
            self._block = self.noise_factor @ self._rng.standard_normal((BLOCK, 4, 3)) @ self._mixing
            self._at = 0
        self._state = self.transition @ self._state + self._block[self._at]
        self._at += 1
        self._read()

    def _read(self) -> None:
        position, velocity, acceleration = (self.output @ self._state).tolist()
        self.n_m, self.e_m, self.psi_rad = position
        self.vn_mps, self.ve_mps, self.r_radps = velocity
        self.an_mps2, self.ae_mps2, _ = acceleration
