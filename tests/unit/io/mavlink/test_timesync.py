"""TIMESYNC: the offset is within half of the shortest round trip, whatever the delays and lies in between."""

from __future__ import annotations

import random
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.config import Config, load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.io.mavlink.timesync import STEP_AFTER, WINDOW, TimeSync
from asvhil.operator.session import OperatorSession
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Frame

S, MS = 1_000_000_000, 1_000_000
T0 = 1_700_000_000 * S


def exchange(sync: TimeSync, t_ns: int, offset_ns: int, out_ns: int, back_ns: int) -> None:
    (request,) = ask(sync, t_ns)
    assert (request.tc1, request.ts1) == (0, t_ns)
    receive(sync, t_ns + out_ns + back_ns, t_ns + out_ns + offset_ns, request.ts1)


def ask(sync: TimeSync, t_ns: int) -> list[Any]:
    sync.ask()
    return sync.data_to_send(t_ns)


def receive(sync: TimeSync, t_ns: int, tc1: int, ts1: int) -> None:
    sync.receive(t_ns, dialect.MAVLink_timesync_message(tc1, ts1))


def test_nothing_is_known_before_the_first_answer() -> None:
    assert TimeSync().offset is None


def test_an_even_exchange_gives_the_offset_to_the_nanosecond() -> None:
    sync = TimeSync()
    exchange(sync, T0, -123_456_789_012, 4 * MS, 4 * MS)
    assert sync.offset is not None
    assert (sync.offset.offset_ns, sync.offset.round_trip_ns) == (-123_456_789_012, 8 * MS)


def test_the_shortest_round_trip_of_the_window_is_believed() -> None:
    sync = TimeSync()
    exchange(sync, T0, 0, 1 * MS, 1 * MS)
    for number in range(1, WINDOW):
        exchange(sync, T0 + number * S, 0, 40 * MS, 5 * MS)
        assert sync.offset is not None and sync.offset.offset_ns == 0
    exchange(sync, T0 + WINDOW * S, 0, 40 * MS, 5 * MS)  # the short one has left the window
    assert sync.offset.offset_ns == (40 * MS - 5 * MS) // 2


@given(
    st.integers(-(10**15), 10**15), st.lists(st.tuples(st.integers(0, 200 * MS), st.integers(0, 200 * MS)), min_size=1)
)
def test_the_error_is_at_most_half_of_the_round_trip(offset_ns: int, delays: list[tuple[int, int]]) -> None:
    sync = TimeSync()
    for number, (out_ns, back_ns) in enumerate(delays):
        exchange(sync, T0 + number * S, offset_ns, out_ns, back_ns)
    assert sync.rejected == 0 and sync.offset is not None
    assert abs(sync.offset.offset_ns - offset_ns) <= sync.offset.round_trip_ns // 2 + 1


def test_outliers_are_dropped_and_a_clock_that_was_set_is_followed() -> None:
    sync = TimeSync()
    for number in range(10):
        exchange(sync, T0 + number * S, 0, 2 * MS, 2 * MS)
    exchange(sync, T0 + 10 * S, 70 * MS, 2 * MS, 2 * MS)
    assert sync.offset is not None and sync.offset.offset_ns == 0 and sync.rejected == 1
    exchange(sync, T0 + 11 * S, 0, 2 * MS, 2 * MS)
    for number in range(STEP_AFTER):
        assert sync.offset.offset_ns == 0 and sync.steps == 0
        exchange(sync, T0 + (12 + number) * S, 5 * S, 2 * MS, 2 * MS)
    assert sync.offset.offset_ns == 5 * S and sync.steps == 1


def test_a_slow_drift_is_no_outlier() -> None:
    sync = TimeSync()
    for number in range(600):
        exchange(sync, T0 + number * S, number * 30_000, MS, MS)  # 30 ppm
    assert sync.rejected == 0 and sync.steps == 0
    assert sync.offset is not None and abs(sync.offset.offset_ns - 599 * 30_000) < MS


