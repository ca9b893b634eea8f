"""The measurements of one log by quantity, through the same decoder as in the backseat."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from asvhil.backseat.build import build_decoder
from asvhil.config import Config
from asvhil.config.ports import ANEMOMETER, AUTOPILOT
from asvhil.controller.pwm import command_of_pulse
from asvhil.errors import LogError
from asvhil.geo import ned_to_body
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.plugins import check_decoding
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of
from asvhil.train.series import Series, interpolate, rotate, series, without_outliers
from asvhil.types import (
    ApparentWind,
    BowWind,
    Frame,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    Outputs,
    TrueWind,
    YawRate,
    record,
)


@record
class LogSeries:
    """Each quantity with its own times (s since the first tick), without outliers."""

    heading: Series  # psi (continuous)
    yaw_rate: Series  # r
    velocity: Series  # vn, ve of the boat's origin
    wind: Series  # speed, from; whether that is from the bow (1) or from north (0); whether it is apparent (1) or true
    command: Series  # port, starboard in [-1, 1]; stretches where it is unknown are missing
    estimate: Series  # u, v, r, psi (continuous)
    truth: Series  # u, v, r, psi (continuous)
    outliers: int  # number of outliers left out
    wind_link: bool = False  # whether the config has a link that wind should have come on


KEPT = 8  # logs
_kept: dict[tuple[Path, int, int], LogSeries] = {}  # by path, size and time of the last change; the oldest first


def read_log_series(path: Path) -> LogSeries:
    """Read one log. LogError where the file is none, holds no tick, or needs a plug-in to be decoded.

    A training reads the same log for its measurements, for its truth, and for the scores: the last few are kept.
    """
    log = LogFile(path)
    config = config_of(log, path, known_only=True)
    check_decoding(log, path, config)
    key = log.path.resolve(), log.size, log.path.stat().st_mtime_ns
    if key not in _kept:
        _kept[key] = _decoded(log, path, config)
        if len(_kept) > KEPT:
            del _kept[next(iter(_kept))]
    return _kept[key]


def _decoded(log: LogFile, path: Path, config: Config) -> LogSeries:
    reader: _Reader | None = None
    for inputs, recorded in log.ticks():
        reader = _Reader(config, inputs.t_ns) if reader is None else reader
        for frame in inputs.frames:
            reader.read_input(frame)
        if recorded is not None:
            reader.read_output(inputs.t_ns, decode_outputs(recorded, path))
    if reader is None:
        raise LogError(f"{path}: holds no tick")
    heading, jumps_psi = without_outliers(_unwrapped(series(reader.heading, 1), 0), 0.5, 2.0, np.inf)
    yaw_rate, jumps_r = without_outliers(series(reader.yaw_rate, 1), 0.5, 2.0, np.inf)
    velocity = _at_origin(series(reader.velocity, 4), heading, yaw_rate)
    velocity, jumps_v = without_outliers(velocity, 1.0, 3.0, 30.0)
    return LogSeries(
        heading=heading,
        yaw_rate=yaw_rate,
        velocity=velocity,
        wind=series(reader.wind, 4),
        command=series(reader.command, 2),
        estimate=_unwrapped(series(reader.estimate, 4), 3),
        truth=_unwrapped(series(reader.truth, 4), 3),
        outliers=jumps_psi + jumps_r + jumps_v,
        wind_link=_has_wind_link(config),
    )


def _has_wind_link(config: Config) -> bool:
    links = config.links
    there = {AUTOPILOT, *links.sensors, *((ANEMOMETER,) if links.anemometer is not None else ())}
    wanted = {source.link for source in config.sources.wind} or {ANEMOMETER}
    return not wanted.isdisjoint(there)


class _Reader:
    """Decodes the frames of one log anew, as the backseat did, and keeps the measurements with their times.

    The truth is read from the simulated autopilot's SIM_STATE, which the backseat never decodes.
    """

    def __init__(self, config: Config, start_ns: int) -> None:
        self._start_ns = start_ns
        self._pwm = config.vehicle.pwm
        self._decoder = build_decoder(config)
        self._truth_parser = Parser()
        self._motors_us: tuple[int, int] | None = None
        self.heading: list[tuple[float, ...]] = []
        self.yaw_rate: list[tuple[float, ...]] = []
        self.velocity: list[tuple[float, ...]] = []
        self.wind: list[tuple[float, ...]] = []
        self.command: list[tuple[float, ...]] = []
        self.estimate: list[tuple[float, ...]] = []
        self.truth: list[tuple[float, ...]] = []

    def read_input(self, frame: Frame) -> None:
        """Decode a frame of the backseat's inputs."""
        for m in self._decoder.decode(frame):
            t_s = self._t_s(m.t_ns)
            match m:
                case Heading():
                    self.heading.append((t_s, m.psi_rad))
                case YawRate():
                    self.yaw_rate.append((t_s, m.r_radps))
                case GroundVelocity():
                    t_s = self._t_s(m.t_ns - m.age_ns)
                    self.velocity.append((t_s, m.vn_mps, m.ve_mps, *m.arm_m))
                case ApparentWind():
                    self.wind.append((t_s, m.speed_mps, m.from_rad, 1.0, 1.0))
                case BowWind():
                    self.wind.append((t_s, m.speed_mps, m.from_rad, 1.0, 0.0))
                case TrueWind():
                    from_rad = math.atan2(-m.ve_mps, -m.vn_mps)
                    self.wind.append((t_s, math.hypot(m.vn_mps, m.ve_mps), from_rad, 0.0, 0.0))
                case FrontseatStatus():
                    self._motors_us = m.motors_us
                case _:
                    pass
        if frame.port == AUTOPILOT:
            self._take_truth(frame)

    def _take_truth(self, frame: Frame) -> None:
        t_s = self._t_s(frame.t_ns)
        for data in self._truth_parser.receive(frame.peer, frame.data):
            if message_id(data) == dialect.MAVLINK_MSG_ID_SIM_STATE and (m := decode(data)) is not None:
                u_mps, v_mps = ned_to_body(m.yaw, m.vn, m.ve)
                self.truth.append((t_s, u_mps, v_mps, m.zgyro, m.yaw))

    def read_output(self, t_ns: int, outputs: Outputs) -> None:
        """Read the outputs of a tick: its pulses or, while released, the outputs that the autopilot reports."""
        t_s = self._t_s(t_ns)
        pulses = outputs.pwm_us or self._motors_us
        if pulses is not None:
            self.command.append((t_s, *(command_of_pulse(self._pwm, pulse_us) for pulse_us in pulses)))
        if outputs.estimate is not None and outputs.estimate.valid:
            e = outputs.estimate
            self.estimate.append((t_s, e.u_mps, e.v_mps, e.r_radps, e.psi_rad))

    def _t_s(self, t_ns: int) -> float:
        return (t_ns - self._start_ns) * 1e-9


def _at_origin(antenna: Series, heading: Series, yaw_rate: Series) -> Series:
    """Velocity of the boat's origin (vn, ve) from that of an antenna (vn, ve, arm forward, arm to starboard)."""
    velocity, arm = antenna.values[:, :2], antenna.values[:, 2:]
    if arm.any() and len(heading.t_s) and len(yaw_rate.t_s):
        arm_n, arm_e = rotate(interpolate(heading, antenna.t_s)[:, 0], arm).T
        r = interpolate(yaw_rate, antenna.t_s)[:, 0]
        velocity = velocity - r[:, None] * np.stack([-arm_e, arm_n], axis=-1)
    return Series(t_s=antenna.t_s, values=velocity)


def _unwrapped(source: Series, column: int) -> Series:
    values = source.values.copy()
    values[:, column] = np.unwrap(values[:, column])
    return Series(t_s=source.t_s, values=values)
