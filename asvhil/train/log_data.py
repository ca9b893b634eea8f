"""Aligned training data out of logs of asvhil: the recorded bytes are decoded again, nothing is taken on trust."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from asvhil.autopilot.mavlink_autopilot import PORT
from asvhil.backseat.build import build_link
from asvhil.config import Config
from asvhil.controller.pwm import command_of_pulse
from asvhil.errors import LogError
from asvhil.geo import ned_to_body
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.train.records import Array, Dataset, Segment, source_hash
from asvhil.train.series import (
    VELOCITY_HALF_WIDTH_S,
    YAW_HALF_WIDTH_S,
    Series,
    change_phase_s,
    common,
    grid,
    hold_mean,
    interpolate,
    low_pass,
    rotate,
    series,
    smooth,
    smooth_mean,
    spans,
    without_outliers,
)
from asvhil.types import Attitude, Frame, FrontseatStatus, GnssFix, WindSample, record

Source = Literal["smoothed", "measured", "estimate", "truth"]

MIN_DATA_S = 30.0
MIN_SEGMENT_S = 2.0
WIND_GAP_S = 5.0
WIND_HALF_WIDTHS_S = (12.0, 1.0)  # direction, speed
WIND_TIME_CONSTANTS_S = (4.0, 0.5)  # the same where looking ahead is not allowed


@record
class _Raw:
    """What one log holds, each source with its own times (s since the first tick)."""

    attitude: Series  # psi (continuous), r
    velocity: Series  # vn, ve
    wind: Series  # apparent: speed, from
    command: Series  # port, starboard in [-1, 1]; stretches where it is unknown are missing
    estimate: Series  # u, v, r, psi (continuous)
    truth: Series  # u, v, r, psi (continuous)
    outliers: int


def dataset_from_logs(
    paths: Sequence[Path], dt_s: float, source: Source = "smoothed", max_gap_s: float = 0.6
) -> Dataset:
    """All logs as one dataset. LogError names the file that is none, too short (30 s), or without what is asked for.

    Sources of u, v, r. `measured`: velocity and heading messages, interpolated; for test data. `smoothed`: the same
    through local quadratic fits, which look ahead; for training data. `estimate`: the backseat's filter, which
    believes in a vessel model. `truth`: SIM_STATE. RMSE against the truth over 90 s of manoeuvres (simulated WAM-V
    in 6 m/s of steady wind, the true parameters; u, v in m/s, r in rad/s): measured .042/.042/.0064, estimate
    .020/.026/.0066, smoothed .028/.024/.0029. Smoothed is the default: as near as the estimate, and no model that is
    trained on it learns another model's mistakes.

    Commands are the overrides that were sent, and where the motors were released the outputs that the autopilot
    reports. Rows begin when commands change. Gaps beyond max_gap_s in any source end a segment.
    """
    segments: list[Segment] = []
    outliers = 0
    for path in paths:
        raw = _read(path)
        segments += _segments(path, raw, dt_s, source, max_gap_s)
        outliers += raw.outliers
    return Dataset(dt_s=dt_s, segments=tuple(segments), source_hash=source_hash(paths), outliers=outliers)


def truth_from_log(path: Path, dt_s: float, max_gap_s: float = 0.6) -> Dataset:
    """The simulated truth (SIM_STATE) on the same rows as `dataset_from_logs([path], dt_s)`; the wind is measured."""
    return dataset_from_logs([path], dt_s, "truth", max_gap_s)


def _segments(path: Path, raw: _Raw, dt_s: float, source: Source, max_gap_s: float) -> list[Segment]:
    for name, what in (("attitude", raw.attitude), ("velocity", raw.velocity), ("motor commands", raw.command)):
        if len(what.t_s) < 2:
            raise LogError(f"{path}: holds no {name}: nothing to train on")
    if source == "truth" and len(raw.truth.t_s) < 2:
        raise LogError(f"{path}: holds no SIM_STATE: the truth is known of simulated runs only")
    shared = spans(raw.attitude.t_s, max_gap_s)
    for other in (raw.velocity, raw.command):
        shared = common(shared, spans(other.t_s, max_gap_s))
    if len(raw.wind.t_s):
        shared = common(shared, spans(raw.wind.t_s, max(WIND_GAP_S, max_gap_s)))
    phase_s = change_phase_s(raw.command, dt_s)
    segments = [
        _segment(raw, times, dt_s, source)
        for times in (grid(span, dt_s, phase_s) for span in shared)
        if len(times) * dt_s >= MIN_SEGMENT_S
    ]
    total_s = dt_s * sum(len(segment.t_s) for segment in segments)
    if total_s < MIN_DATA_S:
        raise LogError(f"{path}: {total_s:.1f} s of usable data, at least {MIN_DATA_S:.0f} s are needed")
    return segments


def _segment(raw: _Raw, t_s: Array, dt_s: float, source: Source) -> Segment:
    attitude = interpolate(raw.attitude, t_s)
    psi = attitude[:, 0]
    body = Series(t_s=raw.velocity.t_s, values=rotate(-_psi_at(raw, raw.velocity.t_s), raw.velocity.values))
    if source == "smoothed":
        yaw = smooth(raw.attitude, t_s, YAW_HALF_WIDTH_S)
        psi = yaw[:, 0]
        nu = np.column_stack([smooth(body, t_s, VELOCITY_HALF_WIDTH_S), yaw[:, 1]])
    elif source == "measured":
        nu = np.column_stack([interpolate(body, t_s), attitude[:, 1]])
    else:
        state = interpolate(raw.estimate if source == "estimate" else raw.truth, t_s)
        nu, psi = state[:, :3], state[:, 3]
    return Segment(
        t_s=t_s,
        nu=nu,
        command=np.clip(hold_mean(raw.command, t_s, dt_s), -1.0, 1.0),
        wind=rotate(-psi, _true_wind(raw, t_s, ahead=source == "smoothed")),
        psi=psi,
    )


def _true_wind(raw: _Raw, t_s: Array, *, ahead: bool) -> Array:
    """(T, 2) velocity of the air over ground, NED: apparent wind turned by the heading, plus the boat's, low-passed.

    A vane of 16 positions is wrong by up to 11 degrees for as long as the boat keeps its heading, while the cups are
    quick and true: so the direction is averaged for long, and the speed along it for a short time.
    """
    if len(raw.wind.t_s) == 0:
        return np.zeros((len(t_s), 2))
    speed, origin = raw.wind.values.T
    apparent = -speed[:, None] * np.stack([np.cos(origin), np.sin(origin)], axis=-1)
    over_ground = rotate(_psi_at(raw, raw.wind.t_s), apparent) + interpolate(raw.velocity, raw.wind.t_s)
    samples = Series(t_s=raw.wind.t_s, values=over_ground)
    if ahead:
        slow, quick = (smooth_mean(samples, t_s, half_width_s) for half_width_s in WIND_HALF_WIDTHS_S)
    else:
        slow, quick = (low_pass(samples, t_s, time_s) for time_s in WIND_TIME_CONSTANTS_S)
    along = slow / np.maximum(np.linalg.norm(slow, axis=1, keepdims=True), 1e-9)
    wind: Array = slow + along * ((quick - slow) * along).sum(axis=1, keepdims=True)
    return wind


def _psi_at(raw: _Raw, t_s: Array) -> Array:
    psi: Array = interpolate(raw.attitude, t_s)[:, 0]
    return psi


# --- reading ---------------------------------------------------------------------------------------------------


class _Reader:
    """Decodes the frames of one log anew, as the backseat did, and keeps the measurements with their times."""

    def __init__(self, config: Config, start_ns: int) -> None:
        self._start_ns = start_ns
        self._pwm = config.vehicle.pwm
        self._link = build_link(config)
        self._anemometer = NmeaCodec("anemometer")
        self._truth_parser = Parser()
        self._outputs_us: tuple[int, ...] = ()
        self.attitude: list[tuple[float, ...]] = []
        self.velocity: list[tuple[float, ...]] = []
        self.wind: list[tuple[float, ...]] = []
        self.command: list[tuple[float, ...]] = []
        self.estimate: list[tuple[float, ...]] = []
        self.truth: list[tuple[float, ...]] = []

    def take_in(self, frame: Frame) -> None:
        """A frame that the backseat was given."""
        t_s = self._t_s(frame.t_ns)
        if frame.port == "anemometer":
            self.wind += [(t_s, sample.speed_mps, sample.from_rad) for sample in self._anemometer.decode(frame)]
            return
        if frame.port != PORT:
            return
        for measurement in self._link.decode(frame):
            match measurement:
                case Attitude():
                    self.attitude.append((t_s, measurement.psi_rad, measurement.r_radps))
                case GnssFix():
                    self.velocity.append((t_s, measurement.vn_mps, measurement.ve_mps))
                case FrontseatStatus():
                    self._outputs_us = measurement.outputs_us
                case WindSample():
                    self.wind.append((t_s, measurement.speed_mps, measurement.from_rad))
                case _:
                    pass
        for data in self._truth_parser.feed(frame.peer, frame.data):
            if message_id(data) == dialect.MAVLINK_MSG_ID_SIM_STATE and (m := decode(data)) is not None:
                u_mps, v_mps = ned_to_body(m.yaw, m.vn, m.ve)
                self.truth.append((t_s, u_mps, v_mps, m.zgyro, m.yaw))

    def take_out(self, t_ns: int, recorded: bytes) -> None:
        """What the backseat did in a tick: its pulses; where it let go, the outputs that the autopilot reports."""
        outputs = decode_outputs(recorded)
        t_s = self._t_s(t_ns)
        pulses = outputs.pwm_us
        if pulses is None:
            port, starboard = (self._output_us(c) for c in (self._pwm.port_channel, self._pwm.starboard_channel))
            pulses = (port, starboard) if port is not None and starboard is not None else None
        if pulses is not None:
            self.command.append((t_s, *(command_of_pulse(self._pwm, pulse_us) for pulse_us in pulses)))
        if outputs.estimate is not None and outputs.estimate.valid:
            e = outputs.estimate
            self.estimate.append((t_s, e.u_mps, e.v_mps, e.r_radps, e.psi_rad))

    def _output_us(self, channel: int) -> int | None:
        return self._outputs_us[channel - 1] if len(self._outputs_us) >= channel else None

    def _t_s(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) * 1e-9


def _read(path: Path) -> _Raw:
    log = LogFile(path)
    config = config_of(log, path, known_only=True)
    reader: _Reader | None = None
    for inputs, recorded in log.ticks():
        reader = _Reader(config, inputs.t_ns) if reader is None else reader
        for frame in inputs.frames:
            reader.take_in(frame)
        if recorded is not None:
            reader.take_out(inputs.t_ns, recorded)
    if reader is None:
        raise LogError(f"{path}: holds no tick")
    attitude, jumps_psi = without_outliers(_unwrapped(series(reader.attitude, 2), 0), 0.5, 2.0, np.inf)
    velocity, jumps_v = without_outliers(series(reader.velocity, 2), 1.0, 3.0, 30.0)
    return _Raw(
        attitude=attitude,
        velocity=velocity,
        wind=series(reader.wind, 2),
        command=series(reader.command, 2),
        estimate=_unwrapped(series(reader.estimate, 4), 3),
        truth=_unwrapped(series(reader.truth, 4), 3),
        outliers=jumps_psi + jumps_v,
    )


def _unwrapped(source: Series, column: int) -> Series:
    values = source.values.copy()
    values[:, column] = np.unwrap(values[:, column])
    return Series(t_s=source.t_s, values=values)
