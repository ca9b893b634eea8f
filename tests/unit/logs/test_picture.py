"""What the picture of a run shows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from matplotlib.figure import Figure

from asvhil.logs.picture import draw_wind
from asvhil.logs.run import RunLog


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
