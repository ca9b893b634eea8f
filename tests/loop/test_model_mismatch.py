"""A boat that is not the model's, in the loop: the operator is told, and the hold ends where the config asks."""

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase

# Motors that are three times as slow as the model's.
OTHER_BOAT = ("plant.vessel.motor_lag_s=1.5", "estimator.monitor.max_r_radps=0.04", "supervisor.motion.on_fault=off")


def keys() -> tuple[str, ...]:
    vessel = load_config("sitl").vehicle.vessel.model_dump(mode="json")
    return (*(f"plant.vessel.{name}={value}" for name, value in vessel.items()), *OTHER_BOAT)


@pytest.mark.parametrize("choice", ["release", pytest.param("tell", marks=pytest.mark.thorough)])
def test_a_model_of_another_boat_is_told_or_ends_the_hold(choice: str) -> None:
    loop = Lockstep(load_config("sitl", (*keys(), f"estimator.monitor.on_mismatch={choice}")))
    told_ticks = 0
    held = False
    for _ in range(90 * 20):
        _, outputs = loop.tick()
        held |= outputs.phase is Phase.HOLD
        told_ticks += any(note.subject == "model" and not note.ok for note in outputs.health.notes)
        if (held and outputs.phase is not Phase.HOLD) or told_ticks == 5 * 20:
            break
    if choice == "tell":
        assert told_ticks and outputs.phase is Phase.HOLD
    else:
        assert outputs.phase is not Phase.HOLD and outputs.health.code == "model-mismatch"
        assert "does not move as the model says" in outputs.health.reason
        for _ in range(20):
            _, outputs = loop.tick()
            assert outputs.pwm_us in (None, (1500, 1500))


@pytest.mark.parametrize(("current_mps", "told"), [(0.4, False), pytest.param(1.2, True, marks=pytest.mark.thorough)])
def test_a_current_ends_no_hold_as_a_model_of_another_boat(current_mps: float, told: bool) -> None:
    """From ahead, of a boat that is the model's; 1.2 m/s are more than the disturbance may be."""
    current = (f"plant.weather.current.speed_mps={current_mps}", "plant.weather.current.toward_deg=180")
    loop = Lockstep(load_config("sitl", (*current, "estimator.monitor.on_mismatch=release")))
    texts, furthest = set(), 0.0
    for _ in range(90 * 20):
        _, outputs = loop.tick()
        texts |= {note.text for note in outputs.health.notes if note.subject == "model"}
        furthest = max(furthest, 0.0 if outputs.model_error is None else outputs.model_error.horizon[0])
    assert outputs.phase is Phase.HOLD and furthest > 0.35
    assert bool(texts) is told and all("or a strong current is why" in text for text in texts)


def test_a_weak_motor_in_wind_is_not_taken_for_a_current() -> None:
    """Its disturbance is as large, and the hold ends for the model within 20 s of the fault."""
    keys = ("plant.weather.wind.speed_mps=8", "plant.weather.wind.toward_deg=90")
    fault = "plant.faults=[{kind: port-motor-weak, from_s: 30, size: 0.3}]"
    loop = Lockstep(load_config("sitl", (*keys, fault, "estimator.monitor.on_mismatch=release")))
    for _ in range(50 * 20):
        _, outputs = loop.tick()
    assert outputs.phase is not Phase.HOLD and outputs.health.code == "model-mismatch"


def test_the_boat_of_the_model_is_not_told() -> None:
    loop = Lockstep(load_config("sitl"))
    for _ in range(50 * 20):
        _, outputs = loop.tick()
        assert not any(note.subject == "model" for note in outputs.health.notes)
