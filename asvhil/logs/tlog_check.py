"""Codec and estimator run over a MAVLink telemetry log, compared with the autopilot's own estimate in it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.backseat.build import build_backseat
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.errors import LogError
from asvhil.geo import wrap_rad
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id, source
from asvhil.logs.tlog import read_tlog
from asvhil.types import Frame, Inputs

CONVERGED_AFTER_S = 10.0


def check_tlog(config: Config, path: Path, on_tick: Callable[[int], None] | None = None) -> dict[str, Any]:
    """Message counts by kind, and the errors of the estimate to the autopilot's position and heading.

    Ticks are cut at the config's tick rate along the log's own time. `cut_off` tells where the last record is cut off;
    what is before it counts. Raises LogError on a file that is damaged otherwise, or holds no whole record.
    """
    backseat = build_backseat(config)
    tick_ns = round(1e9 / config.daemon.tick_hz)
    counts: Counter[str] = Counter()
    undecoded = 0
    pending: list[Frame] = []
    position_m: list[float] = []
    heading_deg: list[float] = []
    theirs: dict[str, Any] = {}
    next_ns: int | None = None
    first_ns: int | None = None
    from_ns: int | None = None
    ticks = 0
    splitter = FrameSplitter(datagrams=True)
    autopilot = (config.links.autopilot.autopilot_system_id, config.links.autopilot.autopilot_component_id)
    cut: list[str] = []
    for unix_us, data in read_tlog(path, cut.append):
        t_ns = unix_us * 1000
        first_ns = t_ns if first_ns is None else first_ns
        next_ns = t_ns + tick_ns if next_ns is None else next_ns
        if t_ns - next_ns > 60_000_000_000:
            next_ns = t_ns  # the recording paused: continue at the next record
        while t_ns >= next_ns:
            inputs = Inputs(t_ns=next_ns, frames=tuple(pending))
            pending = []
            estimate = backseat.step(inputs).estimate
            ticks += 1
            next_ns += tick_ns
            if on_tick is not None and ticks % 50 == 0:
                on_tick(ticks)
            if estimate is not None and estimate.valid:
                from_ns = inputs.t_ns if from_ns is None else from_ns
                if (inputs.t_ns - from_ns) * 1e-9 >= CONVERGED_AFTER_S:
                    _compare(estimate, backseat.frame, theirs, position_m, heading_deg)
        pending.append(Frame(t_ns=t_ns, port=AUTOPILOT, data=data))
        for frame in splitter.receive(data):
            message = decode(frame)
            if message is None:
                undecoded += 1
                continue
            counts[message.get_type()] += 1
            if source(frame) == autopilot and message_id(frame) in (
                dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
                dialect.MAVLINK_MSG_ID_ATTITUDE,
            ):
                theirs[message.get_type()] = message
    if first_ns is None:
        raise LogError(f"{path}: holds no message{''.join(f'; {words}' for words in cut)}")
    undecoded += splitter.unknown + splitter.bad_crc
    return {
        "file": path.name,
        "cut_off": cut[0] if cut else None,
        "messages": dict(sorted(counts.items())),
        "undecoded": undecoded,
        "ticks": ticks,
        "estimate_s": None if from_ns is None or next_ns is None else (next_ns - from_ns) * 1e-9,
        "against_autopilot": None
        if not position_m or from_ns is None
        else {
            "from_s": (from_ns - first_ns) * 1e-9 + CONVERGED_AFTER_S,
            "samples": len(position_m),
            "position_m": {"mean": float(np.mean(position_m)), "max": float(np.max(position_m))},
            "heading_deg": {"mean": float(np.mean(heading_deg)), "max": float(np.max(heading_deg))},
        },
    }


def _compare(
    estimate: Any, local: Any, theirs: dict[str, Any], position_m: list[float], heading_deg: list[float]
) -> None:
    """Append the differences to the autopilot's last own position and heading."""
    position, attitude = theirs.get("GLOBAL_POSITION_INT"), theirs.get("ATTITUDE")
    if position is None or attitude is None:
        return
    n_m, e_m = local.to_ned(position.lat * 1e-7, position.lon * 1e-7)
    position_m.append(math.hypot(estimate.n_m - n_m, estimate.e_m - e_m))
    heading_deg.append(abs(math.degrees(wrap_rad(estimate.psi_rad - attitude.yaw))))
