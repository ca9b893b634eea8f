"""Bounds of values that came as 32-bit floats."""

import math
import struct

import pytest

from asvhil.config.registry import OperatorParameter
from asvhil.config.single import clipped, told, within


def sent(value: float) -> float:
    (came,) = struct.unpack("<f", struct.pack("<f", value))
    return float(came)


@pytest.mark.parametrize("bound", [0.8, 0.7, 0.1, 0.3, 1.5, 30.0, 1e5, 12.345])
def test_a_bound_that_was_sent_is_within_and_counts_as_it_was_typed(bound: float) -> None:
    parameter = OperatorParameter(name="X", path=(), least=bound, most=bound)
    assert within(sent(bound), bound, bound) and parameter.allows(sent(bound))
    assert clipped(sent(bound), bound, bound) == bound == parameter.from_link(sent(bound))
    for beyond in (bound * 1.00001, bound * 0.99999, math.nan, math.inf, -math.inf):
        assert not within(beyond, bound, bound) and not parameter.allows(beyond)


def test_a_value_between_the_bounds_stays_to_the_last_bit() -> None:
    assert clipped(sent(0.3), 0.0, 0.8) == sent(0.3)


def test_a_bound_without_an_end() -> None:
    assert within(1e30, 0.0, math.inf) and not within(math.nan, 0.0, math.inf)


@pytest.mark.parametrize(("most", "words"), [(0.7366, 0.73), (0.8, 0.8), (0.29, 0.29), (3.0, 3.0)])
def test_a_bound_in_words_is_allowed(most: float, words: float) -> None:
    assert told(most) == words
