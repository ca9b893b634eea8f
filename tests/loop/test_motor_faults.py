"""Wrong parameters of the autopilot: a hold is refused, or ends within 3 s, with the reason."""

import random
from dataclasses import replace
from functools import cache
from typing import cast

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Frame, Phase
from tests.support.copies import on_a_copy
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.lossy_plant import PlantBehindLink, losing, losing_messages
from tests.support.motor_faults import BLIND_REASON, WIRED, WRONG, Trial
from tests.support.parts import one_in

LIMIT_S = 3.0
REJECTED = 1
NO_ANSWER = ("PARAM_VALUE",)
BLIND = ("PARAM_VALUE", "RC_CHANNELS", "SYS_STATUS")  # the last one says that a pilot has a transmitter


@cache
def armed(seed: int, lost: tuple[str, ...]) -> Trial:
    """A boat of which some messages never arrive, armed: for copies."""
    return Trial({}, f"plant.seed={seed}", lost=lost)


def test_no_hold_begins_while_the_pilots_sticks_are_not_told() -> None:
    trial = Trial({}, lost=("RC_CHANNELS",))
    seconds, _ = trial.hold()
    assert seconds == 0.0 and trial.results == [REJECTED]
    assert any("the pilot's sticks" in text for text in trial.texts), trial.texts
    assert not any(trial.overrides_us), "nothing was ever sent to the motors"


def neutral_then_released(trial: Trial) -> None:
    """Neutral and release went out in the tick that let go, and nothing but releases since."""
    assert trial.overrides_us[-1][-2:] == [(1500, 1500), (0, 0)]
    for _ in range(40):
        outputs = trial.step()
        assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None
    assert all(pulses in ((1500, 1500), (0, 0)) for sent in trial.overrides_us[-40:] for pulses in sent)
    assert trial.overrides_us[-1] == []


@pytest.mark.parametrize("name", [name for name in WRONG if name not in WIRED])
def test_a_parameter_that_was_read_refuses_the_hold_at_once_and_is_named(name: str) -> None:
    parameters, _ = WRONG[name]
    trial = Trial(parameters)
    seconds, outputs = trial.hold()
    assert seconds == 0.0 and trial.results == [REJECTED]
    assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None
    assert any(wrong in trial.texts[-1] for wrong in parameters)
    (note,) = [note for note in outputs.health.notes if note.subject == "parameters"]
    assert not note.ok and trial.texts[-1] in note.text
    assert not any(trial.overrides_us), "nothing was ever sent to the motors"


@pytest.mark.parametrize("name", one_in(2, WRONG))
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("lost", [NO_ANSWER, BLIND], ids=["no PARAM_VALUE", "nor RC_CHANNELS"])
def test_without_parameters_the_read_back_finds_it_within_3_s_of_the_hold(
    name: str, seed: int, lost: tuple[str, ...]
) -> None:
    parameters, reason = WRONG[name]
    if lost == BLIND and reason is Reason.OVERRIDES_IGNORED:
        reason = BLIND_REASON
    # Nobody reads parameters here, so it does not matter since when they are so; but an output shows since when it is.
    fresh = "SERVO1_FUNCTION" in parameters
    trial = Trial(parameters, f"plant.seed={seed}", lost=lost) if fresh else armed(seed, lost)

    def body() -> None:
        for parameter, value in parameters.items():
            assert trial.frontseat.rover.parameters.set(parameter, float(value))
        seconds, outputs = trial.hold()
        assert seconds is not None and 0.0 < seconds <= LIMIT_S
        assert outputs.health.code == reason
        assert any(outputs.health.reason[:35] in said for said in trial.texts)
        neutral_then_released(trial)

    on_a_copy(body)


@pytest.mark.parametrize("name", WIRED)
def test_a_boat_that_is_wired_so_is_held_where_its_parameters_are_known(name: str) -> None:
    trial = Trial(WRONG[name][0])
    assert trial.hold()[0] is None
    notes = {note.subject: note for note in trial.step().health.notes}
    assert notes["outputs"].ok and "parameters" not in notes


@pytest.mark.parametrize(
    ("name", "motor"), [("reversed", "port"), ("both reversed", "both"), ("swapped", ""), ("no port motor", "")]
)
def test_wiring_that_changes_while_holding_is_a_fault_though_the_change_is_told(name: str, motor: str) -> None:
    trial = Trial({})
    assert trial.hold()[0] is None
    changes, reason = WRONG[name]
    for parameter, value in changes.items():
        station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        change = dialect.MAVLink_param_set_message(1, 1, parameter.encode(), value, 4)
        trial.plant.receive(Frame(t_ns=trial.t_ns, port="autopilot", data=bytes(change.pack(station)), peer="ground"))
    for _ in range(round(LIMIT_S * 20)):
        outputs = trial.step()
        if outputs.phase is Phase.STANDBY:
            break
    assert outputs.phase is Phase.STANDBY and motor in outputs.health.reason
    # While a boat turns on the spot its motors work against each other: swapped is then the same as both reversed.
    alike = (Reason.OUTPUT_REVERSED,) if name == "swapped" else ()
    assert outputs.health.code in (reason, Reason.AUTOPILOT_PARAMETER, *alike)
    neutral_then_released(trial)


