"""The heading that the weather wants, of the WAM-V's physics: from the wind, from what is left over, and from none."""

import math

import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.weather import DOUBT_MPS2, DOUBT_SHARE, EVERY_NS, GAP_NS, LEAST_MPS2, WeatherHeading
from asvhil.geo import body_to_ned, wrap_rad
from asvhil.types import Estimate, Wind

MODEL = SimplifiedDynamics(load_config("sitl").believed_vessel)
S = 1_000_000_000


class Sea:
    """What is fed to the finder in each tick, and the heading (deg) that it gives."""

    def __init__(self, time_constant_s: float = 60.0) -> None:
        self.finder, self.t_ns = WeatherHeading(MODEL, time_constant_s), 1_700_000_000 * S

    def wait(
        self,
        seconds: float,
        wind: tuple[float, float] | None,
        *,
        psi_deg: float = 0.0,
        ahead_mps2: float = 0.0,
        sway_mps2: float = 0.0,
        r_degps: float = 0.0,
    ) -> float | None:
        """`wind`: speed (m/s) and the direction that it blows toward (deg); `sway_mps2` is left over to the side."""
        found, psi_rad = None, math.radians(psi_deg)
        for _ in range(round(seconds * 20)):
            self.t_ns += S // 20
            found = self.finder.step(self.t_ns, self.estimate(psi_rad, sway_mps2, r_degps, ahead_mps2), self.wind(wind))
        return None if found is None else math.degrees(found)

    def estimate(
        self,
        psi_rad: float,
        sway_mps2: float = 0.0,
        r_degps: float = 0.0,
        ahead_mps2: float = 0.0,
        *,
        valid: bool = True,
    ) -> Estimate:
        d_n, d_e = body_to_ned(psi_rad, ahead_mps2, sway_mps2)
        return Estimate(
            t_ns=self.t_ns, n_m=0.0, e_m=0.0, psi_rad=psi_rad, u_mps=0.0, v_mps=0.0, r_radps=math.radians(r_degps),
            motor=(0.0, 0.0), std=(0.0,) * 6, disturbance=(d_n, d_e, 0.0), valid=valid,
        )  # fmt: skip

    def wind(self, at: tuple[float, float] | None) -> Wind | None:
        if at is None:
            return None
        speed_mps, toward_rad = at[0], math.radians(at[1])
        vn, ve = speed_mps * math.cos(toward_rad), speed_mps * math.sin(toward_rad)
        return Wind(t_ns=self.t_ns, vn_mps=vn, ve_mps=ve, std_mps=0.0, valid=True)


@pytest.mark.parametrize("toward_deg", [-173.0, -90.0, 0.0, 41.0, 180.0])
def test_in_wind_alone_the_bow_is_where_it_comes_from(toward_deg: float) -> None:
    found = Sea().wait(5.0, (4.0, toward_deg))
    assert found is not None
    assert abs(math.degrees(wrap_rad(math.radians(found - toward_deg - 180.0)))) < 1.5


def test_what_pushes_to_the_side_turns_it_until_nothing_does() -> None:
    """A current to the east, while the wind comes from the north: the boat turns towards it as far as it helps."""
    sea = Sea(10.0)
    psi_deg = 0.0
    force = 0.02
    for _ in range(60):  # the boat follows, and its disturbance to the side with it
        found = sea.wait(5.0, (4.0, 180.0), psi_deg=psi_deg, sway_mps2=force * math.cos(math.radians(psi_deg)))
        assert found is not None
        psi_deg += 0.3 * (found - psi_deg)
    assert -60.0 < psi_deg < -10.0
    assert abs(found - psi_deg) < 0.5  # there nothing is left to the side


def test_what_is_left_over_ahead_counts_where_it_agrees_and_beyond_what_the_thrust_may_be_wrong() -> None:
    """With a current on the bow a small push to the side turns it a little; without it, by far more."""
    turned = {}
    for ahead_mps2 in (0.1, 0.0, -0.8 * DOUBT_MPS2, -0.1):
        found = Sea().wait(300.0, (2.0, 180.0), ahead_mps2=ahead_mps2, sway_mps2=0.008)
        assert found is not None
        turned[ahead_mps2] = abs(found)
    assert turned[0.1] == turned[0.0] == turned[-0.8 * DOUBT_MPS2] > 30.0
    assert 2.0 < turned[-0.1] < 6.0


def test_what_is_left_over_ahead_may_be_the_load_of_a_strong_wind() -> None:
    """6 m/s push with 0.06 m/s^2, of which a learned model may miss a third: a veer was followed 18 degrees late."""
    sea = Sea()
    sea.wait(60.0, (6.0, 180.0), sway_mps2=0.008)
    share = 0.7 * DOUBT_SHARE * sea.finder.push_mps2
    assert share > 1.2 * DOUBT_MPS2
    turned = {}
    for ahead_mps2 in (0.0, -share, -4.0 * share):
        found = Sea().wait(300.0, (6.0, 180.0), ahead_mps2=ahead_mps2, sway_mps2=0.008)
        assert found is not None
        turned[ahead_mps2] = abs(found)
    assert turned[0.0] == turned[-share] > 1.3 * turned[-4.0 * share]


