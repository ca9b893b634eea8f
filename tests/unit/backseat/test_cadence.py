"""When controls are due, and how floods are spread."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from asvhil.backseat.build import build_cadence
from asvhil.backseat.cadence import EveryPeriod, EveryTicks
from asvhil.config import load_config
from asvhil.daemon.allowance import Allowance

MS = 1_000_000
T0 = 1_700_000_000_000 * MS


def test_by_count() -> None:
    cadence = EveryTicks(4)
    assert [cadence.advance(0) for _ in range(9)] == [True, False, False, False] * 2 + [True]
    cadence.restart()
    assert [cadence.advance(0) for _ in range(2)] == [True, False]


def test_by_time_is_the_same_on_a_regular_grid() -> None:
    by_count, by_time = EveryTicks(4), EveryPeriod(200 * MS, 25 * MS)
    ticks = [T0 + number * 50 * MS for number in range(40)]
    assert [by_count.advance(t) for t in ticks] == [by_time.advance(t) for t in ticks]


def test_a_late_tick_shifts_no_later_one_and_a_long_pause_starts_anew() -> None:
    cadence = EveryPeriod(100 * MS, 10 * MS)
    ticks = [0, 89, 90, 150, 195, 289, 1000, 1089, 1090]
    assert [t for t in ticks if cadence.advance(T0 + t * MS)] == [0, 90, 195, 1000, 1090]
    cadence.restart()
    assert cadence.advance(T0 + 1091 * MS)


def test_a_tick_without_data_leaves_the_solution_to_the_data_that_is_about_to_come() -> None:
    """A sensor each 20.3 ms, a timer each 10 ms: each datagram is solved for at once, whatever the phase."""
    cadence = EveryPeriod(10 * MS, 5 * MS)
    events = sorted([(T0 + number * 10 * MS, False) for number in range(1, 200)] +
                    [(T0 + round(number * 20.3 * MS), True) for number in range(98)])  # fmt: skip
    solved = {t: cadence.advance(t, fresh) for t, fresh in events}
    assert all(solved[t] for t, fresh in events if fresh)


def test_without_any_data_the_rate_is_kept() -> None:
    cadence = EveryPeriod(100 * MS, 10 * MS)
    ticks = [T0 + number * 20 * MS for number in range(500)]
    solved = [t for t in ticks if cadence.advance(t, fresh=t < T0 + 1000 * MS)]
    silent = [b - a for a, b in pairwise(solved) if a >= T0 + 1200 * MS]
    assert len(silent) > 70 and set(silent) == {100 * MS}


@given(st.lists(st.integers(1 * MS, 40 * MS), min_size=200, max_size=200))
def test_irregular_ticks_keep_the_rate(gaps: list[int]) -> None:
    cadence = EveryPeriod(100 * MS, 20 * MS)
    t_ns, solved = T0, 0
    for gap in gaps:
        solved += cadence.advance(t_ns)
        t_ns += gap
    assert abs(solved - sum(gaps) / (100 * MS)) <= 2


def test_the_config_chooses() -> None:
    assert isinstance(build_cadence(load_config("sitl")), EveryTicks)
    assert isinstance(build_cadence(load_config("sitl", ("daemon.cut_on=arrival",))), EveryPeriod)


def test_single_events_pass_at_once_and_a_flood_is_spread() -> None:
    allowance = Allowance(100.0, 5)
    assert [allowance.take_s(float(second)) for second in range(10)] == [0.0] * 10
    now_s, waits = 100.0, []
    for _ in range(25):
        wait_s = allowance.take_s(now_s)
        waits.append(wait_s)
        now_s += wait_s
    assert waits[:5] == [0.0] * 5 and all(abs(wait_s - 0.01) < 1e-9 for wait_s in waits[5:])
