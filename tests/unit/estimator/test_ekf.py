"""The filter against motion that is known: consistency, gates, recovery, determinism."""

import math
import re

import numpy as np
import pytest

from asvhil.config import Config, load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.types import Estimate, GroundVelocity, Heading, Measurement, Position, SpecificForce, YawRate

SHIPPED = load_config("sitl")
CONFIG = load_config("sitl", ("estimator.ekf.position_bias_std_m=0",))  # position is what the receiver says
ORIGIN = LocalFrame(lat_deg=40.4, lon_deg=-86.9)
S = 1_000_000_000


def make(config: Config = CONFIG) -> Ekf:
    return Ekf(config.estimator, SimplifiedDynamics(config.vehicle.vessel))


def fix(t_ns: int, n: float, e: float, vn: float = 0.0, ve: float = 0.0) -> list[Measurement]:
    lat, lon = ORIGIN.to_geodetic(n, e)
    return [Position(t_ns=t_ns, lat_deg=lat, lon_deg=lon, h_acc_m=0.1), GroundVelocity(t_ns=t_ns, vn_mps=vn, ve_mps=ve)]


def attitude(t_ns: int, psi: float, r: float) -> list[Measurement]:
    return [Heading(t_ns=t_ns, psi_rad=psi), YawRate(t_ns=t_ns, r_radps=r)]


def started(t_ns: int = 0, psi: float = 0.0, config: Config = CONFIG) -> Ekf:
    ekf = make(config)
    ekf.on_measurements(attitude(t_ns, psi, 0.0))
    ekf.on_measurements(fix(t_ns, 0.0, 0.0))
    return ekf


def now(ekf: Ekf, t_ns: int) -> Estimate:
    estimate = ekf.estimate(t_ns)
    assert estimate is not None
    return estimate


