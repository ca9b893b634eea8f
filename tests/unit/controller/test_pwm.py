"""Pulse widths: bounds, neutral, slew, by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import PwmConfig
from asvhil.controller.pwm import PulseLimiter, command_of_pulse, pulse_of_command

PWM = PwmConfig(slew_us_per_s=1000.0)
MS = 1_000_000


@pytest.mark.parametrize(
    ("command", "pulse"),
    [
        (0.0, 1500),
        (1.0, 1900),
        (-1.0, 1100),
        (0.5, 1700),
        (7.0, 1900),
        (-7.0, 1100),
        (math.nan, 1500),
        (math.inf, 1500),
        (4.5e305, 1900),
        (-4.5e305, 1100),
    ],
)
def test_pulse_of_command(command: float, pulse: int) -> None:
    assert pulse_of_command(PWM, command) == pulse


def test_asymmetric_ranges_reach_both_ends() -> None:
    pwm = PwmConfig(astern_us=1000, neutral_us=1400, ahead_us=2000)
    assert [pulse_of_command(pwm, c) for c in (-1.0, -0.5, 0.0, 0.5, 1.0)] == [1000, 1200, 1400, 1700, 2000]


@given(st.floats(-1.0, 1.0))
def test_a_pulse_gives_its_command_back(command: float) -> None:
    assert command_of_pulse(PWM, pulse_of_command(PWM, command)) == pytest.approx(command, abs=0.5 / 400 + 1e-9)


def test_no_signal_is_neutral() -> None:
    assert command_of_pulse(PWM, 0) == 0.0


@given(st.lists(st.tuples(st.floats(allow_nan=True), st.floats(allow_nan=True)), max_size=30))
def test_limits_hold_whatever_is_asked(commands: list[tuple[float, float]]) -> None:
    limiter = PulseLimiter(PWM)
    last = (1500, 1500)
    for tick, command in enumerate(commands):
        pulses = limiter.step(tick * 50 * MS, command)
        for now, before in zip(pulses, last, strict=True):
            assert 1100 <= now <= 1900
            away = abs(now - 1500) > abs(before - 1500) and (now - 1500) * (before - 1500) >= 0
            assert not away or abs(now - before) <= 50  # 1000 us/s in 50 ms
        last = pulses


def test_thrust_is_reduced_at_once_and_increased_at_the_slew_rate() -> None:
    limiter = PulseLimiter(PWM)
    limiter.step(0, (1.0, -1.0))
    for tick in range(1, 20):
        pulses = limiter.step(tick * 50 * MS, (1.0, -1.0))
    assert pulses == (1900, 1100)
    assert limiter.step(1000 * MS, (0.0, 0.1)) == (1500, 1540)  # less thrust at once; over neutral, then 40 us
    assert limiter.neutral() == (1500, 1500)
