"""Deviation of the compass and offset of the wind vane, out of a log in which the boat has turned under way.

The compass: the filter itself, over the recorded readings, with the coefficients of the deviation unknown. Gyro and
compass give what depends on the heading; acceleration and the model's sway against the receiver's velocity give the
constant.

The vane: what it tells is the true wind less the boat's velocity, seen from a bow that is turned by the vane's offset.
A Kalman filter of three states holds the true wind, which wanders as gusts do, and the offset, which stays. At
rest an offset turns the wind alone and cannot be seen; under way it can.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from asvhil.backseat.build import build_decoder, build_model
from asvhil.config import CompassConfig, Config, PwmConfig
from asvhil.controller.pwm import command_of_pulse
from asvhil.errors import AsvhilError
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.states import DEVIATION, FilterState
from asvhil.estimator.wind import WindFilter
from asvhil.geo import body_to_ned, ned_to_body, wrap_2pi, wrap_rad
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of, recorded_model
from asvhil.types import ApparentWind, Estimate, FrontseatStatus, Outputs, record

COEFFICIENTS = ("A, constant", "B, sin psi", "C, cos psi", "D, sin 2 psi", "E, cos 2 psi")
UNKNOWN_DEG = 10.0  # standard deviation of each coefficient before the log
# What the filter goes on with afterwards: iron moves about on a boat, and the model's sway is not the boat's.
KEPT_DEG, WALK_DEG = 1.0, 0.02
SECTORS, SECTOR_S = 12, 2.0  # headings that must have been seen, and for how long each
VANE_STEP_RAD = math.tau / 16.0
CUPS_STD_MPS = 0.1
GUST, GUST_TIME_S = 0.15, 15.0  # of the mean wind
VANE_STD_MAX_DEG = 3.0  # circles at speed in light wind leave 2
VANE_LEAST_STDS = 2.0  # an offset of less may be none
COMPASS_STD_MAX_DEG = 3.0  # circles under way leave 0.5, circles on the spot 2 of the constant
SETTLED_S = 10.0  # of the filter, before the wind is looked at


@record
class CompassFit:
    """Coefficients A to E of the deviation and their standard deviations (degrees); `sectors` of 12 were seen."""

    deviation_deg: tuple[float, ...]
    std_deg: tuple[float, ...]
    sectors: int


@record
class VaneFit:
    """How far the vane's zero is turned clockwise from the bow, and its standard deviation (degrees)."""

    offset_deg: float
    std_deg: float


@record
class CalibrationResult:
    """What a log tells; a part that it does not tell is None, and the reason is in `missing`."""

    span_s: float
    compass: CompassFit | None
    vane: VaneFit | None
    missing: tuple[str, ...]

    def yaml(self) -> str:
        """The keys of a config that take it into account."""
        lines = ["estimator:"]
        if self.compass is not None:
            values = ", ".join(f"{value:.2f}" for value in self.compass.deviation_deg)
            lines += [
                "  ekf:",
                f"    compass: {{deviation_deg: [{values}], std_deg: {KEPT_DEG:g}, walk_deg: {WALK_DEG:g}}}",
            ]
        if self.vane is not None:
            lines += ["  wind:", f"    vane_offset_deg: {self.vane.offset_deg:.1f}"]
        return "\n".join(lines) + "\n"


def calibrate(path: Path, on_tick: Callable[[int], None] = lambda ticks: None) -> CalibrationResult:
    """Read a log. AsvhilError where it holds nothing to calibrate from."""
    log = LogFile(path)
    recorded_config = config_of(log, path)
    configured_deg = recorded_config.estimator.wind.vane_offset_deg
    config = _unknown(recorded_config)
    with recorded_model(log, path) as file:
        ekf = Ekf(config.estimator, build_model(config, file))
    decoder = build_decoder(config)
    wind, vane, headings = WindFilter(config.estimator.wind), _Vane(), _Headings()
    status: FrontseatStatus | None = None
    first_ns = last_ns = 0
    for ticks, (inputs, recorded) in enumerate(log.ticks(), start=1):
        first_ns, last_ns = first_ns or inputs.t_ns, inputs.t_ns
        for frame in inputs.frames:
            measurements = decoder.decode(frame)
            ekf.on_measurements(measurements)
            for m in measurements:
                match m:
                    case FrontseatStatus():
                        status = m
                    case ApparentWind():
                        estimate = ekf.estimate(m.t_ns)
                        if estimate is not None:
                            wind.on_apparent_wind(m, estimate)
                            if m.t_ns - first_ns > SETTLED_S * 1e9:
                                vane.take(m, estimate)
                    case _:
                        pass
        estimate = ekf.estimate(inputs.t_ns)
        if estimate is not None:
            headings.take(estimate)
        outputs = decode_outputs(recorded, log.path) if recorded is not None else None
        command = _command(config.vehicle.pwm, outputs, status)
        now = wind.wind(inputs.t_ns)
        ekf.set_forcing(
            ekf.model.input_of_command(command), (now.vn_mps, now.ve_mps) if now is not None and now.valid else None
        )
        on_tick(ticks)
    state = ekf.state
    if state is None:
        raise AsvhilError(f"{path}: holds no position with a heading; there is nothing to calibrate from")
    compass, unknown = _compass_fit(state, headings.sectors)
    missing = [unknown] if unknown else []
    fit, unknown = vane_of(vane.fit(), configured_deg)
    missing += [unknown] if unknown else []
    if compass is None and fit is None:
        raise AsvhilError(f"{path}: {'; '.join(missing)}")
    return CalibrationResult(span_s=(last_ns - first_ns) * 1e-9, compass=compass, vane=fit, missing=tuple(missing))


