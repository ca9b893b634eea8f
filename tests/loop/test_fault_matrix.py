"""The fault matrix: what breaks, on the approach, settled, and across the wind, and what is promised for it.

One of each fault's three runs is made, of every eighth one it is replayed through the fault, bit by bit; the two others
of each, and the other replays, are thorough tests. A boat is
brought to where a fault begins once, with a log; each fault is broken in on a copy of it, and a copy of the backseat is
given what the log has of that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from _pytest.mark.structures import ParameterSet

from asvhil.config import load_config
from asvhil.logs.encoding import encode_outputs, first_difference
from asvhil.logs.opening import open_recorder
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.logs.replay import replay
from asvhil.supervisor.fault_table import Reaction
from asvhil.types import Phase
from tests.support.copies import on_a_copy, with_a_file_of_its_own
from tests.support.fault_matrix import CONTROLLER, PHASES, ROWS, Fault, FaultLoop

AT_ONCE_S = 0.05
GOES_ON_S = 2.0  # so long after its hold has ended, or what broke was mended, a boat is looked at


def cases() -> Iterator[ParameterSet]:
    for number, fault in enumerate(ROWS):
        for at, phase in enumerate(PHASES):
            name = f"{fault.name}-{phase}"
            if number % len(PHASES) != at:
                yield pytest.param(fault, phase, False, marks=pytest.mark.thorough, id=name)
            elif number % 8 == 0:
                yield pytest.param(fault, phase, True, id=name)
            else:
                yield pytest.param(fault, phase, False, id=name)
                yield pytest.param(fault, phase, True, marks=pytest.mark.thorough, id=f"{name}-replayed")


Ready = Callable[[Fault, str], tuple[FaultLoop, Recorder, Path]]


@pytest.fixture(scope="module")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Ready:
    """The loop in which a fault begins, its recorder and its log: made once of those that are alike."""
    made: dict[object, tuple[FaultLoop, Recorder, Path]] = {}

    def loop_for(fault: Fault, phase: str) -> tuple[FaultLoop, Recorder, Path]:
        keys, from_s = PHASES[phase]
        key = fault.config, fault.keys, fault.setup, phase
        if key not in made:
            settings = load_config(fault.config, (*keys, *fault.keys))
            log = tmp_path_factory.mktemp("ready") / "log.mcap"
            recorder = open_recorder(settings, log, "lockstep", threaded=False)
            loop = FaultLoop(settings, recorder)
            if fault.setup is not None:
                fault.setup(loop)
            outputs = loop.wait(from_s)
            assert outputs.phase is Phase.HOLD, outputs.health.reason
            made[key] = loop, recorder, log
        return made[key]

    return loop_for


@pytest.mark.parametrize("fault, phase, is_replayed", list(cases()))
def test_a_fault_has_its_reaction(ready: Ready, fault: Fault, phase: str, is_replayed: bool, tmp_path: Path) -> None:
    loop, recorder, log = ready(fault, phase)

    own = tmp_path / "log.mcap"

    def break_in() -> None:
        with_a_file_of_its_own(log, own)
        react(fault, loop)
        recorder.close()
        assert recorder.error is None
        if fault in CONTROLLER:  # as good as another program, which is the one to replay
            result = replay(own)
            assert result.mismatch is None and result.compared == loop.ticks

    on_a_copy(break_in)
    if is_replayed and fault not in CONTROLLER:
        on_a_copy(lambda: follow(own, loop))


def follow(log: Path, loop: FaultLoop) -> None:
    """Step the backseat from where the fault begins through what the log has from then on."""
    ticks = list(LogFile(log).ticks())[loop.ticks :]
    assert len(ticks) > 30
    for tick, (inputs, recorded) in enumerate(ticks):
        outputs = encode_outputs(loop.backseat.step(inputs))
        assert outputs == recorded, f"tick {tick} of the fault: {first_difference(recorded or b'', outputs)}"


def react(fault: Fault, loop: FaultLoop) -> None:
    """Break the fault in, and see what becomes of it."""
    promise = fault.promise
    before_m = farthest_m = loop.off_m
    loop.begin(fault)
    ended_s: float | None = None
    code = ""
    period_s = loop.period_ns * 1e-9
    mended_s = fault.lasts_s or 0.0
    for tick in range(1, round(fault.watch_s / period_s) + 1):
        if ended_s is not None and tick * period_s > max(ended_s, mended_s) + GOES_ON_S:
            break
        if fault.mend is not None and fault.lasts_s is not None and tick == round(fault.lasts_s / period_s):
            fault.mend(loop)
        outputs = loop.step()
        if ended_s is None:
            farthest_m = max(farthest_m, loop.off_m)
            if outputs.phase is not Phase.HOLD:
                ended_s, code = tick * period_s, outputs.health.code
                assert loop.overrides_us[-1][:1] in ([], [(1500, 1500)], [(0, 0)])
        else:
            assert outputs.phase is not Phase.HOLD, "nobody has asked for a hold since"
            assert outputs.pwm_us in (None, (1500, 1500))
    if promise.reaction is Reaction.KEEP:
        assert ended_s is None, f"ended after {ended_s} s: {code}"
    else:
        assert ended_s is not None, "the hold went on"
        assert ended_s <= promise.within_s + AT_ONCE_S, (ended_s, code)
        assert code in promise.reasons, code
        if promise.reaction is Reaction.NEUTRAL and fault.motors_stop:
            assert loop.motors_stand_still, loop.plant.truth.outputs_us
    assert farthest_m - before_m <= fault.farther_m, (before_m, farthest_m)
