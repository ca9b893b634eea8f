"""First-order wave motion of the simulated boat, in surge, sway and yaw: coloured noise about a peak frequency.

It is superposed on the motion from thrust, wind and current (Fossen 2011, sec. 8.2: eta = eta_LF + eta_WF). A boat
that is short compared with the waves follows the orbital motion of the water: with the Froude-Krylov force on its
displacement, its equations of motion are those in still water for the velocity relative to the water, as in a current.
"""

from __future__ import annotations

import math

import numpy as np

from asvhil.config import WavesConfig
from asvhil.dynamics.arrays import Array

BLOCK = 512  # steps whose random numbers are drawn at once
NODES = 10  # of the quadrature over up to PANEL_RAD of the wave's phase: exact to the last bits
PANEL_RAD = 0.5


class Waves:
    """Position, velocity and acceleration of the wave motion, NED, stationary from the start.

    Along the direction of the waves, across it, and in yaw, the velocity is white noise through two of Fossen's filters
    in series, h(s) = s / (s^2 + 2 zeta w0 s + w0^2). Through a single one its derivative, which accelerometers
    measure, would hold white noise without bound; through two, the position is stationary, the velocity is its
    derivative, and the acceleration is finite. The spectrum peaks at w0 either way.
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
        "transition",
        "ve_mps",
        "vn_mps",
    )

    def __init__(self, config: WavesConfig, toward_deg: float, step_s: float, seed: np.random.SeedSequence) -> None:
        """`toward_deg` is the direction of the waves if `config.toward_deg` is None; any `step_s` is exact."""
        peak_radps = math.tau * config.peak_hz
        a = _dynamics(config.damping)
        stationary = _stationary(a)
        unit = 1.0 / math.sqrt(stationary[3, 3])
        self._a, self._peak_radps = a, peak_radps
        self.set_step(step_s)
        # The second filter's states are position and velocity in the time unit 1 / w0; a's last row is acceleration.
        self.output = unit * np.stack([np.eye(4)[2] / peak_radps, np.eye(4)[3], peak_radps * a[3]])
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
        self.transition = _exponential(self._a * phase)
        self.noise_factor = _noise_factor(self._a, phase)
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


def _dynamics(damping: float) -> Array:
    """A of x' = A x + b w for the two filters in series, in the time unit 1 / w0; w drives x[1], the output is x[3]."""
    return np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-1.0, -2.0 * damping, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 1.0, -1.0, -2.0 * damping],
        ]
    )


def _stationary(a: Array) -> Array:
    """P of A P + P A' + b b' = 0: the stationary covariance."""
    b = np.eye(4)[:, 1:2]
    lyapunov = np.kron(a, np.eye(4)) + np.kron(np.eye(4), a)
    p = np.linalg.solve(lyapunov, -(b @ b.T).ravel()).reshape(4, 4)
    return np.asarray(0.5 * (p + p.T), dtype=np.float64)


def _noise_factor(a: Array, step: float) -> Array:
    """Lower triangular L with L L' = Q, the integral of exp(A s) b b' exp(A' s) over a step.

    Over a short step the entries of Q go down to the seventh power of it, where a Cholesky factorisation would fail: so
    the factor is found from that of a quadrature sum, without forming Q, and doubled to the length of the step.
    """
    doublings = max(0, math.ceil(math.log2(step / PANEL_RAD)))
    panel = step / 2.0**doublings
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    columns = [
        math.sqrt(0.5 * panel * weight) * _exponential(a * (0.5 * panel * (1.0 + node)))[:, 1]
        for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True)
    ]
    factor = _lower(np.array(columns).T)
    for k in range(doublings):  # Q(2 s) = Q(s) + exp(A s) Q(s) exp(A' s)
        factor = _lower(np.hstack([_exponential(a * (panel * 2.0**k)) @ factor, factor]))
    return factor


def _lower(columns: Array) -> Array:
    """The lower triangular L, its diagonal positive, with L L' = columns columns'."""
    upper = np.linalg.qr(columns.T, mode="r")
    return np.asarray((upper * np.sign(np.diag(upper))[:, None]).T, dtype=np.float64)


def _exponential(matrix: Array) -> Array:
    """exp of a small matrix: its Taylor series, scaled and squared."""
    halvings = max(0, math.ceil(math.log2(max(float(np.linalg.norm(matrix)), 1e-300)) + 1.0))
    scaled = matrix / 2.0**halvings
    total = term = np.eye(len(matrix))
    for k in range(1, 20):
        term = term @ scaled / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
