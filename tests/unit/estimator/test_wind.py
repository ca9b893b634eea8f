"""Apparent to true wind for cases worked by hand, the low-pass filter, and faults of the anemometer."""

import math
from collections.abc import Callable

import pytest

from asvhil.config import WindFilterConfig
from asvhil.estimator.wind import CALM_MPS, WindFilter, apparent_wind, true_wind
from asvhil.types import ApparentWind, BowWind, Estimate, Note, TrueWind


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
        for k in range(60):
            wind_filter.on_apparent_wind(
                sample(speed + noisy(k) if k >= 10 else 5.0 + noisy(k), 0.0, k * 200_000_000), boat()
            )
        wind = wind_filter.wind(59 * 200_000_000)
        assert wind is not None
        assert wind.valid is believed
        assert (math.hypot(wind.vn_mps, wind.ve_mps) > 20.0) is believed


def test_a_silent_anemometer_is_reported() -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 2.0, noisy)
    t_ns = (at - 1) * 200_000_000
    assert wind.notes(t_ns + 2_900_000_000) == ()
    assert [note.text for note in wind.notes(t_ns + 3_100_000_000)] == ["silent"]


# --- worked by hand ------------------------------------------------------------------------------------------------

S = 1_000_000_000
CONFIG = WindFilterConfig(time_constant_s=4.0, speed_time_constant_s=0.5, stale_after_s=3.0)


def north_east(wind: WindFilter, t_ns: int) -> tuple[float, float]:
    now = wind.wind(t_ns)
    assert now is not None and now.t_ns == t_ns
    return now.vn_mps, now.ve_mps


def fed(*samples: tuple[int, float, float]) -> WindFilter:
    """A filter after true winds (time, north, east)."""
    wind = WindFilter(CONFIG)
    for sample_ in samples:
        wind.on_true_wind(TrueWind(t_ns=sample_[0], vn_mps=sample_[1], ve_mps=sample_[2]))
    return wind


@pytest.mark.parametrize(
    ("wind_ned", "estimate", "speed", "from_deg"),
    [
        ((-3.0, 0.0), boat(0.0, u=1.0), 4.0, 0.0),
        ((0.0, -3.0), boat(0.0, v=1.0), 4.0, 90.0),
        ((0.0, 3.0), boat(90.0, u=1.0), 2.0, -180.0),
        ((3.0, 0.0), boat(90.0, v=1.0), 4.0, 90.0),
    ],
)
def test_apparent_wind(wind_ned: tuple[float, float], estimate: Estimate, speed: float, from_deg: float) -> None:
    seen = apparent_wind(wind_ned, estimate)
    assert seen == pytest.approx((speed, math.radians(from_deg)), abs=1e-12)


def test_a_wind_relative_to_the_bow_needs_the_heading_but_not_the_motion() -> None:
    wind = WindFilter(CONFIG)
    wind.on_bow_wind(BowWind(t_ns=0, speed_mps=5.0, from_rad=math.atan2(4.0, 3.0)), boat(90.0, u=2.0, v=1.0))
    assert north_east(wind, 0) == pytest.approx((4.0, -3.0))  # to port of the bow and astern, heading east


def test_a_first_sample_is_taken_as_it_is() -> None:
    wind = fed((S, 0.0, 3.0))
    assert north_east(wind, S) == (0.0, 3.0)
    now = wind.wind(S)
    assert now is not None and now.std_mps == 0.0 and now.valid


@pytest.mark.parametrize(("vn", "ve"), [(math.nan, 1.0), (1.0, math.nan), (math.inf, 1.0)])
def test_a_part_that_is_not_finite_spoils_the_whole_sample(vn: float, ve: float) -> None:
    assert fed((0, vn, ve)).wind(0) is None
    wind = WindFilter(CONFIG)
    wind.on_apparent_wind(ApparentWind(t_ns=0, speed_mps=vn, from_rad=ve), boat())
    wind.on_apparent_wind(ApparentWind(t_ns=0, speed_mps=1.0, from_rad=math.nan), boat())
    assert wind.wind(0) is None and wind.notes(0) == ()


def test_a_wind_is_valid_for_just_as_long_as_the_config_says_and_silent_after_that() -> None:
    wind = fed((S, 0.0, 3.0))
    at, after = wind.wind(4 * S), wind.wind(4 * S + 1)
    assert at is not None and at.valid and after is not None and not after.valid
    assert wind.notes(4 * S) == ()
    assert wind.notes(4 * S + 1) == (Note(subject="anemometer", text="silent", ok=False),)


def test_an_implausible_sample_is_told_for_as_long() -> None:
    wind = fed((S, 0.0, 3.0), (2 * S, 0.0, 999.0), (3 * S, 0.0, 3.0))
    assert wind.notes(5 * S) == (Note(subject="anemometer", text="implausible", ok=False),)
    assert wind.notes(5 * S + 1) == ()