def test_of_what_is_left_over_in_the_first_seconds_little_is_believed() -> None:
    young = Sea(60.0).wait(3.0, (3.0, 180.0), sway_mps2=0.03)
    later = Sea(60.0).wait(60.0, (3.0, 180.0), sway_mps2=0.03)
    assert young is not None and later is not None
    assert abs(young) < 0.75 * abs(later)


def test_with_no_wind_and_nothing_left_over_no_heading_is_better() -> None:
    assert Sea().wait(5.0, (0.0, 0.0)) is None
    assert Sea().wait(5.0, None, sway_mps2=0.5 * LEAST_MPS2) is None
    found = Sea().wait(5.0, None, sway_mps2=0.05)  # pushed to the east
    assert found == pytest.approx(-90.0, abs=1.0)


def test_a_wind_is_averaged_over_a_quarter_of_the_time_constant_and_what_is_left_over_over_all_of_it() -> None:
    sea = Sea(60.0)
    sea.wait(300.0, (4.0, 180.0))
    after_3_s = sea.wait(3.0, (4.0, 90.0))
    after_1_min = sea.wait(57.0, (4.0, 90.0))
    assert after_3_s is not None and after_1_min is not None
    assert -20.0 < after_3_s < -3.0
    assert after_1_min == pytest.approx(-90.0, abs=5.0)
    pushed = sea.wait(30.0, (4.0, 90.0), psi_deg=-90.0, sway_mps2=0.04)
    later = sea.wait(270.0, (4.0, 90.0), psi_deg=-90.0, sway_mps2=0.04)
    assert pushed is not None and later is not None
    assert 0.55 < math.sin(math.radians(pushed + 90.0)) ** 2 / math.sin(math.radians(later + 90.0)) ** 2 < 1.0


def test_at_first_all_that_there_is_counts_alike() -> None:
    sea = Sea(1000.0)
    sea.wait(10.0, (4.0, 135.0))
    found = sea.wait(10.0, (4.0, -135.0))
    assert found == pytest.approx(0.0, abs=6.0)


def test_what_is_left_over_in_a_turn_and_soon_after_it_counts_less() -> None:
    """The model's error in a fast turn stays in the disturbance for a while, and is not the weather's."""
    swung, lay = Sea(90.0), Sea(90.0)
    for sea, r_degps in ((swung, 10.0), (lay, 0.0)):
        sea.wait(5.0, (4.0, 180.0))
        sea.wait(8.0, (4.0, 180.0), sway_mps2=0.03, r_degps=r_degps)
        sea.wait(8.0, (4.0, 180.0), sway_mps2=0.02)
    after_swing, after_push = swung.wait(1.0, (4.0, 180.0)), lay.wait(1.0, (4.0, 180.0))
    assert after_swing is not None and after_push is not None
    assert abs(after_swing) < 0.6 * abs(after_push) and abs(after_push) > 10.0
    # Always swinging, as across the weather, it takes no longer than lying still.
    a, b = Sea(90.0), Sea(90.0)
    assert a.wait(60.0, None, sway_mps2=0.02, r_degps=8.0) == pytest.approx(b.wait(60.0, None, sway_mps2=0.02))


def test_without_an_estimate_it_is_kept_for_a_while_and_then_begins_anew() -> None:
    sea = Sea(1000.0)
    before = sea.wait(60.0, (4.0, 90.0))
    t_ns = sea.t_ns
    assert sea.finder.step(t_ns + S, None, None) is not None
    assert sea.finder.step(t_ns + 2 * S, sea.estimate(0.0, valid=False), None) is not None
    assert sea.finder.step(t_ns + GAP_NS, None, None) is None
    sea.t_ns += 2 * GAP_NS
    found = sea.wait(5.0, (4.0, 180.0))
    assert before == pytest.approx(-90.0, abs=1.0)
    assert found == pytest.approx(0.0, abs=1.0)


def test_on_a_course_the_drag_of_the_water_is_weather_too() -> None:
    sea = Sea()
    sea.finder.note_motion((0.0, 0.4))
    found = sea.wait(5.0, (0.0, 0.0))
    assert found == pytest.approx(90.0, abs=1.5), "with the bow ahead"
    push = sea.finder.push_at(0.0)
    assert push is not None and push[1] < -0.01 and abs(push[0]) < 1e-3, "and on the port side of a boat that goes east"
    assert sea.finder.push_at_rest(0.0) == (0.0, 0.0) and sea.finder.push_at(0.0) == push, "which changes nothing"
    sea.finder.note_motion((0.0, 0.0))
    sea.wait(2.0, (0.0, 0.0))
    assert sea.finder.push_at(0.0) == (0.0, 0.0)


def test_it_tells_how_much_the_weather_pushes_on_the_bow() -> None:
    sea = Sea()
    assert sea.finder.push_mps2 == 0.0
    for speed_mps, mps2 in ((2.0, 0.0065), (4.0, 0.026)):
        sea = Sea()
        sea.wait(5.0, (speed_mps, 90.0))
        assert sea.finder.push_mps2 == pytest.approx(mps2, rel=0.15)


def test_it_begins_anew_where_time_goes_back() -> None:
    """As in a log that was edited: 0.2 s before the first of its times nothing at all would be known."""
    sea, other = Sea(), Sea()
    sea.wait(5.0, (4.0, 0.0))
    sea.t_ns = other.t_ns = 1_700_000_000 * S - EVERY_NS
    assert sea.wait(2.0, (4.0, 90.0)) == other.wait(2.0, (4.0, 90.0))