def test_a_hold_waits_until_the_wiring_is_read_and_begins_once_it_has_been_given_up() -> None:
    loop = Lockstep(load_config("sitl", (PLAIN_CONTROLLER,)))
    loop.plant = cast(Plant, PlantBehindLink(loop.plant, losing_messages(NO_ANSWER)))
    reasons = [loop.tick()[1].health.code for _ in range(400)]
    assert Reason.WIRING_UNREAD in reasons and reasons[-1] == Reason.HOLDING
    assert reasons.index(Reason.HOLDING) < 15 * 20


UNBOUNDED = {
    "no transmitter, no fail-safe": ({"FS_THR_ENABLE": 0}, ("plant.frontseat.rc_receiver=false",)),
    "overrides never end": ({"RC_OVERRIDE_TIME": -1}, ()),
    "receiver ignored": ({"FS_THR_ENABLE": 0, "RC_OPTIONS": 1}, ()),
    "servo commands": (
        {"SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 0, "SERVO5_FUNCTION": 94},
        ("links.autopilot.output=set_servo",),
    ),
}


@pytest.mark.parametrize("name", UNBOUNDED)
def test_motors_that_nothing_would_stop_are_not_taken(name: str) -> None:
    parameters, overrides = UNBOUNDED[name]
    trial = Trial(parameters, *overrides, "supervisor.readback.tolerate=[ignored]")
    seconds, outputs = trial.hold()
    assert seconds == 0.0 and trial.results == [REJECTED] and not any(trial.overrides_us)
    assert "nothing would stop the motors if this program died" in "".join(trial.texts)
    (note,) = [note for note in outputs.health.notes if note.subject == "motors after a crash"]
    assert not note.ok and not note.text.endswith("tolerated")


@pytest.mark.parametrize("name", UNBOUNDED)
def test_unless_the_config_takes_that_on_itself_by_name(name: str) -> None:
    parameters, overrides = UNBOUNDED[name]
    trial = Trial(parameters, *overrides, "supervisor.readback.tolerate=[unbounded, ignored]")
    seconds, outputs = trial.hold(3.0)
    assert seconds is None and outputs.phase is Phase.HOLD
    (note,) = [note for note in outputs.health.notes if note.subject == "motors after a crash"]
    assert not note.ok and note.text.endswith("tolerated")


def test_a_parameter_that_goes_wrong_while_holding_ends_the_hold() -> None:
    trial = Trial({})
    assert trial.hold()[0] is None
    trial.frontseat.rover.parameters.set("PILOT_STEER_TYPE", 0.0)
    for _ in range(round(LIMIT_S * 20)):
        outputs = trial.step()
        if outputs.phase is Phase.STANDBY:
            break
    assert outputs.health.reason == describe(explain(Reason.COMMANDS_MIXED, hint="PILOT_STEER_TYPE"))
    neutral_then_released(trial)


def test_a_hold_after_the_mistake_was_mended_is_granted() -> None:
    trial = Trial(WRONG["mixed"][0], lost=NO_ANSWER)
    assert trial.hold()[0] is not None
    trial.frontseat.rover.parameters.set("PILOT_STEER_TYPE", 1.0)
    assert trial.hold()[0] is None
    notes = {note.subject: note for note in trial.step().health.notes}
    assert notes["outputs"].ok and notes["outputs"].text == "follow the commands"


def test_a_cause_that_is_tolerated_is_told_and_nothing_more() -> None:
    trial = Trial(WRONG["slew"][0], "supervisor.readback.tolerate=[slew]", lost=NO_ANSWER)
    assert trial.hold()[0] is None
    (note,) = [note for note in trial.step().health.notes if note.subject == "outputs"]
    assert note.text == "outputs lag behind (MOT_SLEWRATE)" and not note.ok
    trial = Trial(WRONG["slew"][0], "supervisor.readback.tolerate=[slew]")
    assert trial.hold()[0] is None


def test_engage_auto_waits_for_the_mistake_to_be_mended_and_never_arms() -> None:
    loop = Lockstep(load_config("sitl", ("plant.frontseat.mygcs_system_id=255",)))
    for _ in range(200):
        _, outputs = loop.tick()
    assert outputs.phase is Phase.STANDBY and not loop.plant.frontseat.rover.armed
    assert outputs.health.code == Reason.AUTOPILOT_PARAMETER
    assert outputs.health.reason == "SYSID_MYGCS is 255, not 1: overrides are ignored"
    loop.plant.frontseat.rover.parameters.set("SYSID_MYGCS", 1.0)
    for _ in range(65 * 20):  # the change was not told: it is found within a minute
        if (outputs := loop.tick()[1]).phase is Phase.HOLD:
            break
    assert outputs.phase is Phase.HOLD


# --- the pilot is never taken for a fault, nor a fault for him ------------------------------------------------


@pytest.mark.parametrize(
    "lost",
    [(), pytest.param(NO_ANSWER, marks=pytest.mark.thorough), BLIND],
    ids=["all", "no PARAM_VALUE", "nor RC_CHANNELS"],
)
@pytest.mark.parametrize(
    ("act", "why"), [("mode", explain(Reason.MODE_CHANGED, mode="HOLD")), ("disarm", explain(Reason.DISARMED))]
)
def test_the_pilots_act_is_named_as_his(lost: tuple[str, ...], act: str, why: Explanation) -> None:
    trial = Trial({}, lost=lost)
    assert trial.hold()[0] is None
    frontseat = trial.frontseat
    assert frontseat.set_mode(4) if act == "mode" else frontseat.arm(False)
    for _ in range(5):
        outputs = trial.step()
        if outputs.phase is Phase.STANDBY:
            break
    assert (outputs.health.code, outputs.health.reason) == (why.reason, describe(why))
    assert trial.overrides_us[-1] == [(0, 0)], "released, and nothing else said"


def test_the_pilot_comes_first_while_a_fault_is_being_found() -> None:
    trial = Trial(WRONG["swapped"][0], lost=NO_ANSWER)
    assert trial.hold(limit_s=0.5)[0] is None
    trial.frontseat.set_sticks({4: 1700})
    for _ in range(4):
        outputs = trial.step()
        if outputs.phase is Phase.STANDBY:
            break
    assert outputs.health.reason == describe(explain(Reason.STICK_MOVED, channel=4))


def test_a_pilot_who_switches_overrides_off_is_not_a_wrong_parameter() -> None:
    trial = Trial({}, lost=NO_ANSWER)
    assert trial.hold()[0] is None
    trial.frontseat.rover.parameters.set("RC_OPTIONS", 34.0)  # as his switch would
    for _ in range(20):
        outputs = trial.step()
        if outputs.phase is Phase.STANDBY:
            break
    assert outputs.health.code == Reason.OVERRIDE_NOT_FOLLOWED


# --- no false alarm -----------------------------------------------------------------------------------------


RIGHT: list[tuple[str, list[str], float, int]] = [
    ("sitl", ["plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90"], 0.0, 0),
    ("sitl", ["plant.weather.wind.speed_mps=0", "plant.start_n_m=0", "plant.start_e_m=0"], 0.0, 0),
    ("sitl", ["plant.weather.waves.orbital_std_mps=0.07", "plant.weather.waves.yaw_std_radps=0.02"], 0.0, 0),
    ("sitl-bream", [], 0.0, 0),
    ("sitl", [], 0.3, 0),
    ("sitl", [], 0.0, 400),
    ("sitl", ["links.autopilot.streams_hz.SERVO_OUTPUT_RAW=1"], 0.0, 0),
    ("sitl", ["links.autopilot.streams_hz.SERVO_OUTPUT_RAW=40"], 0.0, 0),
    ("sitl", ["links.autopilot.output=manual_control"], 0.0, 0),
    ("sitl", ["plant.frontseat.rc_receiver=false"], 0.0, 0),
    (
        "sitl",
        [
            "links.autopilot.output=set_servo",
            "plant.frontseat.parameters={SERVO1_FUNCTION: 0, SERVO3_FUNCTION: 0, SERVO5_FUNCTION: 94}",
            "supervisor.readback.tolerate=[unbounded]",
        ],
        0.0,
        0,
    ),
]
HELD = [
    pytest.param(*case, lost, marks=() if number < 2 or (lost != BLIND and number % 2) else pytest.mark.thorough)
    for number, case in enumerate(RIGHT)
    for lost in ((), BLIND)
]


@pytest.mark.parametrize(("config", "overrides", "loss", "late_ms", "lost"), HELD)
def test_a_boat_that_is_set_right_is_held(
    config: str, overrides: list[str], loss: float, late_ms: int, lost: tuple[str, ...]
) -> None:
    chance = random.Random(5)
    loop = Lockstep(load_config(config, (PLAIN_CONTROLLER, *overrides)))

    def late_or_lost(frame: Frame) -> list[Frame]:
        return [replace(frame, t_ns=frame.t_ns + late_ms * 1_000_000)] if chance.random() >= loss else []

    from_plant = losing_messages(lost, then=losing(loss, random.Random(3)))
    loop.plant = PlantBehindLink(loop.plant, from_plant, late_or_lost)  # type: ignore[assignment]
    held = False
    for _ in range(16 * 20 if lost else 12 * 20):  # without parameters it is held later
        _, outputs = loop.tick()
        held = held or outputs.phase is Phase.HOLD
        assert not held or outputs.phase in (Phase.HOLD, Phase.FAILSAFE), outputs.health.reason
        assert all(note.ok for note in outputs.health.notes if note.subject in ("outputs", "parameters"))
    assert held
