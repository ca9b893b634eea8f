"""Campaigns: their file, their designs, their figures and their table."""

import itertools
import json
import os
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study.campaigns import design
from asvhil.study.campaigns.campaign import cost_of, run_campaign, summary_of, variants_of
from asvhil.study.campaigns.columns import ERROR, FIGURES, PLACE
from asvhil.study.campaigns.design import check, files_of, job_of, plan
from asvhil.study.campaigns.sensitivity import sensitivities
from asvhil.study.campaigns.spec import CampaignSpec, ParameterSpec, read_spec, runs_of
from asvhil.study.campaigns.table import row_of, write_parquet
from asvhil.study.runner import Finished, run_into
from asvhil.study.store import StoredRun, opened
from tests.support.paths import ROOT

RESULT = {
    "truth": {
        "penalty_score": 1.0,
        "vrx_score": 1.0,
        "distance_m": {"mean": 1.0, "std": 1.0, "max_settled": 1.0},
        "heading_deg": {"mean": 1.0, "std": 1.0, "abs_mean": 1.0},
    },
    "measured": {"penalty_score": 1.0},
    "energy_n2": 1.0,
    "motors": {"reversals_per_min_most": 1.0, "saturated_share": 1.0, "change_per_s": 1.0},
    "held": 1.0,
}
GRID = """
design: {kind: grid}
parameters:
  wind_speed: [3, 6]
  fault: [none, "gnss-silent@3:2s"]
variants:
  LOITER: {controller.name: loiter}
  backstepping: {controller.name: backstepping}
"""


HEAD = "design: {kind: grid}\nparameters: {"


def written(folder: Path, text: str) -> Path:
    path = folder / "winds.yaml"
    path.write_text(text)
    return path


def spec_of(folder: Path, text: str) -> CampaignSpec:
    spec, path, lines = read_spec(written(folder, text))
    check(spec, path, lines)
    return spec


def test_a_grid_has_all_combinations_with_every_variant_at_the_same_seeds(tmp_path):
    spec = spec_of(tmp_path, f"{GRID}repeats: 2\nseed: 10\n")
    runs = list(plan(spec))
    assert len(runs) == runs_of(spec) == 16 and [run.number for run in runs] == list(range(16))
    assert [(run.values["wind_speed"], run.values["fault"]) for run in runs[::4]] == list(
        itertools.product((3, 6), ("none", "gnss-silent@3:2s"))
    )
    assert [(run.point, run.variant, run.seed) for run in runs[4:8]] == [
        (1, "LOITER", 12),
        (1, "LOITER", 13),
        (1, "backstepping", 12),
        (1, "backstepping", 13),
    ]
    config = load_config(runs[12].base, runs[12].overrides)
    assert config.plant.weather.wind.speed_mps == 6 and config.controller.name == "loiter"
    assert [(fault.kind, fault.from_s, fault.until_s) for fault in config.plant.faults] == [("gnss-silent", 3.0, 5.0)]
    assert config.plant.seed == runs[12].seed and not load_config(runs[0].base, runs[0].overrides).plant.faults


@pytest.mark.parametrize("kind", ["lhs", "sobol"])
def test_a_sample_fills_every_range_evenly_and_follows_its_seed(tmp_path, kind):
    text = """
design: {kind: %s, points: 16, seed: %d}
parameters:
  wind_speed: {low: 2, high: 8}
  plant.vessel.mass_kg: {low: 0.5, high: 2.0, factor: true, scale: log}
  gust: [0.0, 0.1]
  sensors: {values: {good: {plant.sensors.gnss.white_m: 0.1}, poor: {plant.sensors.gnss.white_m: 2.0}}}
"""
    spec = spec_of(tmp_path, text % (kind, 1))
    runs = list(plan(spec))
    speeds = sorted(run.values["wind_speed"] for run in runs)
    strata = [int((speed - 2.0) / 6.0 * 16) for speed in speeds]
    assert strata == list(range(16))  # one in each sixteenth of the range: of a Latin hypercube and of a net alike
    assert sorted(run.values["gust"] for run in runs) == [0.0] * 8 + [0.1] * 8
    assert [run.seed for run in runs] == list(range(1, 17))
    hull = load_config("sitl").vehicle.vessel
    for run in runs[:3]:
        config = load_config(run.base, run.overrides)
        factor = run.values["plant.vessel.mass_kg"]
        assert 0.5 <= factor <= 2.0
        assert config.plant_vessel.mass_kg == pytest.approx(hull.mass_kg * factor, rel=1e-5)
        assert config.plant_vessel.motor_arm_m == hull.motor_arm_m and config.vehicle.vessel == hull
        wind = config.plant.weather.wind
        assert wind.gust_across == wind.gust_along / 2.0
        assert config.plant.sensors.gnss.white_m == {"good": 0.1, "poor": 2.0}[run.values["sensors"]]
    assert [run.overrides for run in plan(spec)] == [run.overrides for run in runs]
    other = spec_of(tmp_path, text % (kind, 2))
    assert [run.overrides for run in plan(other)] != [run.overrides for run in runs]


