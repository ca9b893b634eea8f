"""The holds of the safety study: faults that make a boat run away, and healthy boats that must not be let go."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from asvhil.config import VesselConfig, load_config
from asvhil.study.comparison import vessel_override
from asvhil.study.robustness import NO_SENSOR
from asvhil.study.rows import ROWS, row_overrides
from asvhil.types import record

Keys = tuple[str, ...]

BOATS = {"WAM-V": "sitl", "BREAM": "sitl-bream"}
CONFIGS = (*BOATS.values(), "sitl-blueboat")  # of all holds
ENGAGED_S = 4.2  # after power-on the simulated boat is armed and engaged; a current has carried it until then
CURRENT_MPS = 2.5
# The monitor's limits were chosen by the holds of all but the last part, and by earlier ones: 2 m/s toward 180, 5
# toward 45 and 6 toward 270 degrees, seeds 11 to 13; 3.5 toward 145, 4.5 toward 265 and 6 toward 20, seeds 31 to 33.
# The page has the figures of `confirming`, which chose nothing.
WINDS: dict[str, tuple[tuple[float, float], ...]] = {  # m/s, toward degrees
    "tuning": ((3.0, 0.0), (6.0, 90.0), (4.0, 225.0)),
    "judging": ((3.0, 200.0), (5.0, 110.0), (6.0, 330.0)),
    "revising": ((3.0, 300.0), (4.5, 70.0), (5.5, 190.0)),
    "reporting": ((3.5, 160.0), (5.0, 20.0), (6.0, 245.0)),
    "confirming": ((3.0, 120.0), (4.5, 285.0), (6.0, 200.0)),
}
SEEDS: dict[str, tuple[int, ...]] = {
    "tuning": (1, 2, 3),
    "judging": (21, 22, 23),
    "revising": (41, 42, 43),
    "reporting": (51, 52, 53),
    "confirming": (61, 62, 63),
}
STARTS = {"5 m off": 5.0, "from the station": 0.0}


@record
class MotionFault:
    """What is wrong with the boat: config keys, and the codes of `health.code` that name it right.

    `only_told`: a hold need not end, if it is told by name.
    """

    name: str
    keys: Keys
    codes: frozenset[str]
    only_told: bool = False


@record
class HoldCase:
    """One hold: its group and boat in the tables, and the config keys that make it."""

    group: str
    boat: str
    base: str
    keys: Keys
    hold_s: float


def _fault(name: str, *kinds: str, codes: tuple[str, ...], only_told: bool = False) -> MotionFault:
    faults = ", ".join(f"{{{kind}}}" for kind in kinds)
    return MotionFault(name=name, keys=(f"plant.faults=[{faults}]",), codes=frozenset(codes), only_told=only_told)


def _compass(degrees: float, *, only_told: bool = False) -> MotionFault:
    name = f"compass off by {degrees:g}°"
    return _fault(name, f"kind: compass-turned, size: {degrees:g}", codes=("heading-off",), only_told=only_told)


REVERSED = ("kind: port-motor-reversed", "kind: starboard-motor-reversed")
FAULTS: dict[str, MotionFault] = {
    fault.name: fault
    for fault in (
        _fault("both motors reversed", *REVERSED, codes=("motors-reversed",)),
        _fault("port motor reversed", REVERSED[0], codes=("motor-reversed",)),
        _fault("starboard motor reversed", REVERSED[1], codes=("motor-reversed",)),
        _fault("motors swapped", "kind: motors-swapped", codes=("motors-swapped",)),
        _fault("port motor dead", "kind: port-motor", codes=("motor-dead",), only_told=True),
        _fault("starboard motor dead", "kind: starboard-motor", codes=("motor-dead",), only_told=True),
        _fault("both motors dead", "kind: port-motor", "kind: starboard-motor", codes=("no-thrust",)),
        _compass(180.0),
        _compass(90.0),
        _compass(-90.0),
        _compass(45.0, only_told=True),
        _compass(-45.0, only_told=True),
        MotionFault(
            name=f"current of {CURRENT_MPS:g} m/s",
            keys=(f"plant.weather.current.speed_mps={CURRENT_MPS:g}",),
            codes=frozenset({"beyond-motors", "drifted-off"}),
        ),
    )
}


def runaways(part: str, hold_s: float = 60.0) -> Iterator[tuple[MotionFault, str, HoldCase]]:
    """(fault, start, hold) of every fault, boat, start, wind and seed. The current sets across the wind's direction."""
    for fault in FAULTS.values():
        for boat, base in BOATS.items():
            for start, off_m in STARTS.items():
                for speed_mps, toward_deg in WINDS[part]:
                    for seed in SEEDS[part]:
                        bearing_deg = 50.0 * seed + toward_deg  # from the station to the boat
                        keys = (
                            *fault.keys,
                            *wind_keys(speed_mps, toward_deg, seed),
                            *_place(fault, off_m, bearing_deg, toward_deg + 70.0),
                        )
                        yield fault, start, HoldCase(group=fault.name, boat=boat, base=base, keys=keys, hold_s=hold_s)


def wind_keys(speed_mps: float, toward_deg: float, seed: int) -> Keys:
    return (
        f"plant.seed={seed}",
        f"plant.weather.wind.speed_mps={speed_mps:g}",
        f"plant.weather.wind.toward_deg={toward_deg:g}",
    )


