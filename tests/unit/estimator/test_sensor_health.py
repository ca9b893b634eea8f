"""Repeated readings: when the sensor is frozen, and when only its resolution is coarse."""

import math
import random

import pytest

from asvhil.estimator import sensor_health
from asvhil.estimator.fault_recovery import FREEZE_LIMITS
from asvhil.estimator.sensor_health import FreezeLimits, Track
from asvhil.types import changed

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


# --- one reading at a time -----------------------------------------------------------------------------------------

LIMITS = FreezeLimits(noise=0.1, motion=0.5)
BEFORE = Track(
    received_ns=900, accepted=2, value=(1.0, 2.0), expected=(0.9, 2.2), jitter=0.1, step=0.5,
    repeats=3, repeated_since_ns=500, apart_since_ns=700,
)  # fmt: skip


def read(track, t_ns=1300, value=(1.0, 2.0), expected=(1.0, 2.0), limits=LIMITS):
    return sensor_health.update(track, t_ns, value, expected, limits, 300)


@pytest.mark.parametrize(
    ("value", "noise", "moved", "step"),
    [
        ((1.3, 1.6), 0.05, math.hypot(0.2, 0.2), 0.3),  # what the prediction has not moved too
        ((1.3, 1.6), 0.02, 0.2, 0.3),  # at most ten times the noise
        ((1.9, 1.9), 1.0, math.hypot(0.8, 0.1), 0.1),
        ((1.1, 2.9), 1.0, math.hypot(0.0, 1.1), 0.1),
        ((1.6, 2.0), 1.0, math.hypot(0.5, 0.2), 0.5),  # a coarser change is no resolution, nor is none
    ],
)
def test_a_new_value_teaches_jitter_and_resolution(value, noise, moved, step):
    track = read(BEFORE, value=value, limits=FreezeLimits(noise=noise, motion=0.5))
    assert track.jitter == pytest.approx(0.1 + 0.05 * (moved - 0.1))
    assert track.step == pytest.approx(step)
    assert (track.received_ns, track.value, track.expected, track.accepted) == (1300, value, (1.0, 2.0), 2)
    assert (track.repeats, track.repeated_since_ns, track.apart_since_ns) == (0, 1300, sensor_health.NEVER)
    assert track.frozen is False


@pytest.mark.parametrize("before", [{"accepted": 1}, {"frozen": True}, {"value": (math.nan, math.nan)}])
def test_nothing_is_learned_of_jitter_from_a_first_or_a_thawed_reading_or_from_none(before):
    track = read(changed(BEFORE, **before), value=(1.3, 1.6))
    assert (track.jitter, track.frozen, track.value) == (0.1, False, (1.3, 1.6))


STILL = Track(accepted=5, value=(1.0, 2.0), expected=(1.0, 2.0), repeats=3, repeated_since_ns=1000, step=0.01)
AHEAD = (1.7, 2.7)  # the prediction since has moved by more than 0.5


@pytest.mark.parametrize(
    ("before", "now", "frozen"),
    [
        ({"jitter": 0.11}, {}, True),
        ({"jitter": 0.11}, {"t_ns": 1299}, False),
        ({"jitter": 0.11, "repeats": 2}, {}, False),
        ({"jitter": 0.11, "repeats": 2, "repeated_since_ns": -9000}, {}, False),
        ({"jitter": 0.1}, {}, False),
        ({"jitter": 0.2, "step": 0.07}, {}, False),
        ({"jitter": 0.2, "step": 0.06}, {}, True),
        (
            {"jitter": 0.2, "value": (0.0, 0.0), "expected": (0.0, 0.0)},
            {"value": (0.0, 0.0), "expected": (0.0, 0.0)},
            False,
        ),
        ({}, {}, False),
        ({}, {"expected": AHEAD}, True),
        ({"expected": (1.3, 2.3)}, {"expected": AHEAD}, True),
        ({"expected": (1.4, 2.4)}, {"expected": (3.0, 4.0)}, False),  # the two did not agree at the start
        ({"expected": (1.6, 2.0)}, {"expected": (3.0, 2.0)}, False),
        ({"expected": (1.0, 2.6)}, {"expected": (1.0, 4.0)}, False),
        ({"expected": (1.5, 2.0)}, {"expected": (3.0, 2.0)}, False),
        ({}, {"expected": (1.5, 2.0)}, False),
        ({}, {"expected": (1.0, 2.6)}, True),
        ({"step": 1.0}, {"expected": AHEAD}, False),
        ({"frozen": True}, {"t_ns": 1001}, True),
    ],
)
def test_when_a_repeated_reading_is_frozen(before, now, frozen):
    track = read(changed(STILL, **before), **now)
    assert track.frozen is frozen
    assert track.received_ns == now.get("t_ns", 1300)
    assert track.repeats == before.get("repeats", 3) + 1


