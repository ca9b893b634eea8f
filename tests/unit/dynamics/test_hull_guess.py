"""Guesses from tape and scale against the three shipped boats, whose parameters come from other sources."""

import math

import numpy as np
import pytest

from asvhil.config import VesselConfig, load_config
from asvhil.dynamics.hull_guess import HullMeasures, check_measures, doubts, guess_vessel, usual_thrust
from asvhil.dynamics.rigid_body import SimplifiedDynamics, ThrustCurve
from asvhil.errors import ConfigError
from asvhil.types import changed

# Length, beam: makers' data sheets (WAM-V 16, Otter, BlueBoat). Top speed and turning rate: of the shipped parameters.
BOATS = {
    "sitl": HullMeasures(
        length_m=4.88, beam_m=2.44, mass_kg=254.5, top_speed_mps=2.25, motors_apart_m=2.05, turn_degps=19, thrust_n=240
    ),
    "sitl-bream": HullMeasures(
        length_m=2.0, beam_m=1.08, mass_kg=80.0, top_speed_mps=3.09, motors_apart_m=0.79, turn_degps=18.4, thrust_n=120
    ),
    "blueboat": HullMeasures(
        length_m=1.2, beam_m=0.93, mass_kg=20.0, top_speed_mps=3.0, motors_apart_m=0.59, turn_degps=64, thrust_n=44
    ),
}
# By nature: VRX's linear sway drag and the linear surge drag of otter.py are outliers, the curve of Sarda is steeper.
OUTLIERS = {
    ("sitl", "sway_drag_n_per_mps"),
    ("sitl-bream", "surge_drag_n_per_mps"),
    ("sitl-bream", "surge_drag_n_per_mps2"),
}
CAT = HullMeasures(length_m=1.6, beam_m=1.0, mass_kg=38.0, top_speed_mps=2.0, motors_apart_m=0.84)


@pytest.mark.parametrize("name", BOATS)
def test_guesses_are_within_a_factor_of_two(name: str) -> None:
    known, guess = load_config(name).vehicle.vessel, guess_vessel(BOATS[name])
    for key in VesselConfig.model_fields:
        if key not in ("thrust_curve", "coupling") and (name, key) not in OUTLIERS:
            assert 0.5 <= getattr(guess, key) / getattr(known, key) <= 2.01, key
    for end in (0, -1):
        assert 0.6 <= guess.thrust_curve[end][1] / known.thrust_curve[end][1] <= 1.6


def steady(vessel: VesselConfig, port: float, starboard: float) -> tuple[float, float]:
    """Surge speed (m/s) and yaw rate (deg/s) that the physics reach with these commands."""
    model = SimplifiedDynamics(vessel)
    a = model.input_of_command((port, starboard))
    x, wind = np.array([0.0, 0.0, 0.0, *a]), np.zeros(2)
    for _ in range(6000):
        x = x + 0.02 * model.derivative(x, np.array(a), wind)
    return float(x[0]), math.degrees(float(x[2]))


def test_the_guess_reaches_the_speed_and_the_turn_that_it_was_made_from() -> None:
    vessel = guess_vessel(changed(CAT, turn_degps=45.0))
    assert steady(vessel, 1.0, 1.0)[0] == pytest.approx(2.0, rel=0.02)
    assert steady(vessel, 1.0, -1.0)[1] == pytest.approx(45.0, rel=0.1)  # unequal thrusts drive it ahead as well
    fast = guess_vessel(changed(CAT, turn_degps=200.0))  # more than the linear drag would allow
    assert steady(fast, 1.0, -1.0)[1] == pytest.approx(200.0, rel=0.1)
    assert fast.yaw_drag_nm_per_radps > 0.0 and fast.yaw_drag_nm_per_radps2 > 0.0


def test_the_thrust_comes_from_the_speed_where_it_is_not_known() -> None:
    for name in ("sitl-bream", "blueboat"):
        boat = BOATS[name]
        assert boat.thrust_n is not None and usual_thrust(boat) == pytest.approx(boat.thrust_n, rel=0.1)
    curve = ThrustCurve(guess_vessel(CAT).thrust_curve)
    assert curve.ahead_n == pytest.approx(usual_thrust(CAT), abs=0.1)
    assert curve.thrust_n(0.04) == 0.0 and curve.command(1.0) > 0.05


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"length_m": 160.0}, "length 160 m: 0.3 to 12 m is expected"),
        ({"mass_kg": 0.038}, "mass 0.038 kg: 1 to 5000 kg is expected"),
        ({"beam_m": 2.0}, "beam 2 m is more than the length of 1.6 m: exchanged?"),
        ({"motors_apart_m": 1.3}, "distance of the motors 1.3 m is more than the beam of 1 m"),
        ({"mass_kg": 900.0}, "mass 900 kg is too much to float on hulls of 1.6 m"),
        ({"turn_degps": 0.7}, "turning rate 0.7 deg/s: 2 to 360 deg/s is expected"),
        ({"thrust_n": 0.0}, "thrust 0 N: 1 to 5000 N is expected"),
    ],
)
def test_figures_that_cannot_be_are_refused(changes: dict[str, float], words: str) -> None:
    with pytest.raises(ConfigError, match=words.replace("?", r"\?")):
        check_measures(changed(CAT, **changes))


def test_a_thrust_in_kgf_is_doubted() -> None:
    assert doubts(CAT) == "" and doubts(changed(CAT, thrust_n=28.0)) == ""
    assert "about 28 N is expected" in doubts(changed(CAT, thrust_n=2.9))
