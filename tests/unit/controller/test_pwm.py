"""Pulse widths: bounds, neutral, slew, by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import PwmConfig
from asvhil.controller.pwm import PulseLimiter, command_of_pulse, pulse_of_command
from asvhil.controller.solvers.motor_limits import MotorLimits

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


@pytest.mark.parametrize("slew_us_per_s", [4.0, 10.0, 30.0, 37.7, 1000.0])
def test_the_slew_rate_is_that_of_the_config_over_many_ticks(slew_us_per_s: float) -> None:
    """At 20 ticks a second a whole microsecond in each would be 20 us/s at the least."""
    limiter = PulseLimiter(PwmConfig(slew_us_per_s=slew_us_per_s))
    limiter.step(0, (1.0, 1.0))
    seconds = min(20, int(300 / slew_us_per_s) or 1) if slew_us_per_s < 1000 else 0.3
    for tick in range(1, round(20 * seconds) + 1):
        pulses = limiter.step(tick * 50 * MS, (1.0, 1.0))
    assert pulses[0] - 1501 == pytest.approx(slew_us_per_s * seconds, abs=1.0) and pulses[0] < 1900


@pytest.mark.parametrize(
    ("pulse", "command"),
    [
        (1000, -1.0),
        (1200, -0.5),
        (1399, -1 / 400),
        (1400, 0.0),
        (1401, 1 / 600),
        (1700, 0.5),
        (2000, 1.0),
        (900, -1.0),
        (2200, 1.0),
        (1, -1.0),
    ],
)
def test_command_of_a_pulse_in_an_asymmetric_range(pulse: int, command: float) -> None:
    pwm = PwmConfig(astern_us=1000, neutral_us=1400, ahead_us=2000)
    assert command_of_pulse(pwm, pulse) == pytest.approx(command)


@pytest.mark.parametrize(("astern_us", "ahead_us"), [(1000, 2000), (800, 1800)])
def test_a_command_grows_as_fast_as_the_slower_side_allows(astern_us: int, ahead_us: int) -> None:
    pwm = PwmConfig(astern_us=astern_us, neutral_us=1400, ahead_us=ahead_us, slew_us_per_s=1200.0)
    assert MotorLimits.of_pwm(pwm).rate_per_s == pytest.approx(2.0)


def at(last_us: tuple[int, int]) -> PulseLimiter:
    """A limiter that has long been told so, at 0 s."""
    limiter = PulseLimiter(PWM)
    for seconds in range(-3, 1):
        limiter.step(seconds * 1000 * MS, ((last_us[0] - 1500) / 400, (last_us[1] - 1500) / 400))
    return limiter


@pytest.mark.parametrize(
    ("last_us", "wanted", "pulses"),
    [
        ((1900, 1900), (-0.5, 0.5), (1450, 1700)),  # over neutral at the slew rate, however far it came from
        ((1600, 1400), (-0.2, 0.2), (1450, 1550)),
        ((1400, 1600), (1.0, -1.0), (1550, 1450)),
        ((1600, 1400), (1.0, -1.0), (1650, 1350)),
        ((1501, 1499), (-0.2, 0.2), (1450, 1550)),
        ((1500, 1500), (0.2, -0.2), (1550, 1450)),
        ((1600, 1400), (0.25, -0.25), (1600, 1400)),
        ((1600, 1400), (0.05, -0.05), (1520, 1480)),
    ],
)
def test_a_step_of_50_ms(last_us: tuple[int, int], wanted: tuple[float, float], pulses: tuple[int, int]) -> None:
    assert at(last_us).step(50 * MS, wanted) == pulses


def test_a_first_step_and_one_after_a_release_are_of_1_us() -> None:
    limiter = PulseLimiter(PWM)
    assert limiter.step(0, (1.0, -1.0)) == (1501, 1499)
    assert limiter.step(100 * MS, (1.0, -1.0)) == (1601, 1399)
    limiter.reset()
    assert limiter.step(200 * MS, (1.0, -1.0)) == (1501, 1499)


def test_a_pause_counts_as_a_second_at_most() -> None:
    limiter = PulseLimiter(PwmConfig(slew_us_per_s=100.0))
    limiter.step(0, (1.0, -1.0))
    assert limiter.step(5000 * MS, (1.0, -1.0)) == (1601, 1399)


def test_a_cap_on_the_thrust_is_enforced_last() -> None:
    pwm = PwmConfig(command_max=0.25)
    assert [pulse_of_command(pwm, command) for command in (1.0, 0.25, 0.1, 0.0, -0.1, -0.25, -1.0)] == [
        1600, 1600, 1540, 1500, 1460, 1400, 1400,
    ]  # fmt: skip


def test_a_motor_pauses_at_neutral_before_it_turns_the_other_way() -> None:
    limiter = PulseLimiter(PwmConfig(reversal_pause_s=0.3))
    limiter.step(0, (0.2, -0.2))
    assert limiter.step(50 * MS, (0.2, -0.2)) == (1580, 1420)
    for tick in range(2, 8):  # both are told the other way from 100 ms on
        assert limiter.step(50 * tick * MS, (-0.2, 0.2)) == (1500, 1500)
    assert limiter.step(400 * MS, (-0.2, 0.2)) == (1420, 1580)
    assert limiter.step(450 * MS, (-0.2, 0.0)) == (1420, 1500)
    assert limiter.step(500 * MS, (-0.2, 0.1)) == (1420, 1540)  # the same way again: at once
    assert limiter.step(550 * MS, (0.0, -0.1)) == (1500, 1500)
    assert limiter.step(849 * MS, (0.1, -0.1)) == (1500, 1500)
    assert limiter.step(850 * MS, (0.1, -0.1)) == (1508, 1492)  # 1 ms later, by 8000 us/s


@pytest.mark.parametrize("pause_s", [0.3, 5.0])
def test_the_pause_is_as_long_as_the_config_says_to_the_nanosecond(pause_s: float) -> None:
    over_ns = 100 * MS + round(pause_s * 1000 * MS)
    for t_ns, still in ((over_ns - 1, True), (over_ns, False)):
        limiter = PulseLimiter(PwmConfig(reversal_pause_s=pause_s))
        for before_ns, command in ((0, 0.2), (50 * MS, 0.2), (100 * MS, -0.2)):
            limiter.step(before_ns, (command, 0.0))
        assert (limiter.step(t_ns, (-0.2, 0.0))[0] == 1500) is still


def test_a_release_does_not_shorten_the_pause_and_the_first_turn_needs_none() -> None:
    limiter = PulseLimiter(PwmConfig(reversal_pause_s=0.3))
    limiter.step(0, (0.0, 0.0))
    assert limiter.step(50 * MS, (-0.2, 0.2)) == (1420, 1580)
    assert limiter.neutral() == (1500, 1500)
    assert limiter.step(100 * MS, (0.2, 0.2)) == (1500, 1501)
    assert limiter.step(399 * MS, (0.2, 0.2)) == (1500, 1580)
    assert limiter.step(400 * MS, (0.2, 0.2))[0] > 1500


def test_without_a_pause_a_motor_reverses_at_once() -> None:
    limiter = PulseLimiter(PwmConfig())
    limiter.step(0, (0.2, 0.0))
    assert limiter.step(50 * MS, (-0.2, 0.0)) == (1420, 1500)


def test_only_two_motors_are_commanded() -> None:
    with pytest.raises(ValueError):
        PulseLimiter(PWM).step(0, (1.0, 1.0, 1.0))  # type: ignore[arg-type]
