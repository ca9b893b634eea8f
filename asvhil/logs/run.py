"""One run as arrays, from its log: motion as measured, estimated and, of a simulated boat, true; commands; events."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np

from asvhil.backseat.build import build_decoder
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.dynamics.arrays import Array
from asvhil.errors import ConfigError, LogError
from asvhil.geo import LocalFrame, body_to_ned
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.io.sensors.decoder import Decoder
from asvhil.io.sensors.dropped import dropped_of
from asvhil.logs.clock import Stall, TickClock, TimeJump
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.holds import PhaseSpan, PhaseSpans
from asvhil.logs.metrics import MotionTrack
from asvhil.logs.plugins import check_decoding
from asvhil.logs.reader import LogFile, Timing
from asvhil.logs.replay import config_of
from asvhil.supervisor.energy import MEASURED
from asvhil.types import (
    Frame,
    GroundVelocity,
    Heading,
    Inputs,
    Learned,
    Note,
    Outputs,
    Position,
    Station,
    YawRate,
    changed,
    record,
)

READING_NS = 1_000_000_000  # a reading older than this is not the boat's state any more
MAGIC, WHOLE_LEAST = 0xFD, 12  # the first byte of a frame of MAVLink 2, and its length without payload
_NUMBER = re.compile(r"[0-9]+(\.[0-9]+)?")


@record
class StageSpan:
    """Consecutive solutions of one hold in one stage of the station keeping procedure; times (s) of first and last."""

    stage: str
    hold: int
    from_s: float
    to_s: float


@record
class NoteEvent:
    """A note that came, changed in words other than its numbers, or went (empty text)."""

    t_s: float
    subject: str
    text: str
    ok: bool


@record
class RunLog:
    """The data of a run for its figures and its pictures. Times are seconds since the first tick, jumps left out.

    A jump is one of the clock; the time of a stall is in.

    `measured` are the readings of the sources in use, calibrated; `estimated` is what the backseat made of them;
    `truth` comes from a simulator's SIM_STATE. `measured` is None where the sensors need a plug-in that is not loaded.
    """

    config: Config
    metadata: dict[str, dict[str, str]]
    start_ns: int
    duration_s: float
    ticks: int
    measured: MotionTrack | None
    estimated: MotionTrack
    truth: MotionTrack | None
    spans: tuple[PhaseSpan, ...]
    stages: tuple[StageSpan, ...]
    events: tuple[NoteEvent, ...]
    station: Station | None  # the last one held
    wind: Array  # rows of (t_s, speed m/s, direction the wind blows toward, rad, number of the hold)
    wind_origin: str | None  # of the last of them: "sensor", or "disturbance" where none has measured it
    pwm: Array  # rows of (t_s, port us, starboard us), NaN where released
    command: Array  # rows of (t_s, port, starboard in [-1, 1], number of the hold), one per solution
    energy: (
        Array  # rows of (t_s, Wh of the hold so far, 1 measured or 0 by the curve, number of the hold), NaN: unknown
    )
    plans: list[tuple[float, Array]]  # (t_s, rows of t, n, e, psi)
    model_error: Array  # rows of (t_s, u, v, r one step ahead, u, v, r at the horizon, ok)
    phases_s: dict[str, float]
    step_ms: Array  # rows of (t_s, ms)
    overruns: int
    counters: dict[str, int]
    sources: dict[str, str]  # the one in use for each quantity at the end, empty where none was heard
    source_shares: dict[str, dict[str, float]]  # of the time since one was first heard; empty name: none was
    dropped: dict[str, dict[str, int]]  # by sensor link and cause
    notes: dict[str, str]
    learned: Learned | None = None  # at the end
    jumps: tuple[TimeJump, ...] = ()  # of the clock, which no time has
    stalls: tuple[Stall, ...] = ()  # of the program: time in which the boat drifted
    damage: str | None = None  # what is wrong with the log, where it is not whole: the data end there
    damaged_records: tuple[str, ...] = ()  # of the log; the figures do not depend on them
    first_tick: int = 1  # another of a later segment, read alone: sums and counts are then of that segment


def read_run(path: Path, plan_every_s: float = 10.0, on_tick: Callable[[int], None] = lambda ticks: None) -> RunLog:
    """Read a log into arrays; `on_tick` is told how many ticks are read.

    LogError where the file is no asvhil log or holds no tick."""
    log = LogFile(path)
    config = config_of(log, path, known_only=True)
    reader = RunReader(config, _decoder(log, path, config), plan_every_s)
    before: tuple[tuple[str, int], ...] | None = None  # what was counted up to the first tick
    for inputs, recorded in log.ticks(reader.timing.append, up_to_gap=True):
        outputs = None if recorded is None else decode_outputs(recorded, path)
        if before is None and outputs is not None:
            before = outputs.health.counters
        reader.tick(inputs, outputs)
        on_tick(reader.ticks)
    if not reader.ticks:
        raise LogError(f"{path}: holds no tick with outputs")
    run = changed(reader.run(log.metadata), damage=log.damage, damaged_records=tuple(log.damaged.values()))
    return run if log.first_tick == 1 else _alone(run, log.first_tick, dict(before or ()))


class RunReader:
    """Makes a `RunLog` of the ticks of a run: those of its log, or as they happen.

    `decoder` decodes the sensors as the backseat did; without one there is nothing measured. `timing` is to be filled
    by the caller, where it is known.
    """

    def __init__(self, config: Config, decoder: Decoder | None, plan_every_s: float = 10.0) -> None:
        self._config, self._decoder = config, decoder
        self._reading = _Reading(plan_every_s)
        self._sensors: _Sensors | None = None
        self._tick_s = 1.0 / config.daemon.tick_hz
        self._clock = TickClock(self._tick_s)
        self._stalled_s: defaultdict[str, float] = defaultdict(float)
        self._step_ms: list[tuple[float, ...]] = []
        self.timing: list[Timing] = []

    @property
    def ticks(self) -> int:
        """How many ticks with outputs there were."""
        return self._reading.ticks

    def tick(self, inputs: Inputs, outputs: Outputs | None) -> None:
        """Take in the next tick; None where the log ends before its outputs."""
        if self._sensors is None:
            self._sensors = _Sensors(inputs.t_ns, self._decoder, self._clock)
        sensors = self._sensors
        self._take_timing()
        self._take_stall(inputs.t_ns)
        for frame in inputs.frames:
            sensors.read(frame)
        if outputs is not None:
            self._reading.read(self._clock.t_s(inputs.t_ns), outputs, sensors)
        sensors.forget()

    def _take_timing(self) -> None:
        """What the steps so far took, by the clock of their ticks."""
        for row in self.timing[len(self._step_ms) :]:
            self._step_ms.append((self._clock.t_s(row.t_ns), row.step_ns * 1e-6))

    def _take_stall(self, t_ns: int) -> None:
        """The next tick begins: the time without one is of the phase of the tick before."""
        before = len(self._clock.stalls)
        self._clock.tick(t_ns)
        if self._reading.last is not None:
            for stall in self._clock.stalls[before:]:
                self._stalled_s[self._reading.last.phase] += stall.for_s - self._tick_s

    def _phases_s(self) -> dict[str, float]:
        phases = sorted(self._reading.phases.items())
        return {phase: round(count * self._tick_s + self._stalled_s[phase], 3) for phase, count in phases}

    def run(self, metadata: dict[str, dict[str, str]]) -> RunLog:
        """What was read, with the log's metadata. ValueError of no tick."""
        reading, sensors = self._reading, self._sensors
        last = reading.last
        if last is None or sensors is None:
            raise ValueError("no tick with outputs")
        reading.end()
        self._take_timing()
        jumps_s = tuple(jump.at_s for jump in self._clock.jumps)
        start_ns, origin_deg = sensors.start_ns, last.origin_deg
        local = None if origin_deg is None else LocalFrame(lat_deg=origin_deg[0], lon_deg=origin_deg[1])
        return RunLog(
            config=self._config,
            metadata=metadata,
            start_ns=start_ns,
            duration_s=self._clock.t_s(last.t_ns),
            ticks=reading.ticks,
            measured=None if sensors.decoder is None else _placed(reading.measured, local, jumps_s),
            estimated=_track(reading.estimated, jumps_s),
            truth=_placed(reading.truth, local, jumps_s) if reading.truth and local is not None else None,
            spans=reading.spans.all,
            stages=tuple(reading.stages),
            events=tuple(reading.events),
            station=reading.station,
            wind=_rows(reading.wind, 4),
            wind_origin=reading.wind_origin,
            pwm=_rows(reading.pwm, 3),
            command=_rows(reading.command, 4),
            energy=_rows(reading.energy, 4),
            plans=reading.plans,
            model_error=_rows(reading.model_error, 8),
            phases_s=self._phases_s(),
            step_ms=_rows(self._step_ms, 2),
            overruns=sum(row.overrun for row in self.timing),
            counters=dict(last.health.counters),
            sources=dict(last.health.sources),
            source_shares={quantity: _shares(counts) for quantity, counts in reading.used.items()},
            dropped=dropped_of(last.health.counters),
            notes={note.subject: note.text for note in last.health.notes},
            learned=last.learned,
            jumps=tuple(self._clock.jumps),
            stalls=tuple(self._clock.stalls),
        )