def test_a_prediction_may_be_ahead_for_the_lag():
    track, limits = STILL, FreezeLimits(noise=0.1, motion=0.5, lag_ns=200)
    for t_ns, expected, frozen in (
        (1300, AHEAD, False),
        (1400, (1.0, 2.0), False),  # it came back: the lag begins anew
        (1500, AHEAD, False),
        (1699, AHEAD, False),
        (1700, AHEAD, True),
    ):
        track = read(track, t_ns, expected=expected, limits=limits)
        assert track.frozen is frozen, t_ns


def test_an_accepted_reading_ends_a_row_of_rejected_ones():
    track = Track(accepted=4, rejected=7, rejected_in_row=3, steady_since_ns=5)
    track = sensor_health.accept(track, 900)
    assert (track.accepted_ns, track.accepted, track.rejected, track.rejected_in_row) == (900, 5, 7, 0)
    assert track.steady_since_ns == sensor_health.NEVER


def test_an_excluded_reading_counts_as_rejected_but_not_in_a_row():
    track = sensor_health.exclude(Track(accepted=4, rejected=7, rejected_in_row=3, steady_since_ns=5))
    assert (track.accepted, track.rejected, track.rejected_in_row) == (4, 8, 0)
    assert track.steady_since_ns == sensor_health.NEVER


def test_rejected_readings_are_steady_while_their_distance_stays():
    track = Track(accepted=4, rejected=7)
    for t_ns, steady, since_ns, first in (
        (100, (3.0, 8.0), 100, (3.0, 8.0)),
        (200, (3.3, 8.4), 100, (3.0, 8.0)),  # off by 0.5, which is allowed
        (300, (3.4, 8.4), 300, (3.4, 8.4)),
        (400, (3.4, 8.95), 400, (3.4, 8.95)),
        (500, (4.0, 8.95), 500, (4.0, 8.95)),
        (600, (4.0, 8.95), 500, (4.0, 8.95)),
    ):
        track = sensor_health.reject(track, t_ns, steady, (t_ns, 1.0), slack=0.5001)
        assert (track.steady_since_ns, track.steady, track.innovation) == (since_ns, first, (t_ns, 1.0)), t_ns
    assert (track.accepted, track.rejected, track.rejected_in_row, track.rejected_since_ns) == (4, 13, 6, 100)


def test_a_distance_that_changes_by_just_the_slack_is_steady():
    track = sensor_health.reject(Track(), 100, (1.0, 0.0), (0.0, 0.0), slack=0.5)
    assert sensor_health.reject(track, 200, (1.5, 0.0), (0.0, 0.0), slack=0.5).steady_since_ns == 100


@pytest.mark.parametrize(
    ("track", "text"),
    [
        (Track(), ""),
        (Track(rejected_in_row=5), ""),  # never heard
        (Track(received_ns=1000), ""),
        (Track(received_ns=999), "silent"),
        (Track(received_ns=999, frozen=True), "silent"),
        (Track(received_ns=1000, frozen=True, rejected_in_row=5), "frozen"),
        (Track(received_ns=1000, rejected_in_row=1), ""),
        (Track(received_ns=1000, rejected_in_row=2), "jump rejected"),
    ],
)
def test_the_fault_in_words(track, text):
    assert sensor_health.fault(track, 1500, 500) == text
