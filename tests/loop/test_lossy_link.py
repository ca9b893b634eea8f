"""A link that loses frames both ways, with every parameter right. `python -m bench.lossy_link` does it at length."""

import pytest

from tests.support.lossy_link import check_start, hold_start


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("loss", [0.02, 0.05, 0.1, 0.2, 0.4])
def test_a_check_finds_nothing_wrong_and_has_nothing_to_write(loss: float, seed: int) -> None:
    start = check_start(loss, seed)
    assert start.false == () and start.fixable == ()
    assert start.seconds < 40.0


@pytest.mark.parametrize(("loss", "seed"), [(0.02, 1), (0.1, 2), (0.2, 3), (0.4, 4), (0.4, 5)])
def test_a_hold_begins_and_goes_on(loss: float, seed: int) -> None:
    start = hold_start(loss, seed, hold_s=15.0)
    assert not start.for_a_parameter
    assert start.granted_s is not None and start.granted_s < (1.0 if loss < 0.4 else 20.0)
    if loss < 0.4:
        assert start.held_s >= 14.9 and start.ended == "" and start.neutral_s < 2.0, start
    else:  # the request for a message may be lost four times, and 1 Hz of it is too seldom then: told as what it is
        assert start.ended in ("", "estimate-stale"), start
