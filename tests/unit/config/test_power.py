"""The power from the battery in a config: what is refused in one line, and what an older config is taken for."""

from __future__ import annotations

import json

import pytest

from asvhil.config import config_from_json, load_config
from asvhil.errors import ConfigError


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("power_curve=[[0.0, 0.0]]", "at least 2 rows with rising commands"),
        ("power_curve=[[1.0, 9.0], [-1.0, 9.0]]", "at least 2 rows with rising commands"),
        ("power_curve=[[0.0, 0.0], [1.0, 9.0]]", "reach both astern and ahead"),
        ("power_curve=[[-1.0, 9.0], [1.1, 9.0]]", "commands -1..1"),
        ("power_curve=[[-1.0, -9.0], [1.0, 9.0]]", "must not be negative"),
        ("power_curve=[[-1.0, 9.0], [0.5, 9.0], [1.0, 8.0]]", "must not fall as the command goes away from 0"),
        ("power_curve=[[-1.0, 8.0], [-0.5, 9.0], [1.0, 9.0]]", "must not fall as the command goes away from 0"),
        ("hotel_w=-1", "hotel_w"),
        ("capacity_wh=0", "capacity_wh"),
    ],
)
def test_a_wrong_value_is_one_line_that_names_the_key(value: str, why: str) -> None:
    with pytest.raises(ConfigError, match=r"vehicle\.power") as error:
        load_config("sitl", (f"vehicle.power.{value}",))
    assert why in str(error.value) and "\n" not in str(error.value)


def test_a_config_without_it_keeps_its_hash_and_an_empty_one_is_some() -> None:
    bream = load_config("sitl-bream")
    assert bream.vehicle.power is None and "power" not in json.loads(bream.canonical_json())["vehicle"]
    assert config_from_json(bream.canonical_json(), "memory") == bream
    power = load_config("sitl-bream", ("vehicle.power={}",)).vehicle.power
    assert power is not None and power.drawn_w((1.0, 1.0)) is None


@pytest.mark.parametrize(("command", "watts"), [(1.0, 2 * 381.3), (-1.0, 2 * 388.8), (0.45, 41.6 + 73.3), (0.0, 0.0)])
def test_the_curve_of_the_blueboat(command: float, watts: float) -> None:
    power = load_config("blueboat").vehicle.power
    assert power is not None and power.drawn_w((command, command)) == pytest.approx(watts)


def test_a_simulated_sensor_needs_the_curve() -> None:
    with pytest.raises(ConfigError, match=r"plant\.frontseat\.current_sensor: .*vehicle\.power\.power_curve"):
        load_config("sitl-bream", ("plant.frontseat.current_sensor=true", "vehicle.power={capacity_wh: 9}"))
    plain = json.loads(load_config("sitl-bream").canonical_json())
    assert "current_sensor" not in plain["plant"]["frontseat"], "its hash is as before"
