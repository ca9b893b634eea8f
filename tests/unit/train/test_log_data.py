"""Training data are made of what the backseat measured: the same samples at the same times, of every shipped config."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.io.sensors.decoder import Decoder
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.sitl import run_lockstep
from asvhil.train.dataset import Segment, dataset_from_logs, truth_from_log
from asvhil.train.log_data import smooth_velocity
from asvhil.train.log_series import read_log_series
from asvhil.train.series import VELOCITY_HALF_WIDTH_S, Series, interpolate, rotate, smooth
from asvhil.types import (
    ApparentWind,
    Frame,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    Measurement,
    YawRate,
)

DURATION_S = 40.0
BREAM_S = 90.0  # the mean heading of its compass, which is off by 4 degrees each time, is then good to 0.1
INS = "[ins.BINARY]"
# All of the pose from a VN-300, none of it asked of the autopilot, and a vane that is turned and calibrated.
VN300_ALONE = (
    *(f"sources.{quantity}={INS}" for quantity in ("position", "velocity", "heading", "yaw_rate", "acceleration")),
    "links.autopilot.streams_hz={HEARTBEAT: 5, EKF_STATUS_REPORT: 2, RC_CHANNELS: 10, SERVO_OUTPUT_RAW: 10, "
    "SIM_STATE: 10}",
    "plant.sensors.anemometer.misalignment_deg=30",
    "estimator.wind.vane_offset_deg=30",
)
BOATS: dict[str, tuple[str, ...]] = {
    "sitl": (),
    "sitl-bream": (),
    "sitl-vn300": (),
    "sitl-px4": (),
    "vn300-alone": VN300_ALONE,
}


MORE_OF_THE_SHIPPED = ("sitl", "sitl-vn300")


@pytest.fixture(
    scope="module",
    params=[pytest.param(boat, marks=[pytest.mark.thorough] * (boat in MORE_OF_THE_SHIPPED)) for boat in BOATS],
)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Measurement]]:
    """The log of a run in 2 m/s of wind toward east, and what the backseat measured meanwhile.

    By a controller that costs little and needs no trained model.
    """
    name = request.param
    overrides = ("controller.name=loiter", "plant.weather.wind={speed_mps: 2, toward_deg: 90}", *BOATS[name])
    path = tmp_path_factory.mktemp("logs") / f"{name}.mcap"
    seconds = BREAM_S if name == "sitl-bream" else DURATION_S
    found: list[Measurement] = []
    decode = Decoder.decode

    def noted(self: Decoder, frame: Frame) -> list[Measurement]:
        measurements = decode(self, frame)
        found.extend(measurements)
        return measurements

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Decoder, "decode", noted)
        run_lockstep(load_config("sitl-vn300" if name == "vn300-alone" else name, overrides), path, seconds)
    return path, found


@pytest.fixture
def log(run: tuple[Path, list[Measurement]]) -> Path:
    return run[0]


def off_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.degrees((a - b + math.pi) % (2.0 * math.pi) - math.pi)


def toward_deg(segment: Segment) -> float:
    north, east = rotate(segment.psi, segment.wind).mean(axis=0)
    return math.degrees(math.atan2(east, north))


def test_the_samples_and_their_times_are_those_of_the_backseat(run: tuple[Path, list[Measurement]]) -> None:
    log, measured = run
    start_ns = next(iter(LogFile(log).ticks()))[0].t_ns
    rows: dict[str, list[tuple[float, ...]]] = {"heading": [], "yaw_rate": [], "velocity": [], "wind": []}
    for m in measured:
        t_s = (m.t_ns - start_ns) * 1e-9
        match m:
            case Heading():
                rows["heading"].append((t_s, m.psi_rad))
            case YawRate():
                rows["yaw_rate"].append((t_s, m.r_radps))
            case GroundVelocity():
                rows["velocity"].append(
                    (t_s - m.age_ns * 1e-9, m.vn_mps, m.ve_mps)
                )  # as of the fix, not of its message
            case ApparentWind():
                rows["wind"].append((t_s, m.speed_mps, m.from_rad, 1.0, 1.0))
            case FrontseatStatus():
                pass
    used = read_log_series(log)
    assert used.outliers == 0
    for name, expected in rows.items():
        series, table = getattr(used, name), np.array(expected)
        assert len(table) > 4.0 * DURATION_S, name
        assert np.allclose(series.t_s, table[:, 0], rtol=0.0, atol=1e-9), name
        values = series.values - table[:, 1:]
        if name == "heading":  # continuous in the series
            values = (values + math.pi) % (2.0 * math.pi) - math.pi
        assert np.abs(values).max() < 1e-12, name


def test_the_velocity_is_dated_by_its_fix(log: Path) -> None:
    """Against the truth a velocity fits best at its own time; by its arrival it would be late by most of a fix."""
    used = read_log_series(log)
    t_s, velocity = used.velocity.t_s[5:-5], used.velocity.values[5:-5]

    def off(late_s: float) -> float:
        truth = interpolate(used.truth, t_s - late_s)
        return float(np.sqrt(np.mean((velocity - rotate(truth[:, 3], truth[:, :2])) ** 2)))

    lates_s = np.arange(-0.3, 0.31, 0.02)
    assert abs(lates_s[np.argmin([off(late_s) for late_s in lates_s])]) < 0.07


def test_heading_and_wind_of_the_training_data_are_those_of_the_estimate(log: Path) -> None:
    [truth] = truth_from_log(log, 0.2).segments
    [estimate] = dataset_from_logs([log], 0.2, "estimate").segments
    outputs = [decode_outputs(recorded) for _, recorded in LogFile(log).ticks() if recorded is not None]
    winds = [(o.wind.vn_mps, o.wind.ve_mps) for o in outputs if o.wind is not None and o.wind.valid]
    north, east = np.mean(winds, axis=0)
    for source in ("smoothed", "measured"):
        [segment] = dataset_from_logs([log], 0.2, source).segments  # type: ignore[arg-type]
        assert np.array_equal(segment.t_s, truth.t_s) and len(segment.t_s) * 0.2 > 0.9 * DURATION_S
        error, filtered = off_deg(segment.psi, truth.psi).mean(), off_deg(estimate.psi, truth.psi).mean()
        assert abs(error - filtered) < 0.2, source
        assert abs(off_deg(np.radians(toward_deg(segment)), np.arctan2(east, north))) < 2.0, source


@pytest.mark.parametrize("run", ["sitl"], indirect=True)
def test_a_velocity_is_put_to_the_origin_of_the_boat_and_to_its_own_time(log: Path, tmp_path: Path) -> None:
    """The same bytes under a config that says of the velocity's source where it is, and how late."""
    whole = LogFile(log)
    config = json.loads(whole.metadata["config"]["json"])
    late = {"link": "autopilot", "message": "GPS_RAW_INT", "delay_s": 0.25, "arm_m": [1.5, -0.5]}
    config["sources"] |= {"position": [late], "velocity": [late]}
    metadata = whole.metadata | {"config": whole.metadata["config"] | {"json": json.dumps(config)}}
    recorder = Recorder(tmp_path / "arm.mcap", metadata=metadata, chunk_kib=128, sync_period_s=5.0, threaded=False)
    for inputs, recorded in whole.ticks():
        assert recorded is not None
        recorder.write_inputs(inputs)
        recorder.write_outputs(decode_outputs(recorded))
    recorder.close()
    there, here = read_log_series(log), read_log_series(tmp_path / "arm.mcap")
    # The first may be of the source that stands by in the log's own config.
    velocity = dataclasses.replace(
        there.velocity,
        t_s=there.velocity.t_s[-len(here.velocity.t_s) :],
        values=there.velocity.values[-len(here.velocity.t_s) :],
    )
    assert len(velocity.t_s) >= len(there.velocity.t_s) - 2
    assert here.velocity.t_s == pytest.approx(velocity.t_s - 0.25, abs=1e-9)
    moved = dataclasses.replace(velocity, t_s=here.velocity.t_s)
    psi = interpolate(there.heading, moved.t_s)[:, 0]
    r = interpolate(there.yaw_rate, moved.t_s)[:, 0]
    # In body axes an antenna ahead and to port moves with (-r y, r x) against the origin.
    antenna, origin = rotate(-psi, moved.values), rotate(-psi, here.velocity.values)
    assert np.abs(antenna - origin - np.stack([0.5 * r, 1.5 * r], axis=-1)).max() < 1e-9
    assert np.abs(antenna - origin).max() > 0.1


def test_a_drifting_boats_velocity_is_smoothed_over_a_longer_time() -> None:
    t_s = np.arange(0.0, 60.0, 0.1)
    noise = 0.1 * np.random.default_rng(1).normal(size=(len(t_s), 2))
    command = Series(t_s=t_s, values=np.where((t_s > 20.0) & (t_s < 50.0), 0.0, 0.5)[:, None] * np.ones(2))
    smoothed = smooth_velocity(Series(t_s=t_s, values=noise), command, t_s)
    near = smooth(Series(t_s=t_s, values=noise), t_s, VELOCITY_HALF_WIDTH_S)
    off = (t_s > 26.5) & (t_s < 43.5)
    assert smoothed[off].std() < 0.6 * near[off].std()
    driven = (t_s < 25.5) | (t_s > 44.5)  # or not long enough without the motors
    np.testing.assert_array_equal(smoothed[driven], near[driven])
