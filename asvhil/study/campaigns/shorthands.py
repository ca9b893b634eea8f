"""Short names of what campaigns vary most, and the config keys that they stand for."""

from __future__ import annotations

from typing import Any

from asvhil.config.fault_text import parse_fault
from asvhil.config.root import Config
from asvhil.errors import ConfigError

_WEATHER = "plant.weather"
SHORTHANDS: dict[str, tuple[str, ...]] = {
    "wind_speed": (f"{_WEATHER}.wind.speed_mps",),
    "wind_toward": (f"{_WEATHER}.wind.toward_deg",),
    "gust": (f"{_WEATHER}.wind.gust_along", f"{_WEATHER}.wind.gust_across"),
    "gust_time": (f"{_WEATHER}.wind.gust_time_s",),
    "wave_speed": (f"{_WEATHER}.waves.orbital_std_mps",),
    "wave_yaw": (f"{_WEATHER}.waves.yaw_std_radps",),
    "wave_peak": (f"{_WEATHER}.waves.peak_hz",),
    "wave_toward": (f"{_WEATHER}.waves.toward_deg",),
    "current_speed": (f"{_WEATHER}.current.speed_mps",),
    "current_toward": (f"{_WEATHER}.current.toward_deg",),
    "station_heading": ("supervisor.station.heading_deg",),
    "controller": ("controller.name",),
    "fault": ("plant.faults",),
}
ACROSS = 0.5  # of the gusts across the wind to those along it, as in the default wind
VESSEL = "plant.vessel"


def keys_of(name: str) -> tuple[str, ...]:
    """The config keys that a parameter sets."""
    return SHORTHANDS.get(name, (name,))


def assignments(name: str, value: Any) -> dict[str, Any]:
    """Config keys and values of one value of a parameter. ConfigError for a fault that cannot be."""
    if name == "fault":
        faults = [] if value in (None, "none") else value if isinstance(value, list) else [value]
        for one in faults:
            if not isinstance(one, str):
                raise ConfigError(f"none, or KIND@FROM:FORs as text, is expected, not {one!r}")
        return {"plant.faults": [parse_fault(one).model_dump(mode="json") for one in faults]}
    if name == "gust":
        along, across = keys_of(name)
        return {along: value, across: value * ACROSS}
    return {keys_of(name)[0]: value}


def base_value(config: Config, key: str) -> Any:
    """The value of a key in a config; of the simulated hull also where it is that of the vehicle. KeyError if none."""
    if key.startswith(f"{VESSEL}."):
        return getattr(config.plant_vessel, key.removeprefix(f"{VESSEL}."), None)
    node: Any = config
    for part in key.split("."):
        node = getattr(node, part, None)
    return node