def test_a_run_is_known_by_all_that_it_depends_on(tmp_path):
    runs = list(plan(spec_of(tmp_path, GRID)))
    keys = {job_of(run, (1.0, 2.0)).key for run in runs}
    assert len(keys) == 8 and keys == {job_of(run, (1.0, 2.0)).key for run in runs}
    assert job_of(runs[0], (1.0, 3.0)).key not in keys


def test_the_files_behind_the_runs_are_those_of_all_controllers_and_configs(tmp_path):
    text = """
design: {kind: grid}
parameters:
  config: [sitl, sitl-bream]
variants:
  learned: {controller.name: lagnet-mpc}
  none: {controller.name: loiter}
  gone: {controller.name: nnsem-mpc, controller.model: no-such.npz}
"""
    read, _, _ = read_spec(written(tmp_path, text))
    assert [file.name for file in files_of(read)] == [
        *("bream.yaml", "bream-lagnet.npz", "wamv16-lagnet.npz", "sitl-bream.yaml", "sitl.yaml", "wamv16.yaml"),
    ]


def test_parameters_are_values_or_ranges():
    log = ParameterSpec.model_validate({"low": 1.0, "high": 100.0, "scale": "log", "steps": 3})
    assert log.levels() == [1.0, 10.0, 100.0] and log.ends() == [1.0, 100.0] and log.is_number
    words = ParameterSpec.model_validate(["a", "b", "c"])
    assert [words.at(share) for share in (0.0, 0.34, 0.99)] == ["a", "b", "c"] and not words.is_number


