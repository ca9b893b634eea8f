"""What is made of a boat's model is made once in a process: a study builds a backseat for each of its runs."""

from __future__ import annotations

import pytest

from asvhil.backseat.build import build_backseat, build_model
from asvhil.config import load_config
from asvhil.dynamics.buffers import evaluate_with


@pytest.mark.parametrize("over", [(), ("controller.name=sd-mpc",), ("controller.name=sd-mpc", "learning.enabled=true")])
def test_a_second_backseat_of_a_boat_makes_no_function_again(over: tuple[str, ...]) -> None:
    build_backseat(load_config("sitl", over))
    made: list[str] = []
    evaluate_with(lambda function: made.append(function.name()))
    build_backseat(load_config("sitl", over))
    assert made == []
    assert build_model(load_config("sitl", over)) is build_model(load_config("sitl", over))


def test_another_vessel_has_another_model() -> None:
    over = ("controller.name=sd-mpc", "vehicle.vessel.mass_kg=300.0")
    heavier = build_model(load_config("sitl", over))
    assert heavier is not build_model(load_config("sitl", over[:1]))