# t_s, latitude, longitude (degrees) or n, e (m), psi, arm forward, to starboard, velocity north, east, yaw rate
Sample = tuple[float, ...]
# n, e, psi of the station, NaN where there is none; its velocity north, east; number of the hold
Held = tuple[float, float, float, float, float, float]


class _Sensors:
    """What the frames of a tick say of the boat's motion: readings of the sources in use, and SIM_STATE.

    A sample comes with each position; heading, speed and yaw rate are the last ones, NaN where there are none.
    """

    def __init__(self, start_ns: int, decoder: Decoder | None, clock: TickClock) -> None:
        self._t_s = clock.t_s
        self.start_ns = start_ns
        self.decoder = decoder
        self.measured: list[Sample] = []
        self.truth: list[Sample] = []
        self._parser = Parser()
        self._psi = self._rate = (start_ns - 2 * READING_NS, math.nan)
        self._velocity: GroundVelocity | None = None

    def forget(self) -> None:
        """Begin the next tick."""
        self.measured.clear()
        self.truth.clear()

    def read(self, frame: Frame) -> None:
        """Take in a frame of the backseat's inputs."""
        if frame.port == AUTOPILOT and not _is_another(frame.data):
            for data in self._parser.receive(frame.peer, frame.data):
                if message_id(data) == dialect.MAVLINK_MSG_ID_SIM_STATE and (m := decode(data)) is not None:
                    place = m.lat_int * 1e-7, m.lon_int * 1e-7
                    self.truth.append((self._t_s(frame.t_ns), *place, m.yaw, 0.0, 0.0, m.vn, m.ve, m.zgyro))
        if self.decoder is None:
            return
        fixes: list[Position] = []
        for m in self.decoder.decode(frame):
            match m:
                case Heading():
                    self._psi = m.t_ns, m.psi_rad
                case YawRate():
                    self._rate = m.t_ns, m.r_radps
                case GroundVelocity():
                    self._velocity = m
                case Position():
                    fixes.append(m)
                case _:
                    pass
        for m in fixes:
            psi_rad, rate_radps = _at(m.t_ns, self._psi), _at(m.t_ns, self._rate)
            if not math.isnan(psi_rad):
                velocity = self._velocity_mps(m.t_ns, psi_rad, rate_radps)
                place = m.lat_deg, m.lon_deg
                self.measured.append((self._t_s(m.t_ns), *place, psi_rad, *m.arm_m, *velocity, rate_radps))

    def _velocity_mps(self, t_ns: int, psi_rad: float, rate_radps: float) -> tuple[float, float]:
        """Velocity over ground of the boat's origin, north and east."""
        v = self._velocity
        if v is None or t_ns - v.t_ns > READING_NS:
            return math.nan, math.nan
        if not any(v.arm_m):
            return v.vn_mps, v.ve_mps
        arm_n, arm_e = body_to_ned(psi_rad, *v.arm_m)
        return v.vn_mps + rate_radps * arm_e, v.ve_mps - rate_radps * arm_n


