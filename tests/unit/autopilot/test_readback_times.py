"""When the readback speaks: which commands a report may answer, and how long and how much outputs must differ."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from asvhil.autopilot.readback import Fault
from asvhil.autopilot.sent_pulses import SentPulses
from asvhil.types import Cause
from tests.support.readback_bench import (
    AFTER_MS,
    MS,
    STEP_MS,
    T_NS,
    TOLERANCE_US,
    Pair,
    ReadbackBench,
    followed,
    swinging,
)

NEUTRAL = (1500, 1500)
NS = 1e-6  # ms


def mirrored(_: int, us: Pair) -> Pair:
    return 3000 - us[0], 3000 - us[1]


def test_no_time_is_unread_while_the_motors_are_not_driven() -> None:
    bench = ReadbackBench()
    assert bench.watch.unread_ns(T_NS) == 0
    bench.sent(0, NEUTRAL)
    assert bench.watch.unread_ns(T_NS + 300 * MS) == 300 * MS
    bench.reports(400, outputs=NEUTRAL)
    assert bench.watch.unread_ns(T_NS + 500 * MS) == 100 * MS
    bench.watch.stop()
    assert bench.watch.unread_ns(T_NS + 900 * MS) == 0
    bench.sent(1000, NEUTRAL)
    assert bench.watch.unread_ns(T_NS + 1700 * MS) == 700 * MS


@pytest.mark.parametrize(
    ("ms", "outputs", "follows"),
    [
        (250, (1600, 1500), True),
        (250 - NS, (1600, 1500), False),  # perhaps of before
        (250, (1600 - TOLERANCE_US, 1500), True),
        (250, (1600 - TOLERANCE_US - 1, 1500), False),
        (250, (1600, 1500 + TOLERANCE_US + 1), False),
    ],
)
def test_outputs_are_seen_to_follow_from_a_quarter_of_a_second_on(ms: float, outputs: Pair, follows: bool) -> None:
    bench = ReadbackBench()
    bench.sent(0, (1600, 1500))
    bench.reports(ms, outputs=outputs)
    assert bench.watch.follows is follows


@pytest.mark.parametrize(("off_us", "follows"), [(60, False), (61, True), (-60, False), (-61, True)])
def test_only_outputs_that_are_plainly_off_neutral_are_seen_to_follow(off_us: int, follows: bool) -> None:
    for us in ((1500 + off_us, 1500), (1500, 1500 + off_us)):
        bench = ReadbackBench()
        bench.sent(0, us)
        bench.reports(300, outputs=us)
        assert bench.watch.follows is follows


def test_an_old_report_of_the_sticks_hides_no_new_one_of_the_outputs() -> None:
    bench = ReadbackBench()
    bench.sent(0, (1700, 1300))
    bench.reports(300, outputs=(1700, 1300), sticks=(1700, 1300), sticks_ms=100)
    assert bench.watch.follows and not bench.watch.override_seen, "the sticks were of before the settling"


@pytest.mark.parametrize(
    ("report_ms", "fits"), [(600, True), (600 - NS, False), (1100, True), (1100 - NS, True)], ids=str
)
def test_a_report_may_show_a_command_from_the_moment_at_which_it_was_sent(report_ms: float, fits: bool) -> None:
    bench = ReadbackBench()
    bench.sent(0, (1650, 1500))
    bench.sent(600, (1900, 1500))
    bench.reports(report_ms, outputs=(1900, 1500))
    assert bench.watch.follows is fits


@pytest.mark.parametrize(("report_ms", "fits"), [(699, True), (700 - NS, True), (700, False)], ids=str)
def test_and_for_the_lag_after_it_was_replaced(report_ms: float, fits: bool) -> None:
    bench = ReadbackBench()
    bench.sent(0, (1650, 1500))
    bench.sent(600, (1900, 1500))
    bench.reports(report_ms, outputs=(1650, 1500))
    assert bench.watch.follows is fits


# --- how long and how much ------------------------------------------------------------------------------------------


def test_a_fault_is_found_after_the_least_span_stands_and_is_told_with_its_beginning() -> None:
    bench = ReadbackBench()
    assert bench.watch.differing_ns == 0
    commands = swinging(30)
    bad = 10
    found_ms = bench.play(commands, lambda n, us: us if n < bad else mirrored(n, us))
    first_ms = bad * STEP_MS + AFTER_MS
    assert found_ms == first_ms + 800, "the first report 0.7 s or more after it"
    fault = bench.watch.fault
    assert fault == Fault(cause=Cause.REVERSED)
    assert bench.watch.differing_ns == T_NS + first_ms * MS
    assert bench.judge(found_ms) == fault and bench.judge(found_ms + 500) == fault
    bench.watch.stop()
    assert bench.judge(found_ms + 600) == fault, "until the motors are taken anew"
    bench.sent(found_ms + 700, NEUTRAL)
    assert bench.judge(found_ms + 700) is None


def differ(*spans: tuple[float, bool], judged_ms: float) -> Fault | None:
    """The judgement on reports that follow each other after these times (ms), and differ or not."""
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL)
    bench.sent(0, (1700, 1300))
    ms = 300.0
    for n, (span_ms, bad) in enumerate(spans):
        for _ in range(3):  # the same report, with every message of the autopilot
            bench.reports(ms, outputs=(1300 + 20 * (n % 2), 1700) if bad else (1700, 1300))
        ms += span_ms
    return bench.judge(300 + judged_ms)


def test_the_least_span_counts_from_the_first_that_differs() -> None:
    steady = [(100.0, True)] * 7
    assert differ(*steady, (0, True), judged_ms=700) is not None
    assert differ(*steady, (0, True), judged_ms=700 - NS) is None
    assert differ((100, False), *steady, (0, True), judged_ms=700) is None


def test_outputs_must_differ_for_a_third_of_a_second_in_sum() -> None:
    """Each report speaks for the time until the next, at most 0.25 s; the last for as long as the one before it."""
    for short_ms, found in ((0.0, True), (NS, False)):
        assert (
            differ((200, True), (400, False), (150 - short_ms, True), (0, False), judged_ms=750) is not None
        ) is found
        assert (
            differ((400, True), (400, False), (100 - short_ms, True), (0, False), judged_ms=900) is not None
        ) is found
        assert (
            differ((200, True), (400, False), (150 - short_ms, False), (0, True), judged_ms=750) is not None
        ) is found
    assert differ((0, True), judged_ms=900) is None, "one report alone"
    assert differ((200, True), (0, True), judged_ms=900) is not None
    assert differ((170, True), (0, True), judged_ms=900) is None


def test_a_report_is_judged_once() -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL)
    bench.sent(0, (1700, 1300))
    for n in range(8):
        bench.reports(300 + 100 * n, outputs=(1300 + 20 * (n % 2), 1700))
        assert (bench.judge(300 + 100 * n) is None) == (n < 7)


# --- outputs that only stay as they are -----------------------------------------------------------------------------


def stays(moves_us: int) -> float | None:
    """When outputs are a fault that followed and then stay, but for a wobble; ms since the first that differs."""
    bench = ReadbackBench()
    commands = swinging(40)
    held = commands[9]
    found_ms = bench.play(commands, lambda n, us: us if n < 10 else (held[0] + moves_us * (n % 2), held[1]))
    assert found_ms is not None
    return found_ms - (10 * STEP_MS + AFTER_MS)


def test_outputs_that_stay_may_be_commands_that_the_link_lost_and_get_longer() -> None:
    assert stays(0) == stays(2) == 2000, "the first report 1.9 s or more after the first that differs"
    assert stays(3) == 800, "these move, and follow nothing"


@pytest.mark.parametrize(("at_ms", "found"), [(1900, True), (1900 - NS, False)])
def test_outputs_that_stay_are_a_fault_after_just_1_9_s(at_ms: float, found: bool) -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL)
    bench.sent(0, (1650, 1350))
    bench.reports(300, outputs=(1650, 1350), sticks=(1650, 1350))
    bench.sent(310, (1900, 1100))
    for ms in range(450, 2350, 100):
        bench.reports(ms, outputs=(1650, 1350), sticks=(1900, 1100))
        assert bench.judge(ms) is None
    bench.reports(450 + at_ms, outputs=(1650, 1350))
    assert (bench.judge(450 + at_ms) is not None) is found


# --- what is stuck --------------------------------------------------------------------------------------------------


def of_still(commands: list[Pair], outputs: Pair | None = None, *, before: Pair | None = NEUTRAL) -> Fault | None:
    """The fault of outputs that stay at neutral, or where they are told to be instead."""
    bench = ReadbackBench()
    if before is not None:
        bench.reports(-100, outputs=before, sticks=NEUTRAL)
    bench.play(commands, lambda _, us: outputs or NEUTRAL)
    return bench.watch.fault


def test_outputs_are_stuck_that_a_plain_command_does_not_move() -> None:
    assert of_still([(1561, 1439)] * 20) == Fault(cause=Cause.STUCK)
    assert of_still([(1561, 1439)] * 20, before=None) == Fault(cause=Cause.STUCK), "they were not told before"
    for commands in ([(1560, 1440)] * 20, [(1540, 1500)] * 20):
        fault = of_still(commands)
        assert fault is None or fault.cause is not Cause.STUCK, "a dead zone would do that"


def test_two_plain_commands_are_needed() -> None:
    small, plain = (1540, 1460), (1700, 1300)
    two = of_still([small, small, plain, small, plain, small, small, small])
    assert two == Fault(cause=Cause.STUCK)
    one = of_still([small, small, plain, small, small, small, small, small])
    assert one is None or one.cause is not Cause.STUCK


@pytest.mark.parametrize(("wobble_us", "found"), [(2, True), (3, False)])
def test_outputs_that_wobble_by_2_us_are_stuck(wobble_us: int, found: bool) -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=NEUTRAL)
    bench.play(swinging(20), lambda n, _: (1500 + wobble_us * (n % 2), 1500 - wobble_us * (n % 2)))
    assert bench.watch.fault is not None and (bench.watch.fault.cause is Cause.STUCK) is found


@pytest.mark.parametrize("motor", ["port", "starboard"])
@pytest.mark.parametrize("off_us", [0, TOLERANCE_US])
def test_one_motor_is_stuck_where_the_other_follows(motor: str, off_us: int) -> None:
    def outputs(_: int, us: Pair) -> Pair:
        return (1500, us[1] + off_us) if motor == "port" else (us[0] + off_us, 1500)

    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=NEUTRAL)
    assert bench.play(swinging(20), outputs) is not None
    assert bench.watch.fault == Fault(cause=Cause.STUCK, motor=motor)


def test_a_motor_that_was_told_next_to_nothing_is_not_called_stuck_for_the_others_plain_commands() -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=NEUTRAL)
    commands = [(port, 1540) for port, _ in swinging(20)]
    assert bench.play(commands, lambda _, us: (us[0], 1500)) is not None
    assert bench.watch.fault == Fault(cause=Cause.UNEXPLAINED)


# --- which commands a report answers --------------------------------------------------------------------------------


def test_a_report_answers_what_stood_a_lag_before_it_and_what_was_sent_since() -> None:
    sent = [(10 * n, (1000 + 100 * n, 2000 - 100 * n)) for n in range(4)]
    for t_ns, answers in ((30, {2, 3}), (29, {1, 2}), (20, {1, 2}), (19, {0, 1}), (5, {0}), (10, {0, 1}), (99, {3})):
        pulses = SentPulses(sent, [t_ns], [10])
        found = {n for n, (_, us) in enumerate(sent) if pulses.residuals_us(pulses.pulses, np.array([us]))[0] == 0.0}
        assert found == answers, t_ns


def test_each_report_has_a_residual_of_its_own_by_the_worse_motor() -> None:
    pulses = SentPulses([(0, (1600, 1400))], [5, 6, 7], [10] * 3)
    reported = np.array([[1600.0, 1400.0], [1610.0, 1430.0], [1550.0, 1410.0]])
    assert pulses.residuals_us(pulses.pulses, reported).tolist() == [0.0, 30.0, 50.0]
    assert pulses.least(np.abs(pulses.pulses - 1500.0)).tolist() == [[100.0, 100.0]] * 3


def test_a_boat_that_follows_raises_no_fault() -> None:
    bench = ReadbackBench()
    assert bench.play(swinging(100), followed) is None and bench.watch.follows and bench.watch.override_seen


# --- reports that come in bursts ------------------------------------------------------------------------------------


def play_in_bursts(
    bench: ReadbackBench,
    burst_ms: int,
    outputs: Callable[[int, Pair], Pair] = followed,
    *,
    apart_ns: int = 10_000,
    both_ways: bool = False,
) -> float | None:
    """10 s of commands at 10 Hz, each answered at once; the answers, and perhaps the commands, come in bursts.

    When a fault was found (ms); None where there was none.
    """
    waiting: list[Pair] = []
    has = NEUTRAL  # the autopilot's last command
    commands = swinging(100)
    for n, us in enumerate(commands):
        ms = 100 * n
        bench.sent(ms, us)
        delivers = ms % burst_ms < 100
        if delivers or not both_ways:
            has = us
        waiting.append(outputs(n, has))
        if delivers:
            for place, reported in enumerate(waiting):
                bench.reports(ms + 60 + place * apart_ns * NS, outputs=reported)
            waiting = []
        if bench.judge(ms + 99) is not None:
            return ms + 99.0
    return None


@pytest.mark.parametrize("burst_ms", [300, 600, 800, 1000])
@pytest.mark.parametrize("both_ways", [False, True])
def test_a_link_that_delivers_in_bursts_raises_no_fault(burst_ms: int, both_ways: bool) -> None:
    bench = ReadbackBench()
    assert play_in_bursts(bench, burst_ms, both_ways=both_ways) is None
    assert bench.watch.follows


@pytest.mark.parametrize("burst_ms", [300, 600, 800, 1000])
def test_and_hides_none_for_more_than_some_bursts(burst_ms: int) -> None:
    turned = ReadbackBench()
    found_ms = play_in_bursts(turned, burst_ms, mirrored)
    assert found_ms is not None and found_ms <= 700 + 3 * burst_ms
    assert turned.watch.fault == Fault(cause=Cause.REVERSED, late=True)


def test_outputs_that_follow_nothing_known_are_told_with_the_bursts_that_they_come_in() -> None:
    bench = ReadbackBench()
    assert play_in_bursts(bench, 600, lambda n, us: (1300 + 37 * (n % 11), 1620 + 53 * (n % 7))) is not None
    assert bench.watch.fault == Fault(cause=Cause.UNEXPLAINED, late=True)


def test_a_report_that_comes_alone_has_the_lag_alone() -> None:
    """A stream that is slow, and not late, hides no difference."""
    slow, bursts = ReadbackBench(), ReadbackBench()
    for bench, twice in ((slow, False), (bursts, True)):
        for ms, us in ((0, (1700, 1300)), (500, (1600, 1400)), (1300, (1600, 1400))):
            bench.sent(ms, us)
        for ms in (300, 1290):  # the second as if it had waited since the first
            bench.reports(ms - (0.05 if twice else 0.0), outputs=(1700, 1300))
            if twice:
                bench.reports(ms, outputs=(1700, 1300))
    assert [bench.watch._outputs[-1].fits for bench in (slow, bursts)] == [False, True]
