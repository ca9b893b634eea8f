"""Force and moment to two motors: the split, the priority of the yaw moment at the bounds, the dead band."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.controller.allocation import Allocator
from tests.support.classical_boat import CURVE

ALLOCATOR = Allocator(CURVE, 1.0)  # one motor makes -100 .. 200 N; thrust begins at commands of +-0.1


@pytest.mark.parametrize(
    ("surge_n", "yaw_nm", "thrust_n", "saturated"),
    [
        (100.0, 0.0, (50.0, 50.0), False),
        (0.0, 40.0, (20.0, -20.0), False),  # clockwise from above: port ahead
        (-60.0, -40.0, (-50.0, -10.0), False),
        (400.0, 100.0, (200.0, 100.0), True),  # 250 N is not to be had: the sum gives way, the moment stays 100
        (-300.0, 100.0, (0.0, -100.0), True),
        (0.0, 1000.0, (200.0, -100.0), True),  # the most that two motors can turn, at whatever sum that needs
        (0.0, -1000.0, (-100.0, 200.0), True),
    ],
)
def test_the_split_by_hand(surge_n, yaw_nm, thrust_n, saturated):
    got = ALLOCATOR.allocate(surge_n, yaw_nm)
    assert got.thrust_n == pytest.approx(thrust_n)
    assert got.saturated is saturated
    assert (got.surge_n, got.yaw_nm) == pytest.approx((sum(thrust_n), thrust_n[0] - thrust_n[1]))


def test_the_arm_turns_moment_into_force():
    assert Allocator(CURVE, 0.5).allocate(0.0, 40.0).thrust_n == pytest.approx((40.0, -40.0))


def test_commands_step_over_the_dead_band():
    # 50 of 200 N ahead: 0.1 + 0.9 / 4. 20 of 100 N astern: -0.1 - 0.9 / 5.
    assert ALLOCATOR.allocate(100.0, 0.0).command == pytest.approx((0.325, 0.325))
    assert ALLOCATOR.allocate(0.0, 40.0).command == pytest.approx((0.19, -0.28))
    assert ALLOCATOR.allocate(0.0, 0.0).command == (0.0, 0.0)


@given(surge_n=st.floats(-1e4, 1e4), yaw_nm=st.floats(-1e4, 1e4))
def test_bounds_priority_and_the_curve_back(surge_n, yaw_nm):
    got = ALLOCATOR.allocate(surge_n, yaw_nm)
    assert all(-100.0 - 1e-9 <= thrust <= 200.0 + 1e-9 for thrust in got.thrust_n)
    assert all(-1.0 <= part <= 1.0 for part in got.command)
    assert [CURVE.thrust_n(part) for part in got.command] == pytest.approx(got.thrust_n, abs=1e-6)
    assert got.yaw_nm == pytest.approx(min(max(yaw_nm, -300.0), 300.0), abs=1e-6)
    wanted = (0.5 * (surge_n + yaw_nm), 0.5 * (surge_n - yaw_nm))
    if all(-100.0 <= thrust <= 200.0 for thrust in wanted):
        assert got.thrust_n == pytest.approx(wanted, abs=1e-6) and not got.saturated
    elif any(thrust < -100.001 or thrust > 200.001 for thrust in wanted):
        assert got.saturated
