"""The six tests: what a run is, who wins a row, what the tables say."""

import json
import re
import shutil

import numpy as np
import pytest

from asvhil.config import load_config
from asvhil.config.mean_wind import station_heading_deg
from asvhil.errors import ConfigError
from asvhil.logs.metrics import PoseErrors, score
from asvhil.study import comparison
from asvhil.study.approach import study_approach
from asvhil.study.rows import (
    ROWS,
    along_the_wind,
    checked,
    refuse_own,
    row_overrides,
    title,
    trial_job,
    wind_of,
)
from asvhil.study.runner import Finished, run_into
from asvhil.study.six_tests import REFERENCE, available, labelled, study_six_tests, tabulate, verdict, with_solvers
from asvhil.study.six_tests_report import draw_bars, report, verdict_line
from asvhil.study.statistics import plus_minus
from asvhil.study.trials.trial import run_named_trial
from tests.support.paths import ROOT

MODELS = ROOT / "config" / "models"
SHIPPED = load_config("sitl").vehicle.name


def run(row: str, controller: str, seed: int, ps: float, e_h_deg: float = 0.1, held: float = 1.0) -> dict:
    errors = {
        "distance_m": {"mean": ps / 4, "std": ps / 8, "max": 14.3, "max_settled": ps / 2 + seed},
        "heading_deg": {"mean": e_h_deg, "std": ps / 2},
        "penalty_score": ps,
        "vrx_score": ps / 3,
    }
    measured = {**errors, "penalty_score": ps + 0.5}
    return {
        "row": row,
        "controller": controller,
        "seed": seed,
        "truth": errors,
        "measured": measured,
        "energy_n2": 1000.0 * seed,
        "motors": {"reversals_per_min_most": 10.0 + seed, "change_per_s": 0.25},
        "arrived_s": 20.0 + seed,
        "control_tick_ms": {"p50": 2.0, "p99": 4.0, "first": 8.0 + seed},
        "wind": {"speed_mps": 3.0, "toward_deg": 90.0},
        "own_bound": 0.8 * ps if row == "5" else None,
        "held": held,
    }


# Two seeds each. The reference is best of all and must not win.
RUNS = [
    *(run("5", "LagNet-MPC", seed, ps) for seed, ps in ((1, 4.0), (2, 5.0))),
    *(run("5", "backstepping", seed, ps) for seed, ps in ((1, 4.5), (2, 5.7))),
    *(run("5", REFERENCE, seed, ps) for seed, ps in ((1, 3.0), (2, 3.0))),
    *(run("1", "LagNet-MPC", seed, 1.5, e_h_deg) for seed, e_h_deg in ((1, 0.4), (2, -0.4))),
    *(run("1", "backstepping", seed, 1.0) for seed in (1, 2)),
]
STUDY = {
    "window_s": [60.0, 360.0],
    "seeds": [1, 2],
    "noise": True,
    "slow_error": True,
    **tabulate(RUNS, {"3@90": 3.6}),
    "cost": {"process_s": {"LagNet-MPC": 90.0}, "processes": 2, "minutes": 0.75, "runs_of_other_code": 3},
    "left_out": ["NODE-MPC is left out: no model"],
}


def test_the_rows_are_the_papers_with_mirrors_and_diagonals():
    assert [ROWS[name] for name in "123456"] == [(3, 0), (6, 0), (3, 180), (6, 180), (3, 90), (6, 90)]
    assert {ROWS[name] for name in ROWS if "mirrored" in name} == {(3.0, -90.0), (6.0, -90.0), (6.0, -45.0)}
    assert [name for name in ROWS if along_the_wind(name)] == ["1", "2", "3", "4"]
    assert (wind_of("5 mirrored"), wind_of("diagonal")) == ("3@90", "6@45")
    assert title("6 mirrored") == "6 mirrored (6 m/s toward -90°)"


def test_names_are_checked_and_put_in_order():
    assert checked(["6", "1"], ROWS, "--row") == ["1", "6"]
    assert checked([], ROWS, "--row") == list(ROWS)
    with pytest.raises(ConfigError, match=r"--row 7: unknown \(known: 1, 2"):
        checked(["1", "7"], ROWS, "--row")