class _Reading:
    """Collects the outputs of the ticks, and with them what the sensors said."""

    def __init__(self, plan_every_s: float) -> None:
        self._plan_every_s = plan_every_s
        self._noted: dict[str, str] = {}
        self._stage: tuple[str, int, float, float] | None = None
        self.ticks = 0
        self.last: Outputs | None = None
        self.spans = PhaseSpans()
        self.station: Station | None = None
        self.measured: list[tuple[Sample, Held]] = []
        self.estimated: list[tuple[Sample, Held]] = []
        self.truth: list[tuple[Sample, Held]] = []
        self.stages: list[StageSpan] = []
        self.events: list[NoteEvent] = []
        self.wind: list[tuple[float, ...]] = []
        self.wind_origin: str | None = None
        self.pwm: list[tuple[float, ...]] = []
        self.command: list[tuple[float, ...]] = []
        self.energy: list[tuple[float, ...]] = []
        self.plans: list[tuple[float, Array]] = []
        self.model_error: list[tuple[float, ...]] = []
        self.phases: Counter[str] = Counter()
        self.used: dict[str, Counter[str]] = {}

    def read(self, t_s: float, outputs: Outputs, sensors: _Sensors) -> None:
        """Take in a tick: its samples belong to the station and the hold of its outputs."""
        self.ticks += 1
        self.last = outputs
        self.phases[outputs.phase] += 1
        self.spans.add(t_s, outputs.phase, outputs.health.reason, outputs.health.code)
        hold, station = self.spans.hold, outputs.station
        pose = (math.nan,) * 3 if station is None else (station.n_m, station.e_m, station.psi_rad)
        moves = (0.0, 0.0) if station is None else (station.vn_mps, station.ve_mps)
        held: Held = (pose[0], pose[1], pose[2], *moves, float(hold))
        self.measured += [(sample, held) for sample in sensors.measured]
        self.truth += [(sample, held) for sample in sensors.truth]
        if hold:
            self.station = station
        if (e := outputs.estimate) is not None:
            velocity = body_to_ned(e.psi_rad, e.u_mps, e.v_mps)
            self.estimated.append(((t_s, e.n_m, e.e_m, e.psi_rad, 0.0, 0.0, *velocity, e.r_radps), held))
        if outputs.wind is not None:
            vn, ve = outputs.wind.vn_mps, outputs.wind.ve_mps
            self.wind.append((t_s, math.hypot(vn, ve), math.atan2(ve, vn), hold))
            self.wind_origin = outputs.wind.origin
        self.pwm.append((t_s, *(outputs.pwm_us or (math.nan, math.nan))))
        if hold and (use := outputs.energy) is not None:
            measured = float(use.by == MEASURED) if use.by else math.nan
            self.energy.append((t_s, math.nan if use.hold_wh is None else use.hold_wh, measured, hold))
        if outputs.control is not None:
            self.command.append((t_s, *outputs.control.command, hold))
            if outputs.control.plan and (not self.plans or t_s - self.plans[-1][0] >= self._plan_every_s):
                self.plans.append((t_s, np.array(outputs.control.plan)))
            self._take_stage(t_s, outputs.control.stage, hold)
        if (error := outputs.model_error) is not None:
            self.model_error.append((t_s, *error.one_step, *error.horizon, error.ok))
        for quantity, source in outputs.health.sources:
            if source or quantity in self.used:
                self.used.setdefault(quantity, Counter())[source] += 1
        if outputs.health.notes or self._noted:
            self._take_notes(t_s, outputs.health.notes)

    def end(self) -> None:
        """Close what is open."""
        if self._stage is not None and self._stage[0]:
            stage, hold, from_s, to_s = self._stage
            self.stages.append(StageSpan(stage=stage, hold=hold, from_s=from_s, to_s=to_s))
        self._stage = None

    def _take_stage(self, t_s: float, stage: str, hold: int) -> None:
        if self._stage is not None and self._stage[:2] == (stage, hold):
            self._stage = (*self._stage[:3], t_s)
            return
        self.end()
        self._stage = stage, hold, t_s, t_s

    def _take_notes(self, t_s: float, notes: tuple[Note, ...]) -> None:
        kinds = {note.subject: _NUMBER.sub("#", note.text) for note in notes}
        if kinds == self._noted:
            return
        self.events += [
            NoteEvent(t_s=t_s, subject=note.subject, text=note.text, ok=note.ok)
            for note in notes
            if self._noted.get(note.subject) != kinds[note.subject]
        ]
        gone = (subject for subject in self._noted if subject not in kinds)
        self.events += [NoteEvent(t_s=t_s, subject=subject, text="", ok=True) for subject in gone]
        self._noted = kinds


