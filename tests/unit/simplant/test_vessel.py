"""The true motion of the simulated boat against figures worked by hand from the parameters in wamv16.yaml."""

from __future__ import annotations

import math

import pytest

from asvhil.config import load_config
from asvhil.dynamics.rigid_body import ThrustCurve
from asvhil.simplant.boat.vessel import MotorTable, Vessel

VEHICLE = load_config("wamv16", ("links.autopilot.endpoint=udpin:127.0.0.1:14560",)).vehicle


def boat(heading_deg: float = 0.0, current: tuple[float, float] = (0.0, 0.0), step_s: float = 0.01) -> Vessel:
    return Vessel(VEHICLE.vessel, VEHICLE.pwm, step_s, (0.0, 0.0, math.radians(heading_deg)), current)


def run(vessel: Vessel, seconds: float, wind: tuple[float, float] = (0.0, 0.0), step_s: float = 0.01) -> Vessel:
    for _ in range(round(seconds / step_s)):
        vessel.step(*wind)
    return vessel


@pytest.mark.parametrize(
    ("pulse_us", "thrust_n"),
    [
        (1500, 0.0),
        (1900, 240.5),
        (2000, 240.5),
        (1700, 84.5),
        (1560, 2.25),
        (1540, 0.0),
        (1420, 0.0),
        (1300, -13.0),
        (1110, -93.0),  # the curve was measured down to a command of -0.95
        (1100, -93.0),
        (0, 0.0),  # no signal
    ],
)
def test_pulse_width_gives_the_thrust_of_the_measured_curve(pulse_us: int, thrust_n: float) -> None:
    assert MotorTable(VEHICLE.vessel, VEHICLE.pwm).thrust_n(pulse_us) == pytest.approx(thrust_n, abs=1e-9)


def test_every_pulse_agrees_with_the_thrust_curve_of_the_model() -> None:
    table, curve = MotorTable(VEHICLE.vessel, VEHICLE.pwm), ThrustCurve(VEHICLE.vessel.thrust_curve)
    for pulse_us in range(1000, 2001):
        command = max(-1.0, min(1.0, (pulse_us - 1500) / 400.0))
        assert table.thrust_n(pulse_us) == pytest.approx(curve.thrust_n(command), abs=1e-9)


def test_terminal_speed_balances_drag_and_thrust() -> None:
    # 2 x 84.5 N = 51.3 u + 72.4 u^2 (water) + 0.5 u^2 (still air)  ->  u = 1.21085 m/s
    vessel = boat()
    vessel.drive((1700, 1700))
    run(vessel, 60.0)
    assert vessel.u_mps == pytest.approx(1.21085, abs=1e-4)
    assert vessel.v_mps == vessel.r_radps == vessel.psi_rad == 0.0
    assert vessel.e_m == 0.0 and vessel.n_m > 60.0


def test_thrust_lags_by_the_motor_time_constant() -> None:
    vessel = boat()
    vessel.drive((1700, 1700))
    run(vessel, 0.3)
    assert vessel.thrust_port_n == pytest.approx(84.5 * (1.0 - math.exp(-1.0)), rel=1e-9)


def test_port_thrust_turns_clockwise_and_starboard_thrust_the_other_way() -> None:
    port, starboard = boat(), boat()
    port.drive((1700, 1500))
    starboard.drive((1500, 1700))
    run(port, 5.0)
    run(starboard, 5.0)
    assert port.r_radps > 0.05 and port.psi_rad > 0.2 and port.e_m > 0.0
    assert (starboard.r_radps, starboard.psi_rad, starboard.e_m) == pytest.approx(
        (-port.r_radps, -port.psi_rad, -port.e_m)
    )


def test_spin_on_the_spot_balances_yaw_drag() -> None:
    # port +84.5 N (1700), starboard -84 N (1140: command -0.9): N = 1.027 x 168.5 = 800 r + 800 r^2  ->  r = 0.18299
    vessel = boat()
    vessel.drive((1700, 1140))
    run(vessel, 30.0)
    assert vessel.r_radps == pytest.approx(0.18299, abs=2e-4)


