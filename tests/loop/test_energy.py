"""The energy of a hold, told tick by tick, is that of its log, and of the pulses that were sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase

# Made up here: full power is in proportion to the command.
POWER = "vehicle.power={power_curve: [[-1, 100], [0, 0], [1, 200]], hotel_w: 10, capacity_wh: 50}"


def test_a_hold_by_the_curve_is_told_logged_and_replayed(tmp_path: Path) -> None:
    config = load_config("sitl", (POWER, "controller.name=backstepping"))
    recorder = open_recorder(config, tmp_path / "log.mcap", "lockstep", threaded=False)
    loop = Lockstep(config, recorder)
    joule, told, holds = 0.0, [], 0
    for _ in range(16 * 20):
        _, outputs = loop.tick()
        use = outputs.energy
        assert use is not None
        if outputs.phase is not Phase.HOLD:
            assert use.hold_wh is None
            continue
        if holds:
            assert use.hold_wh == pytest.approx(joule / 3600.0)
        assert outputs.pwm_us is not None and use.by == "curve"
        power_w = 10.0 + sum(0.5 * p if p > 0 else -0.25 * p for p in (us - 1500 for us in outputs.pwm_us))
        assert use.power_w == pytest.approx(power_w)
        joule, holds = joule + 0.05 * power_w, holds + 1
        told.append(use)
    recorder.close()
    last = told[-1]
    assert holds > 150 and last.hold_wh is not None and last.hold_wh > 0.1 and last.mean_w is not None
    assert last.hours_left == pytest.approx((50.0 - last.hold_wh) / last.mean_w, rel=0.01)
    figures = summarise(read_run(tmp_path / "log.mcap"))
    (hold,) = figures["holds"]
    assert (figures["energy_wh"], hold["energy_wh"]) == (last.hold_wh, last.hold_wh)
    assert figures["energy_by"] == hold["energy_by"] == "curve"
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == result.ticks
