"""Circumstances under which models are compared in the loop: with helps taken away, in waves, on boats that changed."""

from __future__ import annotations

import json
from typing import Any

from asvhil.config import Config, VesselConfig, load_config
from asvhil.study.comparison import vessel_override
from asvhil.study.robustness import NO_SENSOR
from asvhil.study.rows import Keys
from asvhil.study.safety_cases import CHOP, heavy, weak

SECOND = "sitl-second"
TRUE_VESSEL = "plant.vessel"
AS_SHIPPED = "as shipped"
SECOND_BOAT = "second boat"
# Without what makes up for a wrong model: as in the paper.
BARE = ("controller.mpc.disturbance_feedforward=false", "controller.mpc.trim_max_rad=0")


def slow(vessel: VesselConfig) -> dict[str, Any]:
    """Motors that follow their commands with twice the lag of the WAM-V's."""
    return {"motor_lag_s": 0.6}


def slippery(vessel: VesselConfig) -> dict[str, Any]:
    """Half of the drag in sway."""
    return {
        "sway_drag_n_per_mps": 0.5 * vessel.sway_drag_n_per_mps,
        "sway_drag_n_per_mps2": 0.5 * vessel.sway_drag_n_per_mps2,
    }


def tall(vessel: VesselConfig) -> dict[str, Any]:
    """Wind loads 1.6 times those of the model."""
    names = ("wind_surge_n_per_mps2", "wind_sway_n_per_mps2", "wind_yaw_nm_per_mps2")
    return {name: 1.6 * getattr(vessel, name) for name in names}


CHANGES = {
    "thrust x 0.7": weak,
    "mass + 40 %": heavy,
    "motor lag 0.6 s": slow,
    "side drag x 0.5": slippery,
    "wind load x 1.6": tall,
}


def circumstances(base: str, overrides: Keys = ()) -> dict[str, Keys]:
    """Config keys of each circumstance by its name, the same for all controllers; of the boat of a config.

    The second boat is there where the config is of the vehicle that it was made from.
    """
    config = load_config(base, overrides)
    vessel = config.vehicle.vessel
    found: dict[str, Keys] = {
        AS_SHIPPED: (),
        "no disturbance, no trim": BARE,
        "no wind sensor": NO_SENSOR,
        "light chop": CHOP,
    }
    second = load_config(SECOND)
    if second.vehicle.name == config.vehicle.name:
        found[SECOND_BOAT] = second_boat(second)
    for name, change in CHANGES.items():
        found[name] = (vessel_override(vessel.model_copy(update=change(vessel)), TRUE_VESSEL),)
    return found


def second_boat(second: Config) -> Keys:
    """The keys that put the second boat in the place of the plant and leave what the controllers believe."""
    parts = {"wind_load": second.plant.wind_load, "motors": second.plant.motors}
    made = {name: part.model_dump(mode="json") for name, part in parts.items() if part is not None}
    keys = (f"plant.{name}={json.dumps(part)}" for name, part in made.items())
    return (vessel_override(second.plant_vessel, TRUE_VESSEL), *keys)
