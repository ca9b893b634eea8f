"""Tables of points."""

import math

import numpy as np
import pytest

from asvhil.dynamics.table import Table

X = np.array([-1.0, -0.4, -0.1, -0.1, 0.3, 1.0])  # with a step, as the inverse of a thrust curve has
Y = np.array([-17.1, -3.2, -0.4, 0.2, 5.5, 28.5])


@pytest.mark.parametrize("points", [np.linspace(-1.3, 1.3, 1000), X, [-math.inf, math.inf]])
def test_it_is_the_interpolation_of_numpy(points):
    table = Table(X, Y)
    assert [table.at(float(x)) for x in points] == [float(np.interp(x, X, Y)) for x in points]


def test_what_is_not_a_number_stays_so():
    assert math.isnan(Table(X, Y).at(math.nan))
