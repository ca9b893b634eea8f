"""The reason of a fault of the outputs, and the parameters it points to: none that was read and is right."""

import pytest

from asvhil.autopilot import ardurover_parameters, px4_parameters
from asvhil.autopilot.fault_reasons import explain_fault
from asvhil.autopilot.readback import Fault
from asvhil.autopilot.requirements import Finding, judge
from asvhil.config import load_config
from asvhil.supervisor.reasons import Reason, describe
from asvhil.types import Cause


def findings(name: str = "sitl", *overrides: str, **values: float) -> list[Finding]:
    config = load_config(name, overrides)
    profile = {"ardurover": ardurover_parameters, "px4": px4_parameters}[config.links.autopilot.profile]
    return judge(profile.requirements(config.links.autopilot, config.vehicle.pwm, values), values)


def hint(fault: Fault, found: list[Finding]) -> str:
    return str(dict(explain_fault(fault, found).detail)["hint"])


@pytest.mark.parametrize(
    ("fault", "reason", "text"),
    [
        (Fault(cause=Cause.IGNORED), Reason.OVERRIDES_IGNORED, "overrides are ignored"),
        (Fault(cause=Cause.STUCK, motor="port"), Reason.OUTPUT_STUCK, "stuck output: port"),
        (Fault(cause=Cause.STUCK, blind=True), Reason.OUTPUTS_UNCHANGED, "no output moves"),
        (Fault(cause=Cause.REVERSED), Reason.OUTPUT_REVERSED, "reversed output: both"),
        (Fault(cause=Cause.SWAPPED), Reason.OUTPUTS_SWAPPED, "outputs are swapped"),
        (Fault(cause=Cause.MIXED), Reason.COMMANDS_MIXED, "commands are mixed"),
        (Fault(cause=Cause.UNEXPLAINED), Reason.OUTPUTS_DIFFER, "outputs do not follow the commands"),
    ],
)
def test_each_fault_has_its_reason(fault: Fault, reason: Reason, text: str) -> None:
    why = explain_fault(fault, [])
    assert (why.reason, describe(why)) == (reason, text)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        (Fault(cause=Cause.IGNORED), "SYSID_MYGCS or RC_OPTIONS"),
        (Fault(cause=Cause.MIXED), "PILOT_STEER_TYPE"),
        (Fault(cause=Cause.SWAPPED), "SERVO1/3_FUNCTION"),
        (Fault(cause=Cause.REVERSED), "SERVO1/3_REVERSED"),
        (Fault(cause=Cause.REVERSED, motor="port"), "SERVO1_REVERSED"),
        (Fault(cause=Cause.STUCK), "SERVO1/3_FUNCTION"),
        (Fault(cause=Cause.STUCK, motor="starboard"), "SERVO3_FUNCTION"),
        (Fault(cause=Cause.STUCK, blind=True), "SYSID_MYGCS or SERVO1/3_FUNCTION"),
        (Fault(cause=Cause.UNEXPLAINED), "asvhil check"),
        (Fault(cause=Cause.UNEXPLAINED, late=True), "slow link"),
        (Fault(cause=Cause.REVERSED, motor="port", late=True), "SERVO1_REVERSED"),
    ],
)
def test_what_was_not_read_is_to_be_looked_at(fault: Fault, expected: str) -> None:
    assert hint(fault, findings()) == expected


def test_px4_has_hints_by_the_same_rule() -> None:
    assert hint(Fault(cause=Cause.STUCK), findings("sitl-px4")) == "PWM_MAIN_FUNC1/3"
    assert hint(Fault(cause=Cause.MIXED), findings("sitl-px4")) == ""


def test_a_parameter_that_was_read_and_is_right_is_not_the_cause() -> None:
    assert hint(Fault(cause=Cause.IGNORED), findings(SYSID_MYGCS=1.0)) == "RC_OPTIONS"
    right = findings(SERVO1_REVERSED=0.0)
    assert hint(Fault(cause=Cause.REVERSED), right) == "RC1/3_REVERSED"
    assert hint(Fault(cause=Cause.REVERSED, motor="port"), right) == "RC1_REVERSED"
    functions = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0, "FS_THR_VALUE": 910.0}
    assert hint(Fault(cause=Cause.STUCK, blind=True), findings(**functions)) == "SYSID_MYGCS or RC_OPTIONS"
    assert hint(Fault(cause=Cause.SWAPPED), findings(**functions)) == "RCMAP_ROLL or RCMAP_THROTTLE"


def test_a_pattern_that_only_parameters_make_names_them_though_they_were_read_as_right() -> None:
    """One has been changed since: it is read again once a minute only."""
    assert hint(Fault(cause=Cause.MIXED), findings(PILOT_STEER_TYPE=1.0)) == "PILOT_STEER_TYPE"
    right = {f"{pin}{n}_REVERSED": 0.0 for pin in ("RC", "SERVO") for n in (1, 3)}
    assert hint(Fault(cause=Cause.REVERSED), findings(**right)) == "SERVO1/3_REVERSED"


def test_what_was_read_as_wrong_comes_before_what_has_not_answered() -> None:
    assert hint(Fault(cause=Cause.IGNORED), findings(RC_OPTIONS=34.0)) == "RC_OPTIONS"
    plain = "vehicle.pwm.starboard={astern_us: 1100, ahead_us: 1900}"  # what the config does not say is followed
    assert hint(Fault(cause=Cause.REVERSED), findings("sitl", plain, SERVO3_REVERSED=1.0)) == "SERVO3_REVERSED"


def test_a_motor_that_does_not_answer_though_its_function_is_right_has_no_parameter_to_look_at() -> None:
    functions = {"SERVO1_FUNCTION": 73.0, "SERVO3_FUNCTION": 74.0, "FS_THR_VALUE": 910.0}
    assert hint(Fault(cause=Cause.STUCK), findings(**functions)) == ""


def test_where_all_were_read_and_are_right_no_command_is_named_either() -> None:
    required = findings("sitl", "links.autopilot.output=set_servo")
    values = {finding.name: 0.0 for finding in required}
    assert hint(Fault(cause=Cause.UNEXPLAINED), required) == "asvhil check"
    assert hint(Fault(cause=Cause.UNEXPLAINED), findings("sitl", "links.autopilot.output=set_servo", **values)) == ""


UNREAD = {name: findings(name, "vehicle.pwm.starboard.output=8") for name in ("sitl", "sitl-px4")}


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("motor", ["", "port", "starboard"])
@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize("name", UNREAD)
def test_words_fit_a_statustext(cause: Cause, motor: str, blind: bool, name: str) -> None:
    fault = Fault(cause=cause, motor=motor, blind=blind)
    text = describe(explain_fault(fault, UNREAD[name]))
    assert len(text) <= 50 and text.isascii()