def test_narrow_ranges_have_the_digits_that_they_need():
    lat = ParameterSpec.model_validate({"low": 36.123451, "high": 36.123459, "steps": 5})
    assert lat.levels() == [36.123451, 36.123453, 36.123455, 36.123457, 36.123459]
    for low, high, steps in ((-180.0, 180.0, None), (2.0, 8.0, None), (0.8, 1.25, None), (2.0, 3.0, 10_000)):
        levels = ParameterSpec.model_validate({"low": low, "high": high, "steps": steps}).levels()
        assert len(set(levels)) == len(levels)
    assert ParameterSpec.model_validate({"low": 2.0, "high": 8.0}).at(1.0 / 3.0) == 4.0
    assert ParameterSpec.model_validate({"low": 0.8, "high": 1.25}).digits == 6, "as many as runs are known by"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a mapping of keys is expected"),
        ("design: {kind: grid}", "key parameters: this key is required"),
        (
            "desing: {kind: grid}\nparameters: {wind_speed: [1]}",
            "unknown key, did you mean design? (line 1)",
        ),
        ("design: {kind: grid}\nparameters: {wind_sped: [1]}", "did you mean wind_speed? (line 2)"),
        ("design: {kind: grid}\nparameters: {plant.sead: [1]}", "key parameters.plant.sead: plant.sead: unknown key"),
        ("design: {kind: grid}\nparameters: {plant.seed: [1]}", "`seed` and `repeats` set it"),
        ("design: {kind: grid}\nparameters: {wind_speed: [3, -1]}", "key parameters.wind_speed: plant.weather.wind"),
        ("design: {kind: grid}\nparameters: {wind_speed: {low: 1, high: 2}}", "a range in a grid needs steps"),
        ("design: {kind: grid}\nparameters: {wind_speed: {low: 2, high: 1}}", "low < high must hold"),
        ("design: {kind: grid}\nparameters: {wind_speed: {lo: 2, high: 1}}", "unknown key, did you mean low?"),
        ("design: {kind: grid}\nparameters: {wind_speed: []}", "at least one value"),
        ("design: {kind: grid}\nparameters: {wind_speed: [1, 1]}", "a value is there twice"),
        ("design: {kind: grid}\nparameters: {fault: [gnss-jmp@3]}", "did you mean gnss-jump?"),
        ("design: {kind: grid}\nparameters: {controller: [loter]}", "key parameters.controller: controller.name: "),
        ("design: {kind: lhs}\nparameters: {wind_speed: [1]}", "lhs needs points"),
        ("design: {kind: grid, points: 3}\nparameters: {wind_speed: [1]}", "a grid has all combinations"),
        ("design: {kind: gird}\nparameters: {wind_speed: [1]}", "key design.kind: "),
        (
            "config: sitll\ndesign: {kind: grid}\nparameters: {wind_speed: [1]}",
            "key config: sitll: no such config",
        ),
        (f"{GRID}set: {{plant.weather.wind.speed_mps: 3}}", "is set by set too"),
        (
            f"{GRID}set: {{plant.weather.wind: {{speed_mps: 3}}}}",
            "plant.weather.wind.speed_mps with plant.weather.wind is set by set too",
        ),
        (f"{GRID}  both: {{controller.name: loiter, controller: {{name: loiter}}}}", "is set by the same set too"),
        (f"{GRID}set: {{plant: {{seed: 3}}}}", "plant cannot be set here: `seed` and `repeats` set it"),
        *(
            (f"{HEAD}{name}: {{values: {{a: {{plant.weather.wind.speed_mps: 3}}}}}}}}", "column of this name already")
            for name in ("run", "variant", "ps", "held", "error")
        ),
        ("design: {kind: grid}\nparameters: {fault: [3]}", "key parameters.fault: none, or KIND@FROM:FORs as text"),
        (
            "design: {kind: grid}\nparameters: {fault: [none, gnss-silent@90:5s]}\nwindow_s: [5, 90]",
            "gnss-silent begins at 90 s, and the runs end at 90 s (line 2)",
        ),
        (f"{GRID}seed: 99999999999999999999999", "key seed: a number of 1000000000 or less is expected"),
        (
            "config: field\ndesign: {kind: grid}\nparameters: {gust: [0.1]}",
            "key config: supervisor.station: a campaign",
        ),
        (f"{GRID}set: {{plant.sead: 3}}", "did you mean seed?"),
        (
            f"{GRID}window_s: [20, 10]",
            "key window_s: two rising times, begin and end in s, are expected, not 20 and 10",
        ),
        (f"{GRID}window_s: [20, 10]", " (line 9)"),
        (f"{GRID}window_s: [10, 1e9]", "key window_s: an end within a day"),
        (f"{GRID}window_s: [1, 5, 15]", "key window_s: two numbers are expected, not 3 (line 9)"),
        (f"{GRID}window_s: [1]", "key window_s: two numbers are expected, not 1 (line 9)"),
        ("design: {kind: grid}\nparameters: {wind_speed: [3]}\nvariants: {'': {}}", "key variants: variants need"),
        (
            f"{GRID}repeats: 100000000000",
            "key repeats: 800000000000 runs (4 points, 2 variants, 100000000000 repeats), 10000000 at most (line 9)",
        ),
        (
            "design: {kind: lhs, points: 10000000}\nparameters: {wind_speed: [3, 6]}\nvariants: {a: {}, b: {}}",
            "key variants: 20000000 runs (10000000 points, 2 variants), 10000000 at most (line 3)",
        ),
        (
            "design: {kind: grid}\nparameters: {wind_speed: {values: 3}}",
            "key parameters.wind_speed.values: a list or a section, with keys below it, is expected, not 3 (line 2)",
        ),
        (f"{GRID}score: pss", "key score: "),
        ("design: {kind: grid}\nparameters: {wind_speed: 3}", "a list of values, as [3, 5], or a range"),
        ("design: {kind: grid}\nparameters: {wind_speed: [1e30]}", "key parameters.wind_speed: plant.weather.wind"),
        (
            "design: {kind: grid}\nparameters: {wind_speed: {low: 1, high: 2, steps: 10000000000}}",
            "key parameters.wind_speed.steps: ",
        ),
        (
            "design: {kind: grid}\nparameters: {wind_speed: {low: 1, high: 2, steps: 10000}, "
            "wind_toward: {low: 1, high: 2, steps: 10000}}",
            "key parameters: the grid has 100000000 points, 10000000 at most",
        ),
        (
            "design: {kind: grid}\nparameters: {plant.seeed: {low: 1, high: 2, steps: 2, factor: true}}",
            "a factor needs",
        ),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path, text, words):
    with pytest.raises(ConfigError) as raised:
        spec_of(tmp_path, text)
    assert words in str(raised.value) and "\n" not in str(raised.value)
    assert str(raised.value).startswith(f"{tmp_path / 'winds.yaml'}: ")