def _is_another(data: bytes) -> bool:
    """Whether these bytes are one whole frame of MAVLink 2 without signature, and not SIM_STATE: most are."""
    whole = len(data) >= WHOLE_LEAST and data[0] == MAGIC and len(data) == data[1] + WHOLE_LEAST
    return whole and message_id(data) != dialect.MAVLINK_MSG_ID_SIM_STATE


def _at(t_ns: int, reading: tuple[int, float]) -> float:
    """The value of a reading (time, value) at a time; NaN where it is too old."""
    return math.nan if t_ns - reading[0] > READING_NS else reading[1]


def _decoder(log: LogFile, path: Path, config: Config) -> Decoder | None:
    """What decoded the sensors in the run; None where that needs a plug-in that is not loaded."""
    try:
        check_decoding(log, path, config)
        return build_decoder(config)
    except (LogError, ConfigError):
        return None


def _placed(samples: list[tuple[Sample, Held]], local: LocalFrame | None, jumps_s: tuple[float, ...]) -> MotionTrack:
    """The track of samples in latitude and longitude, at the boat's origin; empty where there is no local frame."""
    if local is None:
        return _track([], jumps_s)
    found: list[tuple[Sample, Held]] = []
    for (t_s, lat_deg, lon_deg, psi_rad, *arm_m, vn_mps, ve_mps, rate_radps), held in samples:
        n_m, e_m = local.to_ned(lat_deg, lon_deg)
        if any(arm_m):
            arm_n, arm_e = body_to_ned(psi_rad, arm_m[0], arm_m[1])
            n_m, e_m = n_m - arm_n, e_m - arm_e
        found.append(((t_s, n_m, e_m, psi_rad, 0.0, 0.0, vn_mps, ve_mps, rate_radps), held))
    return _track(found, jumps_s)


