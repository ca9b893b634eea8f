"""A model file that was trained on another boat than the config describes, though it has the name."""

import dataclasses
from pathlib import Path

import pytest

from asvhil.backseat.build import build_backseat, build_model, model_file, model_replaced
from asvhil.config import Config, load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import read_model, save_model
from asvhil.errors import OtherHullError
from asvhil.preflight.computer import computer_checks
from asvhil.preflight.table import Result

# The boat of a reader of the README: 38 kg, and called as the one whose config was copied.
SMALL = (
    "controller.name=nnsem-mpc",
    "vehicle.vessel.mass_kg=38",
    "vehicle.vessel.inertia_yaw_kgm2=9",
    "vehicle.vessel.motor_arm_m=0.42",
)


def small(*keys: str) -> Config:
    return load_config("sitl", (*SMALL, *keys))


def test_it_is_refused_by_its_figures() -> None:
    with pytest.raises(OtherHullError) as caught:
        build_backseat(small())
    text = str(caught.value)
    assert "wamv16-nnsem.npz" in text and "mass 280 kg for" in text and "motor arm 1.03 m for 0.42 m" in text
    assert "controller.on_other_hull" in text and "\n" not in text
    (check, *_) = computer_checks(small())
    assert check.result is Result.FAIL and "motor arm" in check.found


def test_the_physics_stand_in_for_it_where_the_config_says_so() -> None:
    config = small("controller.on_other_hull=physics")
    model = build_model(config)
    assert isinstance(model, SimplifiedDynamics) and model_replaced(config, model)
    (check, *_) = computer_checks(config)
    assert check.result is Result.WARN and "another hull" in check.found


def test_it_is_used_where_the_config_says_so() -> None:
    config = small("controller.on_other_hull=use")
    model = build_model(config)
    assert model.name == "nnsem" and not model_replaced(config, model)


def test_physics_that_the_estimator_alone_assumes_do_not_count() -> None:
    keys = tuple(key.replace("vehicle.vessel", "controller.vessel") for key in SMALL)
    vessel = load_config("sitl").vehicle.vessel.model_dump(mode="json")
    whole = tuple(f"controller.vessel.{name}={value}" for name, value in vessel.items())
    config = load_config("sitl", ("controller.name=nnsem-mpc", *whole, *keys))
    assert build_model(config).name == "nnsem"


def test_a_file_that_does_not_tell_is_used_and_check_says_so(tmp_path: Path) -> None:
    shipped = model_file(load_config("sitl", ("controller.name=nnsem-mpc",)))
    assert shipped is not None
    file = tmp_path / "wamv16-nnsem.npz"
    save_model(file, dataclasses.replace(read_model(shipped), hull=None))
    config = small(f"controller.model={file}")
    assert build_model(config).name == "nnsem"
    (check, *_) = computer_checks(config)
    assert check.result is Result.PASS and "does not tell of which hull" in check.found
