"""A short soak: every hold comes back, and what does not is told. Long: docs/results/soak.md."""

from __future__ import annotations

import pytest

from asvhil.config import load_config
from asvhil.study.soak import judge, markdown
from asvhil.study.trials import soak
from asvhil.study.trials.soak import EVERY_S, OF_THE_BOAT, OF_THE_LOOP, SoakLoop, draw_faults, run_soak
from asvhil.types import Phase

CONFIG = ("controller.name=backstepping",)


def test_holds_come_back_after_each_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(soak, "EVERY_S", 65.0)
    monkeypatch.setattr(soak, "LOST_S", 30.0)
    seconds = []
    run = run_soak(load_config("sitl", CONFIG), 0.0367, 3, seconds.append)
    assert len(run["faults"]) == 1 and seconds[-1] == 132
    assert judge(run)["met"] and judge(run)["lost"] == []
    assert run["held_share"] > 0.9
    assert "Lost for good: 0" in markdown({"run": run, "verdict": judge(run)})


@pytest.mark.thorough
def test_a_hold_that_nobody_asks_for_again_is_lost_for_good(monkeypatch: pytest.MonkeyPatch) -> None:
    act = SoakLoop.act

    def once(self: SoakLoop, phase: Phase) -> None:
        if self.t_s < EVERY_S:
            act(self, phase)
        else:
            self._begin_and_end()

    monkeypatch.setattr(SoakLoop, "act", once)
    seed = next(seed for seed in range(100) if draw_faults(seed, 0.17)[0].kind == "pilot disarms")
    run = run_soak(load_config("sitl", CONFIG), 0.17, seed)
    assert run["faults"][0]["ended_by"] == "disarmed" and run["faults"][0]["back_s"] is None
    assert not judge(run)["met"]


def test_faults_are_drawn_from_the_seed_one_in_each_span_and_of_every_kind() -> None:
    faults = draw_faults(5, 24.0)
    assert faults == draw_faults(5, 24.0) != draw_faults(6, 24.0)
    assert [int(fault.from_s // EVERY_S) for fault in faults] == list(range(1, 288))
    assert all(fault.until_s < EVERY_S * (number + 2) for number, fault in enumerate(faults))
    assert {fault.kind for fault in faults} == {*OF_THE_BOAT, *OF_THE_LOOP}


def test_growth_and_drift_are_judged_from_the_second_hour_on() -> None:
    hour = {"resident_kb": 100.0, "tick_ms": 1.0, "young_ms": 1.0, "off_m_median": 0.1, "off_m_most": 1.0}
    run = {"faults": [], "hourly": [hour | {"resident_kb": 50.0}, hour, hour]}
    assert judge(run)["met"]
    back = {"kind": "gnss", "from_s": 300.0, "until_s": 310.0, "ended_by": "", "back_s": 9.0}
    lost = back | {"back_s": None}
    assert judge(run | {"faults": [back]})["met"] and not judge(run | {"faults": [back, lost]})["met"]
    assert not judge(run | {"hourly": [hour, hour, hour | {"resident_kb": 106.0}]})["met"]
    assert not judge(run | {"hourly": [hour, hour, hour | {"tick_ms": 1.2}]})["met"]
    assert judge(run | {"hourly": [hour, hour, hour | {"tick_ms": 1.2, "young_ms": 1.2}]})["met"]  # a slower host
