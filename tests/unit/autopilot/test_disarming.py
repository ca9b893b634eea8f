"""Who has disarmed: the autopilot by itself, by its own words or a reboot, or people."""

import pytest

from asvhil.autopilot.disarming import BATCH_NS, BEAT_NS, FENCE_NS, Disarming
from asvhil.io.mavlink.frames import dialect

S = 1_000_000_000


def text(words: str) -> dialect.MAVLink_statustext_message:
    return dialect.MAVLink_statustext_message(4, words.encode())


def armed(*, fence_disarms: bool = True) -> Disarming:
    vehicle = Disarming(lambda: fence_disarms)
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
    assert vehicle.itself == "a fail-safe (it says GCS)", "the name is of whichever check looked last"


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
        (0, "Terminating due to GCS request"),
        (0, "PreArm: Battery 1 critical voltage failsafe"),
    ],
)
def test_what_says_nothing_of_it_leaves_it_a_persons_doing(late_ns: int, words: str) -> None:
    vehicle = armed()
    vehicle.on_text(5 * S + late_ns, text(words))
    vehicle.on_heartbeat(5 * S, armed=False)
    assert vehicle.itself == ""


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("Radio Failsafe", "a fail-safe (it says Radio)"),
        ("Battery 1 is critical 10.50V used 763 mAh", "battery 1 is critical"),
        ("Battery 2 is low 11.10V used 5210 mAh", "battery 2 is low"),
        ("Crash: Going to HOLD", "its crash check"),
        ("Terminating due to dual loss", "terminated for dual loss"),
    ],
)
@pytest.mark.parametrize("early_ns", [0, BATCH_NS, BATCH_NS + 1])
def test_what_acts_is_told_in_one_go_with_the_disarming(words: str, why: str, early_ns: int) -> None:
    """As of a real ArduRover with BATT_FS_CRT_ACT 5; a person may disarm a boat soon after its battery is told low."""
    vehicle = armed()
    vehicle.on_text(5 * S - early_ns, text(words))
    vehicle.on_text(5 * S, text("Throttle disarmed"))
    vehicle.on_heartbeat(5 * S + 800_000_000, armed=False)
    assert vehicle.itself == (why if early_ns <= BATCH_NS else "")


BREACH = "PreArm: Vehicle breaching Circle fence"
OUTSIDE = "it is outside its fence (Circle)"


@pytest.mark.parametrize("beat_ns", [200_000_000, 800_000_000], ids=["heartbeat first", "text first"])
@pytest.mark.parametrize("says", [True, False])
def test_a_fence_is_named_by_the_first_check_before_arming(says: bool, beat_ns: int) -> None:
    """A real ArduRover with FENCE_ACTION 5 says nothing else of it, and that 0.7 s later."""
    vehicle = armed()
    if says:
        vehicle.on_text(5 * S, text("Throttle disarmed"))
    for t_ns, what in sorted(((5 * S + 700_000_000, "text"), (5 * S + beat_ns, "beat"))):
        if what == "text":
            vehicle.on_text(t_ns, text(BREACH))
        else:
            vehicle.on_heartbeat(t_ns, armed=False)
    assert vehicle.itself == OUTSIDE
    vehicle.on_heartbeat(7 * S, armed=False)
    assert vehicle.itself == OUTSIDE


@pytest.mark.parametrize(("late_ns", "named"), [(FENCE_NS, True), (FENCE_NS + 1, False)])
@pytest.mark.parametrize("says", [True, False])
def test_a_later_check_says_only_where_the_boat_is(says: bool, late_ns: int, named: bool) -> None:
    vehicle = armed()
    if says:
        vehicle.on_text(5 * S, text("Throttle disarmed"))
    vehicle.on_heartbeat(5 * S + (300_000_000 if says else 0), armed=False)
    vehicle.on_text(5 * S + late_ns, text(BREACH))
    assert vehicle.itself == (OUTSIDE if named else "")


def test_a_person_disarms_a_boat_outside_a_fence_that_would_not() -> None:
    vehicle = armed(fence_disarms=False)
    vehicle.on_text(5 * S, text("Throttle disarmed"))
    vehicle.on_heartbeat(5 * S, armed=False)
    vehicle.on_text(6 * S, text(BREACH))
    assert vehicle.itself == ""


def test_what_stopped_an_earlier_time_names_no_later_one() -> None:
    vehicle = armed()
    vehicle.on_text(5 * S, text("Throttle disarmed"))
    vehicle.on_heartbeat(5 * S, armed=False)
    vehicle.on_heartbeat(50 * S, armed=True)
    vehicle.on_text(60 * S - BEAT_NS, text("GCS Failsafe"))
    vehicle.on_heartbeat(60 * S, armed=False)
    assert vehicle.itself == "a fail-safe (it says GCS)", "this time its own word was lost"


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