def test_no_signal_switches_the_motors_off() -> None:
    vessel = boat()
    assert vessel.outputs_us == (0, 0)
    vessel.drive((1900, 1900))
    run(vessel, 1.0)
    vessel.drive((0, 0))
    run(vessel, 6.0)
    assert abs(vessel.thrust_port_n) < 1e-5 and abs(vessel.thrust_starboard_n) < 1e-5


@pytest.mark.parametrize("heading_deg", [0.0, 77.0])
def test_a_boat_without_thrust_or_relative_wind_drifts_exactly_with_the_current(heading_deg: float) -> None:
    vessel = run(boat(heading_deg, current=(-0.2, 0.5)), 100.0, wind=(-0.2, 0.5))
    assert (vessel.n_m, vessel.e_m) == pytest.approx((-20.0, 50.0), abs=1e-9)
    assert vessel.ground_velocity_ned() == pytest.approx((-0.2, 0.5), abs=1e-12)
    assert vessel.psi_rad == math.radians(heading_deg) and vessel.r_radps == 0.0


def test_ground_velocity_in_body_axes_is_that_in_ned_turned_by_the_heading() -> None:
    vessel = boat(90.0, current=(0.0, 0.5))  # heading east, carried east: pure surge
    assert vessel.ground_velocity_body() == pytest.approx((0.5, 0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("wind", "u_dot", "v_dot", "r_dot"),
    [
        # 4 m/s from astern: X = 0.5 x 16 = 8 N on 279.95 kg
        ((4.0, 0.0), 0.028577, 0.0, 0.0),
        # 4 m/s onto the port side: Y = 1.0 x 16 = 16 N on 636.25 kg
        ((0.0, 4.0), 0.0, 0.025147, 0.0),
        # 4 m/s toward 45 deg: X = 4 N, Y = 8 N, N = -2 x 0.33 x 8 = -5.28 N m on 892 kg m2: the bow goes to windward
        ((2.828427, 2.828427), 0.014288, 0.012574, -0.0059193),
    ],
)
def test_wind_load_at_rest(wind: tuple[float, float], u_dot: float, v_dot: float, r_dot: float) -> None:
    vessel = boat()
    vessel.step(*wind)
    assert vessel.u_mps / 0.01 == pytest.approx(u_dot, rel=2e-3, abs=1e-9)
    assert vessel.v_mps / 0.01 == pytest.approx(v_dot, rel=2e-3, abs=1e-9)
    assert vessel.r_radps / 0.01 == pytest.approx(r_dot, rel=1e-2, abs=1e-9)
    assert (vessel.ax_mps2, vessel.ay_mps2) == pytest.approx((u_dot, v_dot), rel=5e-3, abs=1e-9)


def test_wind_load_turns_with_the_hull() -> None:
    # heading east, wind toward north: onto the starboard side, so it pushes to port
    vessel = boat(90.0)
    vessel.step(4.0, 0.0)
    assert vessel.v_mps / 0.01 == pytest.approx(-0.025147, rel=2e-3)
    assert abs(vessel.u_mps) < 1e-9


def test_the_accelerometer_feels_the_centripetal_acceleration_of_a_steady_turn() -> None:
    # In a steady turn the path is a circle: |a| = speed x rate, square to the velocity.
    vessel = boat()
    vessel.drive((1700, 1600))
    run(vessel, 120.0)
    speed = math.hypot(vessel.u_mps, vessel.v_mps)
    assert math.hypot(vessel.ax_mps2, vessel.ay_mps2) == pytest.approx(speed * vessel.r_radps, rel=1e-3)
    assert vessel.ax_mps2 * vessel.u_mps + vessel.ay_mps2 * vessel.v_mps == pytest.approx(0.0, abs=1e-4)


def test_steps_of_10_ms_stay_within_a_millimetre_of_steps_of_1_ms() -> None:
    coarse, fine = boat(), boat(step_s=0.001)
    for outputs in ((1900, 1500), (1500, 1900), (1200, 1700), (1700, 1600)):
        coarse.drive(outputs)
        fine.drive(outputs)
        run(coarse, 5.0, wind=(3.0, -5.0))
        run(fine, 5.0, wind=(3.0, -5.0), step_s=0.001)
    assert math.hypot(coarse.n_m - fine.n_m, coarse.e_m - fine.e_m) < 0.001
    assert coarse.psi_rad == pytest.approx(fine.psi_rad, abs=5e-5)
