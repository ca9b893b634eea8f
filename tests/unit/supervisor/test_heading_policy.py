"""The heading of a station that follows the weather: at once when a hold begins, then slowly, not for every gust."""

import math

import pytest

from asvhil.config import HeadingConfig
from asvhil.geo import wrap_rad
from asvhil.supervisor.heading_policy import FAR, LEAST_CHANGE_RAD, STRONG_MPS2, HeadingPolicy
from asvhil.types import Station

TICK_NS = 50_000_000


class Held:
    """A station that a policy turns, tick by tick."""

    def __init__(self, psi_deg: float = 0.0, *, weak_astern: bool = True, **keys: object) -> None:
        config = HeadingConfig.model_validate({"policy": "bow", "time_constant_s": 1.0, **keys})
        self.policy, self.t_ns = HeadingPolicy(config, weak_astern=weak_astern), 1_000_000_000_000
        self.boat_deg: float | None = None
        self.push_mps2 = math.inf
        self.station = Station(n_m=3.0, e_m=-4.0, psi_rad=math.radians(psi_deg))
        self.policy.begin()

    def wait(self, seconds: float, bow_deg: float | None) -> float:
        """The heading (deg) after a time with the weather's heading there."""
        bow_rad = None if bow_deg is None else math.radians(bow_deg)
        for _ in range(max(1, round(seconds * 1e9 / TICK_NS))):
            self.t_ns += TICK_NS
            self.station = self.policy.turned(
                self.t_ns,
                self.station,
                bow_rad,
                None if self.boat_deg is None else math.radians(self.boat_deg),
                self.push_mps2,
            )
        assert (self.station.n_m, self.station.e_m) == (3.0, -4.0)
        return math.degrees(self.station.psi_rad)


def test_a_fixed_heading_stays() -> None:
    assert Held(20.0, policy="fixed").wait(60.0, 90.0) == pytest.approx(20.0)


@pytest.mark.parametrize(("policy", "expected"), [("bow", 130.0), ("stern", -50.0)])
def test_a_hold_begins_with_the_heading_of_the_weather(policy: str, expected: float) -> None:
    assert Held(0.0, policy=policy).wait(0.0, 130.0) == pytest.approx(expected)


@pytest.mark.parametrize(("asked", "expected"), [(10.0, -30.0), (130.0, 150.0), (-119.0, -30.0), (-121.0, 150.0)])
def test_either_takes_the_nearer_one_and_keeps_to_it(asked: float, expected: float) -> None:
    held = Held(asked, policy="either")
    assert held.wait(0.0, -30.0) == pytest.approx(expected)
    veered = held.wait(1200.0, -150.0)  # now the other one would be nearer to what was asked for
    assert veered == pytest.approx(wrapped(expected - 120.0), abs=1.0)


def wrapped(degrees: float) -> float:
    return math.degrees(wrap_rad(math.radians(degrees)))


def test_within_the_dead_band_nothing_turns() -> None:
    held = Held()
    held.wait(30.0, 40.0)
    for gust_deg in (47.0, 33.0, 45.0, 40.0):
        assert held.wait(60.0, gust_deg) == pytest.approx(40.0, abs=0.6)


def test_beyond_it_the_heading_follows_no_faster_than_it_may_and_all_the_way() -> None:
    held = Held(turn_deg_per_min=20.0)
    held.wait(30.0, 0.0)
    assert held.wait(60.0, 90.0) == pytest.approx(20.0, abs=0.1)
    assert held.wait(260.0, 90.0) == pytest.approx(90.0, abs=0.6)


def test_in_little_weather_it_follows_slower() -> None:
    held = Held(turn_deg_per_min=20.0)
    held.wait(30.0, 0.0)
    held.push_mps2 = STRONG_MPS2 / 4.0
    assert held.wait(60.0, 15.0) == pytest.approx(5.0, abs=0.1)
    held.push_mps2 = 2.0 * STRONG_MPS2
    assert held.wait(60.0, 90.0) == pytest.approx(25.0, abs=0.1)


