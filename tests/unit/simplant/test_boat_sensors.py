"""Sensor errors against their configured statistics, and the anemometer against geometry worked by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pynmeagps import NMEAReader

from asvhil.config import (
    AnemometerSensorConfig,
    FusedVelocityConfig,
    GnssSensorConfig,
    HeadingSensorConfig,
    SensorsConfig,
    load_config,
)
from asvhil.simplant.boat.sensors import Anemometer, Navigation, mwv_sentence
from asvhil.simplant.boat.vessel import Vessel

VEHICLE = load_config("wamv16", ("links.autopilot.endpoint=udpin:127.0.0.1:14560",)).vehicle
LOOP_NS = 20_000_000


def truth(heading_deg: float = 0.0, vn_mps: float = 0.0, ve_mps: float = 0.0) -> Vessel:
    return Vessel(VEHICLE.vessel, VEHICLE.pwm, 0.01, (10.0, -20.0, math.radians(heading_deg)), (vn_mps, ve_mps))


def navigation(seed: int = 1, **sections: object) -> Navigation:
    return Navigation(SensorsConfig(**sections), 50.0, 0, np.random.SeedSequence(seed))


def record(nav: Navigation, boat: Vessel, loops: int, *names: str) -> np.ndarray:
    rows = []
    for k in range(loops):
        nav.sample(k * LOOP_NS, boat)
        rows.append([getattr(nav, name) for name in names])
    return np.array(rows)


def test_white_noise_of_each_sensor() -> None:
    nav = navigation(gnss=GnssSensorConfig(slow_bias_m=0.0))
    seen = record(nav, truth(90.0), 20_000, "psi_rad", "r_radps", "fix_n_m", "fix_e_m", "fix_vn_mps", "fix_ve_mps")
    assert seen.mean(axis=0) == pytest.approx([math.pi / 2, 0.0, 10.0, -20.0, 0.0, 0.0], abs=0.01)
    assert seen.std(axis=0) == pytest.approx([math.radians(0.25), 0.009, 0.07, 0.07, 0.05, 0.05], rel=0.08)
    between = np.corrcoef(seen[::10].T) - np.eye(6)  # one row a fix
    assert np.abs(between).max() < 0.1


def test_slow_bias_has_its_spread_and_correlation_time() -> None:
    config = GnssSensorConfig(slow_bias_m=1.0, slow_bias_time_s=2.0, white_m=0.0)
    nav = navigation(gnss=config)
    fixes = record(nav, truth(), 200_000, "fix_n_m", "fix_e_m")[::10]  # 5 Hz, 2000 correlation times
    for column in (fixes - [10.0, -20.0]).T:
        assert column.std() == pytest.approx(1.0, rel=0.07)
        assert np.mean(column[10:] * column[:-10]) / column.var() == pytest.approx(math.exp(-1.0), abs=0.07)


def test_a_filter_has_a_slow_error_of_velocity_and_what_comes_of_it_in_its_position() -> None:
    gnss = GnssSensorConfig(slow_bias_m=0.0, white_m=0.0, velocity_white_mps=0.0)
    config = SensorsConfig(gnss=gnss, fused_velocity=FusedVelocityConfig(slow_bias_mps=0.015, slow_bias_time_s=2.0))
    names = ("vn_mps", "ve_mps", "n_m", "e_m", "fix_vn_mps", "fix_ve_mps", "fix_n_m", "fix_e_m")
    filtered = Navigation(config, 50.0, 0, np.random.SeedSequence(1), filtered=True)
    seen = record(filtered, truth(), 200_000, *names)[::10]
    for column in seen[:, :2].T:
        assert column.std() == pytest.approx(0.015, rel=0.07)
        assert np.mean(column[10:] * column[:-10]) / column.var() == pytest.approx(math.exp(-1.0), abs=0.07)
    assert np.allclose(seen[:, 2:4] - [10.0, -20.0], 1.0 * seen[:, :2])  # 1 s of it
    assert np.allclose(seen[:, 4:], [0.0, 0.0, 10.0, -20.0])  # the receiver has none of it
    receiver = record(Navigation(config, 50.0, 0, np.random.SeedSequence(1)), truth(), 100, *names)
    assert np.allclose(receiver, [0.0, 0.0, 10.0, -20.0, 0.0, 0.0, 10.0, -20.0])


def test_fixes_come_at_their_rate_and_the_fused_position_moves_on_between_them() -> None:
    nav, boat = navigation(), truth()
    seen = []
    for k in range(100):  # 2 s at 1 m/s north
        boat.n_m = 10.0 + 0.02 * k
        nav.sample(k * LOOP_NS, boat)
        seen.append((nav.fix_ns, nav.fix_n_m, nav.n_m - boat.n_m))
    assert sorted({row[0] for row in seen}) == [k * 200_000_000 for k in range(10)]
    assert len({row[1] for row in seen}) == 10
    assert len({round(row[2], 9) for row in seen}) == 10  # the error is that of the last fix, not more


def test_a_fix_rate_beyond_the_loop_gives_one_fix_a_loop() -> None:
    nav = navigation(gnss=GnssSensorConfig(rate_hz=200.0))
    record(nav, truth(), 100, "n_m")
    assert nav.fixes == 100


def test_the_rate_of_one_sensor_does_not_change_the_noise_of_the_others() -> None:
    names = "psi_rad", "r_radps", "ax_mps2", "ay_mps2"
    slow = record(navigation(gnss=GnssSensorConfig(rate_hz=1.0)), truth(), 500, *names)
    fast = record(navigation(gnss=GnssSensorConfig(rate_hz=10.0)), truth(), 500, *names)
    assert np.array_equal(slow, fast)


def test_the_noise_depends_on_the_seed() -> None:
    assert np.array_equal(*(record(navigation(5), truth(), 50, "n_m", "psi_rad") for _ in range(2)))
    other = record(navigation(6), truth(), 50, "n_m", "psi_rad")
    assert not np.any(other == record(navigation(5), truth(), 50, "n_m", "psi_rad"))


def test_accelerometer_has_a_turn_on_bias_and_white_noise_about_the_specific_force() -> None:
    boat = truth()
    boat.ax_mps2, boat.ay_mps2 = 0.3, -0.2
    means, spreads = [], []
    for seed in range(200):
        seen = record(navigation(seed), boat, 100, "ax_mps2", "ay_mps2")
        means.append(seen.mean(axis=0))
        spreads.append(seen.std(axis=0))
    assert np.mean(means, axis=0) == pytest.approx([0.3, -0.2], abs=0.012)
    assert np.std(means, axis=0) == pytest.approx([0.05, 0.05], rel=0.2)
    assert np.mean(spreads, axis=0) == pytest.approx([0.021, 0.021], rel=0.05)


def test_heading_wraps_into_one_turn_and_carries_its_bias() -> None:
    nav = navigation(heading={"white_deg": 0.0, "bias_deg": 5.0})
    nav.sample(0, truth(358.0))
    assert math.degrees(nav.psi_rad) == pytest.approx(3.0)
    nav.sample(LOOP_NS, truth(-90.0))
    assert math.degrees(nav.psi_rad) == pytest.approx(275.0)


@pytest.mark.parametrize(
    ("heading_deg", "reads_deg"),
    [(0.0, 4.5), (90.0, 93.5), (180.0, 176.5), (270.0, 269.5), (45.0, 45.0 + 1.0 + 6.0 * math.sqrt(0.5) + 1.0)],
)
def test_a_compass_deviates_by_its_heading(heading_deg: float, reads_deg: float) -> None:
    """A 1, B 2, C 4, D 1, E -0.5: A + C + E, A + B - E, A - C + E, A - B - E; at 45: A + (B + C) / √2 + D."""
    nav = navigation(heading={"white_deg": 0.0, "bias_deg": 1.0, "deviation_deg": [2.0, 4.0, 1.0, -0.5]})
    nav.sample(0, truth(heading_deg))
    assert math.degrees(nav.psi_rad) == pytest.approx(reads_deg)


@pytest.mark.parametrize(
    ("heading_deg", "velocity", "wind", "speed_mps", "from_deg"),
    [
        (0.0, (0.0, 0.0), (-3.0, 0.0), 3.0, 0.0),  # at rest, wind from ahead
        (90.0, (0.0, 0.0), (-3.0, 0.0), 3.0, 270.0),  # heading east, wind from the north: from port
        (0.0, (2.0, 0.0), (0.0, 0.0), 2.0, 0.0),  # still air, under way: from ahead
        (0.0, (3.0, 0.0), (3.0, 0.0), 0.0, 0.0),  # running with the wind: none
        (0.0, (3.0, 0.0), (0.0, -3.0), 4.2426, 45.0),  # wind from the east, under way north: from starboard ahead
        (0.0, (0.0, 0.0), (3.0, 3.0), 4.2426, 225.0),  # wind from the south-west: from port astern
        (180.0, (0.0, 1.0), (0.0, 0.0), 1.0, 270.0),  # heading south, drifting east (to port): from port
    ],
)
def test_apparent_wind(
    heading_deg: float, velocity: tuple[float, float], wind: tuple[float, float], speed_mps: float, from_deg: float
) -> None:
    sensor = Anemometer(AnemometerSensorConfig(speed_white_mps=0.0), np.random.SeedSequence(1))
    assert sensor.sample(truth(heading_deg, *velocity), *wind) == pytest.approx((speed_mps, from_deg), abs=1e-4)


@pytest.mark.parametrize(
    ("true_deg", "directions", "misalignment_deg", "reads_deg"),
    [
        (40.0, 16, 0.0, 45.0),  # 16 positions of 22.5 degrees
        (30.0, 16, 0.0, 22.5),
        (355.0, 16, 0.0, 0.0),
        (100.0, 4, 0.0, 90.0),
        (123.4, 360, 0.0, 123.0),
        (45.0, 16, 22.5, 22.5),  # the vane's zero stands 22.5 degrees clockwise of the bow
        (0.0, 16, 22.5, 337.5),
    ],
)
def test_the_vane_has_positions_and_may_be_turned(
    true_deg: float, directions: int, misalignment_deg: float, reads_deg: float
) -> None:
    config = AnemometerSensorConfig(speed_white_mps=0.0, directions=directions, misalignment_deg=misalignment_deg)
    sensor = Anemometer(config, np.random.SeedSequence(1))
    angle = math.radians(true_deg)
    assert sensor.sample(truth(), -5.0 * math.cos(angle), -5.0 * math.sin(angle))[1] == pytest.approx(reads_deg)


def test_anemometer_speed_noise_never_makes_the_speed_negative() -> None:
    sensor = Anemometer(AnemometerSensorConfig(speed_white_mps=0.1), np.random.SeedSequence(1))
    windy = [sensor.sample(truth(), 5.0, 0.0)[0] for _ in range(5000)]
    calm = [sensor.sample(truth(), 0.0, 0.0)[0] for _ in range(5000)]
    assert np.mean(windy) == pytest.approx(5.0, abs=0.01) and np.std(windy) == pytest.approx(0.1, rel=0.05)
    assert min(calm) == 0.0


def test_the_vane_stays_where_it_was_when_the_wind_dies() -> None:
    sensor = Anemometer(AnemometerSensorConfig(speed_white_mps=0.0), np.random.SeedSequence(1))
    assert sensor.sample(truth(), 0.0, -3.0) == (3.0, 90.0)
    assert sensor.sample(truth(), 0.0, 0.0) == (0.0, 90.0)


def test_sentence() -> None:
    assert mwv_sentence(4.2426, 45.0) == b"$WIMWV,45.0,R,4.24,M,A*23\r\n"
    parsed = NMEAReader.parse(mwv_sentence(0.0, 337.5))
    assert (parsed.talker, parsed.msgID, parsed.angle, parsed.reference) == ("WI", "MWV", 337.5, "R")
    assert (parsed.speed, parsed.speedu, parsed.status) == (0.0, "M", "A")


@pytest.mark.parametrize(
    ("outputs_us", "pull_deg"), [((0, 0), 0.0), ((1500, 1500), 0.0), ((1900, 1100), 5.0), ((1300, 1500), 1.0)]
)
def test_the_motors_current_pulls_the_compass_to_one_side(outputs_us: tuple[int, int], pull_deg: float) -> None:
    nav = navigation(heading=HeadingSensorConfig(white_deg=0.0, motor_deg=(2.0, 3.0)))
    boat = truth(40.0)
    boat.drive(outputs_us)
    nav.sample(0, boat)
    assert math.degrees(nav.psi_rad) == pytest.approx(40.0 + pull_deg)
    assert math.degrees(nav.compass_error_rad) == pytest.approx(pull_deg)
