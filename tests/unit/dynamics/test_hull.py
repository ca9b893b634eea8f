"""Which boat a model is of: told from the hull and motors, and never from the name alone."""

import pytest

from asvhil.config import VesselConfig, load_config
from asvhil.dynamics.hull import UNITS, differences, hull_of

VESSELS = {name: load_config(name).vehicle.vessel for name in ("sitl", "sitl-bream", "sitl-blueboat")}


def changed(vessel: VesselConfig, **by: float) -> VesselConfig:
    """The vessel with some figures multiplied."""
    thrust = by.pop("thrust", 1.0)
    curve = tuple((command, thrust * force_n) for command, force_n in vessel.thrust_curve)
    return vessel.model_copy(
        update={name: factor * getattr(vessel, name) for name, factor in by.items()} | {"thrust_curve": curve}
    )


@pytest.mark.parametrize("name", VESSELS)
def test_a_boat_is_itself_and_no_other_shipped_one(name: str) -> None:
    hull = hull_of(VESSELS[name])
    assert set(hull) == set(UNITS)
    assert differences(hull, VESSELS[name]) == ""
    for other in set(VESSELS) - {name}:
        assert "mass" in differences(hull, VESSELS[other])


@pytest.mark.parametrize(
    ("by", "told"),
    [
        ({"mass_kg": 1.4}, ""),  # a payload
        ({"mass_kg": 0.7}, ""),
        ({"motor_arm_m": 0.9, "thrust": 1.2}, ""),
        ({"mass_kg": 1.8}, "mass"),
        ({"mass_kg": 0.4, "added_mass_surge_kg": 0.4}, "mass"),
        ({"inertia_yaw_kgm2": 3.0}, "yaw inertia"),
        ({"motor_arm_m": 0.5}, "motor arm"),
        ({"thrust": 0.5}, "thrust ahead"),
        ({"thrust": 2.0}, "thrust astern"),
    ],
)
def test_what_counts_as_another_boat(by: dict[str, float], told: str) -> None:
    found = differences(hull_of(VESSELS["sitl"]), changed(VESSELS["sitl"], **by))
    assert (told in found) if told else found == ""


def test_figures_that_a_file_does_not_have_say_nothing() -> None:
    assert differences({}, VESSELS["sitl"]) == ""
    assert differences({"mass": 10.0}, VESSELS["sitl"]) == "mass 10 kg for 280 kg"
