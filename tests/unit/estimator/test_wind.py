"""Apparent to true wind for cases worked by hand, the low-pass filter, and faults of the anemometer."""

import math
from collections.abc import Callable

import pytest

from asvhil.config import WindFilterConfig
from asvhil.estimator.wind import WindFilter, true_wind
from asvhil.types import ApparentWind, Estimate


def boat(psi_deg: float = 0.0, u: float = 0.0, v: float = 0.0) -> Estimate:
    return Estimate(
        t_ns=0, n_m=0.0, e_m=0.0, psi_rad=math.radians(psi_deg), u_mps=u, v_mps=v, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


def sample(speed: float, from_deg: float, t_ns: int = 0) -> ApparentWind:
    return ApparentWind(t_ns=t_ns, speed_mps=speed, from_rad=math.radians(from_deg))


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
def test_true_wind(apparent: ApparentWind, estimate: Estimate, vn: float, ve: float) -> None:
    assert true_wind(apparent, estimate) == pytest.approx((vn, ve), abs=1e-12)


def test_the_filter_follows_with_its_time_constant_and_goes_stale() -> None:
    wind = WindFilter(WindFilterConfig(time_constant_s=4.0, speed_time_constant_s=4.0, stale_after_s=3.0))
    assert wind.wind(0) is None
    wind.on_apparent_wind(sample(0.0, 0.0), boat())
    t_ns = 0
    for _ in range(20):
        t_ns += 200_000_000
        wind.on_apparent_wind(sample(1.0, 180.0, t_ns), boat())
    now = wind.wind(t_ns)
    assert now is not None and now.vn_mps == pytest.approx(1.0 - math.exp(-1.0)) and now.std_mps > 0.1
    later = wind.wind(t_ns + 3_100_000_000)
    assert now.valid and later is not None and not later.valid
    wind.on_apparent_wind(sample(2.0, 180.0, t_ns + 9_000_000_000), boat())  # after a silence it starts afresh
    again = wind.wind(t_ns + 9_000_000_000)
    assert again is not None and again.vn_mps == pytest.approx(2.0)


def test_readings_that_are_not_finite_are_ignored() -> None:
    wind = WindFilter(WindFilterConfig())
    wind.on_apparent_wind(ApparentWind(t_ns=0, speed_mps=math.nan, from_rad=0.0), boat())
    assert wind.wind(0) is None


def test_a_gust_shows_in_the_speed_at_once_and_a_step_of_the_vane_hardly() -> None:
    wind = WindFilter(WindFilterConfig())
    wind.on_apparent_wind(sample(4.0, 0.0), boat())
    wind.on_apparent_wind(sample(6.0, 22.5, 500_000_000), boat())
    now = wind.wind(500_000_000)
    assert now is not None
    assert math.hypot(now.vn_mps, now.ve_mps) == pytest.approx(4.0 + 2.0 * (1.0 - math.exp(-1.0)))
    toward = math.degrees(math.atan2(now.ve_mps, now.vn_mps))
    assert toward == pytest.approx(-180.0 + 22.5 * (1.0 - math.exp(-0.125)))


def run(
    wind: WindFilter, seconds: float, speed: Callable[[int], float], turn_deg_per_s: float = 0.0, start: int = 0
) -> int:
    """Samples at 5 Hz of a vane that always says 45 degrees, on a boat that turns; returns the next number."""
    for k in range(start, start + round(seconds * 5)):
        wind.on_apparent_wind(sample(speed(k), 45.0, k * 200_000_000), boat(psi_deg=turn_deg_per_s * k / 5.0))
    return start + round(seconds * 5)


def noisy(k: int) -> float:
    """A speed as noisy cups tell it."""
    return round(4.0 + 0.1 * math.sin(37.0 * k), 2)


def test_cups_that_stop_changing_are_stuck_and_their_wind_is_not_valid_until_they_turn_again() -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 20.0, noisy)
    at = run(wind, 1.8, lambda k: 4.03, start=at)
    now = wind.wind((at - 1) * 200_000_000)
    assert now is not None and now.valid and wind.notes((at - 1) * 200_000_000) == ()
    at = run(wind, 1.0, lambda k: 4.03, start=at)
    t_ns = (at - 1) * 200_000_000
    now = wind.wind(t_ns)
    assert now is not None and not now.valid
    assert [(note.subject, note.text) for note in wind.notes(t_ns)] == [("anemometer", "stuck")]
    at = run(wind, 0.2, lambda k: 5.5, start=at)  # it turns again, in another wind
    now = wind.wind((at - 1) * 200_000_000)
    assert now is not None and now.valid and math.hypot(now.vn_mps, now.ve_mps) == pytest.approx(5.5)
    assert wind.notes((at - 1) * 200_000_000) == ()


@pytest.mark.parametrize("speed", [4.0, 0.0])
def test_a_speed_that_never_changes_and_a_calm_are_not_stuck(speed: float) -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 30.0, lambda k: speed)
    now = wind.wind((at - 1) * 200_000_000)
    assert now is not None and now.valid


def test_a_vane_that_stays_while_the_boat_turns_is_stuck_and_one_on_a_steady_boat_is_not() -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 30.0, noisy)
    assert wind.notes((at - 1) * 200_000_000) == ()
    for k in range(at, at + 25):  # 10 degrees per second
        wind.on_apparent_wind(sample(noisy(k), 45.0, k * 200_000_000), boat(psi_deg=2.0 * (k - at)))
    t_ns = (at + 24) * 200_000_000
    assert [(note.subject, note.text) for note in wind.notes(t_ns)] == [("anemometer", "vane stuck")]
    now = wind.wind(t_ns)
    assert now is not None and not now.valid


def test_a_single_outlier_is_rejected_and_reported() -> None:
    """A right checksum does not make a wind: 999 is what a counter that ran away prints."""
    wind_filter = WindFilter(WindFilterConfig())
    for k in range(20):
        wild = {10: 999.0, 12: 59.0}.get(k, 5.0 + 0.1 * noisy(k))
        wind_filter.on_apparent_wind(sample(wild, 0.0, k * 200_000_000), boat())
        wind = wind_filter.wind(k * 200_000_000)
        assert wind is not None and wind.valid and math.hypot(wind.vn_mps, wind.ve_mps) < 6.0
        assert [note.text for note in wind_filter.notes(k * 200_000_000)] == (["implausible"] if k >= 10 else [])


def test_a_lasting_jump_of_the_wind_is_accepted_and_one_above_the_limit_never() -> None:
    for speed, believed in ((25.0, True), (80.0, False)):
        wind_filter = WindFilter(WindFilterConfig())
        for k in range(40):
            wind_filter.on_apparent_wind(
                sample(speed + noisy(k) if k >= 10 else 5.0 + noisy(k), 0.0, k * 200_000_000), boat()
            )
        wind = wind_filter.wind(39 * 200_000_000)
        assert wind is not None
        assert wind.valid is believed
        assert (math.hypot(wind.vn_mps, wind.ve_mps) > 20.0) is believed


def test_a_silent_anemometer_is_reported() -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 2.0, noisy)
    t_ns = (at - 1) * 200_000_000
    assert wind.notes(t_ns + 2_900_000_000) == ()
    assert [note.text for note in wind.notes(t_ns + 3_100_000_000)] == ["silent"]
