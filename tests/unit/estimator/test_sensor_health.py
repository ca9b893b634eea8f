"""Repeated readings: when the sensor is frozen, and when only its resolution is coarse."""

import math
import random

import pytest

from asvhil.estimator import sensor_health
from asvhil.estimator.fault_recovery import FREEZE_LIMITS
from asvhil.estimator.sensor_health import FreezeLimits, Track

HZ = 5
AFTER_NS = 300_000_000


def verdicts(limits: FreezeLimits, step: float, noise: float, speed: float = 0.0, stops: int = 50, stuck: int = 10**9):
    """Whether each of 30 s of readings is called frozen: rounded to steps, of a boat that moves for `stops` readings.

    From reading `stuck` on the sensor repeats the one before, while the boat goes on as it did.
    """
    chance, track, value, found = random.Random(1), Track(), (0.0, 0.0), []
    for k in range(30 * HZ):
        true = speed * min(k, stops) / HZ
        if k < stuck:
            read = (true + chance.gauss(0.0, noise), chance.gauss(0.0, noise))
            value = (round(read[0] / step) * step, round(read[1] / step) * step)
        track = sensor_health.update(track, k * 10**9 // HZ, value, (true, 0.0), limits, AFTER_NS)
        found.append(track.frozen)
        track = track if track.frozen else sensor_health.accept(track, k * 10**9 // HZ)
    return found


@pytest.mark.parametrize(
    ("name", "step", "noise", "speed"),
    [
        ("position", 0.185, 0.01, 1.0),  # minutes with four decimals
        ("heading", math.radians(0.5), math.radians(0.1), math.radians(6.0)),
        ("heading", math.radians(1.0), math.radians(0.3), math.radians(6.0)),
        ("velocity", 0.05, 0.02, 0.1),
    ],
)
def test_a_coarse_sensor_of_a_boat_that_has_come_to_rest_is_not_frozen(name, step, noise, speed):
    assert not any(verdicts(FREEZE_LIMITS[name], step, noise, speed))


@pytest.mark.parametrize(
    ("name", "step", "noise"),
    [
        ("position", 0.02, 0.07),
        ("velocity", 0.01, 0.05),
        ("heading", 1e-6, math.radians(0.25)),
        ("yaw_rate", 1e-3, 9e-3),
    ],
)
def test_a_fine_and_noisy_sensor_that_repeats_itself_is_frozen_within_a_second(name, step, noise):
    found = verdicts(FREEZE_LIMITS[name], step, noise, stuck=100)
    assert not any(found[:100])
    assert all(found[100 + HZ :])


@pytest.mark.parametrize("first", [0, 25])
def test_a_sensor_that_stays_while_the_boat_moves_is_frozen_however_coarse(first):
    found = verdicts(FREEZE_LIMITS["position"], 0.185, 0.01, 1.0, stops=10**9, stuck=first)
    assert not any(found[:first])
    assert all(found[first + HZ :])


def test_a_velocity_of_exactly_zero_is_not_reported_as_frozen():
    chance, track = random.Random(1), Track()
    for k in range(100):
        moving = k < 50
        value = (0.3 + chance.gauss(0.0, 0.05), chance.gauss(0.0, 0.05)) if moving else (0.0, 0.0)
        expected = (0.3, 0.0) if moving else (0.02, 0.0)
        track = sensor_health.accept(
            sensor_health.update(track, k * 200_000_000, value, expected, FREEZE_LIMITS["velocity"], AFTER_NS), k
        )
        assert not track.frozen


def accelerometer(expected, value):
    """Whether an accelerometer is called frozen at each of its readings; forward parts by time (s)."""
    track, found = Track(), []
    for k in range(6 * 20):
        t_ns, t_s = k * 50_000_000, k / 20
        track = sensor_health.update(
            track, t_ns, (value(t_s), 0.0), (expected(t_s), 0.0), FREEZE_LIMITS["acceleration"], AFTER_NS
        )
        found.append(track.frozen)
        track = track if track.frozen else sensor_health.accept(track, t_ns)
    return found


@pytest.mark.parametrize(
    ("expected", "value"),
    [
        (lambda t: 1.25 * (t >= 2.0), lambda t: 0.0 if t < 2.2 else min(t - 2.2, 1.25)),  # the motors start 0.2 s later
        (lambda t: 0.05 + 0.02 * t, lambda t: 0.0),  # a thrust that the model has wrong, on a boat that stands
        (lambda t: -0.05 - 0.01 * t, lambda t: -0.00980665 * (t < 3.0)),
    ],
)
def test_a_coarse_accelerometer_of_a_boat_at_rest_is_not_frozen(expected, value):
    assert not any(accelerometer(expected, value))


def test_an_accelerometer_that_stays_while_the_motors_push_is_frozen():
    found = accelerometer(lambda t: 1.25 * (t >= 2.0), lambda t: 0.0)
    assert not any(found[:40])
    assert all(found[50:])
