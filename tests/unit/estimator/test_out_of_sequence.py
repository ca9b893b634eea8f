"""Out-of-sequence readings give the same filter state, to the last bit, as readings in order."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.out_of_sequence import History
from asvhil.geo import LocalFrame
from asvhil.types import Estimate, GroundVelocity, Heading, Measurement, Position, SpecificForce, YawRate

CONFIG = load_config("sitl", ("estimator.ekf.compass={std_deg: 3, walk_deg: 0.1}",))
MODEL = SimplifiedDynamics(CONFIG.vehicle.vessel)
ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
S = 1_000_000_000
MS = 1_000_000


@given(st.permutations(range(12)), st.integers(min_value=0, max_value=11))
def test_the_state_is_that_of_the_events_in_order_of_their_times(order: list[int], span: int) -> None:
    """The state is the list of what was taken in; a span that is too short leaves out what comes after it."""
    history: History[tuple[int, ...]] = History(lambda s, t, e: (*s, e), span, -1, ())
    newest, kept = -1, []
    for t in order:
        history.add(t, t)
        newest = max(newest, t)
        if newest - t <= span:
            kept.append(t)
    assert history.state == tuple(sorted(kept))
    assert history.too_late == len(order) - len(kept)


def test_what_is_kept_is_bounded() -> None:
    history: History[int] = History(lambda s, t, e: s + 1, 100, 0, 0)
    for t in range(1, 5000):
        history.add(t, None)
    assert len(history._entries) <= 102 and history.state == 4999
    history.add(4950, None)
    assert history.state == 5000


Readings = list[Measurement]


def readings(seed: int) -> list[Readings]:
    """Two seconds of noisy sensors of a boat that turns, no two at the same time; some readings are far off."""
    rng = np.random.default_rng(seed)
    found: list[Readings] = []
    for k in range(1, 41):
        t_ns = k * 50 * MS
        psi = 0.3 + 0.02 * k + rng.normal(0, 0.01) + (1.0 if rng.random() < 0.1 else 0.0)
        found.append([Heading(t_ns=t_ns, psi_rad=psi), YawRate(t_ns=t_ns, r_radps=0.4 + rng.normal(0, 0.01))])
        found.append([SpecificForce(t_ns=t_ns + 7 * MS, ax_mps2=rng.normal(0, 0.1), ay_mps2=rng.normal(0, 0.1))])
        if k % 4 == 0:
            n, e, vn, ve = rng.normal(0, 0.1, 4) + (20.0 if rng.random() < 0.2 else 0.0)
            lat, lon = ORIGIN.to_geodetic(n, e)
            t_ns -= 11 * MS
            position = Position(t_ns=t_ns, lat_deg=lat, lon_deg=lon)
            found.append([position, GroundVelocity(t_ns=t_ns, vn_mps=vn, ve_mps=ve)])
    return found


def run(arrivals: list[tuple[int, Readings]]) -> tuple[Ekf, Estimate]:
    """Each reading handed over in the first tick of 50 ms after its arrival, a new forcing in each tick."""
    ekf = Ekf(CONFIG.estimator, MODEL)
    ekf.on_measurements([Heading(t_ns=0, psi_rad=0.3), YawRate(t_ns=0, r_radps=0.4)])
    position = Position(t_ns=0, lat_deg=ORIGIN.lat_deg, lon_deg=ORIGIN.lon_deg)
    ekf.on_measurements([position, GroundVelocity(t_ns=0, vn_mps=0.0, ve_mps=0.0)])
    waiting = sorted(arrivals, key=lambda one: one[0])
    for tick in range(1, 60):
        t_ns = tick * 50 * MS + 3 * MS
        while waiting and waiting[0][0] <= t_ns:
            ekf.on_measurements(waiting.pop(0)[1])
        ekf.predict(t_ns)
        ekf.set_forcing((0.1 * math.sin(tick), 0.2), (3.0, 1.0) if tick % 20 else None)
    estimate = ekf.estimate(3 * S)
    assert estimate is not None
    return ekf, estimate


@settings(max_examples=12, deadline=None)
@given(st.integers(min_value=0, max_value=10_000), st.integers(min_value=0, max_value=10_000))
def test_readings_that_come_late_give_the_estimate_of_those_in_order_to_the_last_bit(seed: int, delays: int) -> None:
    """Delays of up to 0.6 s that differ from reading to reading, so that the order is another one; gates included."""
    random_delay = random.Random(delays)
    ordered = [(m[0].t_ns, m) for m in readings(seed)]
    late = [(t_ns + random_delay.randrange(600 * MS), m) for t_ns, m in ordered]
    one, in_order = run(ordered)
    other, shuffled = run(late)
    assert shuffled == in_order
    assert other.rejected == one.rejected and other.too_late == 0


def test_the_covariance_stays_symmetric_and_positive() -> None:
    ekf, _ = run([(m[0].t_ns, m) for m in readings(1)])
    assert ekf._history is not None
    for entry in ekf._history._entries:
        p = entry.state.p
        assert p == pytest.approx(p.T, abs=1e-12)
        assert np.linalg.eigvalsh(0.5 * (p + p.T)).min() > -1e-12


def test_what_is_older_than_the_history_is_dropped_and_counted() -> None:
    ekf, before = run([(m[0].t_ns, m) for m in readings(2)])
    ekf.on_measurements([Heading(t_ns=S, psi_rad=0.0), YawRate(t_ns=S, r_radps=0.0)])
    assert ekf.too_late == 1 and ekf.estimate(3 * S) == before