def test_nothing_before_position_and_heading() -> None:
    ekf = make()
    ekf.on_measurements(fix(0, 0.0, 0.0))
    assert ekf.estimate(0) is None
    ekf.on_measurements(attitude(0, 1.0, 0.0))
    assert ekf.estimate(0) is None
    ekf.on_measurements(fix(S // 10, 0.0, 0.0))
    assert now(ekf, S // 10).psi_rad == pytest.approx(1.0)


def drive(
    ekf: Ekf, seconds: float, rng: np.random.Generator, *, speed: float, psi: float, start_s: float = 0.0
) -> None:
    """A straight line at constant speed with sensor noise: attitude at 20 Hz, fixes at 10 Hz."""
    for tick in range(1, round(seconds * 20) + 1):
        t_s = start_s + tick / 20
        t_ns = round(t_s * S)
        ekf.on_measurements(attitude(t_ns, psi + rng.normal(0, math.radians(0.25)), rng.normal(0, 0.009)))
        if tick % 2 == 0:
            n, e = speed * t_s * math.cos(psi), speed * t_s * math.sin(psi)
            vn, ve = speed * math.cos(psi) + rng.normal(0, 0.05), speed * math.sin(psi) + rng.normal(0, 0.05)
            ekf.on_measurements(fix(t_ns, n + rng.normal(0, 0.07), e + rng.normal(0, 0.07), vn, ve))


def test_it_follows_a_straight_line_through_noise_within_its_standard_deviation() -> None:
    psi = math.radians(170.0)
    ekf = started(psi=psi)
    rng = np.random.default_rng(1)
    drive(ekf, 40.0, rng, speed=1.0, psi=psi)
    estimate = now(ekf, 40 * S)
    assert estimate.valid
    assert math.hypot(estimate.n_m - 40 * math.cos(psi), estimate.e_m - 40 * math.sin(psi)) < 0.15
    assert estimate.u_mps == pytest.approx(1.0, abs=0.05) and estimate.v_mps == pytest.approx(0.0, abs=0.05)
    assert estimate.psi_rad == pytest.approx(psi, abs=math.radians(0.4))
    assert all(0.0 < std < limit for std, limit in zip(estimate.std, (0.2, 0.2, 0.01, 0.1, 0.1, 0.02), strict=True))


def test_an_unmodelled_push_becomes_the_disturbance() -> None:
    # A hull that is pulled along at 0.5 m/s with its motors off must be pushed: drag of 43.8 N on 279.95 kg.
    ekf = started()
    drive(ekf, 120.0, np.random.default_rng(2), speed=0.5, psi=0.0)
    expected = (51.3 * 0.5 + 72.4 * 0.25) / (254.5 + 25.45)
    assert now(ekf, 120 * S).disturbance[0] == pytest.approx(expected, abs=0.04)


def still(
    ekf: Ekf, start_s: float, seconds: float, rng: np.random.Generator, n: float = 0.0, e: float = 0.0, psi: float = 0.0
) -> None:
    """A boat at rest whose sensors say (n, e, psi): noisy attitude at 20 Hz, noisy fixes at 10 Hz."""
    for tick in range(1, round(seconds * 20) + 1):
        t_ns = round((start_s + tick / 20) * S)
        ekf.on_measurements(attitude(t_ns, wrap_rad(psi + rng.normal(0, 0.004)), rng.normal(0, 0.009)))
        if tick % 2 == 0:
            dn, de, vn, ve = rng.normal(0, 0.05, 4)
            ekf.on_measurements(fix(t_ns, n + dn, e + de, vn, ve))
        ekf.predict(t_ns)


@pytest.mark.parametrize("jump_m", [20.0, -200.0])
def test_a_jump_never_moves_a_valid_estimate_and_is_accepted_once_there_is_none(jump_m: float) -> None:
    ekf = started()
    rng = np.random.default_rng(3)
    still(ekf, 0.0, 10.0, rng)
    before = now(ekf, 10 * S)
    for second in range(10, 60):
        still(ekf, second, 1.0, rng, n=jump_m)
        at = now(ekf, (second + 1) * S)
        assert abs(at.n_m - before.n_m) < 0.5 or not at.valid or second >= 40
        if second == 15:
            assert [(note.subject, note.text) for note in ekf.notes(16 * S)] == [("gnss position", "jump rejected")]
        if second == 30:
            assert at.valid and ekf.resets == 0
        if second == 46:  # 35 s of dead reckoning are over
            assert not at.valid or ekf.resets == 1
    assert now(ekf, 60 * S).n_m == pytest.approx(jump_m, abs=0.3)
    assert now(ekf, 60 * S).valid and ekf.resets == 1 and ekf.rejected["position"] > 300
    (note,) = ekf.notes(60 * S)  # it has not recovered: it is believed, right or wrong
    told = re.fullmatch(r"believed after a jump of (\d+\.\d) m: is it right\?", note.text)
    assert note.subject == "gnss position" and not note.ok
    assert told is not None and float(told[1]) == pytest.approx(abs(jump_m), abs=0.6)
    for second in range(60, 110):
        still(ekf, second, 1.0, rng, n=jump_m)
    assert ekf.notes(110 * S) == ()


@pytest.mark.parametrize("jump_deg", [20.0, -90.0, 170.0, 180.0])
def test_a_heading_is_believed_as_soon_as_any_other_and_its_jump_told_as_large_as_it_is(jump_deg: float) -> None:
    ekf = started()
    rng = np.random.default_rng(5)
    still(ekf, 0.0, 10.0, rng)
    still(ekf, 10.0, 40.0, rng, psi=math.radians(jump_deg))
    (note,) = ekf.notes(50 * S)
    told = re.fullmatch(r"believed after a jump of (\d+) deg: is it right\?", note.text)
    assert note.subject == "compass" and told is not None and float(told[1]) == pytest.approx(abs(jump_deg), abs=3.0)
    assert abs(wrap_rad(now(ekf, 50 * S).psi_rad - math.radians(jump_deg))) < math.radians(1.0)


def test_a_turn_that_only_the_gyro_shows_is_one_the_compass_is_not_rejected_for() -> None:
    ekf = started()
    rng = np.random.default_rng(6)
    still(ekf, 0.0, 10.0, rng)
    psi = 0.0
    for tick in range(1, 7):  # at 1.2 rad/s for 0.3 s, as from a blow
        psi += 1.2 / 20
        ekf.on_measurements(attitude(10 * S + tick * S // 20, psi, 1.2))
    assert "gyro" in {note.subject for note in ekf.notes(10 * S + 6 * S // 20)}
    still(ekf, 10.3, 3.0, rng, psi=psi)
    assert ekf.notes(round(13.3 * S)) == () and now(ekf, round(13.3 * S)).psi_rad == pytest.approx(psi, abs=0.02)


def test_a_filter_without_a_record_accepts_a_persistent_reading() -> None:
    """The first fix was 50 m off."""
    ekf = started()
    still(ekf, 0.0, 5.0, np.random.default_rng(8), n=50.0)
    assert ekf.resets == 1 and now(ekf, 5 * S).n_m == pytest.approx(50.0, abs=0.3)


@pytest.mark.parametrize(
    ("accelerometer", "speed", "resets", "config", "within_m"),
    [(False, 1.2, 0, CONFIG, 0.5), (True, 3.0, 2, CONFIG, 0.5), (True, 3.0, 2, SHIPPED, 1.0)],
)
def test_a_push_that_only_the_receiver_measures_is_followed(
    accelerometer: bool, speed: float, resets: int, config: Config, within_m: float
) -> None:
    """Position and velocity leave together and explain each other; an accelerometer that denies it costs 3 s.

    A receiver's slow error is no way out: it is bounded.
    """
    ekf = started(config=config)
    rng = np.random.default_rng(9)
    for tick in range(1, 400):
        t_s = tick / 20
        t_ns = round(t_s * S)
        push = speed if t_s > 10.0 else 0.0
        ekf.on_measurements(attitude(t_ns, rng.normal(0, 0.004), rng.normal(0, 0.009)))
        dn, de, vn, ve = rng.normal(0, 0.05, 4)
        if accelerometer:
            ax, ay = rng.normal(0, 0.02, 2)
            ekf.on_measurements([SpecificForce(t_ns=t_ns, ax_mps2=ax, ay_mps2=ay)])
        if tick % 2 == 0:
            ekf.on_measurements(fix(t_ns, push * (t_s - 10.0) + dn, de, push + vn, ve))
    end = now(ekf, t_ns)
    assert end.u_mps == pytest.approx(speed, abs=0.25) and end.n_m == pytest.approx(speed * 9.95, abs=within_m)
    assert ekf.resets == resets and end.valid


@pytest.mark.parametrize("accelerometer", [False, True])
@pytest.mark.parametrize(("push", "gyro"), [(2.0, 0.0), (5.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.0, 2.0)])
def test_a_rate_that_its_place_denies_is_not_believed_however_long_it_lasts(
    accelerometer: bool, push: float, gyro: float
) -> None:
    """A boat at rest, whose receiver says that it moves but not that it is elsewhere; or gyro and compass alike."""
    ekf = started(config=SHIPPED)
    rng = np.random.default_rng(3)
    for tick in range(1, 80 * 20):
        t_ns = tick * S // 20
        wrong = t_ns > 20 * S
        ekf.on_measurements(attitude(t_ns, rng.normal(0, 0.004), rng.normal(0, 0.009) + (gyro if wrong else 0.0)))
        if accelerometer:
            ax, ay = rng.normal(0, 0.02, 2)
            ekf.on_measurements([SpecificForce(t_ns=t_ns, ax_mps2=ax, ay_mps2=ay)])
        if tick % 2 == 0:
            dn, de, vn, ve = rng.normal(0, 0.05, 4)
            ekf.on_measurements(fix(t_ns, dn, de, vn + (push if wrong else 0.0), ve))
        if tick % 20 == 0:
            estimate = now(ekf, t_ns)
            if estimate.valid and wrong:
                assert math.hypot(estimate.n_m, estimate.e_m) < 0.5, t_ns / S
                assert abs(estimate.psi_rad) < math.radians(3.0) and abs(estimate.r_radps) < 0.1, t_ns / S


def test_one_wild_velocity_leaves_the_slow_error_followed() -> None:
    ekf = started(config=SHIPPED)
    rng = np.random.default_rng(4)
    for tick in range(1, 20 * 20):
        t_ns = tick * S // 20
        ekf.on_measurements(attitude(t_ns, rng.normal(0, 0.004), rng.normal(0, 0.009)))
        if tick % 4 == 0:
            dn, de, vn, ve = rng.normal(0, 0.05, 4)
            ekf.on_measurements(fix(t_ns, dn, de, vn + (50.0 if tick == 360 else 0.0), ve))
    assert ekf.state.follows_bias


def test_without_fixes_it_dead_reckons_within_its_limits() -> None:
    ekf = started()
    drive(ekf, 20.0, np.random.default_rng(4), speed=0.0, psi=0.0)
    rng = np.random.default_rng(5)
    valid_for_s = 0.0
    for tick in range(1, 20 * 60):
        t_ns = 20 * S + tick * S // 20
        ekf.on_measurements(attitude(t_ns, rng.normal(0, 0.004), rng.normal(0, 0.009)))
        at = now(ekf, t_ns)
        if at.valid:
            assert max(at.std[:2]) <= CONFIG.estimator.trust.position_std_max_m
            valid_for_s = tick / 20
    # Without accelerometer the model alone bridges less than the 35 s that are allowed.
    assert 5.0 < valid_for_s < 35.0
    assert [(note.subject, note.text) for note in ekf.notes(80 * S)][:2] == [
        ("gnss position", "silent"),
        ("gnss velocity", "silent"),
    ]


@pytest.mark.parametrize("silent", ["everything", "position and yaw rate", "heading and yaw rate"])
def test_it_is_not_valid_once_nothing_is_left_to_bridge_with(silent: str) -> None:
    ekf = started()
    drive(ekf, 5.0, np.random.default_rng(4), speed=0.0, psi=0.0)
    assert now(ekf, 5 * S).valid
    for tick in range(1, 30):
        t_ns = 5 * S + tick * S // 20
        if silent == "position and yaw rate":
            ekf.on_measurements([Heading(t_ns=t_ns, psi_rad=0.0)])
        if silent == "heading and yaw rate":
            ekf.on_measurements(fix(t_ns, 0.01 * tick % 0.03, 0.0))
    assert not now(ekf, 5 * S + 29 * S // 20).valid


def test_heading_across_south_does_not_swing_round() -> None:
    ekf = started(psi=math.pi - 0.01)
    for tick in range(1, 40):
        psi = math.pi - 0.01 + 0.001 * tick
        ekf.on_measurements(attitude(tick * S // 20, (psi + math.pi) % (2 * math.pi) - math.pi, 0.02))
    assert abs(now(ekf, 2 * S).psi_rad) == pytest.approx(math.pi - 0.029, abs=0.005) and ekf.rejected["heading"] == 0


def test_late_frames_and_gaps_do_no_harm() -> None:
    ekf = started()
    ekf.on_measurements(attitude(S, 0.0, 0.0))
    ekf.on_measurements(attitude(S // 2, 0.0, 0.0))  # from the past
    ekf.predict(100_000 * S)
    assert all(map(math.isfinite, (now(ekf, 100_000 * S).n_m, *now(ekf, 100_000 * S).std)))


def test_two_filters_agree_to_the_last_bit() -> None:
    def run() -> Estimate:
        ekf = started()
        ekf.set_forcing((0.3, -0.2), (2.0, 1.0))
        drive(ekf, 20.0, np.random.default_rng(5), speed=0.3, psi=0.5)
        return now(ekf, 20 * S)

    assert run() == run()
