"""Covariances of the filter against the textbook's matrices."""

import math

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.covariance import Correction
from asvhil.estimator.measurement_model import Comparison
from asvhil.estimator.prediction import MotionModel
from asvhil.estimator.states import B_E, B_N, D_N, DEVIATION, PSI, SIZE, U, V
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Heading

STEP_S = 0.005
UNBOUNDED = np.full(B_E + 1 - D_N, np.inf)
RNG = np.random.default_rng(3)


def covariance() -> np.ndarray:
    root = RNG.normal(size=(SIZE, SIZE)) * 10.0 ** RNG.uniform(-3.0, 0.0, SIZE)[:, None]
    return root @ root.T


@pytest.mark.parametrize("rows", [1, 2, 4])
@pytest.mark.parametrize("biased", [True, False])
def test_a_correction_is_that_of_joseph(rows: int, biased: bool) -> None:
    p, h, variances = covariance(), RNG.normal(size=(rows, SIZE)), RNG.uniform(0.01, 1.0, rows)
    x = RNG.normal(size=SIZE) * 0.1
    innovation, used = RNG.normal(size=rows), np.ones(SIZE)
    used[B_N : B_E + 1] = float(biased)
    correction = Correction(rows, x, p.ravel(), UNBOUNDED)
    correction.h[:], correction.noise[:] = h, variances
    correction.evaluate_innovation()
    s = h @ p @ h.T + np.diag(variances)
    assert np.allclose(correction.s, s, rtol=1e-12)
    correction.innovation[:], correction.used[:] = innovation, used
    correction.evaluate()
    gain = used[:, None] * (p @ h.T @ np.linalg.inv(s))
    keep = np.eye(SIZE) - gain @ h
    after, expected = correction.p_after, x + gain @ innovation
    expected[PSI] = (expected[PSI] + math.pi) % math.tau - math.pi
    assert np.allclose(correction.x_after, expected, rtol=1e-9, atol=1e-12)
    assert np.allclose(after, keep @ p @ keep.T + gain @ np.diag(variances) @ gain.T, rtol=1e-9, atol=1e-12)
    assert np.array_equal(after, after.T)


def test_a_sharp_reading_leaves_no_negative_variance() -> None:
    before = covariance().ravel()
    correction = Correction(2, np.zeros(SIZE), before, UNBOUNDED)
    correction.h[:], correction.noise[:] = np.eye(SIZE)[:2], 1e-9
    for _ in range(200):
        correction.evaluate_innovation()
        correction.evaluate()
        before[:] = correction.p_after.ravel()
    p = before.reshape(SIZE, SIZE)
    assert np.linalg.eigvalsh(p).min() > -1e-14
    assert np.all(p.diagonal() > 0.0)


def test_the_covariance_is_carried_by_the_derivative_of_the_state() -> None:
    p, rate = covariance(), RNG.uniform(0.0, 20.0, SIZE)
    motion = MotionModel(SimplifiedDynamics(load_config("sitl").vehicle.vessel), 60.0, rate, UNBOUNDED)
    motion.x[:], motion.motor[:] = RNG.normal(size=SIZE) * 0.3, RNG.normal(size=motion.motor.size) * 0.3
    motion.input[:], motion.wind[:] = (0.4, -0.2), (3.0, 1.0)
    motion.p[:], added = p, rate * STEP_S
    motion.predict(STEP_S, 0.0, follows_bias=True)
    after = motion.p_after.copy()
    start = motion.x.copy()
    columns = []
    for i in range(SIZE):
        ends = []
        for sign in (1.0, -1.0):
            motion.x[:] = start
            motion.x[i] += sign * 1e-5
            motion.predict(STEP_S, 0.0, follows_bias=True)
            ends.append(motion.x_after.copy())
        columns.append((ends[0] - ends[1]) / 2e-5)
    f = np.array(columns).T
    assert np.allclose(
        after, f @ p @ f.T + np.diag(added), rtol=1e-3, atol=1e-4
    )  # the filter's slope is of first order
    assert np.array_equal(after, after.T)


def test_an_accelerometer_takes_its_share_of_the_noise_and_a_fused_velocity_that_of_the_slow_error() -> None:
    rate = np.arange(1.0, SIZE + 1.0)
    rate[V] = rate[U]
    motion = MotionModel(SimplifiedDynamics(load_config("sitl").vehicle.vessel), 60.0, rate, UNBOUNDED)
    motion.predict(STEP_S, 0.25, follows_bias=False)
    expected = rate * STEP_S
    expected[U : V + 1] *= 0.75
    expected[[B_N, B_E]] = 0.0
    assert np.allclose(motion.p_after.diagonal(), expected, rtol=1e-12)


@pytest.mark.parametrize("psi_rad", [0.3, 3.1, -3.14, 6.0])
def test_a_corrected_state_has_its_heading_wrapped_and_keeps_its_bounds(psi_rad: float) -> None:
    most = np.full(B_E + 1 - D_N, 0.01)
    x = np.zeros(SIZE)
    x[PSI], x[D_N], x[B_E], x[DEVIATION.start] = psi_rad, 0.5, -0.5, 0.02
    comparison = Comparison((Heading,), [0.01], x, covariance().ravel(), most)
    (group,) = comparison.compare([Heading(t_ns=0, psi_rad=psi_rad + 0.1)], LocalFrame(lat_deg=0.0, lon_deg=0.0))
    correction = comparison.correction
    assert correction.innovation[0] == pytest.approx(0.08)
    assert group.sensor == "heading" and group.expected == pytest.approx((psi_rad + 0.02, 0.0))
    correction.used[:] = 0.0
    correction.evaluate()
    assert correction.x_after[PSI] == wrap_rad(psi_rad)
    assert (correction.x_after[D_N], correction.x_after[B_E]) == (0.01, -0.01)
    correction.innovation[0] = math.nan
    correction.evaluate()
    assert np.isnan(correction.x_after[D_N])  # no bound hides a state that is not a number


def test_no_reading_passes_the_gate_where_the_covariance_is_not_finite() -> None:
    """Not one of other states either: whatever made it so has been in all of them."""
    x, p = np.zeros(SIZE), np.eye(SIZE).ravel()
    comparison = Comparison((Heading,), [1.0], x, p, np.ones(B_E + 1 - D_N))
    reading = Heading(t_ns=0, psi_rad=0.1)
    comparison.compare([reading], LocalFrame(lat_deg=0.0, lon_deg=0.0))
    assert math.isfinite(comparison.correction.s[0, 0])
    p[U * SIZE + U] = math.nan
    comparison.compare([reading], LocalFrame(lat_deg=0.0, lon_deg=0.0))
    assert math.isnan(comparison.correction.s[0, 0])
