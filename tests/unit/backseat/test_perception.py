"""Perception on the frames of a simulated boat: what is known by the end of each tick."""

import math
from collections.abc import Callable

import pytest

from asvhil.backseat.build import build_link, build_model, build_perception
from asvhil.backseat.perception import Perceived, Perception
from asvhil.config import Config, load_config
from asvhil.simplant.plant import Plant
from asvhil.types import Frame, Inputs

TICK_NS = 50_000_000
CONFIG = load_config("sitl", ("controller.name=loiter", "plant.weather.wind={speed_mps: 5, toward_deg: 90}"))


def make() -> Perception:
    return build_perception(CONFIG, build_model(CONFIG), build_link(CONFIG))


def run(
    perception: Perception,
    seconds: float,
    keep: Callable[[Frame], bool] = lambda frame: True,
    pulses_us: tuple[int, int] | None = None,
    config: Config = CONFIG,
) -> list[Perceived]:
    plant = Plant(config, 0)
    seen = []
    for tick in range(1, round(seconds * 1e9 / TICK_NS) + 1):
        frames = tuple(frame for frame in plant.advance(tick * TICK_NS) if keep(frame))
        seen.append(perception.step(Inputs(t_ns=tick * TICK_NS, frames=frames)))
        perception.note_pulses(pulses_us, seen[-1].usable_wind)
    return seen


def test_the_boat_and_the_wind_are_known_once_the_autopilot_is_ready() -> None:
    perception = make()
    first, *_, last = run(perception, 12.0)
    assert first.estimate is None and first.wind is None and first.frame is None
    assert last.estimate is not None and last.estimate.valid and last.frame == perception.frame is not None
    assert last.usable_wind is last.wind is not None and last.wind.valid
    assert math.hypot(last.wind.vn_mps, last.wind.ve_mps - 5.0) < 2.0
    assert dict(perception.sources(last.t_ns))["wind"] == "anemometer.MWV"
    counts = dict(perception.counters())
    assert counts["anemometer.sentences"] > 30 and counts["ekf.resets"] == 0
    assert perception.notes(last.t_ns) == ()


def test_every_status_of_a_tick_is_handed_on_and_the_last_one_kept() -> None:
    seen = run(make(), 3.0)
    assert sum(len(at.statuses) for at in seen) > 5
    for at in seen:
        assert not at.statuses or at.status == at.statuses[-1]
    quiet = next(at for at in seen[20:] if not at.statuses)
    assert quiet.status is not None


def test_without_an_anemometer_there_is_no_usable_wind_and_after_30_s_that_of_the_disturbance() -> None:
    perception = make()
    seen = run(perception, 45.0, keep=lambda frame: frame.port != "anemometer" or frame.t_ns < 10_000_000_000)
    at = {round(p.t_ns * 1e-9, 2): p for p in seen}
    assert at[9.0].usable_wind is not None
    silent = at[20.0]
    assert silent.usable_wind is None and silent.wind is not None
    assert silent.wind.origin == "sensor" and not silent.wind.valid
    assert [(note.subject, note.text) for note in perception.notes(20_000_000_000)] == [("anemometer", "silent")]
    late = at[45.0]
    assert late.usable_wind is None and late.wind is not None and late.wind.origin == "disturbance"


def test_a_sensor_that_the_estimate_lacks_is_told_with_what_ails_it() -> None:
    silent = make()
    assert silent.lacks == ""
    run(silent, 12.0, keep=lambda frame: frame.port != "autopilot" or frame.t_ns < 10_000_000_000)
    assert silent.lacks == "gnss position silent, compass silent, gyro silent"
    jump = load_config("sitl-bream", ("controller.name=loiter", "plant.faults=[{kind: heading-jump, from_s: 10}]"))
    rejected = build_perception(jump, build_model(jump), build_link(jump))
    run(rejected, 12.0, config=jump)
    assert rejected.lacks == "compass rejected, though heard"


@pytest.mark.parametrize(("pulses_us", "ahead"), [((1900, 1900), True), (None, False)])
def test_the_pulses_that_are_sent_drive_the_prediction(pulses_us: tuple[int, int] | None, ahead: bool) -> None:
    """Without pulses of ours the autopilot's outputs do, and a boat that is not armed has none."""
    perception = make()
    *_, last = run(perception, 6.0, pulses_us=pulses_us)
    assert last.estimate is not None
    motors_on = max(abs(state) for state in last.estimate.motor)
    assert (motors_on > 0.9) is ahead and (motors_on == 0.0) is not ahead


def test_the_model_is_checked_in_control_ticks_once_its_horizon_is_filled() -> None:
    """A horizon of 4 s at 5 Hz: 20 steps."""
    perception, plant, errors = make(), Plant(CONFIG, 0), []
    for tick in range(1, 401):
        seen = perception.step(Inputs(t_ns=tick * TICK_NS, frames=tuple(plant.advance(tick * TICK_NS))))
        perception.note_pulses(None, seen.usable_wind)
        if tick % 4 == 0 and seen.estimate is not None:
            errors.append(perception.check_model(seen))
    assert errors[:20] == [None] * 20 and all(error is not None and error.ok for error in errors[20:])
    assert len(errors) > 40 and perception.model_ok
