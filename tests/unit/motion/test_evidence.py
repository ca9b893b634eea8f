"""Sequential evidence: how it grows, that it begins anew at 0, and that the sound hypotheses count as one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asvhil.motion.evidence import LEAK, Evidence


def add(evidence: Evidence, *log: float, times: int = 1, weight: float = 1.0) -> None:
    for _ in range(times):
        evidence.add(np.array(log), weight)


def of(sound: int, faulty: int) -> Evidence:
    return Evidence(sound, [0.0] * faulty)


def test_the_sum_is_the_log_of_the_ratio_and_never_falls_below_zero() -> None:
    evidence = of(1, 2)
    add(evidence, -2.0, -1.7, -3.0)
    for sums in (evidence.sums, evidence.names):
        assert sums == pytest.approx([0.3, 0.0])
    add(evidence, -2.0, -2.1, -1.8)
    assert evidence.sums == pytest.approx([0.2, 0.2])
    add(evidence, -2.0, -2.3, -2.0)
    for sums in (evidence.sums, evidence.names):
        assert sums == pytest.approx([0.0, 0.2])


def test_one_step_adds_so_much_at_the_most_and_more_to_the_name() -> None:
    evidence = of(1, 2)
    add(evidence, 0.0, 50.0, 5.0)
    assert evidence.sums.tolist() == [0.4, 0.4] and evidence.names.tolist() == [10.0, 5.0]
    add(evidence, 0.0, 0.7, 3.0)
    assert evidence.sums.tolist() == [0.8, 0.8] and evidence.names.tolist() == [10.7, 8.0]
    add(evidence, 0.0, -50.0, -5.0)
    assert evidence.sums.tolist() == [0.4, 0.4]
    assert evidence.names.tolist() == pytest.approx([0.7, 3.0])


def test_a_step_of_less_weight_tells_less_and_at_the_most_less() -> None:
    evidence = of(1, 2)
    add(evidence, -1.0, 0.0, 49.0, weight=0.25)
    assert evidence.sums.tolist() == [0.1, 0.1] and evidence.names.tolist() == [0.25, 10.0]
    other = of(1, 1)
    other.add(np.array([0.0, 0.3]))
    assert other.sums.tolist() == [0.3], "of full weight, if nothing is said"
    add(evidence, -1.0, -1.2, -51.0, weight=0.25)
    assert evidence.sums.tolist() == pytest.approx([0.05, 0.0])
    assert evidence.names.tolist() == pytest.approx([0.2, 0.0])


def test_two_faults_at_once_are_less_likely_beforehand() -> None:
    """Only their name is: a sum that says that something is wrong has no prior."""
    evidence = Evidence(1, [0.0, -2.0])
    assert evidence.names.tolist() == [0.0, -2.0]
    add(evidence, 0.0, 3.0, 4.0)
    assert evidence.names.tolist() == [3.0, 2.0] and evidence.sums.tolist() == [0.4, 0.4]
    evidence.reset()
    assert evidence.names.tolist() == [0.0, -2.0]


def test_a_name_begins_anew_with_its_sum() -> None:
    evidence = of(1, 1)
    add(evidence, 0.0, 8.0)
    add(evidence, 0.0, -2.0)
    assert evidence.sums.tolist() == [0.0] and evidence.names.tolist() == [0.0]


def test_the_sound_ones_are_equal_at_first() -> None:
    evidence = of(4, 1)
    add(evidence, 0.0, -99.0, -99.0, -99.0, 0.0)
    assert evidence.names == pytest.approx([math.log(4.0)])


def test_the_sound_one_that_has_been_right_counts_alone() -> None:
    evidence = of(2, 1)
    add(evidence, 0.0, -3.0, 1.0, times=3)
    assert evidence.best_sound == 0
    before = float(evidence.names[0])
    add(evidence, 0.0, -3.0, 0.5)
    # The other one has its share of the leak by now, e^-3 of it after each step.
    rest = LEAK / 2.0 * (1.0 + math.exp(-3.0))
    assert evidence.names[0] - before == pytest.approx(0.5 + rest, abs=2e-4)


def test_any_of_the_sound_ones_may_become_the_true_one() -> None:
    """Without the leak the weight of the second would be e^-800 after the first half, and 0."""
    evidence = of(2, 1)
    add(evidence, 0.0, -4.0, -9.0, times=200)
    assert evidence.best_sound == 0
    add(evidence, -4.0, 0.0, -9.0, times=3)
    assert evidence.best_sound == 1
    before = evidence.sums.copy()
    add(evidence, -4.0, 0.0, -0.5, times=1)
    assert evidence.sums == pytest.approx(before) and not evidence.sums.any()


def test_the_leak_is_a_thousandth() -> None:
    evidence = of(2, 1)
    add(evidence, 0.0, -700.0, -9.0, times=2)
    add(evidence, -700.0, 0.0, 0.0)
    assert evidence.sums.tolist() == [0.4]
    assert evidence.names == pytest.approx([-math.log(LEAK / 2.0)], rel=1e-3)


def test_a_reset_forgets_weights_and_sums() -> None:
    evidence = of(2, 2)
    add(evidence, 0.0, -9.0, 3.0, 1.0, times=4)
    evidence.reset()
    assert not evidence.sums.any() and not evidence.names.any()
    add(evidence, 0.0, -99.0, 0.0, 0.0)
    assert evidence.names == pytest.approx([math.log(2.0)] * 2)