def test_in_little_weather_that_has_veered_far_it_follows_faster_again() -> None:
    held = Held(turn_deg_per_min=20.0, deadband_deg=8.0)
    held.wait(30.0, 0.0)
    held.push_mps2 = STRONG_MPS2 / 16.0
    far_deg = 2.0 * FAR * 8.0
    assert held.wait(6.0, far_deg) == pytest.approx(2.0 * 2.0 / 16.0, abs=0.01)


def test_the_last_degrees_of_a_turn_are_slow() -> None:
    held = Held(turn_deg_per_min=30.0, deadband_deg=10.0)
    held.wait(30.0, 0.0)
    assert held.wait(20.0, 14.0) == pytest.approx(10.0, abs=0.2)  # 30 degrees a minute, to 4 degrees off
    assert held.wait(20.0, 14.0) == pytest.approx(12.0, abs=0.2)  # 6 degrees a minute
    assert held.wait(60.0, 14.0) == pytest.approx(14.0, abs=0.6)


def test_the_station_says_that_its_heading_is_the_weathers() -> None:
    held = Held(policy="fixed")
    held.wait(1.0, 40.0)
    assert not held.station.of_weather
    held.policy.choose("bow")
    held.wait(1.0, None)
    assert not held.station.of_weather, "nothing is known of the weather"
    held.wait(1.0, 40.0)
    assert held.station.of_weather
    held.policy.choose("fixed")
    held.wait(1.0, 40.0)
    assert held.station.of_weather is False


def test_while_a_hold_is_young_it_follows_in_the_dead_band_too_and_three_times_as_fast() -> None:
    held = Held(turn_deg_per_min=20.0, time_constant_s=20.0, deadband_deg=10.0)
    held.wait(0.0, 0.0)
    assert held.wait(3.0, 4.0) == pytest.approx(3.0, abs=0.06)  # 1 degree a second
    assert held.wait(3.0, 4.0) == pytest.approx(4.0, abs=0.01)
    held.wait(15.0, 4.0)
    assert held.wait(6.0, 8.0) == pytest.approx(8.0, abs=0.01)
    held.wait(4.0, 8.0)  # 31 s old
    assert held.wait(30.0, 12.0) == pytest.approx(8.0, abs=0.01)
    assert held.wait(6.0, 30.0) == pytest.approx(10.0, abs=0.06)


@pytest.mark.parametrize(("age_ns", "deg"), [(30_000_000_000 - 1, 5.0), (30_000_000_000, 0.5)])
def test_a_hold_is_young_for_one_and_a_half_time_constants(age_ns: int, deg: float) -> None:
    """In 5 s at 90 degrees a minute it reaches the weather 5 degrees off, at 6 degrees a minute it does not."""
    held = Held(time_constant_s=20.0, turn_deg_per_min=30.0)
    held.wait(0.0, 0.0)
    begun_ns = held.t_ns
    held.wait(25.0, 0.0)
    turned = held.policy.turned(begun_ns + age_ns, held.station, math.radians(5.0))
    assert math.degrees(turned.psi_rad) == pytest.approx(deg)


def test_what_is_left_of_a_young_holds_turn_within_the_dead_band_is_turned_slowly() -> None:
    held = Held(turn_deg_per_min=20.0, deadband_deg=10.0)
    held.wait(0.0, 0.0)
    assert held.wait(1.5, 8.0) == pytest.approx(1.5, abs=0.06)  # a young hold's 60 degrees a minute
    assert held.wait(15.0, 8.0) == pytest.approx(2.5, abs=0.1)  # 4 degrees a minute


def test_off_by_the_dead_band_itself_nothing_turns_yet() -> None:
    held = Held(deadband_deg=45.0)
    held.wait(30.0, 0.0)
    assert held.wait(10.0, 45.0) == 0.0
    assert held.wait(10.0, 45.001) > 0.0


def test_a_policy_that_is_new_turns_at_once() -> None:
    policy = HeadingPolicy(HeadingConfig(policy="bow"))
    station = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)
    station = policy.turned(TICK_NS, station, 1.0)
    assert station.psi_rad == 1.0 and policy.turned(2 * TICK_NS, station, 1.0) == station


