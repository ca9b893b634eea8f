"""Scores of open-loop rollouts, against values worked out by hand."""

import numpy as np
import pytest

from asvhil.dynamics.integrate import integrate
from asvhil.errors import LogError
from asvhil.train.evaluate import HOLD, Case, Window, absolute_errors, evaluate, predict, windows_of
from asvhil.train.openloop import open_loop
from asvhil.train.records import Segment
from tests.support.model_data import drive
from tests.support.model_samples import sample


def ramp(count: int, speed_mps: float = 0.0) -> Segment:
    """u rises by 0.1 m/s a row from speed_mps on; v and r are constant."""
    nu = np.column_stack([speed_mps + 0.1 * np.arange(count), np.full(count, 0.2), np.full(count, -0.1)])
    zeros = np.zeros((count, 2))
    return Segment(t_s=0.2 * np.arange(count), nu=nu, command=zeros, wind=zeros, psi=np.zeros(count))


def test_holding_the_initial_value_of_a_ramp() -> None:
    segment = ramp(40)
    # 10 steps of 0.1 m/s: the errors are 0.1, 0.2, ... 1.0, so 0.55 on average.
    rows = evaluate({}, [Case(name="ramp", seen=segment, reference=segment)], 0.2, horizon_s=2.0, every_s=1.0)
    assert rows[HOLD]["all"] == {
        "windows": 3, "mae_u": 0.55, "mae_v": 0.0, "mae_r": 0.0, "std_u": 0.0, "std_v": 0.0, "std_r": 0.0
    }  # fmt: skip


def test_errors_are_taken_from_the_reference_and_the_start_from_what_was_seen() -> None:
    seen = ramp(40, speed_mps=1.0)
    cases = [Case(name="both", seen=seen, reference=ramp(40))]
    windows = [Window(case=0, start=15, moving=True)]
    paths = predict(None, cases, windows, 4, 0.2)
    assert paths[0, :, 0] == pytest.approx([2.5] * 5)
    # Reference 1.6, 1.7, 1.8, 1.9 after the start: 0.9, 0.8, 0.7, 0.6 off.
    assert absolute_errors(paths, cases, windows)[0] == pytest.approx([0.75, 0.0, 0.0])


def test_windows_in_motion_and_idle_ones_are_apart() -> None:
    still = Segment(
        t_s=0.2 * np.arange(60), nu=np.full((60, 3), 0.01), command=np.zeros((60, 2)), wind=np.zeros((60, 2)),
        psi=np.zeros(60),
    )  # fmt: skip
    cases = [Case(name="a", seen=still, reference=still), Case(name="b", seen=ramp(60), reference=ramp(60))]
    windows = windows_of(cases, 2.0, 4.0, 0.2)
    assert [(window.case, window.start, window.moving) for window in windows] == [
        (0, 15, False), (0, 35, False), (1, 15, True), (1, 35, True)
    ]  # fmt: skip
    rows = evaluate({}, cases, 0.2, 2.0, 4.0)[HOLD]
    assert (rows["all"]["windows"], rows["moving"]["windows"], rows["idle"]["windows"]) == (4, 2, 2)
    assert (rows["all"]["mae_u"], rows["moving"]["mae_u"], rows["idle"]["mae_u"]) == (0.275, 0.55, 0.0)


def test_data_without_a_whole_window() -> None:
    segment = ramp(40)
    with pytest.raises(LogError, match=r"no stretch for a rollout of 50 s after 3 s of lead-in: the longest has 8.0 s"):
        windows_of([Case(name="ramp", seen=segment, reference=segment)], 50.0, 10.0, 0.2)


@pytest.mark.parametrize("kind", ["nnsem", "node"])
def test_an_open_loop_is_the_integrator_under_the_recorded_inputs(kind: str) -> None:
    model = sample(kind).dynamics()
    segment, _ = drive(3, 10.0, 4.0)
    path = open_loop(model, segment, np.array([5, 20]), 8, 0.2)
    for i, start in enumerate((5, 20)):
        x = segment.nu[start]
        for k in range(8):
            a, wind = segment.command[start + k], segment.wind[start + k]
            x = integrate(lambda y, a=a, wind=wind: model.derivative(y, a, wind), x, 0.2, 1, model.euler)
            np.testing.assert_allclose(path[i, k + 1], x, atol=1e-12)


def test_motors_start_from_the_commands_before_the_window() -> None:
    # Two records that differ only in what the motors were told before the start.
    model = sample("lagnet").dynamics()
    segment, _ = drive(3, 20.0, 4.0)
    pushed = segment.command.copy()
    pushed[:20] = 1.0
    other = Segment(t_s=segment.t_s, nu=segment.nu, command=pushed, wind=segment.wind, psi=segment.psi)
    a, b = (open_loop(model, part, np.array([20, 60]), 3, 0.2) for part in (segment, other))
    assert np.abs(a[0] - b[0]).max() > 1e-3  # two seconds after the change the motors still remember
    assert (a[1] == b[1]).all()  # eight seconds after it nothing is left of it
