"""The model monitor: no error while boat and model are equal, and a flag when they differ."""

import math
from dataclasses import replace

import numpy as np
import pytest

from asvhil.config import MonitorConfig, load_config
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.monitor import ModelMonitor
from asvhil.types import Estimate, PredictionError, Wind

VESSEL = load_config("sitl").vehicle.vessel
WIND = Wind(t_ns=0, vn_mps=2.0, ve_mps=-1.0, std_mps=0.0, valid=True)
PERIOD_S = 0.2


def watch(
    boat_lag_s: float, mass_kg: float, seconds: float, config: MonitorConfig | None = None
) -> list[PredictionError]:
    """What the monitor of the true model says of a boat with another lag and mass."""
    model = SimplifiedDynamics(VESSEL)
    boat = SimplifiedDynamics(VESSEL.model_copy(update={"motor_lag_s": boat_lag_s, "mass_kg": mass_kg}))
    monitor = ModelMonitor(config or MonitorConfig(), model, PERIOD_S)
    state, found = np.zeros(8), []
    for tick in range(round(seconds / PERIOD_S)):
        motor_input = (0.8 * math.sin(0.35 * tick), 0.5 * math.cos(0.2 * tick))
        n, e, psi, u, v, r = state[:6].tolist()
        estimate = Estimate(
            t_ns=tick * 200_000_000, n_m=n, e_m=e, psi_rad=psi, u_mps=u, v_mps=v, r_radps=r,
            motor=tuple(state[6:].tolist()), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
        )  # fmt: skip
        error = monitor.step(estimate, motor_input, WIND)
        if error is not None:
            found.append(error)
        state = advance(boat, state, np.array(motor_input), np.array([2.0, -1.0]), np.zeros(3), PERIOD_S, 1)
    return found


def test_a_boat_that_is_the_model_shows_no_error() -> None:
    errors = watch(VESSEL.motor_lag_s, VESSEL.mass_kg, 60.0)
    assert len(errors) == 300 - 20
    for error in errors:
        assert max(*error.one_step, *error.horizon) < 1e-9 and error.ok


def test_a_boat_that_has_changed_is_noticed_once_the_window_is_full() -> None:
    config = MonitorConfig(window_s=10.0, max_u_mps=0.1, max_v_mps=0.05, max_r_radps=0.05)
    errors = watch(VESSEL.motor_lag_s, 2.0 * VESSEL.mass_kg, 60.0, config)
    assert all(error.ok for error in errors[:49])
    assert not errors[-1].ok
    assert errors[-1].horizon[0] > errors[-1].one_step[0] > 0.0


@pytest.mark.parametrize("known", [True, False])
def test_a_steady_push_that_is_estimated_is_no_error_of_the_model(known: bool) -> None:
    """A boat that is held in a current of 0.4 m/s from ahead: at rest, with the thrust for it."""
    model = SimplifiedDynamics(VESSEL)
    monitor, motors = ModelMonitor(MonitorConfig(), model, PERIOD_S), (0.1, 0.1)
    rest = np.array([0.0] * 6 + [*motors])
    push_mps2 = -advance(model, rest, np.array(motors), np.zeros(2), np.zeros(3), 0.01, 1)[3] / 0.01
    held = Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=motors, std=(), disturbance=(push_mps2 if known else 0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    for tick in range(200):
        error = monitor.step(replace(held, t_ns=tick * 200_000_000), motors, None)
    assert error is not None and error.horizon[0] > 0.4, "told in the log as before"
    assert error.ok is known and (monitor.unexplained[0] < 0.1) is known
    assert push_mps2 == pytest.approx(-0.2, abs=0.1)
    assert monitor.push_mps2 == pytest.approx(-push_mps2 if known else 0.0)


def test_a_gap_starts_the_horizon_anew() -> None:
    monitor = ModelMonitor(MonitorConfig(), SimplifiedDynamics(VESSEL), PERIOD_S)
    still = Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(0.0, 0.0), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    for tick in range(21):
        assert monitor.step(replace(still, t_ns=tick * 200_000_000), (0.0, 0.0), None) is None or tick == 20
    for tick in range(30, 50):
        assert monitor.step(replace(still, t_ns=tick * 200_000_000), (0.0, 0.0), None) is None


def test_a_model_that_diverges_is_not_ok() -> None:
    monitor = ModelMonitor(MonitorConfig(horizon_s=0.2, window_s=0.2), SimplifiedDynamics(VESSEL), PERIOD_S)
    wild = Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=math.nan, v_mps=0.0, r_radps=0.0,
        motor=(0.0, 0.0), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    monitor.step(wild, (0.0, 0.0), None)
    monitor.step(replace(wild, t_ns=200_000_000), (0.0, 0.0), None)
    error = monitor.step(replace(wild, t_ns=400_000_000), (0.0, 0.0), None)
    assert error is not None and not error.ok and error.horizon[0] != pytest.approx(0.0)
