"""From far off to the station in a strong wind, in lockstep with sensors and gusts on; and back after a push."""

import math

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.approach import markdown, study_approach, summarise_approach
from asvhil.study.approach_figure import draw_tracks
from asvhil.study.runner import run_into
from asvhil.study.trials.approach import (
    CHATTER_S,
    SETTLED_S,
    Outcome,
    Start,
    draw_starts,
    run_start,
    start_overrides,
)


@pytest.mark.parametrize(
    ("bearing_deg", "heading_deg", "toward_deg"),
    [
        (180.0, 0.0, 90.0),
        pytest.param(20.0, 100.0, 200.0, marks=pytest.mark.thorough),
        pytest.param(-70.0, -120.0, -45.0, marks=pytest.mark.thorough),
    ],
)
def test_from_sixty_metres_off_the_station_is_reached_and_kept(bearing_deg, heading_deg, toward_deg):
    start = Start(
        seed=7,
        bearing_rad=math.radians(bearing_deg),
        psi_rad=math.radians(heading_deg),
        toward_rad=math.radians(toward_deg),
    )
    outcome = run_start(start, duration_s=130.0)
    assert [stage for _, stage in outcome.changes] == ["approach", "keep_heading"]
    assert outcome.handover_s is not None and 20.0 < outcome.handover_s < 75.0
    assert not outcome.lost and outcome.chatters == 0


@pytest.mark.thorough
def test_a_boat_that_a_squall_drives_beyond_r_d_starts_over():
    """35 m/s for 25 s are more than the motors can meet; after it the boat takes a path again, and comes back."""
    start = Start(seed=3, bearing_rad=math.pi, psi_rad=0.0, toward_rad=math.pi / 2)
    near = ("plant.start_n_m=-5", "plant.start_e_m=0", "plant.weather.wind.speed_mps=3")
    near = (*near, "supervisor.motion.on_fault=tell")  # which would let go of a boat that is driven so far off
    loop = Lockstep(load_config("sitl", (*start_overrides(start), *near)))
    stages, times_s = [], []
    for tick in range(110 * 20):
        loop.plant.weather.mean_mps = 35.0 if 15 * 20 <= tick < 40 * 20 else 3.0
        control = loop.tick()[1].control
        if control is not None and (not stages or control.stage != stages[-1]):
            stages.append(control.stage)
            times_s.append(tick / 20)
    assert stages == ["keep_heading", "recover", "keep_heading"]
    assert times_s[2] - times_s[1] >= CHATTER_S
    truth = loop.plant.truth
    assert math.hypot(truth.n_m, truth.e_m) < 4.0


def test_starts_are_the_same_for_the_same_seed():
    assert draw_starts(3, 5) == draw_starts(3, 5) != draw_starts(3, 6)
    assert draw_starts(2, 5) == draw_starts(3, 5)[:2]


@pytest.mark.thorough
def test_the_study_counts_what_was_lost_and_is_taken_up_again(tmp_path):
    """Two runs whose motors are too weak to get anywhere are lost, and told one by one."""
    weak = ("vehicle.vessel.thrust_curve=[[-1.0, -1.0], [0.0, 0.0], [1.0, 1.0]]", "controller.on_other_hull=use")
    store, seen = tmp_path / "approach.jsonl", []

    def study(runs: int):
        run = run_into(store, workers=0, tell=lambda now: seen.append((now.done, now.total)))
        return study_approach(run, runs, 1, overrides=weak, duration_s=20.0)

    first, _ = study(1)
    figures, outcomes = study(2)
    assert seen == [(0, 1), (1, 1), (1, 2), (2, 2)]  # the first start was not run again
    assert first["bad"] == figures["bad"][:1]
    assert figures["runs"] == 2 and figures["lost"] == 2 and len(figures["bad"]) == 2
    assert figures["handover_s"] is None and figures["end_m"]["min"] > 15.0
    for outcome in outcomes:
        assert len(outcome.track_m) == 20 and math.hypot(*outcome.track_m[0]) == pytest.approx(60.0, abs=0.2)
    text = markdown(figures)
    assert "| lost | none | 2 |" in text and text.count("Lost or too soon") == 2
    draw_tracks(outcomes, tmp_path / "tracks.png")
    assert (tmp_path / "tracks.png").read_bytes().startswith(b"\x89PNG")


def outcome(*changes_s: float, settled_m: float = 0.3) -> Outcome:
    """A run that changed its stage at these times."""
    stages = [(t_s, "keep_heading" if i % 2 else "approach") for i, t_s in enumerate(changes_s)]
    return Outcome(
        start=draw_starts(1, 1)[0],
        handover_s=40.0,
        reached_s=50.0,
        end_m=0.2,
        settled_m=settled_m,
        settled_max_m=1.0,
        settled_heading_deg=2.0,
        changes=tuple(stages),
        track_m=((60.0, 0.0), (0.0, 0.0)),
    )


def test_chatter_and_loss_are_counted_by_hand():
    figures = summarise_approach([outcome(0.0, 40.0), outcome(0.0, 40.0, 49.0, 49.5), outcome(0.0, settled_m=6.0)])
    assert figures["lost"] == 1 and figures["changes_too_soon"] == 2
    assert figures["changes_per_10_s_max"] == 3 and figures["changes_per_run_max"] == 3
    assert len(figures["bad"]) == 2 and SETTLED_S == 60.0
