"""Wave filter: takes first-order wave motion out of the estimate, so that the motors do not work against it.

The estimator follows the boat as it moves, waves included. This filter splits its pose and velocity into low-frequency
motion, which vessel model, motors and wind explain, and wave motion about a peak that is learned while it runs:
eta = eta_LF + eta_WF (Fossen 2011, sec. 8.2 and 13.2). The controller gets the low-frequency part. Where there are no
waves the estimate passes unchanged, to the bit.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import casadi as ca
import numpy as np

from asvhil.config import VesselConfig, WaveFilterConfig
from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model
from asvhil.estimator import wave_gain
from asvhil.estimator.prediction import REMEMBERED
from asvhil.estimator.wave_gain import STATES, WAVE_POSITION, WAVE_VELOCITY
from asvhil.estimator.wave_spectrum import FREQUENCIES_HZ, WaveSpectrum
from asvhil.geo import wrap_rad
from asvhil.types import Estimate, WaveMotion, Wind, changed

SAMPLE_S = 0.2  # of the spectrum
LONGEST_GAP_S = 1.0  # after a longer one the filter begins anew
JUMP_M, JUMP_RAD, JUMP_MPS = 0.7, math.radians(12.0), 0.7  # a step by more is a reset of the estimator, and no motion
MEASURED_STD = (0.03, 0.01), (0.003, 0.003)  # of the estimator's pose and velocity, by tick: m, m/s; rad, rad/s
SHARE_TIME_S = 5.0  # time constant at which the share follows the size of the waves
LEVEL_BASE = 2.0  # the gains are those of the nearest power of this, times the least waves: the size matters little
LEVELS = 5


class WaveFilter:
    """`set_forcing` with what drives the boat, `step` with the estimate of each tick; `waves` is what was found.

    `step_s` is the time between ticks: the gains are made for it, and ticks that come late count as several.
    """

    def __init__(self, config: WaveFilterConfig, model: Dynamics, vessel: VesselConfig, step_s: float) -> None:
        self._config = config
        self._step_s = step_s
        inertia = vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2
        arm_m = math.sqrt(inertia / vessel.mass_kg)
        self._spectrum = WaveSpectrum(SAMPLE_S, arm_m)
        self._least = (config.least_mps / math.sqrt(3.0), config.least_mps / math.sqrt(3.0) / arm_m)
        self._sample_ticks = max(1, round(SAMPLE_S / step_s))
        self._ticks = 0
        self._t_ns: int | None = None  # of the state
        self._share = 0.0
        self._scheduled: tuple[int, tuple[int, ...]] | None = None  # peak and levels that the gains are for
        self._peak_radps = 1.0
        self._build(model)
        self._schedule()

    def _build(self, model: Dynamics) -> None:
        """The step as one CasADi function on buffers: prediction of the three axes, and correction."""
        n = STATES
        self._x, self._after = np.zeros(3 * n), np.zeros(3 * n)
        self._measured, self._motor = np.zeros(6), np.zeros(model.n_motor)
        self._input, self._wind = np.zeros(2), np.zeros(2)
        self._f, self._h = np.zeros(n * n), np.zeros(2 * n)
        self._k_place, self._k_yaw = np.zeros(2 * n), np.zeros(2 * n)
        self._left_over, self._pushed = np.zeros(3), np.zeros(3)
        function = _function(_serialized_rate(model), self._step_s)
        arguments = [self._x, self._measured, self._motor, self._input, self._wind, self._f, self._h]
        results = [self._after, self._left_over, self._pushed]
        self._predict = bind(function, [*arguments, np.zeros(2 * n), np.zeros(2 * n)], results)
        self._predict_and_correct = bind(function, [*arguments, self._k_place, self._k_yaw], results)

    def set_forcing(self, model_input: tuple[float, float], wind: Wind | None) -> None:
        """The model's input (2) and the usable wind from now on."""
        self._input[:] = model_input
        self._wind[:] = (0.0, 0.0) if wind is None else (wind.vn_mps, wind.ve_mps)

    @property
    def waves(self) -> WaveMotion | None:
        """The waves that are taken out; None where there are none."""
        if not self._share:
            return None
        velocity_mps, yaw_radps = self._spectrum.std
        return WaveMotion(
            peak_hz=float(FREQUENCIES_HZ[self._spectrum.peak]),
            velocity_std_mps=velocity_mps,
            yaw_std_radps=yaw_radps,
            share=self._share,
        )

    def step(self, estimate: Estimate | None) -> Estimate | None:
        """The estimate without the waves, by the share that they have come to have."""
        if estimate is None:
            return None
        self._follow(estimate)
        if not self._share:
            return estimate
        wave = self._share * self._x.reshape(3, STATES)[:, [WAVE_POSITION, WAVE_VELOCITY]]
        wave[:, 0] /= self._peak_radps
        (n_m, vn), (e_m, ve), (psi, r) = wave.tolist()
        beside_waves, with_waves = self._x[2::STATES], np.array(estimate.disturbance)
        d_n, d_e, d_r = (self._share * beside_waves + (1.0 - self._share) * with_waves).tolist()
        c, s = math.cos(estimate.psi_rad), math.sin(estimate.psi_rad)
        vn, ve = c * estimate.u_mps - s * estimate.v_mps - vn, s * estimate.u_mps + c * estimate.v_mps - ve
        c, s = math.cos(estimate.psi_rad - psi), math.sin(estimate.psi_rad - psi)
        return changed(
            estimate,
            n_m=estimate.n_m - n_m,
            e_m=estimate.e_m - e_m,
            psi_rad=wrap_rad(estimate.psi_rad - psi),
            u_mps=c * vn + s * ve,
            v_mps=c * ve - s * vn,
            r_radps=estimate.r_radps - r,
            disturbance=(d_n, d_e, d_r),
        )

    def _follow(self, estimate: Estimate) -> None:
        """Bring the state to the time of an estimate, and learn from what is left over."""
        c, s = math.cos(estimate.psi_rad), math.sin(estimate.psi_rad)
        y = self._measured
        y[0], y[2] = estimate.n_m, estimate.e_m
        y[1] = c * estimate.u_mps - s * estimate.v_mps
        y[3] = s * estimate.u_mps + c * estimate.v_mps
        psi_rad = float(self._x[2 * STATES])
        y[4] = psi_rad + wrap_rad(estimate.psi_rad - psi_rad)
        y[5] = estimate.r_radps
        steps = 0 if self._t_ns is None else round((estimate.t_ns - self._t_ns) * 1e-9 / self._step_s)
        if self._t_ns is None or steps * self._step_s > LONGEST_GAP_S or self._has_jumped():
            self._restart(estimate)
            return
        if steps <= 0:
            return
        self._t_ns += round(steps * self._step_s * 1e9)
        self._motor[:] = estimate.motor
        for number in range(steps, 0, -1):
            if number == 1:
                self._predict_and_correct()
            else:
                self._predict()
            if not all(map(math.isfinite, self._after.tolist())):
                self._restart(estimate)
                return
            self._x[:] = self._after
        self._ticks += steps
        while self._ticks >= self._sample_ticks:  # more than once where ticks come late: the sample is held
            self._ticks -= self._sample_ticks
            self._spectrum.step(self._left_over, self._pushed)
            self._set_share()
            self._schedule()

    def _has_jumped(self) -> bool:
        """Whether the estimate is away from the state by more than a boat moves in a tick."""
        north, east, yaw = self._x.reshape(3, STATES).tolist()
        n_m, vn, e_m, ve, psi_rad, _ = self._measured.tolist()
        peak_radps = self._peak_radps
        off_n = abs(n_m - (north[0] + north[WAVE_POSITION] / peak_radps))
        off_e = abs(e_m - (east[0] + east[WAVE_POSITION] / peak_radps))
        off_psi = abs(psi_rad - (yaw[0] + yaw[WAVE_POSITION] / peak_radps))
        fast_n, fast_e = abs(vn - north[1] - north[WAVE_VELOCITY]), abs(ve - east[1] - east[WAVE_VELOCITY])
        return max(off_n, off_e) > JUMP_M or off_psi > JUMP_RAD or max(fast_n, fast_e) > JUMP_MPS

    def _restart(self, estimate: Estimate) -> None:
        """No waves, and the low-frequency motion as the estimator has it; spectrum and share stay."""
        self._t_ns = estimate.t_ns
        self._x[:] = 0.0
        self._x[0::STATES], self._x[1::STATES] = self._measured[0::2], self._measured[1::2]
        self._x[2 * STATES] = estimate.psi_rad
        self._x[2::STATES] = estimate.disturbance

    def _set_share(self) -> None:
        """0 below the least waves, 1 from twice these on."""
        config = self._config
        wanted = 1.0
        if config.mode == "auto":
            wanted = min(max(self._spectrum.level_mps / config.least_mps - 1.0, 0.0), 1.0)
        step = SAMPLE_S / SHARE_TIME_S
        self._share += min(max(wanted - self._share, -step), step)

    def _schedule(self) -> None:
        """Gains for the present peak and size."""
        config = self._config
        levels = tuple(
            min(max(round(math.log(max(std, 1e-9) / least, LEVEL_BASE)), 0), LEVELS - 1)
            for std, least in zip(self._spectrum.std, self._least, strict=True)
        )
        key = self._spectrum.peak, levels
        if key == self._scheduled:
            return
        peak_radps = math.tau * float(FREQUENCIES_HZ[self._spectrum.peak])
        if self._scheduled is not None:  # the waves' position is in units of the peak
            self._x[WAVE_POSITION::STATES] *= peak_radps / self._peak_radps
        self._scheduled, self._peak_radps = key, peak_radps
        design = config.damping, self._step_s
        self._f[:] = wave_gain.transition(peak_radps, *design).ravel(order="F")
        self._h[:] = wave_gain.measurement(peak_radps).ravel(order="F")
        walks = (
            (config.velocity_walk_mps, config.disturbance_walk_mps2),
            (config.yaw_rate_walk_radps, config.disturbance_yaw_walk_radps2),
        )
        self._k_place[:], self._k_yaw[:] = (
            wave_gain.gain(peak_radps, *design, least * LEVEL_BASE**level, *walk, std).ravel(order="F")
            for least, level, walk, std in zip(self._least, levels, walks, MEASURED_STD, strict=True)
        )


