"""Preflight of the autopilot's parameters: each wrong one is found, named, mended, and gone."""

import pytest

from asvhil.preflight.checks import checks_of
from asvhil.preflight.parameter_checks import wiring_checks
from asvhil.preflight.table import Result, folded, worst
from asvhil.preflight.wiring import SIDES, yaml_to_pin
from asvhil.supervisor.reasons import Reason, explain
from tests.support.dock import Dock, bad, of
from tests.support.parts import one_in

# A wrong value for each parameter that can be mended, by firmware.
WRONG: dict[str, float] = {
    "SYSID_MYGCS": 255,
    "RC_OPTIONS": 34,
    "RC_OVERRIDE_TIME": 0,
    "PILOT_STEER_TYPE": 0,
    "MOT_SLEWRATE": 100,
    "MOT_THR_MIN": 5,
    "MOT_THST_EXPO": 0.8,
    "MOT_THR_MAX": 50,
    "MOT_THST_ASYM": 4.5,
    "MANUAL_STR_EXPO": 0.5,
    "MANUAL_OPTIONS": 1,
    "RC1_DZ": 30,
    "RC3_DZ": 30,
    "FS_THR_VALUE": 1101,
    "ARMING_RUDDER": 2,
    "SYSID_ENFORCE": 1,
    "FS_THR_ENABLE": 0,
    "FS_ACTION": 0,
    "FS_GCS_ENABLE": 1,
    "FS_GCS_TIMEOUT": 60,
    "ARMING_CHECK": 0,
}
# Of the boat's wiring, which is never written: what leads nowhere, ...
WIRING: dict[str, float] = {
    "RCMAP_ROLL": 3,
    "RCMAP_THROTTLE": 1,
    **{
        f"{name}{n}_{part}": value
        for n in (1, 3)
        for name, part, value in (
            ("SERVO", "FUNCTION", 0),
            ("SERVO", "TRIM", 1380),
            ("SERVO", "MIN", 1200),
            ("SERVO", "MAX", 1800),
            ("RC", "MIN", 1480),
            ("RC", "MAX", 1550),
        )
    },
}
# ... and what is followed.
FOLLOWED: dict[str, float] = {
    f"{name}{n}_{part}": value
    for n in (1, 3)
    for name, part, value in (
        ("SERVO", "REVERSED", 1),
        ("SERVO", "TRIM", 1480),
        ("RC", "REVERSED", 1),
        ("RC", "TRIM", 1520),
        ("RC", "MIN", 1100),
        ("RC", "MAX", 1900),
    )
}
NEWER = {"MAV_GCS_SYSID": 255.0, "ARMING_SKIPCHK": -1.0, "MAV_OPTIONS": 1.0}
ONLY_WARNS = {"FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "ARMING_CHECK", "ARMING_SKIPCHK", "SYSID_ENFORCE", "MAV_OPTIONS"}


@pytest.mark.parametrize("firmware", ["4.6", "4.7"])
def test_a_vehicle_that_is_set_right_passes(firmware: str) -> None:
    dock = Dock(f"plant.frontseat.firmware='{firmware}'")
    checks = dock.look()
    assert bad(checks) == {}
    assert of(checks, "firmware").found == {"4.6": "4.6.3", "4.7": "4.7.0"}[firmware]
    assert of(checks, "heartbeat").found == "ArduPilot, boat"
    assert of(checks, "TIMESYNC").found.startswith("round trip ")
    assert of(checks, "wind: anemometer.MWV").found.startswith(("4.8 Hz, last 0.", "5.0 Hz, last 0."))
    assert {c.item for c in checks if c.section == "rates"} == set(dock.config.links.autopilot.streams_hz)
    assert sum(c.section == "parameters" for c in checks) >= 35
    assert [c.item for c in folded(checks) if c.section == "parameters"] == [
        f"all {sum(c.section == 'parameters' for c in checks)}"
    ]


@pytest.mark.parametrize("name", one_in(2, [*WRONG, *NEWER]))
def test_each_wrong_parameter_is_found_and_named_and_mended(name: str) -> None:
    newer = name in NEWER
    value = NEWER[name] if newer else WRONG[name]
    dock = Dock(
        f"plant.frontseat.parameters={{{name}: {value}}}", f"plant.frontseat.firmware='{'4.7' if newer else '4.6'}'"
    )
    first = dock.look()
    result = Result.WARN if name in ONLY_WARNS else Result.FAIL
    assert bad(first) == {name: result}
    check = of(first, name)
    assert check.found == f"{value:g}" and check.wanted and "--fix" in check.todo
    assert worst(first) is result
    written = dock.survey.fix()
    assert {f.name for f in written} == {name}
    dock.run(2.0)
    assert not dock.survey.fixing and not dock.survey.link.parameters.unwritten
    assert bad(checks_of(dock.survey)) == {}


@pytest.mark.parametrize(
    ("config", "name", "value"),
    [
        *one_in(2, (("sitl", name, value) for name, value in WIRING.items())),
        ("sitl-px4", "PWM_MAIN_FUNC1", 101),
        ("sitl-px4", "PWM_MAIN_FUNC3", 0),
        ("sitl-px4", "PWM_MAIN_MIN3", 1200),
        ("sitl-px4", "PWM_MAIN_MAX1", 1800),
        ("sitl-px4", "PWM_MAIN_DIS3", 1000),
    ],
)
def test_wiring_that_leads_nowhere_is_told_and_never_written(config: str, name: str, value: float) -> None:
    dock = Dock(f"plant.frontseat.parameters={{{name}: {value}}}", config=config)
    checks = dock.look()
    told = "RCMAP_THROTTLE" if name == "RCMAP_ROLL" else name  # the second of two that name one channel
    assert bad(checks)[told] is Result.FAIL and "never written" in of(checks, told).todo
    motors = [of(checks, f"{side} motor") for side in SIDES]
    assert any(motor.result is Result.FAIL and told in motor.todo for motor in motors)
    assert yaml_to_pin(dock.survey) == ""
    assert dock.survey.fixable == [] and dock.survey.fix() == []
    dock.run(1.0)
    assert all(message.get_type() != "PARAM_SET" for message in dock.said)


@pytest.mark.parametrize(
    ("config", "parameters"),
    [
        *one_in(2, (("sitl", {name: value}) for name, value in FOLLOWED.items())),
        ("sitl", {"RCMAP_ROLL": 6, "RCMAP_THROTTLE": 5}),
        ("sitl", {"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 0, "SERVO8_FUNCTION": 73}),
        ("sitl-px4", {"PWM_MAIN_REV": 4}),
        ("sitl-px4", {"PWM_MAIN_MIN3": 1000, "PWM_MAIN_MAX1": 2000}),
        ("sitl-px4", {"PWM_MAIN_FUNC1": 302, "PWM_MAIN_FUNC3": 0, "PWM_MAIN_FUNC7": 301}),
    ],
)
def test_wiring_of_another_kind_is_followed_and_never_written(config: str, parameters: dict[str, float]) -> None:
    wired = ", ".join(f"{name}: {value}" for name, value in parameters.items())
    dock = Dock(f"plant.frontseat.parameters={{{wired}}}", config=config)
    assert bad(dock.look()) == {}
    assert dock.survey.fixable == [] and dock.survey.fix() == []
    assert yaml_to_pin(dock.survey).startswith("vehicle:\n  pwm:\n    port: {output: ")


def test_of_two_motors_that_is_wired_right_passes_and_neither_is_pinned() -> None:
    dock = Dock("plant.frontseat.parameters={SERVO5_FUNCTION: 73}")
    checks = dock.look()
    assert bad(checks) == {"port motor": Result.FAIL, "SERVO5_FUNCTION": Result.FAIL}
    assert yaml_to_pin(dock.survey) == ""


def test_the_wiring_of_another_vehicle_is_not_pinned() -> None:
    dock = Dock()
    dock.look()
    dock.survey.stranger = explain(Reason.TWO_VEHICLES, system=1)
    assert {check.result for check in wiring_checks(dock.survey)[:2]} == {Result.FAIL}
    assert yaml_to_pin(dock.survey) == ""


@pytest.mark.parametrize("output", ["rc_override", "manual_control"])
@pytest.mark.parametrize(
    ("setting", "found", "ways_out"),
    [
        ("plant.frontseat.parameters={RCMAP_ROLL: 2}", "2, 4: channel 2 moves the port motor", "RCMAP_ROLL"),
        (
            "supervisor.stick_channels=[3, 1]",
            "3, 1: channel 3 moves the starboard motor, channel 1 moves the port motor",
            "RCMAP_THROTTLE and RCMAP_ROLL",
        ),
    ],
)
def test_a_stick_that_is_to_end_a_hold_and_moves_a_motor_fails(
    output: str, setting: str, found: str, ways_out: str
) -> None:
    checks = Dock(setting, f"links.autopilot.output={output}").look()
    check = of(checks, "stick channels")
    assert bad(checks) == {"stick channels": Result.FAIL}
    assert check.section == "wiring" and check.found == found
    assert f"change {ways_out} on the boat, or name others in supervisor.stick_channels" in check.todo


def test_sticks_that_nothing_hides_may_move_motors() -> None:
    free = ("links.autopilot.output=set_servo", "supervisor.stick_channels=[1, 3]")
    assert not [check for check in Dock(*free).look() if check.item == "stick channels"]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("COM_OBL_RC_ACT", 0),
        ("COM_OF_LOSS_T", 10.0),
    ],
)
def test_each_wrong_parameter_of_a_px4_too(name: str, value: float) -> None:
    dock = Dock(f"plant.frontseat.parameters={{{name}: {value}}}", config="sitl-px4")
    assert bad(dock.look()) == {name: Result.FAIL}
    assert {finding.name for finding in dock.survey.fix()} == {name}
    dock.run(2.0)
    assert bad(dock.look()) == {}, "the second run"


@pytest.mark.parametrize(
    ("value", "written"), [(245, 21), (1023, 543), pytest.param(53, 21, marks=pytest.mark.thorough)]
)
def test_a_px4_that_would_lose_a_boat_adrift_is_told_the_cure(value: int, written: int) -> None:
    """Adrift in a current: the position is lost after some 15 s. 245 is the default of PX4 1.15, 1023 that of 1.16."""
    adrift = ("plant.weather.current.speed_mps=0.3", f"plant.frontseat.parameters={{EKF2_GPS_CHECK: {value}}}")
    dock = Dock(*adrift, config="sitl-px4")
    dock.run(30.0)
    checks = dock.look()
    assert bad(checks)["EKF2_GPS_CHECK"] is Result.WARN
    found = of(checks, "EKF2_GPS_CHECK")
    assert "--fix writes it" in found.todo and "moves" in found.todo and found.wanted == "bits 5, 6, 7, 8 not set"
    dock.survey.fix()
    dock.run(12.0)
    assert dock.plant.frontseat.vehicle.parameters["EKF2_GPS_CHECK"] == written
    assert bad(dock.look()) == {}, "position and heading too"


def test_all_wrong_at_once_are_mended_at_once() -> None:
    values = ", ".join(f"{name}: {value}" for name, value in WRONG.items())
    dock = Dock(f"plant.frontseat.parameters={{{values}}}")
    assert set(WRONG) <= set(bad(dock.look()))
    dock.survey.fix()
    dock.run(10.0)
    assert bad(dock.look()) == {}, "the second run"


def test_nothing_is_written_without_being_asked_to() -> None:
    dock = Dock("plant.frontseat.mygcs_system_id=255")
    dock.look()
    assert all(message.get_type() != "PARAM_SET" for message in dock.said)


def test_a_px4_is_looked_over_by_its_own_parameters() -> None:
    checks = Dock(config="sitl-px4").look()
    assert worst([c for c in checks if c.section in ("vehicle", "parameters", "sensors")]) is not Result.FAIL
    assert of(checks, "heartbeat").found == "PX4, boat"
    assert any(c.item == "COM_OBL_RC_ACT" for c in checks)
