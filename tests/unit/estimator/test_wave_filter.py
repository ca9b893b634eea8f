"""The wave filter on estimates of a boat whose low-frequency motion is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from asvhil.config import WaveFilterConfig, WavesConfig, load_config
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.wave_filter import WaveFilter
from asvhil.geo import wrap_rad
from asvhil.simplant.boat.waves import Waves
from asvhil.types import Estimate, Wind, changed

VESSEL = load_config("sitl").vehicle.vessel
STEP_S = 0.05
BREEZE = Wind(t_ns=0, vn_mps=2.0, ve_mps=1.0, std_mps=0.0, valid=True)
NAMES = ("n_m", "e_m", "psi_rad", "u_mps", "v_mps", "r_radps")


@dataclass
class Boat:
    """A boat that swings under slow commands and rides on waves; its filter, and what goes in and comes out of it."""

    mode: str = "auto"
    orbital_mps: float = 0.1
    peak_hz: float = 0.3
    wind: Wind | None = BREEZE
    state: np.ndarray = field(default_factory=lambda: np.zeros(8))
    tick: int = 0

    def __post_init__(self) -> None:
        model = SimplifiedDynamics(VESSEL)
        self.model = model
        self.filter = WaveFilter(WaveFilterConfig(mode=self.mode), model, VESSEL, STEP_S)
        config = WavesConfig(
            orbital_std_mps=self.orbital_mps, yaw_std_radps=0.3 * self.orbital_mps, peak_hz=self.peak_hz, spreading=1.0
        )
        self.waves = Waves(config, 0.0, STEP_S, np.random.SeedSequence(1))
        self.slow: Estimate | None = None

    def estimate(self) -> Estimate:
        """The motion with waves; `slow` becomes that without."""
        n, e, psi, u, v, r = self.state[:6].tolist()
        t_ns = round(self.tick * STEP_S * 1e9)
        motor, still = tuple(self.state[6:].tolist()), (0.0, 0.0, 0.0)
        self.slow = Estimate(
            t_ns=t_ns, n_m=n, e_m=e, psi_rad=wrap_rad(psi), u_mps=u, v_mps=v, r_radps=r,
            motor=motor, std=(), disturbance=still, valid=True,
        )  # fmt: skip
        w = self.waves
        c, s = math.cos(psi), math.sin(psi)
        vn, ve = c * u - s * v + w.vn_mps, s * u + c * v + w.ve_mps
        psi += w.psi_rad
        c, s = math.cos(psi), math.sin(psi)
        return changed(
            self.slow,
            n_m=n + w.n_m,
            e_m=e + w.e_m,
            psi_rad=wrap_rad(psi),
            u_mps=c * vn + s * ve,
            v_mps=c * ve - s * vn,
            r_radps=r + w.r_radps,
        )

    def step(self, skipped: int = 0) -> tuple[Estimate, Estimate]:
        """One tick: the filter's estimate, and the boat's motion with waves. `skipped` ticks before it never came."""
        for _ in range(skipped + 1):
            command = 0.35 * math.sin(0.3 * self.tick * STEP_S), 0.35 * math.cos(0.23 * self.tick * STEP_S)
            wind = (0.0, 0.0) if self.wind is None else (self.wind.vn_mps, self.wind.ve_mps)
            pushed = self.model.input_of_command(command)
            self.filter.set_forcing(pushed, self.wind)
            self.state = advance(self.model, self.state, np.array(pushed), np.array(wind), np.zeros(3), STEP_S, 1)
            self.waves.advance()
            self.tick += 1
        before = self.estimate()
        after = self.filter.step(before)
        assert after is not None
        return after, before

    def run(self, seconds: float, skipped: int = 0) -> np.ndarray:
        """(ticks, 2, 6): errors to the slow motion of what comes out, and of what went in."""
        rows = []
        for _ in range(round(seconds / STEP_S / (skipped + 1))):
            pair = self.step(skipped)
            assert self.slow is not None
            rows.append([[getattr(x, name) - getattr(self.slow, name) for name in NAMES] for x in pair])
        errors = np.array(rows)
        errors[:, :, 2] = (errors[:, :, 2] + math.pi) % math.tau - math.pi
        return errors


def rms(errors: np.ndarray) -> np.ndarray:
    """(2, 6), once it has settled."""
    return np.sqrt(np.square(errors[len(errors) // 2 :]).mean(axis=0))


@pytest.mark.parametrize("peak_hz", [0.15, pytest.param(0.3, marks=pytest.mark.thorough), 0.6])
def test_waves_are_taken_out_and_slow_motion_stays(peak_hz: float) -> None:
    boat = Boat(peak_hz=peak_hz)
    out, into = rms(boat.run(300.0))
    assert (out[3:] < (0.45 if peak_hz < 0.2 else 0.3) * into[3:]).all()
    assert (out[:3] < 0.7 * into[:3]).all()
    found = boat.filter.waves
    assert found is not None and found.share == 1.0
    assert abs(math.log(found.peak_hz / peak_hz)) < 0.25
    assert found.velocity_std_mps == pytest.approx(0.1, rel=0.5)
    assert found.yaw_std_radps == pytest.approx(0.03, rel=0.5)


def test_no_wave_no_change_to_the_bit() -> None:
    boat = Boat(orbital_mps=0.0)
    for _ in range(1000):
        after, before = boat.step()
        assert after is before
    assert boat.filter.waves is None


def test_waves_that_end_are_filtered_no_more() -> None:
    boat = Boat()
    boat.run(120.0)
    assert boat.filter.waves is not None
    boat.waves = Waves(WavesConfig(), 0.0, STEP_S, np.random.SeedSequence(1))
    boat.run(180.0)
    assert boat.filter.waves is None


def test_the_share_grows_slowly() -> None:
    """So that the estimate does not jump when the filter begins."""
    boat, shares = Boat(), [0.0]
    for _ in range(2400):
        boat.step()
        shares.append(boat.filter.waves.share if boat.filter.waves else 0.0)
    assert shares[-1] == 1.0
    assert max(np.diff(shares)) < 0.05


def test_always_on_follows_a_boat_in_still_water() -> None:
    out, _ = rms(Boat(mode="on", orbital_mps=0.0).run(60.0))
    assert out == pytest.approx(np.zeros(6), abs=1e-3)


def test_a_tick_that_comes_late_counts_as_several() -> None:
    every, third = rms(Boat().run(150.0))[0], rms(Boat().run(150.0, skipped=2))[0]
    assert (third[3:] < 2.0 * every[3:]).all()


def test_a_jump_of_the_estimator_is_followed_at_once() -> None:
    boat = Boat()
    boat.run(120.0)
    boat.state[0] += 5.0
    boat.state[2] += 1.0
    errors = boat.run(2.0)
    assert np.abs(errors[:, 0, 0]).max() < 0.3
    assert np.abs(errors[:, 0, 2]).max() < 0.1


def test_a_long_gap_begins_anew() -> None:
    boat = Boat()
    boat.run(60.0)
    boat.tick += 200
    boat.state[:2] += 0.5
    errors = boat.run(1.0)
    assert np.abs(errors[:, 0, :2]).max() < 0.3


def test_an_input_that_is_no_number_spoils_one_tick_and_no_more() -> None:
    boat = Boat()
    boat.run(120.0)
    boat.filter.set_forcing((math.nan, 0.0), BREEZE)
    boat.tick += 1
    bad = boat.filter.step(boat.estimate())
    assert bad is not None and math.isfinite(bad.u_mps)
    errors = boat.run(120.0)
    out, into = rms(errors)
    assert np.isfinite(errors).all()
    assert (out[3:] < 0.35 * into[3:]).all()


def test_the_heading_may_pass_half_a_turn() -> None:
    boat = Boat()
    boat.state[2] = math.pi - 0.01
    out, into = rms(boat.run(240.0))
    assert (out[3:] < 0.35 * into[3:]).all()


def test_without_an_estimate_there_is_none() -> None:
    assert Boat().filter.step(None) is None
