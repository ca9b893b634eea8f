"""What a log holds: its run, its channels with their rates, its holds, and whether it is whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
from mcap.records import Channel, Message

from asvhil.errors import LogError
from asvhil.logs.clock import clock_of, jump_words, stall_words
from asvhil.logs.encoding import NOT_VALID, decode_outputs
from asvhil.logs.holds import PhaseSpans
from asvhil.logs.reader import LogFile, begin_words, decode_timing, gap_words
from asvhil.logs.recorder import INPUTS_TOPIC, OUTPUTS_TOPIC, TIMING_TOPIC


class _Config(msgspec.Struct):
    class Controller(msgspec.Struct):
        name: str

    controller: Controller


def log_info(path: Path, on_bytes: Callable[[int], None] = lambda done: None) -> dict[str, Any]:
    """The figures of a log as a JSON-ready tree, of all that is intact. LogError where the file is no log of asvhil.

    Times are seconds since the first tick, rates are means over the channel's own span. `damage` holds a line for each
    piece that is not intact; a whole log has none.
    """
    log = LogFile(path)
    channels: dict[int, Channel] = {}
    counts: Counter[int] = Counter()
    sizes: Counter[int] = Counter()
    span_ns: dict[int, tuple[int, int]] = {}
    damage = list(log.damaged.values())
    phases: Counter[str] = Counter()
    spans = PhaseSpans()
    run, stored = log.metadata.get("run", {}), log.metadata.get("config", {})
    config = _config(stored.get("json", ""))
    clock = clock_of(log.metadata)
    first_ns: int | None = None
    last_ns = 0
    ticks = dropped = overruns = 0
    sequence = log.first_tick - 1  # of a later segment, read alone: those before it are no loss
    for offset, piece in log.pieces():
        on_bytes(offset)
        if isinstance(piece, LogError):
            damage.append(str(piece).removeprefix(f"{path}: "))
            continue
        for item in piece:
            if isinstance(item, Channel):
                channels[item.id] = item
            if not isinstance(item, Message) or item.channel_id not in channels:
                continue
            number = item.channel_id
            counts[number] += 1
            sizes[number] += len(item.data)
            span_ns[number] = span_ns.get(number, (item.log_time, 0))[0], item.log_time
            topic = channels[number].topic
            if topic == INPUTS_TOPIC:
                first_ns = item.log_time if first_ns is None else first_ns
                last_ns = item.log_time
                clock.tick(item.log_time, item.sequence)
                ticks += 1
                dropped += max(0, item.sequence - sequence - 1)
                if item.sequence <= sequence:
                    damage.append(gap_words(sequence + 1, item.sequence))
                sequence = item.sequence
            elif topic == OUTPUTS_TOPIC and first_ns is not None:
                outputs = decode_outputs(item.data, path)
                phases[outputs.phase] += 1
                spans.add(round(clock.t_s(outputs.t_ns), 3), outputs.phase, outputs.health.reason)
            elif topic == TIMING_TOPIC:
                overruns += decode_timing(item.data, path).overrun
    return {
        "log": str(path),
        "bytes": log.size,
        "segments": log.segments,
        "whole": not damage,
        "damage": damage,
        "recovered_from": log.metadata.get("recovered", {}).get("from"),
        "started": None if first_ns is None else _utc(first_ns),
        "duration_s": 0.0 if first_ns is None else clock.t_s(last_ns),
        "time_jumps": [{"tick": jump.tick, "at_s": jump.at_s, "by_s": jump.by_s} for jump in clock.jumps],
        "stalls": [{"tick": stall.tick, "at_s": stall.at_s, "for_s": stall.for_s} for stall in clock.stalls],
        "warnings": [*begin_words(log.first_tick), *jump_words(clock.jumps), *stall_words(clock.stalls)],
        "mode": run.get("mode"),
        "vehicle": run.get("vehicle"),
        "seed": run.get("seed") if run.get("mode") != "live" else None,
        "controller": None if config is None else config.controller.name,
        "model": log.metadata.get("model", {}).get("file"),
        "config_hash": stored.get("hash"),
        "versions": log.metadata.get("versions", {}),
        "first_tick": log.first_tick,
        "ticks": ticks,
        "ticks_dropped": dropped,
        "overruns": overruns,
        "phases": {phase: count for phase, count in phases.most_common()},
        "holds": spans.holds,
        "channels": [
            {
                "topic": channels[number].topic,
                "peer": channels[number].metadata.get("peer", ""),
                "via": channels[number].metadata.get("via", ""),
                "encoding": channels[number].message_encoding,
                "messages": count,
                "bytes": sizes[number],
                "rate_hz": _rate_hz(count, *span_ns[number]),
            }
            for number, count in sorted(counts.items(), key=lambda part: (channels[part[0]].topic, part[0]))
        ],
    }


def _config(text: str) -> _Config | None:
    try:
        return msgspec.json.decode(text, type=_Config)
    except NOT_VALID:
        return None


def _rate_hz(count: int, first_ns: int, last_ns: int) -> float | None:
    return (count - 1) / ((last_ns - first_ns) * 1e-9) if last_ns > first_ns else None


def _utc(t_ns: int) -> str:
    return datetime.fromtimestamp(t_ns * 1e-9, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
