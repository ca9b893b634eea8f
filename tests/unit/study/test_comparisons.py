"""Robustness and learned models in the loop: what the setups really are, and how they are judged."""

import json

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.study import approach, learned_loop, robustness
from asvhil.study.circumstances import circumstances
from asvhil.study.comparison import compare, vessel_override
from asvhil.study.learned_loop import COEFFICIENTS, CRUDE, TRUE, off_name, off_vessel, signs, study_learned_loop
from asvhil.study.robustness import CURRENT, PAIRS, crude_vessel, judge, setups, study_robustness
from asvhil.study.rows import row_overrides
from asvhil.study.runner import run_into
from asvhil.types import Phase

VESSEL = load_config("sitl").vehicle.vessel
SETUPS = setups(("controller.name=nnsem-mpc",), "sitl")


def config_of(name: str):
    return load_config("sitl", (*row_overrides("5", 1), *SETUPS[name]))


def test_ratios_and_differences_by_hand():
    found = compare({1: 2.0, 2: 4.0}, {1: 1.0, 2: 1.0, 3: 50.0})
    assert found["ratio"] == 3.0 and found["difference"]["mean"] == 2.0
    assert (found["ps"]["mean"], found["against_ps"]["mean"]) == (3.0, 1.0)


def test_a_vessel_goes_through_the_config_unchanged():
    config = load_config("sitl", ("controller.name=sd-mpc", vessel_override(crude_vessel(VESSEL))))
    assert config.controller.vessel == crude_vessel(VESSEL) != config.vehicle.vessel == VESSEL


def test_the_crude_model_knows_the_thrust_curve_and_little_else():
    crude = crude_vessel(VESSEL)
    same = {name for name in type(VESSEL).model_fields if getattr(crude, name) == getattr(VESSEL, name)}
    assert same == {"mass_kg", "motor_arm_m", "thrust_curve", "coupling"}


def test_without_the_sensor_the_boat_never_has_a_measured_wind():
    with_sensor, without = Lockstep(config_of("with sensor")), Lockstep(config_of("without sensor"))
    for _ in range(20 * 8):
        with_sensor.tick()
        _, outputs = without.tick()
        # From the start the disturbance tells of a wind, which is never valid: the controller does not use it.
        assert outputs.wind is None or (outputs.wind.origin == "disturbance" and not outputs.wind.valid)
    assert with_sensor.tick()[1].wind.valid
    assert outputs.phase is Phase.HOLD


def test_the_setups_differ_in_what_they_say_alone():
    true, wrong = config_of("true model"), config_of("crude model, vane turned")
    assert true.controller.name == wrong.controller.name == "sd-mpc"
    assert true.controller.vessel is None and wrong.controller.vessel == crude_vessel(VESSEL)
    assert wrong.plant.sensors.anemometer.misalignment_deg == 20.0
    assert true.plant.sensors.anemometer.misalignment_deg == 0.0
    current = config_of("crude model, vane turned, current")
    assert current.plant.weather.current.speed_mps == 0.3 and current.controller == wrong.controller
    assert config_of("true model, current") == load_config(
        "sitl", (*row_overrides("5", 1), "controller.name=sd-mpc", *CURRENT)
    )
    assert {name for pair in PAIRS.values() for name in pair} == set(SETUPS)


@pytest.mark.parametrize(
    ("pair", "row", "tried", "what", "met"),
    [
        ("no wind sensor", "1", 2.1, "difference", True),  # 1.1 more
        ("no wind sensor", "1", 2.3, "difference", False),
        ("no wind sensor", "6", 1.14, "ratio", True),
        ("no wind sensor", "6", 1.16, "ratio", False),
        ("crude model, vane turned by 20°", "1", 1.16, "ratio", False),
    ],
)
def test_each_row_is_held_against_what_is_asked_of_it(pair, row, tried, what, met):
    names = PAIRS[pair]
    scores = {(names[0], row): {1: tried}, (names[1], row): {1: 1.0}}
    held = dict.fromkeys(scores, 1.0)
    found = judge(pair, row, scores, held)
    assert list(found["asked"]) == [what] and found["met"] is met
    for key in held:  # without the motors all the time nothing is met
        assert judge(pair, row, scores, {**held, key: 0.9})["met"] is False


def test_the_patterns_put_every_coefficient_off_by_thirty_percent():
    seen = set()
    for pattern in range(1, 5):
        factors = signs(pattern)
        assert set(factors) == set(COEFFICIENTS) and factors == signs(pattern)
        assert sorted(factors.values()) == [0.7] * 7 + [1.3] * 8
        seen.add(tuple(factors[name] for name in COEFFICIENTS))
        vessel = off_vessel(VESSEL, pattern)
        assert vessel.mass_kg == pytest.approx(factors["mass_kg"] * VESSEL.mass_kg)
        assert vessel.thrust_curve[-1] == (1.0, pytest.approx(factors["thrust_curve"] * 240.5))
        assert (vessel.motor_arm_m, vessel.motor_lag_s) == (VESSEL.motor_arm_m, VESSEL.motor_lag_s)
    assert len(seen) == 4
    assert set(COEFFICIENTS) == set(type(VESSEL).model_fields) - {"motor_arm_m", "motor_lag_s", "coupling"}


