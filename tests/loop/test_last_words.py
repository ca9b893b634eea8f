"""What the guardian would send: every way to the motors stops by it, and making it up changes nothing."""

import functools
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import sequence
from asvhil.logs.encoding import encode_outputs
from asvhil.types import Frame, Outputs, Phase
from tests.loop.test_ground_station_pilot import PilotLoop
from tests.loop.test_ways_to_the_motors import NEUTRAL, WAYS, SeveredLoop, config, driven
from tests.support.copies import on_a_copy
from tests.support.parts import one_in

STEP_NS = 50_000_000


def say(loop: SeveredLoop | PilotLoop, steps: list[list[Frame]]) -> list[tuple[int, int]]:
    """Deliver last words as the guardian would: the outputs after each step."""
    outputs = []
    for frames in steps:
        loop.deliver(tuple(frames))
        loop.t_ns += STEP_NS
        loop.plant.advance(loop.t_ns)
        outputs.append(loop.plant.frontseat.outputs_us)
    return outputs


@pytest.mark.parametrize("way", WAYS)
def test_every_way_is_neutral_at_once_and_stays_so(way: str) -> None:
    loop = driven(way)
    steps = loop.backseat.last_words(loop.t_ns)
    assert len(steps) >= 6 and len({sequence(frame.data) for frames in steps for frame in frames}) == sum(
        map(len, steps)
    ), "no frame looks like a copy of another"

    def body() -> None:
        assert say(loop, steps) == [NEUTRAL] * len(steps)
        assert loop.left_alone(10.0) == NEUTRAL

    on_a_copy(body)


@functools.cache
def driven_without_receiver(way: str) -> PilotLoop:
    """A boat that is held and drives: for copies."""
    loop = PilotLoop(way).held()
    loop.wait(5.0, until=lambda outputs: min(abs(us - 1500) for us in loop.frontseat.outputs_us) > 100)
    assert min(abs(us - 1500) for us in loop.frontseat.outputs_us) > 100
    return loop


@pytest.mark.parametrize("way", ["rc_override", "manual_control", "script"])
@pytest.mark.parametrize(
    "lost", [(0, 1), *(pytest.param(lost, marks=pytest.mark.thorough) for lost in ((), (0,), (3,), (4, 5)))]
)
def test_without_a_receiver_the_motors_do_not_run_on(way: str, lost: tuple[int, ...]) -> None:
    """Neutral goes alone, long before the release, with which it would have no effect; some of it may get lost."""
    loop = driven_without_receiver(way)
    steps = loop.backseat.last_words(loop.t_ns)

    def body() -> None:
        outputs = say(loop, [[] if i in lost else frames for i, frames in enumerate(steps)])
        assert outputs[3:] == [NEUTRAL] * (len(steps) - 3)
        for seconds in (0.5, 2.0, 8.0):
            loop.plant.advance(loop.t_ns + round(seconds * 1e9))
            assert loop.frontseat.outputs_us == NEUTRAL

    on_a_copy(body)


def test_there_are_none_where_the_motors_are_not_ours() -> None:
    loop = PilotLoop("rc_override")
    assert loop.backseat.last_words(loop.t_ns) == []
    loop.held()
    loop.wait(2.0)
    assert loop.backseat.last_words(loop.t_ns)
    seat = loop.frontseat
    seat.set_sticks({2: 1900})  # the pilot, by a stick that is not overridden
    seat.set_mode(4)
    kinds = []
    for _ in range(40):
        outputs = loop.step()
        kinds.append((outputs.phase, len(loop.backseat.last_words(loop.t_ns))))
    assert kinds[-1] == (Phase.STANDBY, 0)
    ended = [count for phase, count in kinds if phase is Phase.STANDBY]
    assert ended[0] > 0 and sorted(ended, reverse=True) == ended, "until the last release has been sent"


def test_a_pilot_who_takes_the_motors_gets_no_neutral_from_the_dead() -> None:
    loop = PilotLoop("rc_override", "plant.frontseat.rc_receiver=true").held()
    loop.wait(2.0)
    neutral_and_release = len(loop.backseat.last_words(loop.t_ns))
    loop.frontseat.set_mode(4)
    while loop.step().phase is Phase.HOLD:
        pass
    assert 0 < len(loop.backseat.last_words(loop.t_ns)) < neutral_and_release


@pytest.mark.parametrize("way", one_in(2, WAYS))
def test_making_them_up_changes_nothing(way: str, tmp_path: Path) -> None:
    def outputs_of(*, asked: bool) -> list[bytes]:
        loop, found = SeveredLoop(config(way)), list[Outputs]()
        for _ in range(200):
            found.append(loop.tick()[1])
            if asked:
                loop.backseat.last_words(loop.t_ns)
        return [encode_outputs(outputs) for outputs in found]

    assert outputs_of(asked=True) == outputs_of(asked=False)


def test_the_scripts_orders_go_on_in_its_session() -> None:
    loop = PilotLoop("script").held()
    loop.wait(2.0)
    before = [loop.backseat.last_words(loop.t_ns) for _ in range(2)]
    assert before[0] == before[1]
    assert load_config("sitl").daemon.guardian
