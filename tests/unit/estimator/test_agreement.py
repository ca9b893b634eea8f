"""Positions and velocities of one receiver that agree, against a vessel model that says otherwise."""

from __future__ import annotations

import pytest

from asvhil.estimator.agreement import Agreement

FIX_S = 0.2
SLACK_M = 0.5


def followed(seconds: float, v_mps: float = 0.5, told_mps: float | None = None) -> tuple[Agreement, float, float]:
    """The agreement after positions of a boat under way, its place (m) and the integral of the velocity told (m)."""
    agreement, place, integral = Agreement(), 0.0, 0.0
    for _ in range(round(seconds / FIX_S)):
        place += v_mps * FIX_S
        integral += (v_mps if told_mps is None else told_mps) * FIX_S
        agreement = agreement.with_place((place, 0.0), (integral, 0.0), FIX_S, accepted=True)
    return agreement, place, integral


def test_a_position_that_moved_as_the_velocity_says_has_not_jumped() -> None:
    agreement, place, integral = followed(20.0)
    for _ in range(15):  # rejected by the filter, while the boat goes twice as fast as it predicts
        place, integral = place + 0.2, integral + 0.2
        agreement = agreement.with_place((place, 0.0), (integral, 0.0), FIX_S, accepted=False)
    assert agreement.clears_place(SLACK_M)


@pytest.mark.parametrize("jump_m", [0.8, 5.0, -30.0])
def test_a_position_that_jumps_is_not_cleared_however_long_it_stays(jump_m: float) -> None:
    agreement, place, integral = followed(20.0)
    for _ in range(100):
        agreement = agreement.with_place((place + jump_m, 0.0), (integral, 0.0), FIX_S, accepted=False)
        assert not agreement.clears_place(SLACK_M)


def test_nothing_is_cleared_before_a_position_and_a_velocity_have_been_heard() -> None:
    assert not Agreement().clears_place(SLACK_M)
    assert not Agreement().clears_rate(5.0, 10.0, SLACK_M)


def test_a_velocity_that_the_positions_bear_out_is_cleared() -> None:
    agreement, _, _ = followed(20.0)
    assert agreement.clears_rate(0.4, 3.0, SLACK_M)
    assert not agreement.clears_rate(0.1, 3.0, SLACK_M)  # too little to tell


def test_a_velocity_that_the_positions_leave_is_not_cleared() -> None:
    agreement, place, integral = followed(20.0)
    for _ in range(15):  # the receiver says 0.5 m/s more than the boat makes
        place, integral = place + 0.5 * FIX_S, integral + 1.0 * FIX_S
        agreement = agreement.with_place((place, 0.0), (integral, 0.0), FIX_S, accepted=True)
    assert not agreement.clears_rate(0.5, 3.0, SLACK_M)
