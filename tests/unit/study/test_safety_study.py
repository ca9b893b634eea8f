"""The study of runaways: its holds, its verdicts, and one real hold of each sort."""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.study.runner import Finished
from asvhil.study.safety import false_alarms, judge, markdown, study_safety
from asvhil.study.safety_cases import FAULTS, SEEDS, WINDS, healthy, runaways
from asvhil.study.trials.safety import run_hold
from asvhil.supervisor.reasons import Reason, describe, explain

HELD: dict[str, Any] = {
    "begun": True,
    "ended_s": None,
    "thrust_s": 60.0,
    "reason": "",
    "text": "",
    "begin_m": 5.0,
    "farther_m": 80.0,
    "failsafe": False,
    "told": {},
}
ENDED = HELD | {
    "ended_s": 6.0,
    "thrust_s": 5.0,
    "reason": "motor-dead",
    "text": "port motor: no thrust",
    "farther_m": 2.0,
}
PORT_DEAD = describe(explain(Reason.MOTOR_DEAD, motor="port"))
AT = {"since_s": 10.0, "thrust_s": 9.0, "farther_m": 1.0}


def test_all_sets_have_winds_and_seeds_of_their_own() -> None:
    for of in (WINDS, SEEDS):
        all_of_them = [each for part in of for each in of[part]]
        assert len(set(all_of_them)) == len(all_of_them) == 15


def test_every_fault_comes_with_every_boat_start_wind_and_seed() -> None:
    counts = Counter((fault.name, case.boat, start) for fault, start, case in runaways("confirming"))
    assert set(counts.values()) == {9} and len(counts) == len(FAULTS) * 2 * 2


@pytest.mark.parametrize("part", ["tuning", "confirming"])
def test_at_least_300_healthy_holds_and_all_configs_load(part: str) -> None:
    cases = list(healthy(part))
    assert len(cases) >= 300
    for case in cases[::7]:
        load_config(case.base, case.keys)


@pytest.mark.parametrize(
    ("fault", "result", "met", "named"),
    [
        ("port motor dead", ENDED, True, True),
        ("port motor dead", HELD, False, False),
        ("port motor dead", ENDED | {"thrust_s": 15.5}, False, True),
        ("port motor dead", ENDED | {"farther_m": 10.5}, False, True),
        ("motors swapped", ENDED, True, False),
        ("port motor dead", HELD | {"told": {PORT_DEAD: AT}}, True, True),
        ("port motor dead", HELD | {"told": {PORT_DEAD: AT | {"thrust_s": 15.5}}}, False, True),
        ("port motor dead", HELD | {"told": {PORT_DEAD: AT | {"farther_m": 10.5}}}, False, True),
        ("port motor dead", HELD | {"told": {"something else": AT}}, False, False),
        ("port motor dead", ENDED | {"thrust_s": 20.0, "told": {PORT_DEAD: AT}}, True, True),
        ("both motors reversed", HELD | {"told": {PORT_DEAD: AT}}, False, False),
    ],
)
def test_verdicts(fault: str, result: dict[str, Any], met: bool, named: bool) -> None:
    verdict = judge(FAULTS[fault], result)
    assert (verdict["met"], verdict["named"]) == (met, named)


def test_a_healthy_hold_that_ends_is_told_or_never_begins_is_a_false_alarm() -> None:
    fine = HELD | {"farther_m": 0.0}
    assert false_alarms([fine, ENDED, fine | {"told": {"x": AT}}, fine | {"begun": False}])[0] is ENDED
    assert len(false_alarms([fine, ENDED, fine | {"told": {"x": AT}}, fine | {"begun": False}])) == 3


def test_the_tables_count_what_the_runs_did() -> None:
    def run(function: Any, jobs: Any) -> Finished:
        results = [ENDED if "port-motor" in str(job.arguments[1]) else HELD for job in jobs]
        return Finished(results=results, group_s={}, processes=1, outdated=0, errors={})

    figures = study_safety(run, faults=["port motor dead", "compass off by 180°"], every=3)
    text = markdown(figures)
    assert "| port motor dead | WAM-V | 6 | 6 | 6 | 6 | 5.0, 5.0 | 2.0, 2.0 |" in text
    assert "| compass off by 180° | BREAM | 6 | 0 | **0** | 0 | - | -; not found: 80.0, 80.0 |" in text
    assert "104 holds of 120 s, 0 false alarms." in text


def test_a_hold_that_nobody_ends_is_followed_to_its_end() -> None:
    keys = ("plant.start_n_m=-3", "plant.start_e_m=0", "controller.name=sd-mpc", "plant.weather.wind.speed_mps=1")
    result = run_hold("sitl", keys, 4.0)
    assert result["begun"] and result["ended_s"] is None
    assert result["begin_m"] == pytest.approx(3.0, abs=0.5) and 1.0 < result["thrust_s"] <= 4.05


def test_a_hold_that_ends_says_when_and_why() -> None:
    """All that the estimate needs is silent from 3 s after the begin of the hold on."""
    silent = ", ".join(f"{{kind: {kind}, from_s: 7}}" for kind in ("gnss", "heading-silent", "imu-silent"))
    result = run_hold("sitl", (f"plant.faults=[{silent}]", "controller.name=sd-mpc", "plant.start_n_m=-3"), 60.0)
    assert result["ended_s"] is not None and 5.0 < result["ended_s"] < 40.0
    assert result["thrust_s"] < result["ended_s"]  # the last seconds were neutral
    assert (result["reason"], result["failsafe"]) == ("estimate-stale", True)