def _track(samples: list[tuple[Sample, Held]], jumps_s: tuple[float, ...]) -> MotionTrack:
    rows = _rows([(*sample, *held) for sample, held in samples], 15)
    return MotionTrack(
        t_s=rows[:, 0],
        pose=rows[:, 1:4],
        speed_mps=np.hypot(rows[:, 6] - rows[:, 12], rows[:, 7] - rows[:, 13]),
        yaw_rate_radps=rows[:, 8],
        station=rows[:, 9:12],
        moves=(rows[:, 12:14] != 0.0).any(axis=1),
        hold=rows[:, 14].astype(int),
        jumps_s=jumps_s,
    )


def _alone(run: RunLog, first_tick: int, before: dict[str, int]) -> RunLog:
    """A later segment without what the segments before it have counted and summed up; counters only grow."""
    counters = {name: count - before.get(name, 0) for name, count in run.counters.items()}
    return changed(
        run,
        first_tick=first_tick,
        energy=_energy_since(run.energy),
        counters=counters,
        dropped=dropped_of(tuple(counters.items())),
    )


def _energy_since(energy: Array) -> Array:
    """The rows of `RunLog.energy` without what the first of their holds had used before the first of them."""
    if not len(energy) or math.isnan(energy[0, 1]):  # not known before: the sum begins in these rows
        return energy
    since = energy.copy()
    since[energy[:, 3] == energy[0, 3], 1] -= energy[0, 1]
    return since


def _shares(counts: Counter[str]) -> dict[str, float]:
    """Of their sum, the greatest first."""
    return {name: count / counts.total() for name, count in counts.most_common()}


def _rows(rows: list[tuple[float, ...]], width: int) -> Array:
    return np.array(rows, dtype=float).reshape(-1, width)
