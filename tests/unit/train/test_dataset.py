"""Uneven samples to even rows, splits and ranges, and what comes out of a collected log, clean and damaged."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.collect import collect
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.controller.pwm import command_of_pulse
from asvhil.errors import LogError
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.train.dataset import Dataset, Segment, dataset_from_logs, ranges, split, truth_from_log
from asvhil.train.series import (
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
    spans,
    without_outliers,
)
from asvhil.types import Frame

FUSED = ("links.autopilot.position_source=GLOBAL_POSITION_INT", "plant.sensors.fused_velocity.slow_bias_mps=0")
CONFIG = load_config("sitl", ("plant.weather.wind.gust_along=0", "plant.weather.wind.gust_across=0", *FUSED))


def rms(a: np.ndarray) -> np.ndarray:
    return np.sqrt((a**2).mean(axis=0))


# --- series ----------------------------------------------------------------------------------------------------


def test_rows_are_put_in_order_and_cleaned() -> None:
    made = series([(2.0, 20.0), (1.0, 10.0), (2.0, 21.0), (3.0, math.nan)], 1)
    assert made.t_s.tolist() == [1.0, 2.0] and made.values.tolist() == [[10.0], [21.0]]
    assert len(series([], 2).t_s) == 0


@given(
    st.lists(st.floats(0.01, 1.0), min_size=1, max_size=20),
    st.lists(st.floats(-1.0, 1.0), min_size=21, max_size=21),
    st.floats(0.05, 0.7),
)
def test_the_mean_of_a_held_signal(steps: list[float], levels: list[float], dt_s: float) -> None:
    t_s = np.concatenate([[0.0], np.cumsum(steps)])
    values = np.array(levels[: len(t_s)])
    rows = np.arange(0.0, t_s[-1], dt_s)
    got = hold_mean(Series(t_s=t_s, values=values[:, None]), rows, dt_s)[:, 0]
    edges = np.append(t_s, np.inf)
    for begin, mean in zip(rows, got, strict=True):
        share = np.clip(np.minimum(edges[1:], begin + dt_s) - np.maximum(edges[:-1], begin), 0.0, None)
        assert mean == pytest.approx(share @ values / dt_s, abs=1e-9)


def test_a_held_signal_that_changes_with_the_rows_is_kept_exactly() -> None:
    t_s = 0.05 * np.arange(200)
    values = np.repeat(np.random.default_rng(1).uniform(-1, 1, (50, 2)), 4, axis=0)
    source = Series(t_s=t_s + 0.15, values=values)
    phase_s = change_phase_s(source, 0.2)
    assert phase_s == pytest.approx(0.15)
    rows = grid((0.15, 0.15 + t_s[-1]), 0.2, phase_s)
    assert np.allclose(hold_mean(source, rows, 0.2), values[::4][: len(rows)], atol=1e-12)


@given(st.tuples(*[st.floats(-2.0, 2.0)] * 3), st.integers(0, 1000))
def test_smoothing_keeps_a_parabola_and_tames_noise(c: tuple[float, float, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    t_s = np.sort(rng.uniform(0.0, 10.0, 120))
    truth = lambda t: c[0] + c[1] * t + c[2] * t * t  # noqa: E731
    rows = np.arange(1.5, 8.5, 0.2)
    exact = smooth(Series(t_s=t_s, values=truth(t_s)[:, None]), rows, 1.2)[:, 0]
    assert np.allclose(exact, truth(rows), atol=1e-6)
    noisy = Series(t_s=t_s, values=rng.normal(0.0, 1.0, (120, 1)))
    assert rms(smooth(noisy, rows, 1.2)) < rms(interpolate(noisy, rows))


def test_the_low_pass_looks_back_only() -> None:
    t_s = 0.2 * np.arange(100)
    step = Series(t_s=t_s, values=np.where(t_s < 9.9, 0.0, 1.0)[:, None])
    got = low_pass(step, t_s, 2.0)[:, 0]
    assert (got[t_s < 9.9] == 0.0).all()
    at = int(np.searchsorted(t_s, 11.9))
    assert got[at] == pytest.approx(1.0 - math.exp(-2.0 / 2.0), abs=0.05)


def test_jumps_are_left_out_and_counted_and_motion_is_not() -> None:
    t_s = 0.1 * np.arange(200)
    motion = 2.0 * np.sin(1.5 * t_s)  # up to 3 m/s^2
    jumpy = motion.copy()
    jumpy[[0, 50, 120, 121, 199]] += [3.0, -5.0, 4.0, 4.0, -3.0]
    clean, removed = without_outliers(Series(t_s=t_s, values=jumpy[:, None]), 1.0, 3.0, 30.0)
    assert removed == 5 and np.allclose(clean.values[:, 0], np.delete(motion, [0, 50, 120, 121, 199]))
    assert without_outliers(Series(t_s=t_s, values=motion[:, None]), 1.0, 3.0, 30.0)[1] == 0
    assert without_outliers(Series(t_s=t_s[:3], values=np.array([[1.0], [31.0], [2.0]])), 1.0, 3.0, 30.0)[1] == 1


def test_stretches() -> None:
    assert spans(np.array([0.0, 0.5, 1.0, 3.0, 3.5]), 0.6) == [(0.0, 1.0), (3.0, 3.5)]
    assert spans(np.array([]), 0.6) == []
    assert common([(0.0, 5.0), (6.0, 9.0)], [(1.0, 7.0), (8.0, 10.0)]) == [(1.0, 5.0), (6.0, 7.0), (8.0, 9.0)]
    assert np.allclose(grid((0.0, 1.0), 0.2, 0.1), [0.1, 0.3, 0.5, 0.7])
    assert np.allclose(grid((0.1, 0.9), 0.2, 0.1), [0.1, 0.3, 0.5, 0.7])


def test_a_north_wind_on_a_boat_that_heads_east() -> None:
    body = rotate(-np.array([math.pi / 2]), np.array([[-4.0, 0.0]]))  # the air moves south
    assert np.allclose(body, [[0.0, 4.0]])  # that is to starboard of a boat that heads east


# --- split and ranges --------------------------------------------------------------------------------------------


def plain(length: int, offset: float) -> Segment:
    k = np.arange(length, dtype=float)
    return Segment(
        t_s=0.2 * k,
        nu=np.stack([k + offset, -k, 0.0 * k], axis=-1),
        command=np.stack([k / length, -k / length], axis=-1),
        wind=np.zeros((length, 2)),
        psi=np.full(length, np.nan),
    )


def test_the_split_is_by_time_and_the_ranges_come_from_the_training_set() -> None:
    whole = Dataset(dt_s=0.2, segments=(plain(100, 0.0), plain(50, 5.0)), source_hash="abc", outliers=3)
    train, test = split(whole, 0.2)
    assert [len(s.t_s) for s in train.segments] == [80, 40] and [len(s.t_s) for s in test.segments] == [20, 10]
    for early, late in zip(train.segments, test.segments, strict=True):
        assert early.t_s[-1] < late.t_s[0]
    assert train.source_hash == test.source_hash == "abc" and train.outliers == 3
    assert train.duration_s == pytest.approx(24.0)
    assert ranges(train).nu.tolist() == [[0.0, 79.0], [-79.0, 0.0], [0.0, 0.0]]
    assert ranges(train).command.tolist() == [[0.0, 0.79], [-0.79, 0.0]]
    with pytest.raises(LogError, match="too short to be split"):
        split(Dataset(dt_s=0.2, segments=(plain(3, 0.0),), source_hash=""), 0.01)
    with pytest.raises(ValueError, match="test_fraction"):
        split(whole, 1.0)


# --- logs ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("collected") / "log.mcap"
    [run] = collect(CONFIG, "lockstep", 60.0, [parse_wind("6@90")], path)
    assert run.complete
    return path


def edited(log: Path, to: Path, edit: Callable[[float, Frame], Frame | None]) -> Path:
    """The log with each inbound frame as `edit(seconds, frame)` makes it; the outputs stay as they were."""
    whole = LogFile(log)
    recorder = Recorder(to, metadata=whole.metadata, chunk_kib=128, sync_period_s=5.0, threaded=False)
    start_ns = None
    for inputs, recorded in whole.ticks():
        start_ns = inputs.t_ns if start_ns is None else start_ns
        t_s = (inputs.t_ns - start_ns) * 1e-9
        frames = tuple(kept for frame in inputs.frames if (kept := edit(t_s, frame)) is not None)
        recorder.write_inputs(dataclasses.replace(inputs, frames=frames))
        assert recorded is not None
        recorder.write_outputs(decode_outputs(recorded))
    recorder.close()
    return to


def test_a_collected_log_gives_states_near_the_truth_and_smoothed_ones_nearer(log: Path) -> None:
    [truth] = truth_from_log(log, 0.2).segments
    errors = {}
    for source in ("measured", "smoothed", "estimate"):
        data = dataset_from_logs([log], 0.2, source)
        [segment] = data.segments
        assert np.array_equal(segment.t_s, truth.t_s) and np.allclose(np.diff(segment.t_s), 0.2)
        errors[source] = rms(segment.nu - truth.nu)
        assert data.outliers == 0 and 58.0 < data.duration_s < 65.0
        assert np.abs(segment.psi - truth.psi).max() < math.radians(1.5)
    assert (errors["measured"] < [0.05, 0.05, 0.009]).all()
    assert (errors["smoothed"] < [0.034, 0.034, 0.005]).all(), errors
    assert (errors["smoothed"] < errors["measured"]).all()
    assert (errors["estimate"][:2] < errors["measured"][:2]).all()  # yaw rate is the gyro's in both


def test_commands_are_the_pulses_that_were_sent(log: Path) -> None:
    segment = dataset_from_logs([log], 0.2).segments[0]
    pwm = CONFIG.vehicle.pwm
    ticks = [(inputs.t_ns, decode_outputs(recorded)) for inputs, recorded in LogFile(log).ticks() if recorded]
    sent = {round((t_ns - ticks[0][0]) * 1e-9, 3): out.pwm_us for t_ns, out in ticks if out.control is not None}
    del sent[min(sent)]  # the first pulses start from neutral, at the slew rate
    seen = 0
    for t_s, command in zip(segment.t_s, segment.command, strict=True):
        pulses = sent.get(round(float(t_s), 3))
        if pulses is not None:
            seen += 1
            expected = [command_of_pulse(pwm, pulse) for pulse in pulses]
            assert command == pytest.approx(expected, abs=1e-6)
    assert seen > 250


def test_the_wind_is_the_true_one_in_body_axes(log: Path) -> None:
    for source in ("smoothed", "measured"):
        segment = dataset_from_logs([log], 0.2, source).segments[0]
        over_ground = rotate(segment.psi, segment.wind)  # 6 m/s toward east, without gusts
        assert np.abs(over_ground.mean(axis=0) - [0.0, 6.0]).max() < 0.3
        # Along the wind the cups tell the speed: what is left of the boat's own 0.7 m/s would be seen.
        assert over_ground[10:, 1].std() < 0.25 and over_ground[10:, 0].std() < 0.6, over_ground.std(axis=0)


def test_a_gap_ends_a_segment(log: Path, tmp_path: Path) -> None:
    def without_autopilot(t_s: float, frame: Frame) -> Frame | None:
        return None if frame.port == "autopilot" and 25.0 < t_s < 30.0 else frame

    data = dataset_from_logs([edited(log, tmp_path / "gap.mcap", without_autopilot)], 0.2)
    first, second = data.segments
    assert first.t_s[-1] == pytest.approx(25.0, abs=0.4) and second.t_s[0] == pytest.approx(30.0, abs=0.5)
    assert all(np.isfinite(part).all() for s in data.segments for part in (s.nu, s.command, s.wind, s.psi))


def test_without_an_anemometer_the_wind_is_zero(log: Path, tmp_path: Path) -> None:
    calm = edited(log, tmp_path / "calm.mcap", lambda _, frame: None if frame.port == "anemometer" else frame)
    assert (dataset_from_logs([calm], 0.2).segments[0].wind == 0.0).all()


def test_a_jump_of_the_velocity_is_left_out_and_counted(log: Path, tmp_path: Path) -> None:
    jumped: list[float] = []

    def jump(t_s: float, frame: Frame) -> Frame:
        found = FrameSplitter().receive(frame.data) if frame.port == "autopilot" and t_s > 35.0 else []
        for data in found:
            message = decode(data)
            if message is not None and message.get_type() == "GLOBAL_POSITION_INT" and len(jumped) < 2:
                jumped.append(t_s)
                message.vx = 1900
                packer = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
                return dataclasses.replace(frame, data=frame.data.replace(data, bytes(message.pack(packer))))
        return frame

    hit = edited(log, tmp_path / "jump.mcap", jump)
    assert len(jumped) == 2
    data = dataset_from_logs([hit], 0.2, "measured")
    assert data.outliers == 2
    assert np.abs(data.segments[0].nu[:, :2]).max() < 3.0


def test_logs_that_cannot_be_used_are_told_by_name(log: Path, tmp_path: Path) -> None:
    def without(kind: bytes) -> Callable[[float, Frame], Frame | None]:
        def edit(_: float, frame: Frame) -> Frame | None:
            return None if any(data[7:10] == kind for data in FrameSplitter().receive(frame.data)) else frame

        return edit

    sim_state, attitude = (number.to_bytes(3, "little") for number in (108, 30))
    with pytest.raises(LogError, match=r"a\.mcap: holds no SIM_STATE"):
        truth_from_log(edited(log, tmp_path / "a.mcap", without(sim_state)), 0.2)
    with pytest.raises(LogError, match=r"b\.mcap: holds no heading"):
        dataset_from_logs([log, edited(log, tmp_path / "b.mcap", without(attitude))], 0.2)
    short = edited(log, tmp_path / "c.mcap", lambda t_s, frame: frame if t_s < 14.0 else None)
    with pytest.raises(LogError, match=r"c\.mcap: 10\.\d s of usable data, at least 30 s"):
        dataset_from_logs([short], 0.2)
    (tmp_path / "d.mcap").write_text("u,v,r\n")
    with pytest.raises(LogError, match=r"d\.mcap: not a log"):
        dataset_from_logs([tmp_path / "d.mcap"], 0.2)


def test_two_logs_are_one_dataset_with_its_own_hash(log: Path) -> None:
    one, two = dataset_from_logs([log], 0.2), dataset_from_logs([log, log], 0.2)
    assert len(two.segments) == 2 and len(one.source_hash) == 64 and one.source_hash != two.source_hash
    assert one.source_hash == dataset_from_logs([log], 0.4).source_hash