def test_shipped_campaigns_are_right():
    files = sorted((ROOT / "config" / "campaigns").glob("*.yaml"))
    assert files
    for file in files:
        check(*read_spec(file))
    page = (ROOT / "docs" / "campaigns.md").read_text()
    fence = page.partition("```yaml\n")[2].partition("```")[0]
    assert (ROOT / "config" / "campaigns" / "winds.yaml").read_text().endswith(fence)


def test_what_moves_the_score_is_found_with_its_direction():
    rng = np.random.default_rng(1)
    n = 400
    up, down, round_, nothing = rng.uniform(-1.0, 1.0, (4, n))
    kind = rng.choice(["a", "b"], n)
    score = 2.0 * up - 1.0 * down + 3.0 * round_**2 + 0.8 * (kind == "b") + rng.normal(0.0, 0.1, n)
    columns = {"up": up, "down": down, "round": round_, "kind": kind, "nothing": nothing}
    found = sensitivities(
        {name: list(values) for name, values in columns.items()},
        {name: name != "kind" for name in columns},
        list(score),
    )
    # Variances: 4/3, 1/3, 9 * 4/45 = 0.8, 0.16; that of the sum is 2.64 with the noise.
    assert list(found)[:2] == ["up", "round"]
    assert found["up"]["share"] == pytest.approx(1.333 / 2.64, abs=0.08)
    assert found["round"]["share"] == pytest.approx(0.8 / 2.64, abs=0.08)
    assert found["nothing"]["share"] < 0.03 and found["nothing"]["p"] > 0.05 > found["kind"]["p"]
    assert found["up"]["prcc"] > 0.8 and found["down"]["prcc"] < -0.4 and found["kind"]["prcc"] is None
    assert abs(found["round"]["prcc"]) < 0.2
    low, high = found["nothing"]["prcc_ci95"]
    assert low < 0.0 < high and high - low == pytest.approx(2 * 1.96 / np.sqrt(n), rel=0.1)


def test_too_few_runs_or_a_constant_tell_nothing():
    assert sensitivities({"x": [1, 2, 3]}, {"x": True}, [1.0, 2.0, 3.0]) == {}
    found = sensitivities({"x": [1, 1, 1, 1], "y": [1, 2, 1, 2]}, {"x": True, "y": True}, [1.0, 2.0, 1.5, 2.5])
    assert list(found) == ["y"]


def rows(scores: dict[str, list[float]]) -> list[dict]:
    return [
        {"variant": name, "ps": score, "held": 1.0 if score < 9.0 else 0.5}
        for name, part in scores.items()
        for score in part
    ]


def test_the_summary_has_intervals():
    found = summary_of(rows({"": [float(i) for i in range(1, 11)]}), "ps")
    assert found is not None and found["mean"] == 5.5 and found["median"]["value"] == 5.5
    assert found["ci95"] == pytest.approx(2.262 * 3.0277 / np.sqrt(10), abs=0.01)
    # Order statistics of 10 values: the second and the ninth enclose the median with 97.9 %.
    assert found["median"]["ci95"] == [2.0, 9.0] and found["p95"]["ci95"][1] is None
    # Wilson's interval of 8 of 10.
    assert found["held"] == {"share": 0.8, "ci95": [pytest.approx(0.490, abs=1e-3), pytest.approx(0.943, abs=1e-3)]}
    assert summary_of([], "ps") is None


def test_variants_are_compared_run_by_run(tmp_path):
    spec = spec_of(tmp_path, GRID)
    found = variants_of(spec, rows({"LOITER": [1.0, 5.0, 9.0], "backstepping": [2.0, 6.1, 9.9]}))
    assert found["LOITER"]["behind_first"] is None
    assert found["backstepping"]["behind_first"]["mean"] == pytest.approx(1.0)
    assert found["backstepping"]["behind_first"]["ci95"] < 0.3  # though the runs differ by 8


def test_the_cost_of_a_million_runs_is_that_of_the_measured_ones():
    finished = Finished(results=[], group_s={"a": 30.0, "b": 10.0}, processes=2, outdated=0, errors={}, idle_s=0.5)
    cost = cost_of(finished, 20)
    assert cost["run_s"] == 2.0 and cost["runs_per_core_hour"] == 1440.0
    assert cost["million_core_hours"] == pytest.approx(2.5e6 / 3600.0)


