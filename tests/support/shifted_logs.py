"""Logs whose times are other ones from a tick on: a stall of the program, or a jump of the clock."""

from __future__ import annotations

from pathlib import Path

from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.types import changed


def shifted(source: Path, target: Path, by_s: float, from_tick: int) -> Path:
    """The log with all times from a tick on, those of the frames of that tick too, another."""
    log = LogFile(source)
    recorder = Recorder(target, metadata=log.metadata, chunk_kib=128, sync_period_s=1.0, threaded=False)
    timing = [row.step_ns for row in log.timing()]
    for number, (inputs, data) in enumerate(log.ticks(), 1):
        by_ns = round(by_s * 1e9) if number >= from_tick else 0
        frames = tuple(changed(frame, t_ns=frame.t_ns + by_ns) for frame in inputs.frames)
        recorder.write_inputs(changed(inputs, t_ns=inputs.t_ns + by_ns, frames=frames))
        assert data is not None
        outputs = decode_outputs(data, source)
        recorder.write_outputs(changed(outputs, t_ns=outputs.t_ns + by_ns))
        recorder.write_timing(inputs.t_ns + by_ns, timing[number - 1], False)
    recorder.close()
    return target
