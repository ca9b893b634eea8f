"""The autopilot's clock against ours: what is a slow simulation, a delay that passes, and a radio."""

import random

import pytest

from asvhil.autopilot.pace import Pace

MS, S = 1_000_000, 1_000_000_000


def feed(
    pace: Pace, from_s: float, seconds: float, late_s: float = 0.0, slower: float = 0.0, jitter_s: float = 0.0
) -> None:
    """Messages at 20 Hz: `late_s` at first, and `slower` (s/s) ever later."""
    chance = random.Random(1)
    for k in range(round(20 * seconds)):
        at_s = from_s + k / 20
        delay_s = late_s + slower * k / 20 + chance.uniform(0.0, jitter_s)
        pace.take(round(at_s * S), round(1000.0 * (100.0 + at_s - delay_s)))


def test_a_clock_that_keeps_pace_is_never_late() -> None:
    pace = Pace()
    feed(pace, 0.0, 100.0, late_s=0.4)
    assert not pace.was_late(100 * S) and pace.lost_s(100 * S) == 0.0


def test_a_radio_that_is_late_by_a_fifth_of_a_second_at_random_is_no_reason_either() -> None:
    pace = Pace()
    feed(pace, 0.0, 100.0, jitter_s=0.2)
    assert not pace.was_late(100 * S) and pace.lost_s(100 * S) == 0.0


def test_what_a_slow_simulation_loses_is_known_at_once_and_told_for_half_a_minute() -> None:
    pace = Pace()
    feed(pace, 0.0, 20.0)
    feed(pace, 20.0, 3.0, slower=0.5)
    assert pace.was_late(23 * S)
    feed(pace, 23.0, 10.0, late_s=1.5)
    assert pace.was_late(33 * S) and pace.lost_s(33 * S) == pytest.approx(1.5, abs=0.05)
    feed(pace, 33.0, 10.0, late_s=1.5)
    assert not pace.was_late(43 * S)
    feed(pace, 43.0, 20.0, late_s=1.5)
    assert pace.lost_s(63 * S) == 0.0


def test_a_steady_loss_of_a_tenth_is_known_too() -> None:
    pace = Pace()
    feed(pace, 0.0, 20.0, slower=0.1)
    assert pace.was_late(20 * S) and pace.lost_s(20 * S) > 0.5


def test_a_delay_that_passes_loses_nothing() -> None:
    pace = Pace()
    feed(pace, 0.0, 20.0)
    feed(pace, 20.0, 3.0, late_s=1.0)
    assert pace.was_late(23 * S)
    feed(pace, 23.0, 3.0)
    assert pace.lost_s(26 * S) == 0.0
    feed(pace, 26.0, 15.0)
    assert not pace.was_late(41 * S)


def test_the_same_messages_by_a_slower_way_say_nothing() -> None:
    pace = Pace()
    for k in range(400):
        pace.take(k * 50 * MS, 1000 + 50 * k)
        pace.take(k * 50 * MS + MS, 50 * k)  # by a way that is 1 s late
    assert not pace.was_late(20 * S)


def test_a_restart_and_a_clock_that_stands_still() -> None:
    pace = Pace()
    feed(pace, 0.0, 20.0)
    pace.restart()
    feed(pace, 20.0, 20.0, late_s=100.0)
    assert not pace.was_late(40 * S) and pace.lost_s(40 * S) == 0.0
    for k in range(1000):
        pace.take(k * 50 * MS, 0)
    assert pace.lost_s(50 * S) == 0.0


def test_a_fix_is_as_old_as_the_autopilots_clock_says() -> None:
    pace = Pace()
    assert pace.age_ns(0, 0) == 0  # nothing is known of its clock
    feed(pace, 0.0, 20.0, late_s=0.05, jitter_s=0.03)
    boot_us = round(1e6 * 119.80)  # the fix of 0.2 s ago; the least delay of all messages, 0.05 s, is in both
    assert pace.age_ns(20 * S, boot_us) == pytest.approx(0.15 * S, abs=0.005 * S)


@pytest.mark.parametrize("boot_us", [0, 10**15, 130_000_000, 119_000_000])
def test_a_date_by_another_clock_is_none(boot_us: int) -> None:
    """None at all, of the day, of the future, and older than any fix is."""
    pace = Pace()
    feed(pace, 0.0, 20.0)
    assert pace.age_ns(20 * S, boot_us) == 0
    assert pace.age_ns(20 * S, 119_900_000) == pytest.approx(0.1 * S, abs=1000 * MS // 1000)
    assert pace.age_ns(26 * S, 125_900_000) == 0  # its clock has not been heard for long
    pace.restart()
    assert pace.age_ns(20 * S, 119_900_000) == 0