def test_without_noise_there_is_neither_a_gust_nor_any_error_of_a_sensor():
    quiet = load_config("sitl", row_overrides("6", 1, noise=False)).plant
    assert (quiet.weather.wind.speed_mps, quiet.weather.wind.toward_deg) == (6.0, 90.0)
    assert quiet.weather.wind.gust_along == quiet.weather.wind.gust_across == 0.0
    gnss, imu = quiet.sensors.gnss, quiet.sensors.imu
    assert gnss.slow_bias_m == gnss.white_m == gnss.velocity_white_mps == quiet.sensors.heading.white_deg == 0.0
    assert imu.gyro_white_radps == imu.accel_white_mps2 == imu.accel_bias_mps2 == 0.0
    config = load_config("sitl", row_overrides("6", 7))
    loud = config.plant
    assert loud.seed == 7 and loud.sensors.gnss.white_m > 0.0 and loud.sensors.gnss.slow_bias_m == 0.0
    assert config.estimator.ekf.position_bias_std_m == 0.0 < load_config("sitl").estimator.ekf.position_bias_std_m


def test_the_wind_of_a_row_is_from_the_stations_heading():
    east = row_overrides("6", 1, heading_deg=90.0)
    assert load_config("sitl", ("supervisor.station.heading_deg=90", *east)).plant.weather.wind.toward_deg == 180.0
    assert "plant.weather.wind.toward_deg=45.0" in row_overrides("diagonal mirrored", 1, heading_deg=90.0)
    # Stored runs are known by these.
    assert row_overrides("6 mirrored", 1)[-1] == "plant.weather.wind.toward_deg=-90.0"
    assert row_overrides("6 mirrored", 1, heading_deg=0.0) == row_overrides("6 mirrored", 1)
    assert station_heading_deg(load_config("sitl", ("supervisor.station.heading_deg=90",))) == 90.0
    assert station_heading_deg(load_config("sitl", ("supervisor.engage=command", "supervisor.station=null"))) == 0.0


def test_the_jobs_of_both_studies_have_the_wind_from_the_stations_heading():
    seen = []

    def note(function, jobs):
        seen.extend(load_config(*job.arguments[:2]).plant.weather.wind.toward_deg for job in jobs)
        raise InterruptedError

    setups = {"LOITER": ("supervisor.station.heading_deg=90", "controller.name=loiter")}
    with pytest.raises(InterruptedError):
        study_six_tests(note, controllers=setups, rows=["6"], seeds=[1])
    with pytest.raises(InterruptedError):
        comparison.run_setups(note, setups, ["6"], [1], (1.0, 2.0))
    assert seen == [180.0, 180.0]


def nothing_runs(function, jobs):
    raise AssertionError("it was to be refused before anything runs")


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("plant.seed=7", "plant.seed"),
        ("plant.weather.wind.speed_mps=9", "plant.weather.wind.speed_mps"),
        ("plant.weather.wind={toward_deg: 9}", "plant.weather.wind.toward_deg"),
        ("plant={seed: 7}", "plant.seed"),
    ],
)
def test_a_key_that_a_study_sets_itself_is_refused(override, key):
    words = re.escape(f"--set {override}: key {key} is set by the study itself; leave it out")
    with pytest.raises(ConfigError, match=words):
        study_six_tests(nothing_runs, controllers={"LOITER": (override,)}, rows=["1"])
    with pytest.raises(ConfigError, match=words):
        comparison.run_setups(nothing_runs, {"LOITER": (override,)}, ["1"], [1], (1.0, 2.0))
    with pytest.raises(ConfigError, match=words):
        study_approach(nothing_runs, 1, overrides=(override,))


def test_other_keys_are_not_refused_and_the_approach_refuses_its_starts():
    refuse_own(("plant.weather.wind={gust_along: 0}", "plant.seeds=1"), row_overrides("1", 1))
    with pytest.raises(ConfigError, match=r"key plant\.start_n_m is set by the study itself"):
        study_approach(nothing_runs, 1, overrides=("plant.start_n_m=5",))
    with pytest.raises(ConfigError, match="not valid YAML"):
        study_approach(nothing_runs, 1, overrides=("plant.seed=[",))