def test_samples_after_a_gap_of_just_that_time_are_still_filtered() -> None:
    gain = 1.0 - math.exp(-3.0 / 0.5)
    assert north_east(fed((0, 0.0, 3.0), (3 * S, 0.0, 5.0)), 3 * S)[1] == pytest.approx(3.0 + 2.0 * gain)
    assert north_east(fed((0, 0.0, 3.0), (3 * S + 1, 0.0, 5.0)), 3 * S + 1) == (0.0, 5.0)


def test_speed_and_direction_are_filtered_apart() -> None:
    gain, turn = 1.0 - math.exp(-1.0), 1.0 - math.exp(-0.125)
    north, east = north_east(fed((0, 0.0, 3.0), (S // 2, -5.0, 0.1)), S // 2)
    assert math.hypot(north, east) == pytest.approx(3.0 + gain * (math.hypot(5.0, 0.1) - 3.0))
    angle = math.atan2(0.1, -5.0) - math.pi / 2
    assert math.atan2(east, north) == pytest.approx(math.pi / 2 + turn * angle)


@pytest.mark.parametrize("second", [(0.1, -5.0), (5.0, 0.1)])
def test_a_wind_across_an_axis_is_no_calm(second: tuple[float, float]) -> None:
    gain = 1.0 - math.exp(-1.0)
    north, east = north_east(fed((0, 4.0, 0.0), (S // 2, *second)), S // 2)
    assert math.hypot(north, east) == pytest.approx(4.0 + gain * (math.hypot(*second) - 4.0))


def test_in_a_calm_the_parts_are_filtered() -> None:
    gain = 1.0 - math.exp(-1.0)
    wind = fed((0, 0.2, 0.3), (S // 2, 1.0, -0.9))
    assert north_east(wind, S // 2) == pytest.approx((0.2 + gain * 0.8, 0.3 - gain * 1.2))
    at_limit = north_east(fed((0, CALM_MPS, 0.0), (S // 2, 0.0, 2.0)), S // 2)
    assert math.hypot(*at_limit) == pytest.approx(CALM_MPS + gain * (2.0 - CALM_MPS))


def test_a_sample_of_the_past_changes_nothing() -> None:
    assert north_east(fed((S, 0.2, 0.3), (0, 0.4, 0.1)), S) == (0.2, 0.3)


def test_the_standard_deviation_is_that_of_the_samples_about_the_wind() -> None:
    turn = 1.0 - math.exp(-0.125)
    wind = fed((0, 0.0, 3.0), (S // 2, 1.0, 5.0))
    variance = turn * 0.5 * (1.0 + 4.0)
    now = wind.wind(S // 2)
    assert now is not None and now.std_mps == pytest.approx(math.sqrt(variance))
    wind.on_true_wind(TrueWind(t_ns=S, vn_mps=now.vn_mps + 0.6, ve_mps=now.ve_mps - 0.8))
    now = wind.wind(S)
    assert now is not None and now.std_mps == pytest.approx(math.sqrt(variance + turn * (0.5 - variance)))


@pytest.mark.parametrize(
    ("first", "second", "taken"),
    [
        ((0.0, 0.0), (6.0, 8.0), True),  # 10 m/s off, which is allowed
        ((0.0, 0.0), (6.0, 8.1), False),
        ((0.0, 0.0), (0.0, -10.1), False),
        ((0.0, 6.0), (0.0, 7.0), True),
        ((7.0, 6.0), (6.0, 7.0), True),
    ],
)
def test_a_wind_that_leaps_is_not_taken(first: tuple[float, float], second: tuple[float, float], taken: bool) -> None:
    wind = fed((0, *first), (S, *second))
    assert (north_east(wind, S) != first) is taken
    assert [note.text for note in wind.notes(S)] == ([] if taken else ["implausible"])


@pytest.mark.parametrize(("vn", "ve", "taken"), [(60.0, 0.0, True), (36.0, 48.1, False), (0.0, -60.1, False)])
def test_no_wind_above_the_limit_is_taken(vn: float, ve: float, taken: bool) -> None:
    assert (fed((0, vn, ve)).wind(0) is not None) is taken


@pytest.mark.parametrize(("leap_mps", "after_s"), [(12.0, 3), (20.0, 8), (40.0, 10)])
def test_a_leap_is_believed_once_it_has_lasted_the_longer_the_larger_it_is(leap_mps: float, after_s: int) -> None:
    still = [(second * S, 0.0, 0.0) for second in range(6)]
    wind = fed(*still, *((second * S, leap_mps, 0.0) for second in range(6, 6 + after_s)))
    at_ns = (6 + after_s) * S
    assert north_east(wind, at_ns - 1) == (0.0, 0.0)
    wind.on_true_wind(TrueWind(t_ns=at_ns, vn_mps=leap_mps, ve_mps=0.0))
    assert north_east(wind, at_ns)[0] > 0.7 * leap_mps


def test_a_single_sample_at_the_start_is_nothing_to_wait_for() -> None:
    wind = fed((0, 55.0, 0.0), *((second * S // 2, 4.0, 0.0) for second in range(1, 8)))
    assert north_east(wind, 7 * S // 2) == pytest.approx((4.0, 0.0), abs=0.1)


def test_a_leap_begins_anew_where_a_sample_was_sound_and_ends_at_once_after_a_silence() -> None:
    again = fed((0, 0.0, 0.0), (S, 12.0, 0.0), (2 * S, 1.0, 0.0), (7 * S // 2, 12.0, 0.0), (5 * S, 12.0, 0.0))
    assert north_east(again, 5 * S)[0] < 2.0  # the second leap lasts only since 3.5 s
    assert north_east(fed((0, 0.0, 0.0), (3 * S, 20.0, 0.0)), 3 * S) == (0.0, 0.0)
    assert north_east(fed((0, 0.0, 0.0), (3 * S + 1, 20.0, 0.0)), 3 * S + 1) == (20.0, 0.0)


# --- a stuck sensor, at its limits ---------------------------------------------------------------------------------


def stuck(wind: WindFilter, t_ns: int) -> str:
    return "".join(note.text for note in wind.notes(t_ns))


def test_without_a_time_nothing_is_stuck() -> None:
    wind = WindFilter(WindFilterConfig(stuck_after_s=None))
    at = run(wind, 10.0, noisy)
    at = run(wind, 10.0, lambda k: 4.03, 20.0, at)
    now = wind.wind((at - 1) * S // 5)
    assert now is not None and now.valid and stuck(wind, (at - 1) * S // 5) == ""


@pytest.mark.parametrize(("speed", "text"), [(0.6, "stuck"), (0.0, "")])
def test_cups_that_stay_in_a_light_wind_are_stuck_and_in_a_calm_at_rest(speed: float, text: str) -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 20.0, lambda k: 0.6 + 0.1 * math.sin(37.0 * k))
    at = run(wind, 4.0, lambda k: speed, start=at)
    assert stuck(wind, (at - 1) * S // 5) == text


def test_cups_that_stay_are_stuck_after_just_the_time() -> None:
    wind = WindFilter(WindFilterConfig(stuck_after_s=2.0))
    at = run(wind, 20.0, noisy)
    for after_ns, text in ((0, ""), (S // 2, ""), (S, ""), (3 * S // 2, ""), (2 * S - 1, ""), (2 * S, "stuck")):
        t_ns = at * S // 5 + after_ns
        wind.on_apparent_wind(sample(4.03, 45.0, t_ns), boat())
        assert stuck(wind, t_ns) == text


def vane(wind: WindFilter, t_ns: int, psi_deg: float, from_deg: float = 0.0, speed: float = 4.0) -> str:
    wind.on_apparent_wind(sample(speed + 0.2 * (t_ns % 7), from_deg, t_ns), boat(psi_deg))
    return stuck(wind, t_ns)


def test_a_vane_is_stuck_after_just_its_time_and_turn_until_it_turns() -> None:
    wind = WindFilter(WindFilterConfig(stuck_after_s=2.0))
    assert vane(wind, S, 0.0) == "" and vane(wind, S + 1, 0.0, 1.0) == ""
    assert vane(wind, 2 * S, 36.0, 1.0) == ""
    assert vane(wind, 3 * S, 36.0, 1.0) == ""  # 1 ns too soon
    assert vane(wind, 3 * S + 1, 36.0, 1.0) == "vane stuck"
    assert vane(wind, 4 * S, 0.0, 1.0) == "vane stuck"  # the boat has turned back
    assert vane(wind, 5 * S, 0.0, 2.0) == ""


@pytest.mark.parametrize(
    ("psi_deg", "speed", "text"),
    [(34.0, 4.0, ""), (-36.0, 4.0, "vane stuck"), (-90.0, 0.9, ""), (90.0, 1.5, "vane stuck")],
)
def test_a_vane_must_follow_a_turn_of_more_than_35_degrees_in_a_wind(psi_deg: float, speed: float, text: str) -> None:
    wind = WindFilter(WindFilterConfig(stuck_after_s=2.0))
    for k in range(3):
        vane(wind, k * 7, 0.0, 1.0 + k / 10, speed)
    assert vane(wind, 3 * S // 7 * 7, psi_deg, 1.2, speed) == text


@pytest.mark.parametrize("kind", ["true", "bow"])
def test_what_was_stuck_says_nothing_of_the_source_that_takes_over(kind: str) -> None:
    wind = WindFilter(WindFilterConfig())
    at = run(wind, 20.0, noisy)
    at = run(wind, 4.0, lambda k: 4.03, start=at)
    t_ns = (at - 1) * 200_000_000
    found = wind.wind(t_ns)
    assert found is not None and not found.valid and wind.notes(t_ns)
    for _ in range(10):
        t_ns += 10**9
        if kind == "true":
            wind.on_true_wind(TrueWind(t_ns=t_ns, vn_mps=-3.0, ve_mps=1.0))
        else:
            wind.on_bow_wind(BowWind(t_ns=t_ns, speed_mps=3.0, from_rad=0.2), boat())
    found = wind.wind(t_ns)
    assert found is not None and found.valid and not wind.notes(t_ns)
