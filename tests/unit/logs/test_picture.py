"""What the picture of a run shows."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from matplotlib.figure import Figure

from asvhil.logs.picture import draw_wind
from asvhil.logs.report_figures import _motors
from asvhil.logs.run import RunLog, read_run
from asvhil.types import Phase
from tests.support.phase_logs import hold, record_phases


@pytest.mark.parametrize(("toward_deg", "drawn_deg"), [(0.0, 0.0), (355.0, -5.0), (90.0, 90.0), (270.0, 270.0)])
@pytest.mark.parametrize("first_deg", [0.0, 178.0])
def test_the_wind_is_drawn_about_where_it_blows_to(first_deg: float, toward_deg: float, drawn_deg: float) -> None:
    """The first sample of a log may be of a wind that is not known yet, and gusts go over the north."""
    gusts_deg = toward_deg + 6.0 * np.sin(np.arange(200.0))
    psi_rad = np.angle(np.exp(1j * np.radians(np.concatenate(([first_deg], gusts_deg)))))
    wind = np.column_stack((np.arange(201.0), np.full(201, 4.0), psi_rad))
    axes = Figure().add_subplot()
    draw_wind(axes, cast(RunLog, SimpleNamespace(wind=wind)))
    (twin,) = [other for other in axes.figure.axes if other is not axes]
    drawn = np.asarray(twin.lines[0].get_ydata(), dtype=float)[1:]
    assert np.abs(drawn - drawn_deg).max() < 6.5


def test_no_motor_runs_in_the_picture_while_it_is_released(tmp_path: Path) -> None:
    released = 40, Phase.STANDBY, "the sticks were moved", "pilot"
    run = read_run(record_phases(tmp_path / "a.mcap", hold(40), released, hold(40)))
    for axes in _motors(run).axes:
        assert len(axes.lines) == 2, axes.get_ylabel()
        for line in axes.lines:
            t_s, drawn = (np.asarray(part, dtype=float) for part in (line.get_xdata(), line.get_ydata()))
            gap = np.isnan(drawn)
            assert gap.any() and not gap[0] and not gap[-1], axes.get_ylabel()
            assert np.abs(t_s[gap] - 2.0).min() < 0.06 and t_s[~gap & (t_s < 3.0)].max() < 2.0
