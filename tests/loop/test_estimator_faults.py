"""Sensors that jump, freeze or fall silent in the loop: the estimate stays with the boat, the note names the sensor."""

import pytest

from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.rows import row_overrides
from asvhil.study.trials.abrupt import run_abrupt
from asvhil.types import Phase

START_S = 20.0
AFTER_S = 16.0  # back within 5 s, and then good for 10 s


def abrupt(base: str, kind: str, duration_s: float, *overrides: str) -> dict[str, object]:
    fault = f"plant.faults=[{{kind: {kind}, from_s: {START_S}, until_s: {START_S + duration_s}}}]"
    return run_abrupt(base, (*row_overrides("2", 1), fault, *overrides), START_S, duration_s, AFTER_S)


@pytest.mark.parametrize(
    ("base", "kind", "duration_s", "named"),
    [
        ("sitl-bream", "gnss-jump", 5.0, "gnss position"),
        pytest.param("sitl-bream", "heading-jump", 5.0, "compass", marks=pytest.mark.thorough),
        pytest.param("sitl-bream", "gnss-frozen", 10.0, "gnss position", marks=pytest.mark.thorough),
        pytest.param("sitl-bream", "heading-silent", 15.0, "compass", marks=pytest.mark.thorough),
        pytest.param("sitl-bream", "anemometer-stuck", 12.0, "anemometer", marks=pytest.mark.thorough),
        pytest.param("sitl-vn300", "gnss-jump", 5.0, "gnss position", marks=pytest.mark.thorough),
        pytest.param("sitl-vn300", "heading-jump", 5.0, "compass", marks=pytest.mark.thorough),
        pytest.param("sitl-vn300", "gnss-frozen", 10.0, "gnss position", marks=pytest.mark.thorough),
    ],
)
def test_the_estimate_stays_where_the_boat_is_and_the_note_names_the_sensor(
    base: str, kind: str, duration_s: float, named: str
) -> None:
    found = abrupt(base, kind, duration_s)
    assert found["moved_m"] <= 0.6 and found["moved_deg"] <= 3.0  # 0.4 m of it is noise on BREAM, without any fault
    assert isinstance(found["flags"], dict) and found["flags"][named] <= 2.0
    assert found["recovery_s"] is not None and found["recovery_s"] <= 5.0
    assert found["held"] and found["invalid"] == 0.0 and not found["false_flags"]


def test_with_receiver_and_compass_silent_the_motors_are_released() -> None:
    """Both of what the one could be bridged with: within the time of staleness, then of the fail-safe."""
    keys = (
        "plant.faults=[{kind: nmea, from_s: 16}]",
        "vehicle.power.hotel_w=20",
        "vehicle.power.power_curve=[[-1,400],[0,0],[1,400]]",
    )
    loop = Lockstep(load_config("sitl-bream", (*row_overrides("2", 1), *keys)))
    phases, energy = {}, []
    for tick in range(1, 21 * 20):
        _, outputs = loop.tick()
        phases[tick / 20] = outputs.phase
        if outputs.phase in (Phase.HOLD, Phase.FAILSAFE):
            assert outputs.energy is not None
            energy.append(outputs.energy.hold_wh or 0.0)
    assert energy == sorted(energy) and energy[-1] > 0.0, "a fail-safe is of the hold: its energy goes on"
    assert phases[15.9] is Phase.HOLD and phases[17.4] is Phase.FAILSAFE and phases[20.0] is Phase.STANDBY


def test_notes_are_reported_and_withdrawn() -> None:
    fault = "plant.faults=[{kind: gnss-jump, from_s: 14, until_s: 17}]"
    loop = Lockstep(load_config("sitl-bream", (*row_overrides("2", 1), fault)))
    texts = []
    for _ in range(21 * 20):
        _, outputs = loop.tick()
        texts += [frame.data for frame in outputs.frames if b"gnss position" in frame.data]
    assert len(texts) == 2 and b"gnss position: jump rejected" in texts[0] and b"gnss position: recovered" in texts[1]
