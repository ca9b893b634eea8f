"""What the HIL server tells a PX4: samples of the sensors, fixes, and the truth."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.px4_messages import standard_pressure_pa
from tests.support.px4_sitl import ALL, CALM, COMPASS, FAST, FREE, INERTIAL, MS, Sitl, mean_of, of, samples_us

# --- what -------------------------------------------------------------------------------------------------------------


def test_what_a_boat_at_rest_measures() -> None:
    sitl = Sitl(CALM, "plant.start_heading_deg=90")
    samples = of(sitl.lockstep(1500), "HIL_SENSOR")
    full = [sample for sample in samples if sample.fields_updated == ALL]
    assert {sample.fields_updated for sample in samples} == {INERTIAL, ALL}
    assert len(full) == 301  # compass and barometer in the first, then at 50 Hz

    def mean(name: str, of_: list[Any] = samples) -> float:
        return sum(getattr(sample, name) for sample in of_) / len(of_)

    assert (mean("xacc"), mean("yacc"), mean("zacc")) == pytest.approx((0.0, 0.0, -9.80665), abs=0.13)
    assert mean("zacc") == pytest.approx(-9.80665, abs=0.002)
    assert (mean("xgyro"), mean("ygyro"), mean("zgyro")) == pytest.approx((0.0, 0.0, 0.0), abs=1.5e-3)
    # At 40.4 N 86.9 W the field points 0.20 gauss north, 0.016 west, 0.48 down; the bow is east.
    assert (mean("xmag", full), mean("ymag", full), mean("zmag", full)) == pytest.approx(
        (-0.0158, -0.2002, 0.4800), abs=3e-4
    )
    assert mean("abs_pressure", full) == pytest.approx(1013.25, abs=0.01)
    assert mean("pressure_alt", full) == pytest.approx(0.0, abs=0.05)


def test_no_sensor_repeats_itself() -> None:
    """PX4 takes one that does for dead. (Pressure comes in steps of 0.006 Pa, so two may be alike now and then.)"""
    sitl = Sitl(CALM)
    samples = of(sitl.lockstep(300), "HIL_SENSOR")
    full = [sample for sample in samples if sample.fields_updated == ALL]
    for name in ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"):
        assert len({getattr(sample, name) for sample in samples}) == len(samples), name
    for name in ("xmag", "ymag", "zmag", "abs_pressure", "pressure_alt"):
        assert len({getattr(sample, name) for sample in full}) > 0.8 * len(full), name


def test_two_runs_are_alike() -> None:
    runs = [[message.to_dict() for message in Sitl(FREE).lockstep(200, 0.5, 0.2)] for _ in range(2)]
    assert runs[0] == runs[1]
    other = [message.to_dict() for message in Sitl(FREE, "plant.seed=2").lockstep(200, 0.5, 0.2)]
    assert other != runs[0]


def test_fixes_at_their_rate_and_place() -> None:
    sitl = Sitl(CALM, "plant.sensors.gnss={slow_bias_m: 0, white_m: 0.001, velocity_white_mps: 0}")
    fixes = of(sitl.lockstep(1000), "HIL_GPS")
    assert len(fixes) == 21  # the first at once
    fix = fixes[-1]
    assert (fix.fix_type, fix.id, fix.yaw, fix.alt) == (3, 0, 0, 0)
    assert fix.lat * 1e-7 == pytest.approx(40.4237 - 14.0 / 111_030.0, abs=2e-7)
    assert fix.lon * 1e-7 == pytest.approx(-86.9212 - 3.0 / 84_900.0, abs=2e-7)
    assert {b.time_usec - a.time_usec for a, b in pairwise(fixes[1:])} == {200_000}
    assert (fix.vn, fix.ve, fix.vd, fix.vel) == (0, 0, 0, 0)
    ten = Sitl("plant.sensors.gnss.rate_hz=10")
    assert len(of(ten.lockstep(500), "HIL_GPS")) == 21


def test_a_receiver_without_fix_says_nothing() -> None:
    sitl = Sitl("plant.faults=[{kind: gnss, from_s: 1, until_s: 2}]")
    fixes = of(sitl.lockstep(750), "HIL_GPS")
    times_s = [fix.time_usec * 1e-6 % 100.0 for fix in fixes]
    assert len(times_s) == 11
    assert not any(1.0 <= t_s < 2.0 for t_s in times_s)


def test_faults_of_compass_and_imu_reach_the_samples() -> None:
    turned = "{kind: heading-jump, size: 90, from_s: 1, until_s: 2}"
    silent = "{kind: heading-silent, from_s: 2, until_s: 3}, {kind: imu-silent, from_s: 2.5, until_s: 3}"
    sitl = Sitl(CALM, f"plant.faults=[{turned}, {silent}]")
    seconds: list[list[Any]] = [[] for _ in range(4)]
    for sample in of(sitl.lockstep(1000), "HIL_SENSOR"):
        seconds[min(3, (sample.time_usec - 1) // 1_000_000)].append(sample)
    compass = [[s for s in second if s.fields_updated & COMPASS] for second in seconds]
    assert [round(mean_of(second, "xmag"), 2) for second in compass[:2]] == [0.2, -0.02]
    assert [round(mean_of(second, "ymag"), 2) for second in compass[:2]] == [-0.02, -0.2]  # the field comes from port
    assert len(compass[2]) <= 1 and len(compass[3]) > 40
    without = [s for s in seconds[2] if not s.fields_updated & INERTIAL]
    assert len(without) == pytest.approx(125, abs=1)


def test_velocity_over_ground_in_fix_and_truth() -> None:
    current = "plant.weather.current={speed_mps: 0.5, toward_deg: 270}"
    sitl = Sitl(FREE, CALM, current, "plant.sensors.gnss.velocity_white_mps=0")
    assert sitl.ask(115, 5000) == 0
    sent = sitl.lockstep(250)
    fix, truth = of(sent, "HIL_GPS")[-1], of(sent, "HIL_STATE_QUATERNION")[-1]
    assert (fix.vn, fix.ve, fix.vel, fix.cog) == (0, -50, 50, 27000)
    assert (truth.vx, truth.vy, truth.vz) == (0, -50, 0)


def test_the_truth_comes_when_it_is_asked_for() -> None:
    sitl = Sitl(FREE, CALM, "plant.start_heading_deg=60")
    assert of(sitl.lockstep(50), "HIL_STATE_QUATERNION") == []
    assert sitl.ask(115, 20_000) == 0
    states = of(sitl.lockstep(250, 0.5, 0.5), "HIL_STATE_QUATERNION")
    assert len(states) == 51  # the first at once
    state = states[-1]
    q = state.attitude_quaternion
    assert 2.0 * math.atan2(q[3], q[0]) == pytest.approx(math.radians(60.0), abs=1e-3)
    motion = sitl.hil.plant.motion
    assert state.xacc == pytest.approx(motion.ax_mps2 / 9.80665 * 1000.0, abs=15)
    assert state.lat == pytest.approx(sitl.hil.plant.lat_lon_e7(motion.n_m, motion.e_m)[0], abs=3)
    assert sitl.ask(115, -1.0) == 0
    assert of(sitl.lockstep(50), "HIL_STATE_QUATERNION") == []


def test_the_sensor_rate_can_be_asked_for() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(5)
    assert sitl.ask(107, 2000) == 0
    now_us = sitl.hil.plant.t_ns // 1000
    sent = []
    for _ in range(100):
        new = sitl.wait(2 * MS)
        sent += samples_us(new)
        sitl.answer(sent[-1])
    assert sent == [now_us + 2000 * k for k in range(1, 101)]
    assert len({sample.xacc for sample in of(new, "HIL_SENSOR")}) == 1
    assert (sitl.ask(107, 0.0), sitl.ask(107, 100.0), sitl.ask(107, math.nan), sitl.ask(113, 1e5)) == (0, 2, 2, 2)
    assert sitl.ask(1, 0, command=400) == mav.MAV_RESULT_UNSUPPORTED


# --- hostile bytes ----------------------------------------------------------------------------------------------------


def test_the_standard_atmosphere() -> None:
    assert standard_pressure_pa(0.0) == 101_325.0
    assert standard_pressure_pa(1000.0) == pytest.approx(89_875.0, abs=10.0)