def test_answers_that_nobody_asked_for_change_nothing() -> None:
    sync = TimeSync()
    assert len(ask(sync, T0)) == 1 and sync.data_to_send(T0) == []
    receive(sync, T0 + 5 * MS, T0 + S, T0 + 1)  # of another
    receive(sync, T0 - 1, T0 + S, T0)  # before it was asked
    receive(sync, T0 + 2 * S, T0 + S, T0)  # far too late
    assert sync.offset is None and sync.rejected == 3
    receive(sync, T0 + 4 * MS, T0 + 2 * MS, T0)
    receive(sync, T0 + 4 * MS, T0 + S, T0)  # the same once more
    assert sync.offset is not None and sync.offset.offset_ns == 0 and sync.rejected == 4


def test_random_answers_never_raise_nor_grow() -> None:
    sync, noise = TimeSync(), random.Random(1)
    for _ in range(20_000):
        receive(sync, noise.randrange(T0), noise.randrange(-(2**63), 2**63), noise.randrange(-(2**63), 2**63))
    assert len(sync.data_to_send(T0)) <= 16 and sync.offset is None


def test_an_answer_takes_the_middle_of_its_wait() -> None:
    """Who asks, and takes half of the round trip away, gets our time right, though the answer waited for a tick."""
    sync = TimeSync()
    theirs_ns, out_ns, wait_ns, back_ns = 777 * S, 3 * MS, 40 * MS, 3 * MS
    received_ns = T0 + out_ns
    receive(sync, received_ns, 0, theirs_ns)
    (answer,) = sync.data_to_send(received_ns + wait_ns)
    tc1, ts1 = answer.tc1, answer.ts1
    assert ts1 == theirs_ns and sync.data_to_send(received_ns + wait_ns) == []
    arrival_theirs_ns = theirs_ns + out_ns + wait_ns + back_ns
    assert tc1 - (ts1 + arrival_theirs_ns) // 2 == T0 - theirs_ns


# --- on the wire -------------------------------------------------------------------------------------------------


def config() -> Config:
    return load_config("sitl")


def packed(message, system_id: int = 1, component_id: int = 1) -> bytes:  # type: ignore[no-untyped-def]
    return bytes(message.pack(dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)))


def timesyncs(frames) -> list[tuple[int, int]]:  # type: ignore[no-untyped-def]
    messages = [decode(data) for frame in frames for data in FrameSplitter().receive(frame.data)]
    return [(m.tc1, m.ts1) for m in messages if m.get_type() == "TIMESYNC"]


def test_the_autopilot_asks_and_is_answered_and_only_its_own_answers_count() -> None:
    link = ArduRoverAutopilot(config().links.autopilot, config().vehicle.pwm)
    link.receive(Frame(t_ns=T0, port="autopilot", data=packed(dialect.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3))))
    link.receive(Frame(t_ns=T0 + 10, port="autopilot", data=packed(dialect.MAVLink_timesync_message(0, 99))))
    sent = timesyncs(link.data_to_send(T0 + 30))
    assert sent == [(0, T0 + 30), (T0 + 20, 99)]
    answer = dialect.MAVLink_timesync_message(5, T0 + 30)
    link.receive(Frame(t_ns=T0 + 40, port="autopilot", data=packed(answer, 1, 194)))
    assert link.clock is None
    link.receive(Frame(t_ns=T0 + 40, port="autopilot", data=packed(answer)))
    assert link.clock is not None and link.clock.offset_ns == 5 - (T0 + 35) and link.clock.round_trip_ns == 10


def test_a_ground_station_asks_and_is_answered_where_it_is() -> None:
    link = OperatorSession(config().links.autopilot)
    asked = packed(dialect.MAVLink_timesync_message(0, 42), 255, 190)
    answered = packed(dialect.MAVLink_timesync_message(7, 42), 255, 190)
    for peer, data in (("a", asked), ("b", answered)):
        assert link.receive(Frame(t_ns=T0, port="operator", data=data, peer=peer)) == []
    frames = [frame for frame in link.data_to_send(T0 + 20) if timesyncs([frame])]
    assert timesyncs(frames) == [(T0 + 10, 42)] and frames[0].peer == "a"


def test_the_simulated_autopilots_clock_is_found_in_the_loop() -> None:
    loop = Lockstep(config())
    for _ in range(200):
        _, outputs = loop.tick()
    clock = outputs.autopilot_clock
    assert clock is not None and clock.exchanges >= 5
    power_on_ns = loop.plant.frontseat.rover.power_on_ns
    # The simulated link takes no time at all, but each end acts only at its own loop.
    assert abs(clock.offset_ns + power_on_ns) <= clock.round_trip_ns // 2 <= 25 * MS