def _to_body(c: Any, s: Any, v: Any) -> tuple[Any, Any]:
    """An earth-fixed vector (2) in body axes."""
    return c * v[0] + s * v[1], c * v[1] - s * v[0]


@by_model
def _serialized_rate(model: Dynamics) -> str:
    """A model's rate (nu and motors, input, body wind) -> x_dot, remembered as that of `prediction.py`."""
    x, a, wind = ca.SX.sym("x", 3 + model.n_motor), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    rate = ca.Function("rate", [x, a, wind], [model.derivative(x, a, wind)])
    serialized: str = rate.serialize()
    return serialized


@functools.lru_cache(maxsize=REMEMBERED)
def _function(serialized: str, step_s: float) -> ca.Function:
    """The step by a model's rate (nu and motors, input, body wind) -> x_dot; remembered as those of `prediction.py`."""
    rate_of = ca.Function.deserialize(serialized)
    n, n_motor = STATES, rate_of.size1_in(0) - 3
    x, y = ca.SX.sym("x", n, 3), ca.SX.sym("y", 2, 3)
    motor, a, wind = ca.SX.sym("m", n_motor), ca.SX.sym("a", 2), ca.SX.sym("w", 2)
    f, h = ca.SX.sym("f", n, n), ca.SX.sym("h", 2, n)
    k_place, k_yaw = ca.SX.sym("k", n, 2), ca.SX.sym("l", n, 2)
    c, s = ca.cos(x[0, 2]), ca.sin(x[0, 2])
    nu = _to_body(c, s, x[1, :2])
    r = x[1, 2]
    rate = rate_of(ca.vertcat(*nu, r, motor), a, ca.vertcat(*_to_body(c, s, wind)))
    # Of the velocity in north and east: nu_dot + S(r) nu, turned (Fossen 2011, eq. 2.26 differentiated).
    surge, sway = rate[0] - r * nu[1], rate[1] + r * nu[0]
    north, east = c * surge - s * sway, s * surge + c * sway
    pushed = ca.vertcat(0.5 * step_s**2, step_s, ca.SX.zeros(n - 2))
    before = ca.mtimes(f, x) + ca.mtimes(pushed, ca.horzcat(north, east, rate[2]))
    innovation = y - ca.mtimes(h, before)
    gains = (k_place, k_place, k_yaw)
    after = ca.horzcat(*(before[:, i] + ca.mtimes(gains[i], innovation[:, i]) for i in range(3)))
    left = y[1, :] - after[1, :]
    left_over = ca.vertcat(*_to_body(c, s, left[:2]), left[2])
    function = ca.Function(
        "wave_filter",
        [x, y, motor, a, wind, f, h, k_place, k_yaw],
        [after, left_over, ca.vertcat(surge, sway, rate[2])],
        {"cse": True},
    )
    return fastest(function)
