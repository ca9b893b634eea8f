"""`asvhil study ...` as people run it: short runs, an interrupt in the middle, and mistakes in one line."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.command_line import Said, call, refused

TWO_LAWS = ("--controller", "backstepping", "--controller", "LOITER", "--row", "1", "--row", "5")


def study(*arguments: str, cwd: Path) -> Said:
    return call("study", *arguments, "--workers", "1", cwd=cwd)


def without_cost(path: Path) -> dict:
    figures = json.loads(path.read_text())
    figures.pop("cost")
    for line in figures["rows"].values():
        for cell in line.values():
            cell.pop("first_steps_ms")
    return figures


@pytest.mark.thorough
def test_six_tests_killed_in_the_middle_end_like_those_that_were_not(tmp_path):
    arguments = ("six-tests", "--quick", *TWO_LAWS)
    whole = study(*arguments, "-o", "whole", "--json", "figures.json", cwd=tmp_path)
    assert (whole.status, whole.err) == (0, "")
    assert "six tests: 4 runs," in whole.out and "| 5 (3 m/s toward 90°) |" in whole.out
    store = tmp_path / "cut" / "trials.jsonl"
    running = subprocess.Popen(
        [sys.executable, "-m", "asvhil", "study", *arguments, "-o", "cut", "--workers", "1"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        for _ in range(1200):
            if store.exists() and store.read_text().count("\n"):
                break
            time.sleep(0.05)
    finally:
        running.kill()
        running.wait()
    done = store.read_text().count("\n")
    assert 1 <= done < 4
    with store.open("a") as file:
        file.write('{"key": "trial ')  # as if it had been killed while writing
    again = study(*arguments, "-o", "cut", cwd=tmp_path)
    assert (again.status, again.err) == (0, "")
    assert store.read_text().count("\n") == 5  # with the bound of the wind across
    figures = without_cost(tmp_path / "cut" / "six-tests-quick.json")
    assert (
        figures == without_cost(tmp_path / "whole" / "six-tests-quick.json") == without_cost(tmp_path / "figures.json")
    )
    # The shipped bound of 3 m/s across gives a regret in test 5, and in no other of these.
    assert [bool(figures["rows"][row]["LOITER"]["regret"]) for row in ("1", "5")] == [False, True]
    for folder in ("cut", "whole"):
        assert (tmp_path / folder / "six-tests-quick.png").read_bytes().startswith(b"\x89PNG")
        assert "Regret" in (tmp_path / folder / "six-tests-quick.md").read_text()


def test_without_noise_the_figures_stand_apart(tmp_path):
    done = study("six-tests", "--quick", "--no-noise", "--controller", "LOITER", "--row", "1", "-o", ".", cwd=tmp_path)
    assert done.status == 0, done.err
    figures = json.loads((tmp_path / "six-tests-no-noise-quick.json").read_text())
    assert figures["noise"] is False and figures["seeds"] == [1]
    truth, measured = (figures["rows"]["1"]["LOITER"][name]["e_d_m"]["mean"] for name in ("truth", "measured"))
    assert truth == pytest.approx(measured, abs=0.05)
    assert not (tmp_path / "six-tests-quick.json").exists()


def test_the_solvers_side_by_side(tmp_path):
    arguments = ("--ticks", "4", "--problems", "2", "--solver", "sqp", "--solver", "fatrop", "--set", "plant.seed=3")
    done = call("study", "solvers", *arguments, "-o", "out", "--json", "solvers.json", cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    figures = json.loads((tmp_path / "solvers.json").read_text())
    assert list(figures["solvers"]) == ["sqp", "fatrop"] and (figures["steps"], figures["seed"]) == (4, 3)
    assert figures["solvers"]["sqp"]["limit"]["problems"] == 2
    assert "| own SQP (default) |" in done.out and (tmp_path / "out" / "solvers.png").exists()


@pytest.mark.thorough
def test_the_approach_leaves_figures_and_tracks(tmp_path):
    weak = "vehicle.vessel.thrust_curve=[[-1.0, -1.0], [0.0, 0.0], [1.0, 1.0]]"
    boat = ("--set", weak, "--set", "controller.on_other_hull=use")
    done = study("approach", "--quick", "--runs", "1", *boat, "-o", ".", "--json", "out.json", cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    assert json.loads((tmp_path / "out.json").read_text())["lost"] == 1
    assert (
        "| lost | none | 1 |" in (tmp_path / "approach-quick.md").read_text()
        and (tmp_path / "approach-quick.png").exists()
    )


@pytest.mark.thorough
def test_a_field_test_leaves_tables_beside_the_papers_and_the_way(tmp_path):
    done = study("field-tests", "--quick", "--test", "wamv 2", "-o", ".", "--json", "out.json", cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    test = json.loads((tmp_path / "out.json").read_text())["tests"]["wamv 2"]
    assert test["never_there"] == test["let_go"] == 0 and test["handover_s"]["mean"] < 60.0
    distances = [test["ways"][way]["distance_m"]["mean"]["mean"] for way in ("truth", "estimated", "measured")]
    assert all(0.0 < distance_m < 6.0 for distance_m in distances) and len(set(distances)) == 3
    text = (tmp_path / "field-tests-quick.md").read_text()
    assert "### WAM-V" in text and "BREAM" not in text and "| 3.21 ± 2.16 |" in text
    assert (tmp_path / "field-tests-quick.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["six-tests", "--row", "7"], "--row 7: unknown (known: 1, 2"),
        (["six-tests", "--controller", "pid"], "--controller pid: unknown (known: NNSEM-MPC"),
        (["six-tests", "--models", "nowhere"], "--models nowhere: no such folder"),
        (["six-tests", "--bounds", "nowhere.json"], "nowhere.json: cannot be read"),
        (["six-tests", "--set", "plant.sead=1"], "did you mean seed?"),
        (["six-tests", "-o", "taken"], "-o taken: is a file; the name of a folder is expected"),
        (["robustness", "--row", "9"], "--row 9: unknown"),
        (["learned-loop", "--set", "plant.sead=1"], "did you mean seed?"),
        (["field-tests", "--test", "wamv 5"], "--test wamv 5: unknown, did you mean wamv 4? (known: bream 1"),
        (["field-tests", "--set", "plant.seed=1"], "key plant.seed is set by the study itself"),
        (["approach", "--set", "plant.sead=1"], "did you mean seed?"),
        (["solvers", "--solver", "simplex"], "--solver simplex: unknown (known: sqp"),
        (["solvers", "--set", "controller.name=loiter"], "key controller.name: loiter has no solver"),
        (["solvers", "--solver", "sqp", "--peer", "python"], "name that --solver too"),
        (["bound", "--wind", "fast"], "SPEED@DEG is expected"),
    ],
)
def test_a_mistake_is_one_line(arguments, words, tmp_path):
    (tmp_path / "taken").write_text("a file")
    said = call("study", *arguments, cwd=tmp_path)
    assert said.status == 2
    refused(said, words)


@pytest.mark.thorough
def test_the_estimator_study_on_one_set_of_sensors(tmp_path):
    done = study("estimator", "--quick", "--sensors", "BREAM", "-o", "out", "--json", "figures.json", cwd=tmp_path)
    assert (done.status, done.err) == (0, "")
    figures = json.loads((tmp_path / "figures.json").read_text())
    velocity = figures["errors"]["BREAM"]["manoeuvres"]["gusty"]["errors"]
    assert velocity["ekf"]["velocity_mps"]["mean"] < velocity["raw"]["velocity_mps"]["mean"]
    assert set(figures["abrupt"]["BREAM"]) > {"none", "GNSS silent"} and figures["survival"]["lost"] == []
    assert "| GNSS silent |" in done.out
    assert "### Asked and reached" in (tmp_path / "out" / "estimator-quick.md").read_text()
    assert (tmp_path / "out" / "estimator-quick.png").read_bytes().startswith(b"\x89PNG")


def test_sensors_that_no_boat_has_are_refused(tmp_path):
    wrong = study("estimator", "--sensors", "VN-200", cwd=tmp_path)
    refused(wrong, "--sensors VN-200: unknown, did you mean VN-300? (known: VN-300, BREAM)\n")