def test_the_best_mean_wins_and_the_reference_does_not_take_part():
    found = STUDY["verdicts"]["5"]
    assert (found["winner"], found["kind"]) == ("LagNet-MPC", "ours")
    assert found["penalty_score"]["mean"] == 4.5
    # Differences by seed are 0.5 and 0.7: mean 0.6, standard deviation 0.1414, 12.706 * 0.1414 / sqrt(2) = 1.2706.
    assert found["behind"] == {"backstepping": {"mean": pytest.approx(0.6), "ci95": pytest.approx(1.2706)}}


def test_a_baseline_that_wins_is_said_to():
    assert STUDY["verdicts"]["1"]["kind"] == "baseline"
    line = verdict_line("1", STUDY["verdicts"]["1"])
    assert line.startswith("1 (3 m/s toward 0°): **a baseline wins**: backstepping has the lowest mean ps, 1.00 ± 0.00")
    assert "LagNet-MPC is 0.50 ± 0.00 higher" in line
    assert "LagNet-MPC has the lowest mean ps in 1 of 2 rows. Baselines have it in 1: 1." in report(STUDY)


def test_a_row_of_the_reference_alone_has_no_winner():
    assert verdict({REFERENCE: [run("5", REFERENCE, 1, 3.0)]})["winner"] is None


def test_without_the_motors_all_the_time_nobody_wins_and_it_is_said():
    """A boat that drifts, or that somebody else drives, may have the lowest score."""
    runs = [
        *(run("1", "LagNet-MPC", seed, 1.0, held=held) for seed, held in ((1, 1.0), (2, 0.25))),
        *(run("1", "LOITER", seed, 2.0) for seed in (1, 2)),
        run("2", "LOITER", 1, 1.0, held=0.0),
        run("2", REFERENCE, 1, 1.0, held=0.5),
    ]
    study = json.loads(json.dumps({**STUDY, **tabulate(runs, {})}))
    found = study["verdicts"]
    assert (found["1"]["winner"], found["1"]["barred"], found["1"]["behind"]) == ("LOITER", ["LagNet-MPC"], {})
    assert (found["2"]["winner"], found["2"]["barred"]) == (None, ["LOITER"])
    text = report(study)
    assert "- 1 (3 m/s toward 0°), LagNet-MPC: 0.250 at least\n- 2 (6 m/s toward 0°), LOITER: 0.000 at least\n" in text
    assert f"- 2 (6 m/s toward 0°), {REFERENCE}: 0.500 at least" in text
    assert "2 (6 m/s toward 0°): no controller to compare; barred: LOITER." in text
    assert "Without the motors" not in report(STUDY)


def test_a_run_without_an_estimate_in_the_window_has_no_measured_errors():
    blind = run("1", "LOITER", 1, 2.0, held=0.0)
    empty = np.zeros(0)
    blind["measured"] = score(PoseErrors(t_s=empty, distance_m=empty, heading_deg=empty), 60.0)
    study = {**STUDY, **tabulate([blind, run("1", "LOITER", 2, 3.0)], {})}
    measured = study["rows"]["1"]["LOITER"]["measured"]
    assert measured["penalty_score"] == measured["abs_e_h_deg"] == {"mean": None, "ci95": None}
    assert measured["max_distance_m"] is None and plus_minus(measured["penalty_score"]) == "-"
    assert "LOITER: 0.000 at least" in report(study)


def test_the_figures_of_a_cell_by_hand():
    cell = STUDY["rows"]["5"]["LagNet-MPC"]
    assert cell["ps_by_seed"] == {"1": 4.0, "2": 5.0}
    assert cell["truth"]["penalty_score"]["mean"] == 4.5 and cell["measured"]["penalty_score"]["mean"] == 5.0
    assert cell["truth"]["max_distance_m"] == 4.5  # the larger of 2 + 1 and 2.5 + 2
    assert cell["energy_n2"]["mean"] == 1500.0 and cell["held"] == 1.0
    assert cell["regret"] == 4.5 / 3.6
    along = STUDY["rows"]["1"]["LagNet-MPC"]
    assert along["regret"] is None
    # Heading errors of either sign do not cancel in the magnitude that the score is made of.
    assert along["truth"]["e_h_deg"]["mean"] == 0.0 and along["truth"]["abs_e_h_deg"]["mean"] == pytest.approx(0.4)