def test_it_turns_the_short_way_across_south() -> None:
    held = Held(170.0)
    held.wait(30.0, 170.0)
    assert held.wait(30.0, -160.0) == pytest.approx(-175.0, abs=0.1)


def test_without_weather_the_heading_stays_and_is_taken_up_later() -> None:
    held = Held(25.0)
    assert held.wait(60.0, None) == pytest.approx(25.0)
    assert held.wait(12.0, 100.0) == pytest.approx(31.0, abs=0.1)  # the first that is known, at 30 degrees a minute
    assert held.wait(60.0, None) == pytest.approx(31.0, abs=0.1)
    held = Held(25.0)
    assert held.wait(1.0, None) == pytest.approx(25.0)
    assert held.wait(0.0, 100.0) == pytest.approx(100.0)  # while all is still becoming known


def test_a_moved_station_takes_the_heading_of_the_weather_at_once() -> None:
    held = Held()
    held.wait(60.0, 0.0)
    held.policy.begin()
    assert held.wait(0.0, 60.0) == pytest.approx(60.0)


def test_at_its_fastest_it_is_still_the_same_station() -> None:
    """What tells another station from one that turns looks at steps of a tick, and of the samples of a log."""
    held = Held(turn_deg_per_min=60.0, time_constant_s=100.0)
    held.wait(0.0, 0.0)
    before = held.station.psi_rad
    held.wait(0.2, 90.0)
    assert 0.0 < held.station.psi_rad - before < LEAST_CHANGE_RAD


def test_a_policy_that_is_chosen_later_turns_the_station_at_once_and_fixed_leaves_it() -> None:
    held = Held(0.0, policy="fixed")
    assert held.wait(10.0, 130.0) == pytest.approx(0.0)
    held.policy.choose("stern")
    assert held.wait(0.0, 130.0) == pytest.approx(-50.0)
    held.policy.choose("fixed")
    assert held.wait(60.0, 20.0) == pytest.approx(-50.0)
    held.policy.choose("either")  # the nearer of -160 and 20 degrees
    assert held.wait(0.0, 20.0) == pytest.approx(20.0)


@pytest.mark.parametrize(("asked", "weak_astern", "expected"), [(130.0, True, -30.0), (130.0, False, 150.0)])
def test_a_free_heading_takes_the_end_that_asks_less_of_the_motors(
    asked: float, weak_astern: bool, expected: float
) -> None:
    assert Held(asked, policy="free", weak_astern=weak_astern).wait(0.0, -30.0) == pytest.approx(expected)


def test_where_both_ends_are_as_good_a_free_heading_changes_them_when_the_weather_has_gone_round() -> None:
    held = Held(0.0, policy="free", weak_astern=False)
    held.wait(30.0, 0.0)
    assert held.wait(600.0, 100.0) == pytest.approx(100.0, abs=0.6), "less than 110 degrees off: it follows"
    assert held.wait(600.0, -120.0) == pytest.approx(60.0, abs=0.6), "the stern is 40 degrees off, the bow 140"
    bound_to_its_bow = Held(0.0, policy="free")
    bound_to_its_bow.wait(30.0, 0.0)
    assert bound_to_its_bow.wait(600.0, 140.0) == pytest.approx(140.0, abs=0.6)


def test_without_weather_a_free_heading_is_the_boats() -> None:
    held = Held(20.0, policy="free")
    assert held.wait(1.0, None) == pytest.approx(20.0), "nor is the boat's known"
    held.boat_deg = 27.0
    assert held.wait(1.0, None) == pytest.approx(20.0), "a dead band, or the boat would drift about"
    held.boat_deg = 75.0
    assert held.wait(1.0, None) == pytest.approx(75.0)
    held.boat_deg = 90.0
    assert held.wait(1.0, None) == pytest.approx(90.0)
    assert held.wait(120.0, 0.0) == pytest.approx(30.0, abs=1.0), "weather comes up: no faster than it may"
    fixed = Held(20.0, policy="bow")
    fixed.boat_deg = 75.0
    assert fixed.wait(1.0, None) == pytest.approx(20.0)
