"""The paper's first baseline: nonlinear P-D backstepping control after Sarda et al. (2016)."""

from __future__ import annotations

from asvhil.config import BacksteppingConfig, Config, VesselConfig
from asvhil.controller.classical import FAILED, FeedbackLoop, SimplifiedModel, TrackingState, Vector3, to_body
from asvhil.dynamics.protocol import Dynamics
from asvhil.types import Control, Estimate, Station, Wind


class Backstepping:
    """Keeps a station (eta_s, at rest or at a constant velocity) by the paper's backstepping law, less the wind load:

        eta_r_dot = eta_s_dot - Lambda eta_e,    s = eta_e_dot + Lambda eta_e
        tau = M1 [R^T eta_r_ddot + Rdot^T eta_r_dot] + C1(nu) R^T eta_r_dot + D1 R^T eta_r_dot
              - R^T Kd s - R^T Kp eta_e - tau_w

    M1, C1, D1 are `SimplifiedModel`'s; the sway force is used as `Steering` describes.
    """

    def __init__(self, vessel: VesselConfig, config: BacksteppingConfig) -> None:
        self._config = config
        self._model = SimplifiedModel(vessel)
        self._loop = FeedbackLoop(vessel, config.steering, config.wind_feedforward)

    def reset(self) -> None:
        """Forget the steering direction; the law itself has no state."""
        self._loop.steering.reset()

    def new_station(self) -> None:
        """As `reset`."""
        self.reset()

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick. Neutral and not ok where an input is not finite."""
        result = self._loop.step(estimate, wind, station, self.law)
        if result is None:
            return FAILED
        return Control(command=result[1].command, ok=True, iterations=0, cost=0.0)

    def law(self, motion: TrackingState) -> Vector3:
        """tau (N, N, N m) of the law above, without the wind."""
        lam, kd, kp = self._config.lambda_per_s, self._config.kd, self._config.kp
        eta_r_dot, eta_r_ddot, pull = zip(
            *(
                (moves - g * e, -g * de, d * (de + g * e) + p * e)
                for g, d, p, e, de, moves in zip(lam, kd, kp, motion.error, motion.rate, motion.moves, strict=True)
            ),
            strict=True,
        )
        x_n, y_n, n_nm = self._model.load(motion, eta_r_dot, eta_r_ddot)
        x_pull, y_pull, n_pull = to_body(motion.psi_rad, pull)
        return x_n - x_pull, y_n - y_pull, n_nm - n_pull


def build(settings: BacksteppingConfig, config: Config, model: Dynamics) -> Backstepping:
    """The controller of a config, with its simplified model of the vessel that the config assumes."""
    return Backstepping(config.believed_vessel, settings)
