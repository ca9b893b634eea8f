"""Intervals against values of a table of Student's t, and by hand."""

import pytest

from asvhil.study.statistics import mean_ci95, plus_minus, t_quantile


@pytest.mark.parametrize(
    ("freedom", "quantile"), [(1, 12.706), (4, 2.776), (10, 2.228), (11, 2.201), (20, 2.086), (30, 2.042), (120, 1.980)]
)
def test_the_quantile_is_that_of_the_tables(freedom, quantile):
    assert t_quantile(freedom) == pytest.approx(quantile, abs=0.005)


def test_the_mean_and_its_interval_by_hand():
    # Standard deviation 1 over 3 values: 4.303 / sqrt(3).
    assert mean_ci95([1.0, 2.0, 3.0]) == {"mean": 2.0, "ci95": pytest.approx(2.4843, abs=1e-4)}
    assert mean_ci95([5.0]) == {"mean": 5.0, "ci95": None}
    with pytest.raises(ValueError):
        t_quantile(0)


def test_as_people_read_it():
    assert plus_minus({"mean": 1.234, "ci95": 0.056}) == "1.23 ± 0.06"
    assert plus_minus({"mean": 1.234, "ci95": None}, 1) == "1.2"