def test_a_run_that_cannot_be_is_listed_and_the_others_are_in_the_table(tmp_path):
    text = """
design: {kind: grid}
parameters:
  controller.mpc.near_radius_m: [4, 8]
  controller.mpc.far_radius_m: [10, 6]
set: {controller.name: loiter}
window_s: [1, 1.5]
worst: 1
"""
    spec = spec_of(tmp_path, text)
    run = run_into(tmp_path / "runs.jsonl", workers=0, isolate=True)
    again = run_into(tmp_path / "logs.jsonl", workers=0)
    found, _ = run_campaign(spec, run, again, tmp_path, "winds")
    assert (found["runs"], found["failed"], found["all"]["runs"]) == (4, 1, 3)
    failure = found["failures"][0]
    assert failure["run"] == 3 and "near_radius_m < far_radius_m must hold" in failure["error"]
    table = pq.read_table(tmp_path / "winds.parquet")
    assert table.column("run").to_pylist() == [0, 1, 2, 3]
    assert table.column("controller.mpc.far_radius_m").to_pylist() == [10.0, 6.0, 10.0, 6.0]
    assert [value is None for value in table.column("ps").to_pylist()] == [False, False, False, True]
    assert [bool(error) for error in table.column("error").to_pylist()] == [False, False, False, True]
    assert json.loads(table.schema.metadata[b"campaign"])["parameters"]["controller.mpc.near_radius_m"]
    [worst] = found["worst"]
    assert (tmp_path / worst["log"]).stat().st_size > 10_000 and found["cost"]["logs_of_other_bits"] == 0
    assert re.fullmatch(r"winds-worst/run-00000\d-[0-9a-f]{8}\.mcap", worst["log"])
    assert not list((tmp_path / "winds-worst").glob(".*"))


def test_the_page_explains_every_column_of_the_table_in_its_order(tmp_path):
    spec = spec_of(tmp_path, GRID)
    write_parquet(spec, [row_of(run, RESULT, "") for run in plan(spec)], tmp_path / "table.parquet")
    written_ones = pq.read_table(tmp_path / "table.parquet").column_names
    section = (ROOT / "docs" / "campaigns.md").read_text().split("\n## The table\n")[1].split("\n## ")[0]
    named = [re.findall(r"`(\w+)`", row.split("|")[1]) for row in section.splitlines() if row.startswith("|")]
    explained = list(itertools.chain.from_iterable(named))
    assert written_ones == [*PLACE, *spec.parameters, *FIGURES, ERROR]
    assert explained == [name for name in written_ones if name not in spec.parameters]


def test_the_files_behind_a_million_runs_are_found_without_planning_them(tmp_path, monkeypatch):
    parameters = "{wind_speed: {low: 2, high: 8}, controller: [loiter, lagnet-mpc]}"
    text = f"design: {{kind: sobol, points: 1048576}}\nparameters: {parameters}"
    read, _, _ = read_spec(written(tmp_path, text))
    made = []
    overrides = design._overrides
    monkeypatch.setattr(design, "_overrides", lambda *args: made.append(1) or overrides(*args))
    assert "wamv16-lagnet.npz" in [file.name for file in files_of(read)] and len(made) == 2


@pytest.mark.parametrize("taken", ["winds-worst", "winds.parquet"])
def test_files_that_cannot_be_written_are_named_after_the_runs(taken, tmp_path):
    """A file in the place of the folder of logs, and a folder in that of the table."""
    spec = spec_of(tmp_path, f"{GRID}window_s: [0.5, 5]\nworst: 1")
    (tmp_path / taken).touch() if taken == "winds-worst" else (tmp_path / taken / "full").mkdir(parents=True)
    results = [RESULT] * runs_of(spec)

    def run(function, jobs) -> Finished:
        return Finished(results=results, group_s={}, processes=1, outdated=0, errors={})

    with pytest.raises(AsvhilError, match=rf"{taken}: cannot be"):
        run_campaign(spec, run, run, tmp_path, "winds")


def test_a_store_on_a_full_disk_is_named_and_says_how_to_go_on(tmp_path):
    done = StoredRun(code="c", wall_s=1.0, result={})
    with (
        pytest.raises(
            AsvhilError, match=r"runs\.jsonl: cannot be written \(No space left.*give the same command again"
        ),
        opened(tmp_path / "runs.jsonl") as store,
    ):
        store.add("first", done)
        with open("/dev/full", "w") as full:
            os.dup2(full.fileno(), store._file.fileno())
        store.add("second", done)
    with opened(tmp_path / "runs.jsonl") as store:
        assert list(store.runs) == ["first"]
