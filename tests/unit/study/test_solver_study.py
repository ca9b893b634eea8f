"""The solver study in small: both of the quick solvers drive the boat, and the figures are what they claim to be."""

import json
import math
import os
import sys

import numpy as np
import pytest

from asvhil.backseat.build import build_model
from asvhil.config import load_config
from asvhil.controller.solvers.ipopt import Ipopt
from asvhil.controller.solvers.problem import StationProblem
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study import solvers as study_module
from asvhil.study.solver_report import draw_solvers, solver_table
from asvhil.study.solver_runs import starts_of
from asvhil.study.solvers import study_solvers

CONFIG = load_config("sitl", ("controller.name=sd-mpc", "plant.weather.wind.toward_deg=60"))
MODEL = build_model(CONFIG)


@pytest.fixture(scope="module")
def study():
    told = []
    found = study_solvers(
        CONFIG,
        MODEL,
        steps=30,
        problems=12,
        solvers=("sqp", "ipopt"),
        limit_problems=4,
        tell=lambda what, done, total: told.append((what, done, total)),
    )
    return found, told


@pytest.mark.thorough
def test_both_drive_the_approach_near_the_optimum(study):
    found, _ = study
    for row in found["solvers"].values():
        assert row["failed"] == 0
        assert row["gap"]["problems"] == 12
        assert -0.02 < row["gap"]["mean"] < 0.02
        assert row["gap"]["median"] < 0.005
        assert 1.0 < row["distance_end_m"] < 14.3  # on its way
        assert 0.0 < row["step_cpu_ms"]["median"] <= row["step_cpu_ms"]["p99"] <= row["step_cpu_ms"]["max"]
        assert row["limit"]["problems"] == 4 and row["limit"]["agree_share"] == 1.0
    costs = [row["closed_loop_cost"] for row in found["solvers"].values()]
    # 30 steps of 0.2 s that begin 14 m off: the distance squared alone adds up to hundreds.
    assert costs[0] == pytest.approx(costs[1], rel=0.02) and 300.0 < costs[0] < 1200.0
    assert (found["stages"], found["horizon_s"], found["steps"]) == (20, 4.0, 30)


def test_the_default_is_the_faster_one(study):
    rows = study[0]["solvers"]
    assert 2.0 * rows["sqp"]["step_cpu_ms"]["median"] < rows["ipopt"]["step_cpu_ms"]["median"]


def test_progress_comes_to_its_end_for_every_part(study):
    ends = {what: (done, total) for what, done, total in study[1]}
    assert ends["sqp: closed loop"] == (30, 30) and ends["ipopt: optima"] == (12, 12) and ends["sqp: limit"] == (4, 4)


def test_one_core_is_used_and_the_others_given_back_even_after_an_error():
    before = os.sched_getaffinity(0)
    with pytest.raises(AsvhilError), study_module.one_core():
        assert len(os.sched_getaffinity(0)) == 1
        raise AsvhilError("stop")
    assert os.sched_getaffinity(0) == before


def test_the_same_study_gives_the_same_figures_but_for_the_times(study):
    again = study_solvers(CONFIG, MODEL, steps=30, problems=12, solvers=("sqp",), limit_problems=4)
    first, second = study[0]["solvers"]["sqp"], again["solvers"]["sqp"]
    for key in ("gap", "closed_loop_cost", "distance_end_m", "limit", "failed"):
        assert first[key] == second[key]


def test_the_optimum_is_the_cheapest_of_the_converged_starts():
    problem = StationProblem(MODEL, study_module.at_horizon(CONFIG, 4.0).controller.mpc)
    p = problem.pack((-14.0, -3.0, *[0.0] * 6), (1.0, 2.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0), CONFIG.controller.mpc.far)
    warm = np.full((20, 2), 0.4)
    starts = starts_of(problem, warm)
    assert [start[0, 0] for start in starts] == pytest.approx([0.4, 0.0, 0.7 * problem.upper, 0.7 * problem.lower])
    step = study_module.Step(parameters=p, start=warm, cost=0.0, ok=True, wall_ms=0.0, cpu_ms=0.0, truth=None)
    optimum = study_module.with_optima(problem, [step], "", lambda *args: None).optima[0]
    solver = Ipopt(problem)
    assert optimum == min(solver.solve(p, start, 500).cost for start in starts)


def test_the_report_names_every_solver_and_its_gap(study, tmp_path):
    found, _ = study
    table = solver_table(json.loads(json.dumps(found)))
    lines = table.splitlines()
    assert lines[0].count("|") == lines[1].count("|") == lines[2].count("|")
    assert lines[2].startswith("| own SQP (default) |") and lines[3].startswith("| CasADi IPOPT")
    assert f"{100.0 * found['solvers']['sqp']['gap']['mean']:.2f}" in lines[2]
    draw_solvers(found, tmp_path / "solvers.png")
    assert (tmp_path / "solvers.png").read_bytes().startswith(b"\x89PNG")


PROBLEMS = study_module.Problems(
    problem=None, parameters=[np.zeros(2)], starts=[np.zeros(2)], optima=np.array([math.nan])
)


@pytest.mark.parametrize(
    ("peer", "words"),
    [
        (["false"], "false: failed"),
        (["/nowhere/python"], "/nowhere/python: cannot be run"),
        (["echo", "hello"], "echo: .* is expected in its last line, not hello"),
        (["sh", "-c", "echo '[1]'"], "is expected in its last line"),
        (["sh", "-c", """echo '{"ms": [1.0, 2.0], "cost": [1.0]}'"""], "of 1 problems is expected"),
        (["sh", "-c", "printf '\\377'"], "is expected in its last line"),
    ],
)
def test_a_peer_that_fails_is_named(peer, words):
    with pytest.raises(AsvhilError, match=words):
        study_module.peer_row(CONFIG, peer, "", PROBLEMS, lambda *args: None)


def test_a_peer_that_fails_takes_no_other_solver_with_it():
    found = study_solvers(
        CONFIG,
        MODEL,
        steps=2,
        problems=1,
        solvers=("sqp", "torch-lqr"),
        limit_problems=1,
        horizon_s=0.4,
        peer=["echo", "hello"],
    )
    assert list(found["solvers"]) == ["sqp", "torch-lqr"] and found["peer_failed"].startswith("echo: ")


def test_a_solver_whose_package_is_missing_is_refused_before_any_runs(monkeypatch):
    told = []

    def tell(*now):
        told.append(now)

    monkeypatch.setitem(sys.modules, "asvhil.controller.solvers.torch_lqr", None)
    with pytest.raises(ConfigError, match="torch-lqr needs torch"):
        study_solvers(CONFIG, MODEL, tell=tell)
    monkeypatch.setattr(study_module, "fatrop_available", lambda: False)
    with pytest.raises(ConfigError, match="fatrop: this build of CasADi comes without it"):
        study_solvers(CONFIG, MODEL, solvers=("sqp", "fatrop"), tell=tell)
    assert not told
