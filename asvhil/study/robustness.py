"""Study of robustness: the cost of no wind sensor, and of a wrong model with a turned vane and a current."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from asvhil.config import VesselConfig, load_config
from asvhil.study.comparison import Held, Scores, compare, held_words, not_held, run_setups, vessel_override
from asvhil.study.rows import FROM_S, ROWS, TO_S, along_the_wind, title
from asvhil.study.runner import Run
from asvhil.study.six_tests import cost_figures
from asvhil.study.statistics import count_of_seeds, other_code, plus_minus

VANE_DEG = 20.0
CURRENT = ("plant.weather.current.speed_mps=0.3", "plant.weather.current.toward_deg=90")
# The first sentence would come long after the run: a boat without an anemometer.
NO_SENSOR = ("plant.sensors.anemometer.rate_hz=0.0001",)
RATIO_MAX, ALONG_MAX = 1.15, 1.2


def crude_vessel(vessel: VesselConfig) -> VesselConfig:
    """A vessel guessed without measurements: mass, motor arm and thrust curve are known, the rest is a rule of thumb.

    No added mass in surge and as much as the mass in sway; an inertia of twice m times the motors' arm squared, with
    nothing added; drag linear alone in each axis; a quarter too little wind load ahead, a half too much abeam and no
    moment of the wind; the motor lag a third short. The thrust curve and the arm are known.
    """
    m_kg, arm_m = vessel.mass_kg, vessel.motor_arm_m
    return vessel.model_copy(
        update={
            "added_mass_surge_kg": 0.0,
            "added_mass_sway_kg": m_kg,
            "inertia_yaw_kgm2": 2.0 * m_kg * arm_m**2,
            "added_inertia_yaw_kgm2": 0.0,
            "surge_drag_n_per_mps": 2.0 * vessel.surge_drag_n_per_mps,
            "surge_drag_n_per_mps2": 0.0,
            "sway_drag_n_per_mps": 2.0 * vessel.sway_drag_n_per_mps,
            "sway_drag_n_per_mps2": 0.0,
            "yaw_drag_nm_per_radps": 0.7 * vessel.yaw_drag_nm_per_radps,
            "yaw_drag_nm_per_radps2": 0.0,
            "wind_surge_n_per_mps2": 0.75 * vessel.wind_surge_n_per_mps2,
            "wind_sway_n_per_mps2": 1.5 * vessel.wind_sway_n_per_mps2,
            "wind_yaw_nm_per_mps2": 0.0,
            "motor_lag_s": 0.67 * vessel.motor_lag_s,
            "coupling": None,
        }
    )


def setups(controller: tuple[str, ...], base: str, overrides: tuple[str, ...] = ()) -> dict[str, tuple[str, ...]]:
    """Config keys by name: `controller` (its own keys and all others) with and without a wind sensor, and SD-MPC with
    the right and the wrong model, without and with a current."""
    crude = vessel_override(crude_vessel(load_config(base, overrides).vehicle.vessel))
    true = (*overrides, "controller.name=sd-mpc")
    wrong = (*true, crude, f"plant.sensors.anemometer.misalignment_deg={VANE_DEG:g}")
    return {
        "with sensor": controller,
        "without sensor": (*controller, *NO_SENSOR),
        "true model": true,
        "crude model, vane turned": wrong,
        "true model, current": (*true, *CURRENT),
        "crude model, vane turned, current": (*wrong, *CURRENT),
    }


PAIRS = {  # what is asked of: (tried, against)
    "no wind sensor": ("without sensor", "with sensor"),
    "crude model, vane turned by 20°": ("crude model, vane turned", "true model"),
    "crude model, vane turned by 20°, 0.3 m/s of current": ("crude model, vane turned, current", "true model, current"),
}


def study_robustness(
    run: Run,
    *,
    controller: tuple[str, ...],
    rows: Iterable[str] = tuple(ROWS),
    seeds: Iterable[int] = (1, 2, 3, 4, 5),
    window_s: tuple[float, float] = (FROM_S, TO_S),
    base: str = "sitl",
    overrides: tuple[str, ...] = (),
) -> dict[str, Any]:
    """ps of each pair in each row beside its limit: a ratio, or a difference without a sensor along the wind."""
    rows, seeds = list(rows), list(seeds)
    made = setups(controller, base, overrides)
    scores, held, finished = run_setups(run, made, rows, seeds, window_s, base=base)
    return {
        "window_s": list(window_s),
        "seeds": list(seeds),
        "vane_deg": VANE_DEG,
        "current": list(CURRENT),
        "crude_vessel": crude_vessel(load_config(base, overrides).vehicle.vessel).model_dump(mode="json"),
        "pairs": {pair: {row: judge(pair, row, scores, held) for row in rows} for pair in PAIRS},
        "not_held": not_held(held),
        "cost": cost_figures(finished),
    }


def judge(pair: str, row: str, scores: Scores, held: Held) -> dict[str, Any]:
    """The figures of a pair in a row, the limit that applies, and whether it is kept, by runs that had the motors."""
    tried, against = PAIRS[pair]
    figures = compare(scores[tried, row], scores[against, row])
    if pair == "no wind sensor" and along_the_wind(row):
        asked, value = {"difference": ALONG_MAX}, figures["difference"]["mean"]
    else:
        asked, value = {"ratio": RATIO_MAX}, figures["ratio"]
    whole = held[tried, row] >= 1.0 and held[against, row] >= 1.0
    return {**figures, "asked": asked, "met": whole and value <= next(iter(asked.values()))}


def markdown(study: Mapping[str, Any]) -> str:
    """A table for each pair."""
    parts = []
    for pair, rows in study["pairs"].items():
        tried, against = PAIRS[pair]
        lines = [
            f"### {pair[0].upper()}{pair[1:]}",
            "",
            f"| test | {tried} | {against} | ratio | difference | asked | met |",
            "|" + " --- |" * 7,
        ]
        for row, cell in rows.items():
            what, limit = next(iter(cell["asked"].items()))
            met = "yes" if cell["met"] else "**no**"
            lines.append(
                f"| {title(row)} | {plus_minus(cell['ps'])} | {plus_minus(cell['against_ps'])} | {cell['ratio']:.3f} "
                f"| {plus_minus(cell['difference'])} | {what} at most {limit:g} | {met} |"
            )
        parts.append("\n".join(lines))
    from_s, to_s = study["window_s"]
    about = (
        f"Penalty scores against the truth over [{from_s:g}, {to_s:g}] s, {count_of_seeds(study['seeds'])}: "
        "means with half of their 95 % interval; differences are those of runs with the same seed. The "
        "current of 0.3 m/s sets toward 90°; the crude model knows the mass, the arm and the thrust curve of "
        "the motors, and guesses the rest."
    )
    lost = held_words(study["not_held"], "nothing is met with them")
    return "\n\n".join([about, *parts, *lost, *other_code(study["cost"]["runs_of_other_code"])]) + "\n"
