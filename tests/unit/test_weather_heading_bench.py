"""The bench of headings that follow the weather: its figures, its verdicts, and a short run."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from asvhil.study.made_of import state_of
from bench.weather_heading import TO_S, cases, config_of, floor_n2, job_of, main, run, table, turn_deg, verdicts
from bench.weather_heading_figure import draw

WEATHER = {"wind_mps": 6, "current_mps": 0.0, "waves": False}


def test_a_turn_is_the_span_within_a_minute() -> None:
    slow, quick = np.radians(np.linspace(0.0, 60.0, 241)), np.radians([170.0] * 120 + [-170.0] * 120)
    assert turn_deg(slow, 1.0) == pytest.approx(14.75, abs=0.1)  # 60 samples of 0.25 degrees a second
    assert turn_deg(quick, 1.0) == pytest.approx(20.0)
    assert turn_deg(quick[:30], 1.0) == 0.0


def test_the_floor_of_wind_alone_is_half_its_load_and_of_wind_and_current_the_drag_too() -> None:
    assert floor_n2(config_of(WEATHER | {"kind": "bow", "seed": 1})) == pytest.approx((0.5 * 0.5 * 36.0) ** 2, rel=0.01)
    both = floor_n2(config_of({"kind": "bow", "seed": 1, "wind_mps": 2, "current_mps": 0.4, "waves": False}))
    assert both == pytest.approx((0.5 * (51.3 * 0.4 + 72.4 * 0.16)) ** 2, rel=0.15)


def test_all_that_is_asked_for_is_run() -> None:
    whole = cases(range(51, 56))
    assert len(whole) == len({json.dumps(case, sort_keys=True) for case in whole})
    assert [sum(case["kind"] == kind for case in whole) for kind in ("bow", "fixed", "veer")] == [150, 30, 15]


def test_what_was_asked_for_is_told_beside_what_was_reached_and_drawn(tmp_path: Path) -> None:
    figures = {"max_m": 0.6, "turn_deg": 4.0, "off_deg": 2.0, "held": 1.0}
    runs = [
        {"kind": "bow", "seed": 1, "mean_m": 0.3, "thrust_n2": 100.0} | WEATHER | figures,
        {"kind": "bow", "seed": 2, "mean_m": 0.55, "thrust_n2": 300.0} | WEATHER | figures | {"turn_deg": 12.5},
        {"kind": "fixed", "seed": 1, "mean_m": 2.0, "thrust_n2": 4000.0} | WEATHER | figures,
        {"kind": "veer", "seed": 1, "mean_m": 0.5, "thrust_n2": 400.0} | WEATHER | figures | {"max_m": 1.6},
    ]
    text = "\n".join(verdicts(runs))
    assert "held throughout | 2 of 2 runs" in text
    assert "0.5 m to 6 m/s | 1 of 2 runs, worst 0.55 m" in text
    assert "1 of 2 runs, mean 1/20, worst 1/13" in text
    assert "in a minute | 1 of 2 runs, worst 12.5°" in text
    assert "within 1.5 m | 0 of 1 runs, worst 1.60 m" in text
    draw(runs, lambda one: 81.0, tmp_path / "runs.png")
    assert (tmp_path / "runs.png").read_bytes().startswith(b"\x89PNG")
    row = next(line for line in table(runs) if line.startswith("| 6 |"))
    assert row.startswith("| 6 | 0.0 | no | 2 | 0.43, 0.55 | 200 | 1/20 | 1/49 | 12.5 |")


def test_each_case_has_a_key_of_its_own_and_its_settings_too() -> None:
    whole = cases(range(51, 53))
    keys = {job_of(case, overrides).key for case in whole for overrides in ((), ("controller.name=sd-mpc",))}
    assert len(keys) == 2 * len(whole)


def test_runs_are_kept_and_the_page_says_of_what(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calm = {"wind_mps": 2, "current_mps": 0.0, "waves": False}
    kept = [{"kind": kind, "seed": 51} | calm for kind in ("bow", "fixed")]
    near = ["--set", "controller.name=backstepping", "--set", "plant.start_n_m=0", "--set", "plant.start_e_m=0"]
    monkeypatch.setattr("bench.weather_heading.cases", lambda seeds, quick: kept)
    monkeypatch.setattr("bench.weather_heading.TO_S", dict.fromkeys(TO_S, 61.5))
    monkeypatch.setattr("sys.argv", ["weather_heading", "-o", str(tmp_path), "--workers", "0", *near])
    main()
    lines = (tmp_path / "weather-heading.jsonl").read_text()
    figures = json.loads((tmp_path / "weather-heading.json").read_text())
    assert [one["kind"] for one in figures["runs"]] == ["bow", "fixed"]
    assert all(one["held"] == 1.0 for one in figures["runs"])
    assert state_of(tmp_path / "weather-heading.md", "weather-heading.md").state == "fresh"
    main()
    assert (tmp_path / "weather-heading.jsonl").read_text() == lines, "nothing is run again"


def test_a_short_run_has_all_figures() -> None:
    near = ("controller.name=backstepping", "plant.start_n_m=0", "plant.start_e_m=0")
    found = run(WEATHER | {"kind": "veer", "seed": 31}, near, to_s=10.5, from_s=8.5)
    assert found["held"] == 1.0 and 0.0 < found["mean_m"] <= found["max_m"] < 15.0
    assert found["thrust_n2"] > 0.0 and all(math.isfinite(found[key]) for key in ("turn_deg", "off_deg"))


@pytest.mark.thorough
def test_in_wind_and_current_the_boat_lies_still_for_a_twentieth_of_the_thrust() -> None:
    runs = [
        run({"kind": kind, "seed": 31, "wind_mps": 6, "current_mps": 0.2, "waves": True}) for kind in ("bow", "fixed")
    ]
    assert runs[0]["mean_m"] < 0.5 < runs[1]["mean_m"]
    assert runs[0]["thrust_n2"] < runs[1]["thrust_n2"] / 20.0
    assert runs[0]["turn_deg"] < 10.0
