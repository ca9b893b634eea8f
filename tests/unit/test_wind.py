"""Apparent to true wind for hand-worked cases, and the filter's memory."""

import math

import pytest

from asvhil.config import WindFilterConfig
from asvhil.estimator.wind import WindFilter, true_wind
from asvhil.types import Estimate, WindSample


def boat(psi_deg: float = 0.0, u: float = 0.0, v: float = 0.0) -> Estimate:
    return Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=math.radians(psi_deg), u_mps=u, v_mps=v, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


def sample(speed: float, from_deg: float, t_ns: int = 0) -> WindSample:
    return WindSample(t_ns=t_ns, speed_mps=speed, from_rad=math.radians(from_deg))


@pytest.mark.parametrize(
    ("apparent", "estimate", "vn", "ve"),
    [
        (sample(3.0, 0.0), boat(0.0), -3.0, 0.0),  # from ahead, heading north: blows south
        (sample(3.0, 90.0), boat(0.0), 0.0, -3.0),  # from starboard: blows west
        (sample(3.0, 0.0), boat(90.0), 0.0, -3.0),  # from ahead, heading east: blows west
        (sample(2.0, 0.0), boat(0.0, u=2.0), 0.0, 0.0),  # headwind of our own making
        (sample(0.0, 0.0), boat(0.0, v=1.0), 0.0, 1.0),  # no apparent wind while drifting: the air drifts too
        (sample(5.0, 180.0), boat(180.0, u=1.0), -6.0, 0.0),
    ],
)
def test_true_wind(apparent: WindSample, estimate: Estimate, vn: float, ve: float) -> None:
    assert true_wind(apparent, estimate) == pytest.approx((vn, ve), abs=1e-12)


def test_the_filter_follows_with_its_time_constant_and_goes_stale() -> None:
    wind = WindFilter(WindFilterConfig(time_constant_s=4.0, stale_after_s=3.0))
    assert wind.wind(0) is None
    wind.on_sample(sample(0.0, 0.0), boat())
    t_ns = 0
    for _ in range(20):
        t_ns += 200_000_000
        wind.on_sample(sample(1.0, 180.0, t_ns), boat())
    now = wind.wind(t_ns)
    assert now is not None and now.vn_mps == pytest.approx(1.0 - math.exp(-1.0)) and now.std_mps > 0.1
    later = wind.wind(t_ns + 3_100_000_000)
    assert now.valid and later is not None and not later.valid
    wind.on_sample(sample(2.0, 180.0, t_ns + 9_000_000_000), boat())  # after a silence it starts afresh
    again = wind.wind(t_ns + 9_000_000_000)
    assert again is not None and again.vn_mps == pytest.approx(2.0)


def test_numbers_that_are_none_are_ignored() -> None:
    wind = WindFilter(WindFilterConfig())
    wind.on_sample(WindSample(t_ns=0, speed_mps=math.nan, from_rad=0.0), boat())
    assert wind.wind(0) is None