def test_the_report_holds_what_it_should():
    text = report(json.loads(json.dumps(STUDY)))
    tables = [part for part in text.split("\n\n") if part.startswith("|")]
    # ps, ps as measured, VRX's, regret of the own wind and of the row's, greatest distance, way in, energy, work, time
    assert len(tables) == 10
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1
        assert f"*{REFERENCE}, reference* |" in table.splitlines()[0]
    assert "| 5 (3 m/s toward 90°) | **4.50 ± 6.35** (1.12 m, 0.10°, 2.25°) |" in tables[0]
    assert "| 5 (3 m/s toward 90°) | 5.00 ± 6.35 |" in tables[1] and "| 1.500 ± 2.118 |" in tables[2]
    assert tables[3].splitlines()[2:] == ["| 5 (3 m/s toward 90°) | 1.250 ± 0.000 | 1.250 ± 0.000 | 1.250 ± 0.000 |"]
    assert tables[4].splitlines()[2:] == ["| 5 (3 m/s toward 90°) | 1.250 | 1.417 | 0.833 |"]
    assert "NODE-MPC is left out: no model" in text and "3 runs were made by another version of the code" in text
    assert "| 1 (3 m/s toward 0°) | 21.5 ± 6.4 | 21.5 ± 6.4 |  |" in tables[6]
    assert "| 1 (3 m/s toward 0°) | 1.50 ± 6.35 | 1.50 ± 6.35 |  |" in tables[7]
    assert "| 1 (3 m/s toward 0°) | 11.5, 0.25 | 11.5, 0.25 |  |" in tables[8]
    assert "| 1 (3 m/s toward 0°) | 9.5 ± 6.4 | 9.5 ± 6.4 |  |" in tables[9]
    assert "the receiver with its slow error" in text
    plain = report({**json.loads(json.dumps(STUDY)), "noise": False, "slow_error": False})
    assert "no gusts and no sensor noise" in plain and "by the boat's own estimate" not in plain


