"""The fault matrix: what breaks, on the approach, settled, and across the wind, and what is promised for it.

One of each fault's three runs is recorded, and replayed through the fault, bit by bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from asvhil.controller.station_mpc import StationMpc
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.supervisor.fault_table import Reaction
from asvhil.types import Phase
from tests.support.fault_matrix import PHASES, ROWS, Fault, FaultLoop, settings_of

AT_ONCE_S = 0.05


@pytest.fixture(autouse=True)
def whole_controller() -> Iterator[None]:
    step = StationMpc.step
    yield
    StationMpc.step = step  # type: ignore[method-assign]


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("fault", ROWS, ids=[fault.name for fault in ROWS])
def test_a_fault_has_its_reaction(fault: Fault, phase: str, tmp_path: Path) -> None:
    keys, from_s = PHASES[phase]
    promise = fault.promise
    log = tmp_path / "log.mcap"
    settings = settings_of(fault, keys, from_s)
    is_replayed = ROWS.index(fault) % len(PHASES) == list(PHASES).index(phase)
    recorder = open_recorder(settings, log, "lockstep", threaded=False) if is_replayed else None
    loop = FaultLoop(fault, settings, recorder)
    outputs = loop.wait(from_s)
    assert outputs.phase is Phase.HOLD, outputs.health.reason
    before_m = loop.off_m
    if fault.act is not None:
        fault.act(loop)
    ended_s: float | None = None
    code = ""
    farthest_m = before_m
    period_s = loop.period_ns * 1e-9
    for tick in range(1, round(fault.watch_s / period_s) + 1):
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
    if recorder is not None:
        recorder.close()
        assert recorder.error is None
        result = replay(log)
        assert result.mismatch is None, result.mismatch
        assert result.compared == result.ticks > 200