def start_keys(off_m: float, bearing_deg: float) -> Keys:
    """The boat so far from the station, in that direction."""
    bearing = math.radians(bearing_deg)
    return f"plant.start_n_m={off_m * math.cos(bearing):.3f}", f"plant.start_e_m={off_m * math.sin(bearing):.3f}"


def _place(fault: MotionFault, off_m: float, bearing_deg: float, sets_deg: float) -> Keys:
    """Where the boat starts: in a current so far up that it is where it should be when the hold begins."""
    bearing, sets = math.radians(bearing_deg), math.radians(sets_deg)
    up_m = CURRENT_MPS * ENGAGED_S if "current" in fault.name else 0.0
    n_m = off_m * math.cos(bearing) - up_m * math.cos(sets)
    e_m = off_m * math.sin(bearing) - up_m * math.sin(sets)
    keys = f"plant.start_n_m={n_m:.3f}", f"plant.start_e_m={e_m:.3f}"
    return (*keys, f"plant.weather.current.toward_deg={sets_deg % 360.0:g}") if up_m else keys


# --- healthy boats -----------------------------------------------------------------------------------------


def weak(vessel: VesselConfig) -> dict[str, Any]:
    """Motors with 0.7 of the thrust that the model has."""
    return {"thrust_curve": tuple((command, 0.7 * thrust_n) for command, thrust_n in vessel.thrust_curve)}


def heavy(vessel: VesselConfig) -> dict[str, Any]:
    """A boat with 40 % more mass and inertia than the model has."""
    return {"mass_kg": 1.4 * vessel.mass_kg, "inertia_yaw_kgm2": 1.4 * vessel.inertia_yaw_kgm2}


def _other_boat(base: str, change: Callable[[VesselConfig], dict[str, Any]]) -> Keys:
    vessel = load_config(base).vehicle.vessel
    return (vessel_override(vessel.model_copy(update=change(vessel)), "plant.vessel"),)


GUSTY = (
    "plant.weather.wind.gust_along=0.35",
    "plant.weather.wind.gust_across=0.25",
    "plant.weather.wind.gust_time_s=4",
)
CHOP = ("plant.weather.waves.orbital_std_mps=0.07", "plant.weather.waves.yaw_std_radps=0.02")
SEA = ("plant.weather.waves.orbital_std_mps=0.15", "plant.weather.waves.yaw_std_radps=0.05")
DRIFT = ("plant.sensors.gnss.slow_bias_m=2.5", "plant.sensors.gnss.slow_bias_time_s=60")
FIELD = ("controller.mpc.near.heading=120", "controller.mpc.lasting_offset_m=[0.10,0.25]")
MODERATE = ("plant.weather.current.speed_mps=0.3", "plant.weather.current.toward_deg=120")


def _healthy_groups(base: str) -> dict[str, Keys]:
    """Config keys by name of the healthy boats that are held in each wind."""
    return {
        "as it is": (),
        "gusts": (*FIELD, *GUSTY),
        "chop": CHOP,
        "rough water": SEA,
        "glitches": ("plant.glitches={from_s: 10}",),
        "thrust x 0.7": _other_boat(base, weak),
        "mass + 40 %": _other_boat(base, heavy),
        "no wind sensor": NO_SENSOR,
        "receiver drift": DRIFT,
        "current of 0.3 m/s": MODERATE,
        "compass off by 10°": ("plant.faults=[{kind: compass-turned, size: 10}]",),
        "physics model": ("controller.name=sd-mpc",),
    }


def healthy(part: str, hold_s: float = 120.0) -> Iterator[HoldCase]:
    """Holds of healthy boats: the six tests, then other weather, sensors and hulls, from 14 m and from 40 m off."""
    for boat, base in BOATS.items():
        for row in ROWS:
            for seed in SEEDS[part]:
                yield HoldCase(group="six tests", boat=boat, base=base, keys=row_overrides(row, seed), hold_s=hold_s)
        for group, keys in _healthy_groups(base).items():
            for number, (speed_mps, toward_deg) in enumerate(WINDS[part]):
                for seed in SEEDS[part]:
                    start = start_keys((5.0, 14.0, 40.0)[(number + seed) % 3], 50.0 * seed + toward_deg)
                    yield HoldCase(
                        group=group,
                        boat=boat,
                        base=base,
                        keys=(*keys, *wind_keys(speed_mps, toward_deg, seed), *start),
                        hold_s=hold_s,
                    )
    for speed_mps, toward_deg in WINDS[part]:
        for seed in SEEDS[part]:
            keys = (*wind_keys(speed_mps, toward_deg, seed), *start_keys(8.0, 50.0 * seed + toward_deg))
            for group, more in (("as it is", ()), ("no wind sensor", NO_SENSOR), ("chop", CHOP)):
                yield HoldCase(group=group, boat="BlueBoat", base=CONFIGS[-1], keys=(*more, *keys), hold_s=hold_s)
            far = ("controller.procedure.enabled=true", *keys, *start_keys(60.0, 50.0 * seed + toward_deg))
            yield HoldCase(group="approach from 60 m", boat="WAM-V", base="sitl", keys=far, hold_s=hold_s)
