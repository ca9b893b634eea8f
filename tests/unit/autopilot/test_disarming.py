"""Who has disarmed: the autopilot by itself, by its own words or a reboot, or people."""

import pytest

from asvhil.autopilot.disarming import BEAT_NS, Disarming
from asvhil.io.mavlink.frames import dialect

S = 1_000_000_000


def text(words: str) -> dialect.MAVLink_statustext_message:
    return dialect.MAVLink_statustext_message(4, words.encode())


def armed() -> Disarming:
    vehicle = Disarming()
    vehicle.on_heartbeat(S, armed=True)
    vehicle.note_clock()
    return vehicle


@pytest.mark.parametrize("words", ["failsafe", "landing", "auto preflight disarming"])
def test_px4_says_that_it_was_itself_before_its_heartbeat_does(words: str) -> None:
    vehicle = armed()
    assert vehicle.on_text(2 * S, text(f"Disarmed by {words}\t")) and vehicle.itself == words
    vehicle.on_heartbeat(3 * S, armed=False)
    assert vehicle.itself == words
    vehicle.on_heartbeat(4 * S, armed=True)
    assert vehicle.itself == ""


@pytest.mark.parametrize("words", ["external command", "RC switch", "Stick gesture", "kill-switch"])
def test_px4_says_that_it_was_a_person(words: str) -> None:
    vehicle = armed()
    assert vehicle.on_text(2 * S, text(f"Disarmed by {words}\t")) and vehicle.itself == ""


@pytest.mark.parametrize("early_ns", [0, S, BEAT_NS])
def test_an_ardurover_names_the_fail_safe_just_before_it_is_disarmed(early_ns: int) -> None:
    vehicle = armed()
    assert not vehicle.on_text(5 * S - early_ns, text("GCS Failsafe"))
    vehicle.on_heartbeat(5 * S, armed=False)
    assert vehicle.itself == "GCS fail-safe"


@pytest.mark.parametrize("late_ns", [0, S, BEAT_NS])
def test_a_fail_safe_after_it_has_not_disarmed_it(late_ns: int) -> None:
    vehicle = armed()
    vehicle.on_heartbeat(5 * S, armed=False)
    vehicle.on_text(5 * S + late_ns, text("Throttle Failsafe"))  # its pilot has switched the transmitter off
    vehicle.on_heartbeat(5 * S + late_ns, armed=False)
    assert vehicle.itself == ""


@pytest.mark.parametrize(
    ("late_ns", "words"),
    [
        (-BEAT_NS - 1, "GCS Failsafe"),  # its mode had changed long before
        (0, "GCS Failsafe Cleared"),
        (0, "Arm: Radio Failsafe on"),
        (0, "Throttle disarmed"),
    ],
)
def test_what_says_nothing_of_it_leaves_it_a_persons_doing(late_ns: int, words: str) -> None:
    vehicle = armed()
    vehicle.on_text(5 * S + late_ns, text(words))
    vehicle.on_heartbeat(5 * S, armed=False)
    assert vehicle.itself == ""


def test_a_fail_safe_of_a_vehicle_that_was_never_armed_disarms_nothing() -> None:
    vehicle = Disarming()
    vehicle.on_heartbeat(S, armed=False)
    vehicle.on_text(S, text("GCS Failsafe"))
    assert vehicle.itself == ""


@pytest.mark.parametrize("beat_first", [False, True])
def test_a_reboot_disarms(beat_first: bool) -> None:
    vehicle = armed()
    if beat_first:
        vehicle.on_heartbeat(2 * S, armed=False)
    vehicle.restart(2 * S)
    assert vehicle.itself == "reboot"
    vehicle.on_heartbeat(3 * S, armed=False)
    vehicle.note_clock()
    assert vehicle.itself == "reboot"


@pytest.mark.parametrize("clock_goes_on", [False, True])
def test_a_vehicle_that_people_disarm_and_reboot_was_disarmed_by_people(clock_goes_on: bool) -> None:
    vehicle = armed()
    vehicle.on_heartbeat(2 * S, armed=False)
    if clock_goes_on:
        vehicle.note_clock()
    vehicle.restart(2 * S + 1)
    assert vehicle.itself == ""