def vane_of(fit: VaneFit | None, configured_deg: float) -> tuple[VaneFit | None, str]:
    """The offset of the vane where it is one to correct; else None, and why not. `configured_deg`: that of the log."""
    if fit is None:
        return None, "vane: no apparent wind in the log"
    found = f"vane: turned by {fit.offset_deg:.1f} deg, standard deviation {fit.std_deg:.1f}: not written"
    if fit.std_deg > VANE_STD_MAX_DEG:
        return None, f"{found}, above {VANE_STD_MAX_DEG:g}; drive circles at speed, in light wind, for longer"
    if abs(fit.offset_deg) <= VANE_LEAST_STDS * fit.std_deg:
        old = f"; remove estimator.wind.vane_offset_deg, which is {configured_deg:g}" if configured_deg else ""
        return None, f"{found}, as it may be straight{old}"
    return fit, ""


def _compass_fit(state: FilterState, sectors: int) -> tuple[CompassFit | None, str]:
    """What the filter has learned of the compass; else None, and why it is not known."""
    if sectors < SECTORS:
        return None, f"compass: {sectors} of {SECTORS} headings seen; drive full circles, both ways"
    std_deg = np.degrees(np.sqrt(np.diag(state.p)[DEVIATION])).tolist()
    worst = int(np.argmax(std_deg))
    if std_deg[worst] > COMPASS_STD_MAX_DEG:
        known = f"compass: {COEFFICIENTS[worst]}, known to {std_deg[worst]:.0f} degrees only"
        return None, f"{known}; drive circles under way, with a receiver's own velocity in sources.velocity"
    deviation_deg = np.degrees(state.x[DEVIATION]).tolist()
    return CompassFit(deviation_deg=tuple(deviation_deg), std_deg=tuple(std_deg), sectors=sectors), ""


def _unknown(config: Config) -> Config:
    """The config of a log, with a compass and a vane of which nothing is known: its decoder gives raw readings."""
    estimator = config.estimator
    ekf = estimator.ekf.model_copy(update={"compass": CompassConfig(std_deg=UNKNOWN_DEG)})
    wind = estimator.wind.model_copy(update={"vane_offset_deg": 0.0})
    return config.model_copy(update={"estimator": estimator.model_copy(update={"ekf": ekf, "wind": wind})})


def _command(pwm: PwmConfig, outputs: Outputs | None, status: FrontseatStatus | None) -> tuple[float, float]:
    """The motor commands of a tick: what was sent, or else what the autopilot says that it gives out."""
    pulses = outputs.pwm_us if outputs is not None else None
    if pulses is None:
        reported = status.motors_us if status is not None else None
        pulses = reported or (0, 0)
    return command_of_pulse(pwm, pulses[0]), command_of_pulse(pwm, pulses[1])


class _Headings:
    """How long each twelfth of the circle was headed for."""

    def __init__(self) -> None:
        self._last_ns: int | None = None
        self._seconds = [0.0] * SECTORS

    def take(self, estimate: Estimate) -> None:
        if self._last_ns is not None:
            sector = int(wrap_2pi(estimate.psi_rad) / math.tau * SECTORS) % SECTORS
            self._seconds[sector] += (estimate.t_ns - self._last_ns) * 1e-9
        self._last_ns = estimate.t_ns

    @property
    def sectors(self) -> int:
        return sum(seconds >= SECTOR_S for seconds in self._seconds)


class _Vane:
    """Three states: true wind north and east (m/s), and the offset of the vane (rad)."""

    def __init__(self) -> None:
        self._x = np.zeros(3)
        self._p = np.diag([100.0, 100.0, 1.0])
        self._t_ns: int | None = None

    def take(self, sample: ApparentWind, estimate: Estimate) -> None:
        """One sample of the apparent wind with the boat's motion at its time."""
        if not (math.isfinite(sample.speed_mps) and math.isfinite(sample.from_rad)):
            return
        elapsed_s = 0.0 if self._t_ns is None else (sample.t_ns - self._t_ns) * 1e-9
        self._t_ns = sample.t_ns
        wind_mps = math.hypot(self._x[0], self._x[1])
        self._p[[0, 1], [0, 1]] += 2.0 * (GUST * max(wind_mps, 1.0)) ** 2 / GUST_TIME_S * elapsed_s
        # The air's velocity against the boat, along the vane's zero and to its right.
        bow_rad = estimate.psi_rad + self._x[2]
        c, s = math.cos(bow_rad), math.sin(bow_rad)
        vn, ve = body_to_ned(estimate.psi_rad, estimate.u_mps, estimate.v_mps)
        along, right = ned_to_body(bow_rad, self._x[0] - vn, self._x[1] - ve)
        h = np.array([[c, s, right], [-s, c, -along]])
        told = -sample.speed_mps * np.array([math.cos(sample.from_rad), math.sin(sample.from_rad)])
        noise = CUPS_STD_MPS**2 + (sample.speed_mps * VANE_STEP_RAD) ** 2 / 12.0
        ph = self._p @ h.T
        gain = np.linalg.solve(h @ ph + noise * np.eye(2), ph.T).T
        self._x = self._x + gain @ (told - (along, right))
        keep = np.eye(3) - gain @ h
        self._p = keep @ self._p @ keep.T + noise * gain @ gain.T

    def fit(self) -> VaneFit | None:
        """The offset as it is known by now; None without a sample."""
        if self._t_ns is None:
            return None
        offset_deg, std_deg = math.degrees(wrap_rad(self._x[2])), math.degrees(math.sqrt(self._p[2, 2]))
        return VaneFit(offset_deg=offset_deg, std_deg=std_deg)
