"""Covariances of the filter against the textbook's matrices."""

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.covariance import Correction
from asvhil.estimator.prediction import MotionModel
from asvhil.estimator.states import B_E, B_N, SIZE

STEP_S = 0.005
RNG = np.random.default_rng(3)


def covariance() -> np.ndarray:
    root = RNG.normal(size=(SIZE, SIZE)) * 10.0 ** RNG.uniform(-3.0, 0.0, SIZE)[:, None]
    return root @ root.T


@pytest.mark.parametrize("rows", [1, 2, 4])
@pytest.mark.parametrize("biased", [True, False])
def test_a_correction_is_that_of_joseph(rows: int, biased: bool) -> None:
    p, h, variances = covariance(), RNG.normal(size=(rows, SIZE)), RNG.uniform(0.01, 1.0, rows)
    innovation, used = RNG.normal(size=rows), np.ones(SIZE)
    used[B_N : B_E + 1] = float(biased)
    correction = Correction(rows)
    correction.p[:], correction.h[:], correction.noise[:] = p.ravel(), h, variances
    correction.evaluate_innovation()
    s = h @ p @ h.T + np.diag(variances)
    assert np.allclose(correction.s, s, rtol=1e-12)
    correction.innovation[:], correction.used[:] = innovation, used
    correction.evaluate()
    gain = used[:, None] * (p @ h.T @ np.linalg.inv(s))
    keep = np.eye(SIZE) - gain @ h
    after = correction.after.reshape(SIZE, SIZE)
    assert np.allclose(correction.change, gain @ innovation, rtol=1e-9, atol=1e-12)
    assert np.allclose(after, keep @ p @ keep.T + gain @ np.diag(variances) @ gain.T, rtol=1e-9, atol=1e-12)
    assert np.array_equal(after, after.T)


def test_a_sharp_reading_leaves_no_negative_variance() -> None:
    p, h = covariance(), np.eye(SIZE)[:2]
    correction = Correction(2)
    for _ in range(200):
        correction.p[:], correction.h[:], correction.noise[:] = p.ravel(), h, 1e-9
        correction.evaluate_innovation()
        correction.evaluate()
        p = correction.after.reshape(SIZE, SIZE).copy()
    assert np.linalg.eigvalsh(p).min() > -1e-14
    assert np.all(p.diagonal() > 0.0)


def test_the_covariance_is_carried_by_the_derivative_of_the_state() -> None:
    motion = MotionModel(SimplifiedDynamics(load_config("sitl").vehicle.vessel), 60.0)
    motion.state[:] = RNG.normal(size=motion.state.size) * 0.3
    motion.input[:], motion.wind[:] = (0.4, -0.2), (3.0, 1.0)
    p, added = covariance(), RNG.uniform(0.0, 0.1, SIZE)
    motion.covariance[:], motion.variance[:] = p.ravel(), added
    motion.predict(STEP_S, 0.0)
    after = motion.covariance_after.reshape(SIZE, SIZE).copy()
    start = motion.state.copy()
    columns = []
    for i in range(SIZE):
        ends = []
        for sign in (1.0, -1.0):
            motion.state[:] = start
            motion.state[i] += sign * 1e-5
            motion.predict(STEP_S, 0.0)
            ends.append(motion.after[:SIZE].copy())
        columns.append((ends[0] - ends[1]) / 2e-5)
    f = np.array(columns).T
    assert np.allclose(
        after, f @ p @ f.T + np.diag(added), rtol=1e-3, atol=1e-4
    )  # the filter's slope is of first order
    assert np.array_equal(after, after.T)