@pytest.mark.thorough
def test_robustness_in_short(tmp_path):
    keys = {"rows": ["5"], "seeds": (1,), "window_s": (5.0, 6.0)}
    main, run = ("controller.name=nnsem-mpc",), run_into(tmp_path / "trials.jsonl", workers=0)
    found = study_robustness(run, controller=main, **keys)
    assert set(found["pairs"]) == set(PAIRS)
    for row in found["pairs"].values():
        # Seconds after the start, a boat on its way is little moved by what it believes.
        assert 0.5 < row["5"]["ratio"] < 2.0 and row["5"]["ps"]["mean"] > 3.0
    text = robustness.markdown(json.loads(json.dumps(found)))
    assert text.count("| 5 (3 m/s toward 90°) |") == 3 and "ratio at most 1.15" in text
    assert found["not_held"] == [] and "Without the motors" not in text
    lost = {**found, "not_held": [{"row": "5", "controller": "true model", "held": 0.5}]}
    assert "- 5 (3 m/s toward 90°), true model: 0.500 at least" in robustness.markdown(lost)
    assert "another version of the code" not in text
    old = {**found, "cost": {**found["cost"], "runs_of_other_code": 6}}
    assert "6 runs were made by another version of the code." in robustness.markdown(old)
    again = study_robustness(run, controller=main, **keys)
    assert again == found  # nothing was run anew: the times are those of the first


@pytest.mark.thorough
def test_learned_models_in_short(tmp_path):
    learned = {"NNSEM-MPC": ("controller.name=nnsem-mpc",)}
    keys = {"rows": ["3", "5"], "seeds": (1,), "patterns": 2, "starts": 1, "window_s": (3.5, 4.5)}
    run = run_into(tmp_path / "trials.jsonl", workers=0)
    found = study_learned_loop(run, learned=learned, under=["as shipped", "second boat"], **keys)
    names = {"NNSEM-MPC", TRUE, CRUDE, off_name(1), off_name(2)}
    shipped, second = found["under"]["as shipped"], found["under"]["second boat"]
    for rows in (shipped, second):
        assert set(rows) == {"3", "5"}
        assert set(rows["5"]["controllers"]) == (names if rows is shipped else {"NNSEM-MPC", TRUE, CRUDE})
        assert rows["3"]["bound"] is None and rows["3"]["verdict"]["regret"] is None
        mean = rows["5"]["controllers"]["NNSEM-MPC"]["ps"]["mean"]
        assert rows["5"]["verdict"]["regret"] == mean / rows["5"]["bound"]
        assert rows["5"]["verdict"]["to_true"] == mean / rows["5"]["controllers"][TRUE]["ps"]["mean"]
    assert 3.0 < shipped["5"]["bound"] < 4.0 and shipped["5"]["bound"] != second["5"]["bound"]
    assert shipped["5"]["controllers"][TRUE]["by_seed"] != second["5"]["controllers"][TRUE]["by_seed"]
    text = learned_loop.markdown(json.loads(json.dumps(found)))
    assert "### Second boat" in text and "| thrust_curve | " in text
    assert {line.count("|") for line in text.splitlines() if line.startswith("| 5 ")} == {11}
    assert study_learned_loop(run, learned=learned, under=["as shipped", "second boat"], **keys) == found


def test_who_was_let_go_has_no_score_and_nothing_is_said_of_it():
    names = ["NNSEM-MPC", TRUE, CRUDE, off_name(1)]
    scores = {(f"{name}, x", "5"): {1: 3.0 + i, 2: 3.0 + i} for i, name in enumerate(names)}
    held = dict.fromkeys(scores, 1.0)

    def cell(lost=""):
        lacks = {(f"{lost}, x", "5"): 0.4} if lost else {}
        return learned_loop._cell("x", "5", names, scores, {**held, **lacks}, 2.0)

    verdict = cell()["verdict"]
    assert verdict == {
        "best": "NNSEM-MPC",
        "lowest": True,
        "below_crude": True,
        "below_off": [off_name(1)],
        "to_true": 0.75,
        "regret": 1.5,
    }
    assert cell(TRUE)["verdict"]["to_true"] is None
    lost = cell("NNSEM-MPC")
    assert lost["verdict"] is None and lost["controllers"]["NNSEM-MPC"]["ps"] is None
    study = {"under": {"x": {"5": lost}}, "patterns": {"1": signs(1)}, "seeds": [1, 2], "window_s": [60, 360]}
    text = learned_loop.markdown({**study, "cost": {"runs_of_other_code": 0}})
    assert "| 5 (3 m/s toward 90°) | let go | 4.00 ± 0.00 |" in text and "| - | - | - | - | - |" in text


def test_the_circumstances_change_the_boat_and_not_what_the_controllers_believe():
    known = circumstances("sitl")
    assert next(iter(known)) == "as shipped" and known["as shipped"] == ()
    plain = load_config("sitl")
    for name, keys in known.items():
        config = load_config("sitl", keys)
        assert config.believed_vessel == plain.believed_vessel, name
        changed = name not in ("as shipped", "no disturbance, no trim", "no wind sensor", "light chop")
        assert (config.plant_vessel != plain.plant_vessel) is changed, name
    second = load_config("sitl", known["second boat"])
    whole = load_config("sitl-second")
    assert second.plant_vessel == whole.plant_vessel
    assert (second.plant.wind_load, second.plant.motors) == (whole.plant.wind_load, whole.plant.motors)
    assert "second boat" not in circumstances("sitl-bream")


def test_the_approach_says_how_many_runs_other_code_made():
    figures = {"duration_s": 180.0, **approach.summarise_approach([]), "runs_of_other_code": 0}
    assert "another version" not in approach.markdown(figures)
    assert "\n\n1 run was made by another version of the code.\n" in approach.markdown(
        {**figures, "runs_of_other_code": 1}
    )
