"""How long the autopilot counts as alive, and its mode as known, where heartbeats get lost."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import pytest

from asvhil.io.mavlink.frames import decode, source
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Phase
from tests.support.lossy_plant import losing_messages, whole
from tests.support.shared_loop import S, SharedLoop


@pytest.mark.parametrize("lost_s", [0.9, 2.0, 3.0, 3.9])
def test_lost_heartbeats_end_no_hold_while_other_messages_come(lost_s: float) -> None:
    loop = SharedLoop("links.autopilot.streams_hz={HEARTBEAT: 1}").ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    loop.way = losing_messages(["HEARTBEAT"])
    outputs = loop.held(lost_s)
    if lost_s < 1.0 or lost_s >= 3.0:  # the last heartbeat came up to a second before
        assert bool([n for n in outputs.health.notes if n.subject == "autopilot's mode"]) == (lost_s >= 3.0)
    loop.way = whole
    loop.held(3.0)


def test_without_a_heartbeat_the_motors_are_neutral_once_the_mode_is_too_old() -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    loop.way = losing_messages(["HEARTBEAT"])
    assert loop.plant.frontseat.set_mode(4)  # the pilot's word, which the link loses
    start_ns, phases, asked = loop.t_ns, {}, 0
    while loop.t_ns - start_ns < 9 * S:
        _, outputs = loop.tick()
        phases.setdefault(outputs.phase, (loop.t_ns - start_ns) / S)
        asked += sum(
            m is not None and m.get_type() == "COMMAND_LONG" and (m.command, m.param1) == (512, 0.0)
            for m in map(decode, loop.sent)
        )
    # Whatever comes first: outputs that do not follow, or a mode that is too old.
    first = min(at for phase, at in phases.items() if phase is not Phase.HOLD)
    assert first <= 5.3 and outputs.phase is Phase.STANDBY
    assert asked > 5


def test_a_mode_that_is_asked_for_comes_back() -> None:
    """Only the heartbeats that stream are lost: those that were asked for come."""
    loop = SharedLoop("links.autopilot.streams_hz={HEARTBEAT: 0.05}").ready()
    outputs = loop.ask_to_hold()
    assert outputs.phase is Phase.HOLD, outputs.health.reason
    loop.held(25.0)


def test_of_frames_that_are_cut_none_is_lost() -> None:
    for size in (1, 64, 256):
        loop = SharedLoop()
        rest, sent = bytearray(), [0]

        def cut(frame: Frame, size: int = size, rest: bytearray = rest, sent: list[int] = sent) -> Iterable[Frame]:
            rest += frame.data
            sent[0] += 1
            while len(rest) >= size:
                yield dataclasses.replace(frame, data=bytes(rest[:size]))
                del rest[:size]

        loop.way = cut
        loop.ready()
        assert loop.ask_to_hold().phase is Phase.HOLD
        outputs = loop.held(5.0)
        counters = dict(outputs.health.counters)
        assert [counters[f"autopilot.{name}"] for name in ("bad_crc", "garbage_bytes", "lost")] == [0, 0, 0]
        waiting = 1 + size // 12  # at most: frames that end in what is not yet a whole piece
        assert sent[0] - waiting <= counters["autopilot.frames"] <= sent[0]


def test_the_autopilot_may_be_another_component_where_the_config_says_so() -> None:
    loop = SharedLoop("links.autopilot.autopilot_component_id=2")
    loop.ready()
    outputs = loop.ask_to_hold()
    assert outputs.phase is Phase.STANDBY and outputs.health.code == Reason.WAITING_FOR_HOLD
    (note,) = [n for n in outputs.health.notes if n.subject == "neighbours"]
    assert note.text.startswith("surface boat 1/1 is heard, 1/2 is not") and not note.ok
    assert all(source(data)[0] == 1 for data in loop.sent)
