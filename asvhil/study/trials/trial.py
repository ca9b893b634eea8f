"""One run in lockstep without a log, scored against the truth and by the estimate: the unit of most studies."""

from __future__ import annotations

import functools
import hashlib
import json
import math
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.backseat.build import model_file
from asvhil.config import Config, load_config
from asvhil.errors import ConfigError
from asvhil.geo import LocalFrame, wrap_rad
from asvhil.logs.metrics import PoseErrors, motor_figures, score
from asvhil.logs.opening import open_recorder
from asvhil.logs.recorder import Recorder
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase

# No slow errors of position and velocity, and none assumed by the filter: they are the same for all controllers.
NO_SLOW_ERROR = (
    "plant.sensors.gnss.slow_bias_m=0",
    "plant.sensors.fused_velocity.slow_bias_mps=0",
    "links.autopilot.position_source=GLOBAL_POSITION_INT",
    "estimator.ekf.position_bias_std_m=0",
)
FIRST_STEPS = 10
ARRIVED_M = 2.0  # from the station: the way in is over
NO_NOISE = (
    "plant.weather.wind.gust_along=0",
    "plant.weather.wind.gust_across=0",
    *NO_SLOW_ERROR,
    "plant.sensors.gnss.white_m=0",
    "plant.sensors.gnss.velocity_white_mps=0",
    "plant.sensors.heading.white_deg=0",
    "plant.sensors.imu.gyro_white_radps=0",
    "plant.sensors.imu.accel_white_mps2=0",
    "plant.sensors.imu.accel_bias_mps2=0",
    "plant.sensors.anemometer.speed_white_mps=0",
    "plant.sensors.anemometer.directions=360",
)


def run_trial(config: Config, from_s: float, to_s: float, recorder: Recorder | None = None) -> dict[str, Any]:
    """Scores over [from_s, to_s] since the first tick, against truth and as measured, and the work of the motors.

    Scores are those of `metrics.score`, `motors` those of `metrics.motor_figures`; `energy_n2` is the mean squared
    thrust of one motor (N^2), `wind` the mean true wind over the window (m/s, blowing toward degrees from north).
    `held` is the share of the window in which the controller had the motors. `arrived_s` is the time of the first tick
    within `ARRIVED_M` of the station, None where there is none. With a recorder it is written to a log. Raises
    ConfigError where the config has no station to keep.
    """
    at = config.supervisor.station
    if at is None:
        raise ConfigError("key supervisor.station: a study needs a station to keep")
    loop = Lockstep(config, recorder)
    origin = LocalFrame(lat_deg=config.plant.origin_lat_deg, lon_deg=config.plant.origin_lon_deg)
    n_m, e_m = origin.to_ned(at.lat_deg, at.lon_deg)
    psi_rad = math.radians(at.heading_deg)
    truth_rows: list[tuple[float, float, float]] = []
    measured_rows: list[tuple[float, float, float]] = []
    thrust_n2 = held = ticks = wind_n_mps = wind_e_mps = 0.0
    arrived_s: float | None = None
    control_ms: list[float] = []
    commands: list[tuple[float, float, float, float]] = []
    for tick in range(1, round(to_s * config.daemon.tick_hz) + 1):
        start_s = time.perf_counter()
        _, outputs = loop.tick()
        elapsed_ms = (time.perf_counter() - start_s) * 1e3
        t_s = tick / config.daemon.tick_hz
        truth = loop.plant.truth
        off_m = math.hypot(truth.n_m - n_m, truth.e_m - e_m)
        if arrived_s is None and off_m <= ARRIVED_M:
            arrived_s = t_s
        truth_rows.append((t_s, off_m, math.degrees(wrap_rad(truth.psi_rad - psi_rad))))
        estimate, station = outputs.estimate, outputs.station
        if estimate is not None and station is not None:
            distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
            measured_rows.append((t_s, distance_m, math.degrees(wrap_rad(estimate.psi_rad - station.psi_rad))))
        if outputs.control is not None:
            control_ms.append(elapsed_ms)
            if t_s >= from_s:
                commands.append((t_s, *outputs.control.command, 1.0))
        if t_s >= from_s:
            ticks += 1
            held += outputs.phase is Phase.HOLD
            wind_n_mps += truth.wind_n_mps
            wind_e_mps += truth.wind_e_mps
            thrust_n2 += 0.5 * (truth.thrust_n[0] ** 2 + truth.thrust_n[1] ** 2)
    return {
        "truth": _score(truth_rows, from_s),
        "measured": _score(measured_rows, from_s),
        "energy_n2": thrust_n2 / ticks,
        "motors": motor_figures(np.array(commands)),
        "wind": {
            "speed_mps": math.hypot(wind_n_mps, wind_e_mps) / ticks,
            "toward_deg": math.degrees(math.atan2(wind_e_mps, wind_n_mps)),
        },
        "held": held / ticks,
        "arrived_s": arrived_s,
        "control_tick_ms": _times(control_ms) if control_ms else None,
    }


def run_key(config: Config) -> str:
    """Hashes of the config and of its model file: all that a run in lockstep depends on, except the code.

    Only what differs from the defaults counts, so that a key which is new in the code leaves the runs of before their
    keys; a default that has another value is a change of the code. ConfigError, before any run, where its boat cannot
    have its faults.
    """
    config.check_faults()
    tree = config.model_dump(mode="json", exclude_defaults=True)
    tree["plugins"] = [[Path(plugin.file).name, plugin.sha256] for plugin in config.plugins]
    tree.get("controller", {}).pop("model", None)  # its content counts, not the folder that it is in
    digest = hashlib.sha256(json.dumps(tree, sort_keys=True).encode()).hexdigest()[:16]
    file = model_file(config)
    return f"{digest} {'physics' if file is None else _file_hash(file)}"


def run_named_trial(base: str, overrides: tuple[str, ...], window_s: tuple[float, float]) -> dict[str, Any]:
    """`run_trial` by the name of a config and its overrides, for other processes."""
    return run_trial(load_config(base, overrides), *window_s)


def run_logged_trial(base: str, overrides: tuple[str, ...], window_s: tuple[float, float], log: str) -> dict[str, Any]:
    """The same run with a log, which is at its path once it is whole."""
    config, path = load_config(base, overrides), Path(log)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".part-") as folder:
        recorder = open_recorder(config, Path(folder) / path.name, "lockstep", threaded=False)
        try:
            result = run_trial(config, *window_s, recorder)
        finally:
            recorder.close()
        if recorder.error is not None:
            raise recorder.error
        for part in sorted(Path(folder).iterdir(), reverse=True):  # later segments first, so that the first tells all
            os.replace(part, path.parent / part.name)
    return result


def _times(control_ms: list[float]) -> dict[str, float]:
    """Of the ticks that compute a command; `first` is the mean of the first ten, as in the paper's tables."""
    return {
        "p50": float(np.percentile(control_ms, 50)),
        "p99": float(np.percentile(control_ms, 99)),
        "first": float(np.mean(control_ms[:FIRST_STEPS])),
    }


@functools.cache
def _file_hash(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def _score(rows: list[tuple[float, float, float]], from_s: float) -> dict[str, Any]:
    t_s, distance, heading = np.array(rows).reshape(-1, 3).T
    return score(PoseErrors(t_s=t_s, distance_m=distance, heading_deg=heading), from_s)
