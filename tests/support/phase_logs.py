"""Logs of made ticks that go through phases, each with a reason."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from asvhil.config import load_config
from asvhil.logs.opening import open_recorder
from asvhil.types import Phase, changed
from tests.support.log_samples import sample_inputs, sample_outputs

Ticks: TypeAlias = tuple[int, Phase, str, str]  # how many, with their reason and its code


def record_phases(log: Path, *spans: Ticks) -> Path:
    """A log of phases in their order, of ticks of 0.05 s."""
    recorder = open_recorder(load_config("field"), log, "live", threaded=False)
    tick = 0
    for ticks, phase, reason, code in spans:
        for _ in range(ticks):
            outputs = sample_outputs(tick, control=phase is Phase.HOLD)
            health = changed(outputs.health, reason=reason, code=code)
            recorder.write_inputs(sample_inputs(tick))
            recorder.write_outputs(changed(outputs, phase=phase, health=health))
            tick += 1
    recorder.close()
    return log


def hold(ticks: int) -> Ticks:
    return ticks, Phase.HOLD, "holding", "holding"