def test_the_bars_are_drawn_with_and_without_gaps(tmp_path):
    draw_bars(STUDY, tmp_path / "all.png")
    part = {**STUDY, **tabulate([run("5", "LOITER", 1, 80.0)], {})}
    draw_bars(part, tmp_path / "one.png")
    for name in ("all.png", "one.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_a_controller_without_its_model_is_left_out_with_a_line(tmp_path):
    base, kinds = "sitl", ("NODE-MPC", "backstepping")
    with pytest.raises(ConfigError, match="holds no model file"):  # or the shipped ones would be used unnoticed
        available(kinds, tmp_path, base, ())
    (tmp_path / "lagnet.npz").write_bytes(b"any")
    found, lines = available(kinds, tmp_path, base, ("vehicle.name=raft",))
    assert list(found) == ["backstepping"]
    assert len(lines) == 1 and lines[0].startswith("NODE-MPC is left out: raft-node: no such model file")
    # The folder is looked at first, for the vehicle's own file before the kind's.
    (tmp_path / "node.npz").write_bytes(b"any")
    found, lines = available(kinds, tmp_path, base, ("vehicle.name=raft",))
    assert not lines and found["NODE-MPC"][-1] == f"controller.model={tmp_path / 'node.npz'}"
    (tmp_path / "raft-node.npz").write_bytes(b"any")
    found, _ = available(kinds, tmp_path, base, ("vehicle.name=raft",))
    assert found["NODE-MPC"][-1] == f"controller.model={tmp_path / 'raft-node.npz'}"
    with pytest.raises(ConfigError, match=r"--models .*: no such folder"):
        available(kinds, tmp_path / "nowhere", base, ())
    with pytest.raises(ConfigError, match="sead"):
        available(kinds, None, base, ("plant.sead=1",))


def test_a_run_is_another_with_other_weights_wind_seed_or_window(tmp_path):
    file = tmp_path / "model.npz"
    shutil.copy(MODELS / f"{SHIPPED}-nnsem.npz", file)
    keys = ("controller.name=nnsem-mpc", f"controller.model={file}")

    def key(row: str = "5", seed: int = 1, to_s: float = 360.0, keys: tuple[str, ...] = keys) -> str:
        return trial_job("x", "sitl", (*row_overrides(row, seed), *keys), (60.0, to_s)).key

    assert key() == key()
    other = tmp_path / "other.npz"
    other.write_bytes(file.read_bytes() + b"x")
    different = {key(), key(row="6"), key(seed=2), key(to_s=120.0), key(keys=(keys[0], f"controller.model={other}"))}
    assert len(different) == 5
    elsewhere = tmp_path / "elsewhere.npz"
    shutil.copy(file, elsewhere)
    assert key(keys=(keys[0], f"controller.model={elsewhere}")) == key()


def test_the_receivers_slow_error_is_as_the_config_has_it_or_off():
    shipped = load_config("sitl")
    with_error, without = (load_config("sitl", row_overrides("5", 1, slow_error=on)) for on in (True, False))
    assert with_error.plant.sensors.gnss == shipped.plant.sensors.gnss and with_error.estimator == shipped.estimator
    assert with_error.plant.sensors.gnss.slow_bias_m > 0.0 == without.plant.sensors.gnss.slow_bias_m
    assert (
        load_config("sitl", row_overrides("5", 1, slow_error=True, noise=False)).plant.sensors.gnss.slow_bias_m == 0.0
    )


def test_each_run_is_held_against_the_bound_of_the_wind_that_it_had():
    asked, winds = [], ((5.84, 1.3), (6.26, 181.2))

    def given(function, jobs):
        if function is run_named_trial:
            results = [run("6", "LOITER", 1, ps) for ps in (12.0, 15.0)]
            for result, (speed_mps, toward_deg) in zip(results, winds, strict=True):
                result["wind"] = {"speed_mps": speed_mps, "toward_deg": toward_deg}
                del result["row"]
        else:
            asked.extend(jobs)
            results = [{"penalty_score": 10.0}, {"penalty_score": 12.0}]
        return Finished(results=results, group_s={}, processes=1, outdated=0, errors={})

    keys = ("supervisor.station.heading_deg=90", "controller.name=loiter")
    found = study_six_tests(given, controllers={"LOITER": keys}, rows=["6"], seeds=[1, 2], own_starts=4)
    assert [job.key.split()[-2:] for job in asked] == [["5.8@89", "4"], ["6.3@91", "4"]]
    assert found["rows"]["6"]["LOITER"]["own_regret"]["mean"] == pytest.approx((1.2 + 1.25) / 2)
    for result in (run("1", "LOITER", 1, 1.0), run("1", "LOITER", 2, 1.0)):
        assert tabulate([result], {})["rows"]["1"]["LOITER"]["own_regret"]["mean"] is None


def test_each_mpc_is_run_with_each_solver_and_others_are_refused():
    mpcs = available(["NNSEM-MPC"], None, "sitl", ())[0]
    found = with_solvers(mpcs, ["sqp", "ipopt"], "sitl")
    solvers = {label: load_config("sitl", keys).controller.solver for label, keys in found.items()}
    assert solvers == {"NNSEM-MPC, sqp": "sqp", "NNSEM-MPC, ipopt": "ipopt"}
    with pytest.raises(ConfigError, match="--solver ipopt: LOITER solves no problem"):
        with_solvers(available(["LOITER"], None, "sitl", ())[0], ["ipopt"], "sitl")
    runs = [run("5", label, seed, ps) for label, ps in zip(found, (4.0, 5.0), strict=True) for seed in (1, 2)]
    text = report({**STUDY, **tabulate(runs, {})})
    assert "NNSEM-MPC, sqp has the lowest mean ps" in text
    assert "baseline wins" not in text and "No baseline" not in text


def test_two_controllers_in_short(tmp_path):
    seen = []
    found = study_six_tests(
        run_into(tmp_path / "trials.jsonl", workers=0, tell=seen.append),
        controllers=available(["backstepping", "LOITER"], None, "sitl", ())[0],
        rows=["1"],
        seeds=(1, 2),
        window_s=(6.0, 8.0),
        bounds={"3@90": 3.4},
    )
    assert (seen[-1].done, seen[-1].total, seen[-1].remaining_s) == (4, 4, 0.0)
    line = found["rows"]["1"]
    assert set(line) == {"backstepping", "LOITER"} and set(line["LOITER"]["ps_by_seed"]) == {"1", "2"}
    assert all(cell["arrived_s"]["mean"] is None for cell in line.values())
    # Seconds after the start both are still on their way from 14 m off.
    assert all(5.0 < cell["truth"]["e_d_m"]["mean"] < 14.4 for cell in line.values())
    assert set(labelled()) >= set(found["cost"]["process_s"])
