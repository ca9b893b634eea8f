"""A log replayed with faults in its inputs: what the backseat would have noticed and done. Open loop.

The boat of a log moves as it did, by the commands that it got. So these are what the motors get here too, wherever both
the record and this backseat drive them: sticks and outputs that were reported then answer the commands, and neither the
pilot watch, the readback nor the watch over the motion takes the edits for a fault of the boat. What the backseat would
have sent instead is compared. Once it drives while the record's boat was released, nothing more can be judged.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from asvhil.backseat.build import build_backseat
from asvhil.config import FaultConfig, PwmConfig
from asvhil.controller.pwm import PulseLimiter
from asvhil.errors import ConfigError, LogError
from asvhil.logs.clock import TickClock
from asvhil.logs.encoding import decode_outputs, encode_outputs, first_difference
from asvhil.logs.fault_edits import FaultEdits
from asvhil.logs.holds import PhaseSpans
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import check_begin, config_of, recorded_model
from asvhil.types import Note, Outputs, record

_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")


class RecordedPulses:
    """In the place of the limiter: the pulses that the record sent, where it sent any in this tick.

    `wanted_us` is what the limiter would have sent in this tick, None where the motors are not driven. `alone`: they
    were to be driven by the controller, and the record's were released.
    """

    def __init__(self, pwm: PwmConfig) -> None:
        self._limiter = PulseLimiter(pwm)
        self._recorded_us: tuple[int, int] | None = None
        self.wanted_us: tuple[int, int] | None = None
        self.alone = False

    def begin_tick(self, recorded_us: tuple[int, int] | None) -> None:
        """The pulses of the record in the tick that is about to be stepped, None where it had released the motors."""
        self._recorded_us, self.wanted_us, self.alone = recorded_us, None, False

    def reset(self) -> None:
        self._limiter.reset()

    def neutral(self) -> tuple[int, int]:
        self.wanted_us = self._limiter.neutral()
        return self._recorded_us or self.wanted_us

    def step(self, t_ns: int, command: tuple[float, float]) -> tuple[int, int]:
        self.wanted_us = self._limiter.step(t_ns, command)
        self.alone = self._recorded_us is None
        return self._recorded_us or self.wanted_us


@record
class Noticed:
    """What the backseat makes of a log with faults in it. Times (s) are those of a report.

    `edited`: frames that are not as recorded; `untouched`: ports that the faults should show on, and no edit can.
    `first_difference`: tick from 0, time, and the first field of the outputs that differs; None where none does.
    `recorded_holds`, `holds`: as `PhaseSpans.holds` has them. `notes`: (time, subject, text, ok) when first told, of
    those that the record has not at that time. `estimate_off_m`, `pulses_apart_us`: the largest distance of the
    estimates, and of the pulses that would have been sent from those that were. `judged_to_s`: from then on this
    backseat drives and the record does not; None: to the end.
    """

    ticks: int
    span_s: float
    edited: int
    untouched: tuple[str, ...]
    first_difference: tuple[int, float, str] | None
    recorded_holds: tuple[dict[str, Any], ...]
    holds: tuple[dict[str, Any], ...]
    notes: tuple[tuple[float, str, str, bool], ...]
    estimate_off_m: float
    pulses_apart_us: int
    judged_to_s: float | None


class _NewNotes:
    """The notes that a record has not, each kind of text once, with its time."""

    def __init__(self) -> None:
        self.told: list[tuple[float, str, str, bool]] = []
        self._seen: set[tuple[str, str]] = set()

    def add(self, t_s: float, notes: Sequence[Note], recorded: Sequence[Note]) -> None:
        there = {_kind_of(note) for note in recorded}
        for note in notes:
            kind = _kind_of(note)
            if kind not in there and kind not in self._seen:
                self._seen.add(kind)
                self.told.append((t_s, note.subject, note.text, note.ok))


def replay_with_faults(
    path: Path, faults: Sequence[FaultConfig], on_tick: Callable[[int], None] = lambda ticks: None
) -> Noticed:
    """Step a fresh backseat through a log into which faults are put. LogError, ConfigError.

    The plug-ins of the run must have been loaded (`plugins.load_plugins`).
    """
    log = LogFile(path)
    check_begin(log)
    config = config_of(log, path)
    edits = FaultEdits(faults, config)
    _check_span(log, path, faults, 1.0 / config.daemon.tick_hz)
    pulses = RecordedPulses(config.vehicle.pwm)
    with recorded_model(log, path) as file:
        backseat = build_backseat(config, file, limiter=pulses)
    recorded_holds, holds, notes = PhaseSpans(), PhaseSpans(), _NewNotes()
    first: tuple[int, float, str] | None = None
    judged_to_s: float | None = None
    off_m, apart_us, ticks, t_s = 0.0, 0, 0, 0.0
    for inputs, data in log.ticks(up_to_gap=True):
        if data is None:
            break
        edited = edits.apply(inputs)
        t_s = round(edits.clock.t_s(inputs.t_ns), 3)
        was = decode_outputs(data, path)
        pulses.begin_tick(was.pwm_us)
        outputs = backseat.step(edited)
        recorded_holds.add(t_s, was.phase, was.health.reason)
        if judged_to_s is None and pulses.alone:
            judged_to_s = t_s
        if judged_to_s is None:
            if first is None and (field := first_difference(data, encode_outputs(outputs))):
                first = ticks, t_s, field
            holds.add(t_s, outputs.phase, outputs.health.reason)
            notes.add(t_s, outputs.health.notes, was.health.notes)
            off_m = max(off_m, _off_m(outputs, was))
            if was.pwm_us is not None and pulses.wanted_us is not None:
                apart_us = max(apart_us, *(abs(a - b) for a, b in zip(was.pwm_us, pulses.wanted_us, strict=True)))
        ticks += 1
        on_tick(ticks)
    if not ticks:
        raise LogError(f"{path}: holds no tick with outputs to compare")
    return Noticed(
        ticks=ticks,
        span_s=t_s,
        edited=edits.edited,
        untouched=edits.untouched,
        first_difference=first,
        recorded_holds=tuple(recorded_holds.holds),
        holds=tuple(holds.holds),
        notes=tuple(notes.told),
        estimate_off_m=off_m,
        pulses_apart_us=apart_us,
        judged_to_s=judged_to_s,
    )


def _check_span(log: LogFile, path: Path, faults: Sequence[FaultConfig], tick_s: float) -> None:
    """ConfigError where a fault begins behind the log's end: known at once, and not after a replay."""
    first_ns = next((inputs.t_ns for inputs, _ in log.ticks(up_to_gap=True)), None)
    end_ns = log.end_ns()
    last = max(faults, key=lambda fault: fault.from_s, default=None)
    if last is None or first_ns is None or end_ns is None or last.from_s <= (end_ns - first_ns) * 1e-9:
        return
    lasts_s = _duration_s(log, tick_s)
    if last.from_s > lasts_s:
        what = f"--fault {last.kind}@{last.from_s:g}: begins behind the end of {path}"
        raise ConfigError(f"{what}; a time of 0 to {lasts_s:.1f} s is expected")


def _duration_s(log: LogFile, tick_s: float) -> float:
    """As a report has it, by a reading of the whole: where times go back, the last one does not tell it."""
    clock, duration_s = TickClock(tick_s), 0.0
    for inputs, _ in log.ticks(up_to_gap=True):
        clock.tick(inputs.t_ns)
        duration_s = clock.t_s(inputs.t_ns)
    return duration_s


def _kind_of(note: Note) -> tuple[str, str]:
    return note.subject, _NUMBER.sub("#", note.text)


def _off_m(outputs: Outputs, was: Outputs) -> float:
    a, b = outputs.estimate, was.estimate
    return 0.0 if a is None or b is None else math.hypot(a.n_m - b.n_m, a.e_m - b.e_m)
