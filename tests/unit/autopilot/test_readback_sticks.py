"""What the readback makes of sticks: whether an override has been seen, and those of a station that rests."""

from __future__ import annotations

import pytest

from asvhil.autopilot.readback import REST_NS, Fault
from asvhil.types import Cause
from tests.support.readback_bench import MS, T_NS, TOLERANCE_US, Pair, ReadbackBench, followed, swinging

NEUTRAL = (1500, 1500)
REST_MS = REST_NS / MS


def seen(override: Pair, sticks: Pair, before: Pair | None) -> bool:
    """Whether an override counts as seen among the sticks, which stood elsewhere before."""
    bench = ReadbackBench()
    if before is not None:
        bench.reports(-100, sticks=before)
    bench.sent(0, override)
    bench.reports(300, sticks=sticks)
    return bench.watch.override_seen


@pytest.mark.parametrize("motor", [0, 1])
@pytest.mark.parametrize("before", [NEUTRAL, (1700, 1300), None], ids=["neutral", "off", "unknown"])
def test_an_override_is_seen_where_a_stick_shows_it_and_stood_elsewhere(motor: int, before: Pair | None) -> None:
    """Three microseconds are the rounding on the way; ten from where the stick stood tell an override from it."""
    stood = before or NEUTRAL

    def pair(off_us: int) -> Pair:
        return (stood[0] + off_us, stood[1]) if motor == 0 else (stood[0], stood[1] + off_us)

    for sign in (-1, 1):
        assert seen(pair(11 * sign), pair(11 * sign), before)
        assert not seen(pair(10 * sign), pair(10 * sign), before)
        assert seen(pair(40 * sign), pair(43 * sign), before) and seen(pair(40 * sign), pair(37 * sign), before)
        assert not seen(pair(40 * sign), pair(44 * sign), before)
    assert not seen(pair(40), stood, before)


def test_what_was_seen_is_of_this_hold_alone() -> None:
    bench = ReadbackBench()
    assert (bench.watch.override_seen, bench.watch.follows) == (False, False)
    assert bench.play(swinging(5), followed) is None
    assert (bench.watch.override_seen, bench.watch.follows) == (True, True)
    bench.watch.stop()
    bench.sent(5000, (1700, 1300))
    assert (bench.watch.override_seen, bench.watch.follows) == (False, False)
    ours = ReadbackBench(overrides_sticks=False)
    assert ours.play(swinging(5), followed) is None and not ours.watch.override_seen


def test_sticks_that_stood_where_the_override_puts_them_do_not_show_that_it_is_ignored() -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=(1700, 1300))
    assert bench.play([(1700, 1300)] * 20, lambda *_: (1300, 1700)) is not None
    assert not bench.watch.override_seen
    assert bench.watch.fault is not None and bench.watch.fault.cause is not Cause.IGNORED


# --- outputs without sticks -----------------------------------------------------------------------------------------


def stuck(sticks: Pair | None, before: Pair | None, outputs: Pair = NEUTRAL, **options: bool) -> tuple[float, Fault]:
    """When outputs that stay where they were are a fault (ms since the first that should have moved), and which."""
    bench = ReadbackBench(**options)
    bench.reports(-100, outputs=outputs, sticks=before)
    found_ms = bench.play(swinging(20), lambda *_: outputs, lambda *_: sticks)
    assert found_ms is not None and bench.watch.fault is not None
    return found_ms - 350, bench.watch.fault


def test_outputs_that_stay_are_stuck_and_blindly_so_where_no_sticks_are_told() -> None:
    """With sticks that were told before, more is known soon: 1.4 s instead of 0.7 s are waited for them."""
    assert stuck(None, None) == (800, Fault(cause=Cause.STUCK, blind=True))
    assert stuck(None, (1510, 1500)) == (1400, Fault(cause=Cause.STUCK, blind=True))
    assert stuck(None, None, (0, 0)) == (800, Fault(cause=Cause.STUCK)), "no signal is no matter of overrides"
    assert stuck(None, NEUTRAL, overrides_sticks=False) == (800, Fault(cause=Cause.STUCK))


def test_where_the_sticks_show_the_override_stuck_outputs_are_nothing_else() -> None:
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=NEUTRAL)
    assert bench.play(swinging(20), lambda *_: NEUTRAL) == 350 + 800
    assert bench.watch.fault == Fault(cause=Cause.STUCK)


# --- a ground station that rests ------------------------------------------------------------------------------------


def with_station(rest: Pair, outputs: Pair, heard_before_ms: float) -> float | None:
    """When a fault is found in outputs that follow a station, whose messages are heard so long before each report."""
    bench = ReadbackBench()
    bench.reports(-100, outputs=NEUTRAL, sticks=NEUTRAL)
    for n, us in enumerate(swinging(20)):
        ms = 200.0 * n
        bench.sent(ms, us)
        bench.watch.note_station(T_NS + round((ms + 150 - heard_before_ms) * MS), rest)
        bench.reports(ms + 150, outputs=outputs, sticks=us)
        if bench.judge(ms + 150) is not None:
            return ms + 150
    return None


@pytest.mark.parametrize("rest", [(1540, 1480), (1560, 1440)])
def test_outputs_may_follow_a_station_that_rests_while_its_messages_are_heard(rest: Pair) -> None:
    within = (rest[0] + TOLERANCE_US, rest[1] - TOLERANCE_US)
    for outputs in (rest, within):
        assert with_station(rest, outputs, REST_MS - 1e-6) is None
        assert with_station(rest, outputs, REST_MS) is not None, "they are too old"
    assert with_station(rest, (within[0] + 1, within[1]), 0) is not None
    assert with_station(rest, (rest[0], within[1] - 1), 0) is not None


@pytest.mark.parametrize("moved", [(1561, 1500), (1500, 1439)])
def test_a_station_that_drives_explains_no_outputs(moved: Pair) -> None:
    assert with_station(moved, moved, 0) is not None


@pytest.mark.parametrize(("rest", "excused"), [((1530, 1490), True), ((1560, 1500), True), ((1561, 1500), False)])
def test_a_station_that_is_seen_only_among_the_sticks_is_known_once_ours_have_been(rest: Pair, excused: bool) -> None:
    """It takes turns with us, and the outputs happen to be told in its turn."""
    bench = ReadbackBench()
    found_ms = bench.play(swinging(25), lambda n, us: us if n < 3 else rest, lambda n, us: us if n % 2 else rest)
    assert (found_ms is None) == excused
    never = ReadbackBench()
    assert never.play(swinging(25), lambda *_: rest, lambda *_: rest) is not None
    assert never.watch.fault == Fault(cause=Cause.IGNORED)


def test_what_a_station_did_in_the_last_hold_explains_nothing_in_this() -> None:
    bench = ReadbackBench()
    bench.sent(0, (1700, 1300))
    bench.watch.note_station(T_NS, NEUTRAL)
    bench.watch.stop()
    found_ms = bench.play(swinging(20), lambda *_: NEUTRAL, from_ms=100.0)
    assert found_ms == 100 + 350 + 800
