"""The paper's second baseline: sliding mode control with an integral surface and a boundary layer."""

from __future__ import annotations

from asvhil.config import Config, SlidingModeConfig, VesselConfig
from asvhil.controller.classical import (
    FAILED,
    LONGEST_STEP_S,
    FeedbackLoop,
    SimplifiedModel,
    TrackingState,
    Vector3,
    to_body,
)
from asvhil.dynamics.protocol import Dynamics
from asvhil.types import Control, Estimate, Station, Wind


class SlidingMode:
    """Keeps a station (eta_s, at rest or at a constant velocity) by the paper's sliding mode law, less the wind load:

        s = eta_e_dot + 2 Lambda eta_e + Lambda^2 int eta_e
        eta_r_dot = eta_s_dot - 2 Lambda eta_e - Lambda^2 int eta_e
        tau = M1 [R^T eta_r_ddot + Rdot^T eta_r_dot] + C1(nu) R^T eta_r_dot + D1 R^T eta_r_dot
              - R^T U sat(E^-1 s) - tau_w

    The paper prints eta_s instead of eta_r in the feed-forward. With a fixed station that feed-forward would be zero
    and the reference trajectory, which the paper has just defined, unused; so eta_r is meant, as in the other law.
    """

    def __init__(self, vessel: VesselConfig, config: SlidingModeConfig) -> None:
        self._config = config
        self._model = SimplifiedModel(vessel)
        self._loop = FeedbackLoop(vessel, config.steering, config.wind_feedforward)
        self.reset()

    def reset(self) -> None:
        """Empty the integral, as after a time without control."""
        self._loop.steering.reset()
        self.integral: Vector3 = (0.0, 0.0, 0.0)  # of eta_e (m s, m s, rad s)
        self._t_ns: int | None = None

    def new_station(self) -> None:
        """As `reset`: the integral belongs to the last station."""
        self.reset()

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick. Neutral and not ok where an input is not finite; the integral then stays as it is."""
        result = self._loop.step(estimate, wind, station, self.law)
        if result is None:
            return FAILED
        motion, allocation = result
        self._integrate(motion, allocation.saturated)
        return Control(command=allocation.command, ok=True, iterations=0, cost=0.0)

    def law(self, motion: TrackingState) -> Vector3:
        """tau (N, N, N m) of the law above, without the wind."""
        lam, bound, layer = self._config.lambda_per_s, self._config.bound, self._config.layer
        eta_r_dot, eta_r_ddot, push = zip(
            *(
                (moves - 2.0 * g * e - g * g * i, -2.0 * g * de - g * g * e, b * _sat(s / w))
                for g, b, w, e, de, i, s, moves in zip(
                    *(lam, bound, layer, motion.error, motion.rate, self.integral, self.surface(motion), motion.moves),
                    strict=True,
                )
            ),
            strict=True,
        )
        x_n, y_n, n_nm = self._model.load(motion, eta_r_dot, eta_r_ddot)
        x_push, y_push, n_push = to_body(motion.psi_rad, push)
        return x_n - x_push, y_n - y_push, n_nm - n_push

    def surface(self, motion: TrackingState) -> Vector3:
        """s (m/s, m/s, rad/s) at the present integral."""
        along, across, heading = (
            de + 2.0 * g * e + g * g * i
            for g, e, de, i in zip(self._config.lambda_per_s, motion.error, motion.rate, self.integral, strict=True)
        )
        return along, across, heading

    def _integrate(self, motion: TrackingState, saturated: bool) -> None:
        """Anti-windup: an integral does not grow while the motors or its own sat() are saturated, and is bounded.

        While the boat is steered to a distant station nothing is integrated.
        """
        elapsed_s = 0.0 if self._t_ns is None else (motion.t_ns - self._t_ns) * 1e-9
        self._t_ns = motion.t_ns
        if not 0.0 < elapsed_s <= LONGEST_STEP_S or self._loop.steering.away:
            return
        along, across, heading = (
            i if e * i >= 0.0 and (saturated or abs(s) >= w) else _clip(i + e * elapsed_s, limit)
            for e, i, s, w, limit in zip(
                motion.error,
                self.integral,
                self.surface(motion),
                self._config.layer,
                self._config.integral_max,
                strict=True,
            )
        )
        self.integral = (along, across, heading)


def _sat(ratio: float) -> float:
    """sat() of the boundary layer: linear within it, the sign beyond."""
    return _clip(ratio, 1.0)


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def build(settings: SlidingModeConfig, config: Config, model: Dynamics) -> SlidingMode:
    """The controller of a config, with its simplified model of the vessel that the config assumes."""
    return SlidingMode(config.believed_vessel, settings)
