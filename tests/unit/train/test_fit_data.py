"""Data for training: their scaling, windows, and what is said of unsuitable ones."""

import dataclasses

import numpy as np
import pytest

from asvhil.dynamics.weights import KINDS
from asvhil.errors import ModelError
from asvhil.train.fit import fit
from asvhil.train.openloop import open_loop
from asvhil.train.records import Dataset, Segment
from asvhil.train.windows import Windows, mirrored, scaling_of
from tests.support.fit_data import DATA
from tests.support.model_data import drive


def test_mirrored_data_are_what_a_mirrored_boat_would_do() -> None:
    # The simulated boat is symmetric: the mirrored record obeys the same model as well as the record itself does.
    _, truth = drive(5, 60.0, 4.0)
    twin = mirrored(truth)
    assert (twin.command == truth.command[:, [1, 0]]).all()
    model = fit("sd", DATA).dynamics()
    start = np.array([0, 50, 100])
    straight, turned = (open_loop(model, part, start, 50, 0.2) for part in (truth, twin))
    np.testing.assert_allclose(turned, straight * [1.0, -1.0, -1.0], atol=1e-12)


def test_scaling_brings_the_training_set_to_one() -> None:
    scaling = scaling_of(DATA, symmetric=False)
    windows = Windows(DATA.segments, scaling, 20, 0)
    for part in (windows.nu, windows.command, windows.wind):
        np.testing.assert_allclose(
            [part.min(axis=0), part.max(axis=0)], [[-1.0] * part.shape[1], [1.0] * part.shape[1]]
        )
    assert (scaling_of(DATA, symmetric=True).centre == 0.0).all()


def test_a_wind_that_is_not_measured_is_not_scaled() -> None:
    still = dataclasses.replace(DATA.segments[0], wind=np.zeros_like(DATA.segments[0].wind))
    scaling = scaling_of(Dataset(dt_s=0.2, segments=(still,), source_hash=""), symmetric=False)
    assert scaling.half[5:].tolist() == [1.0, 1.0] and scaling.centre[5:].tolist() == [0.0, 0.0]


def changed(**changes: np.ndarray) -> Dataset:
    return Dataset(dt_s=0.2, segments=(dataclasses.replace(DATA.segments[0], **changes),), source_hash="")


def still() -> Segment:
    count = 500
    return Segment(
        t_s=0.2 * np.arange(count), nu=np.zeros((count, 3)), command=np.zeros((count, 2)),
        wind=np.zeros((count, 2)), psi=np.zeros(count),
    )  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_data_that_will_not_do_are_one_line(kind: str) -> None:
    nu = DATA.segments[0].nu.copy()
    nu[[7, 8], 1] = np.nan
    short = dataclasses.replace(
        DATA.segments[0],
        **{name: getattr(DATA.segments[0], name)[:50] for name in ("t_s", "nu", "command", "wind", "psi")},
    )
    steady = np.full_like(DATA.segments[0].command, 0.3)
    for data, words in (
        (changed(nu=nu), "segment 0: nu is not finite in 2 rows, first at 1.4 s"),
        (Dataset(dt_s=0.2, segments=(short,), source_hash=""), "last 10.0 s: at least 60 s are needed"),
        (Dataset(dt_s=0.2, segments=(still(),), source_hash=""), "hold no motion: u spans 0.000 m/s"),
        (changed(command=steady), "no motion of the motors"),
        (Dataset(dt_s=0.2, segments=(), source_hash=""), "no usable segment"),
    ):
        with pytest.raises(ModelError) as caught:
            fit(kind, data, iterations=10)
        assert words in str(caught.value) and "\n" not in str(caught.value)


def test_gaps_leave_no_window_across_them() -> None:
    scaling = scaling_of(DATA, symmetric=True)
    windows = Windows(DATA.segments, scaling, 20, 10)
    first = len(DATA.segments[0].t_s)
    inside = (windows.starts - 10 >= 0) & (windows.starts + 20 < first)
    after = (windows.starts - 10 >= first) & (windows.starts + 20 < 2 * first)
    assert (inside | after).all() and inside.any() and after.any()


def test_a_share_of_each_batch_comes_from_windows_in_motion() -> None:
    # A boat that lies idle for nine tenths of its record.
    nu = np.zeros((1000, 3))
    nu[450:550, 0] = 1.0
    idle = Segment(
        t_s=0.2 * np.arange(1000), nu=nu, command=np.zeros((1000, 2)), wind=np.zeros((1000, 2)), psi=np.zeros(1000)
    )
    windows = Windows((idle,), scaling_of(changed(nu=nu), symmetric=False), 20, 0)

    def moving(share: float) -> float:
        starts = windows.starts[windows.draw(np.random.default_rng(1), 200, 64, share)]
        # More than a fifth of the 21 samples at 1 m/s: from 4 after the window's end to as many before its start.
        return float(((starts + 20 >= 454) & (starts < 546)).mean())

    assert moving(1.0) == 1.0
    assert moving(0.0) == pytest.approx(0.11, abs=0.02)
    assert moving(0.5) == pytest.approx(0.5 + 0.5 * moving(0.0), abs=0.02)
    rest = dataclasses.replace(idle, nu=np.zeros((1000, 3)))
    nothing = Windows((rest,), scaling_of(changed(nu=nu), symmetric=False), 20, 0)
    even = nothing.draw(np.random.default_rng(2), 3, 8, 1.0)
    assert (even == np.random.default_rng(2).integers(980, size=(3, 8))).all()
