"""What is asked of arrays of any shape."""

import numpy as np
import pytest

from asvhil.dynamics.arrays import is_finite


@pytest.mark.parametrize("shape", [(0,), (1,), (40,), (8, 5), (2, 3, 4)])
def test_an_array_is_finite_where_each_component_is(shape: tuple[int, ...]) -> None:
    array = np.full(shape, -1e308)
    assert is_finite(array) is True
    for wrong in (np.nan, np.inf, -np.inf):
        for place in range(array.size):
            array.flat[place] = wrong
            assert is_finite(array) is False and is_finite(array.T) is False
            array.flat[place] = 0.0
