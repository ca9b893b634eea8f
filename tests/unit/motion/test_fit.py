"""How much a step tells, by how well the best hypothesis predicts, and whether a fault's own filter does."""

from __future__ import annotations

import numpy as np
import pytest

from asvhil.motion.fit import CALM, FITS, POOR, SETTLED_S, UNSHOWN, Fit


def stepped(fit: Fit, *squares: float, steps: int = 1, readings: int = 3, dt_s: float = 0.2) -> Fit:
    for _ in range(steps):
        fit.add(np.array(squares), readings, dt_s)
    return fit


def average(begin: float, value: float, steps: int) -> float:
    return float(value + (begin - value) * 0.95**steps)


def test_a_step_tells_what_it_tells_until_calm_water_has_shown() -> None:
    fit = Fit(2)
    assert fit.weight == 1.0
    best = UNSHOWN
    for step in range(1, 60):
        stepped(fit, 0.45, 9.0)
        best = average(UNSHOWN, 0.15, step)
        assert fit.weight == pytest.approx(max(1.0, CALM / best)), step
    assert best < 0.17 and fit.weight > 1.4


def test_it_tells_twice_as_much_at_the_most() -> None:
    assert stepped(Fit(2), 0.0, 0.0, steps=5000).weight == 2.0


def test_in_water_that_is_not_calm_it_tells_less_once_the_hold_has_gone_on_for_a_while() -> None:
    fit = stepped(Fit(2), 1.5, 9.0, steps=74)
    assert fit.weight == 1.0, "after 14.8 s"
    stepped(fit, 1.5, 9.0, steps=2)
    assert fit.weight == pytest.approx(0.5, rel=1e-9) and SETTLED_S == 15.0
    fit.begin()
    assert stepped(fit, 1.5, 9.0).weight == 1.0, "of another hold not before long"


def test_rough_water_counts_from_the_first_and_beyond_a_hold() -> None:
    fit = stepped(Fit(2), 9.0, 12.0)
    assert fit.roughness == pytest.approx(1.1) and fit.weight == pytest.approx(1.1**-4)
    fit.begin()
    assert fit.roughness == pytest.approx(1.1)
    stepped(fit, 0.0, 0.0)
    assert fit.roughness == pytest.approx(1.095)


def test_a_hypothesis_explains_what_its_own_filter_predicts() -> None:
    fit = Fit(2)
    assert fit.explains(0) and fit.explains(1)
    for step in range(1, 40):
        stepped(fit, 0.3, 4.5)
        assert fit.explains(0) and fit.explains(1) is (average(CALM, 1.5, step) <= FITS), step
    assert not fit.explains(1)
    stepped(fit, 0.3, 0.3, steps=20)
    assert fit.explains(1), "again"
    stepped(fit, 0.3, 30.0, steps=5)
    fit.begin()
    assert fit.explains(1), "a hold begins with nothing against it"


def test_a_step_without_readings_says_nothing_of_the_water() -> None:
    fit = stepped(Fit(1), 0.0, readings=0, steps=50)
    assert fit.weight == 1.0 and fit.explains(0)


def test_readings_share_what_they_are_off_by() -> None:
    one, three = stepped(Fit(1), 0.2, readings=1, steps=40), stepped(Fit(1), 0.6, steps=40)
    assert one.weight == pytest.approx(three.weight) and one.weight > 1.0
    assert not stepped(Fit(1), 1.2, readings=1, steps=40).explains(0)
    assert stepped(Fit(1), 1.2, steps=40).explains(0)


def test_no_hypothesis_predicts_well_in_a_chop_once_the_hold_has_gone_on_for_a_while() -> None:
    fit = stepped(Fit(2), 1.5, 9.0, steps=74)
    assert fit.weight == 1.0 and not fit.poor, "after 14.8 s"
    assert stepped(fit, 1.5, 9.0, steps=2).poor
    stepped(fit, 3.0 * POOR - 0.1, 9.0, steps=200)
    assert not fit.poor, "the best one predicts well again"
    stepped(fit, 3.0 * POOR + 0.1, 9.0, steps=200)
    assert fit.poor
    fit.begin()
    assert not fit.poor
