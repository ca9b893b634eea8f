"""`asvhil check` against the simulated vehicle in virtual time: the vehicle, its sensors, and this computer."""

from dataclasses import replace
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.preflight import computer
from asvhil.preflight.checks import checks_of
from asvhil.preflight.computer import computer_checks
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result, as_json
from asvhil.supervisor.reasons import describe
from asvhil.types import Frame, Inputs
from tests.support.dock import Dock, S, bad, of
from tests.support.plugins import write_line_wind


def test_an_autopilot_that_has_just_been_switched_on_fools_nobody() -> None:
    early = ("plant.frontseat.setup_s=4", "plant.frontseat.rc1_dz_us=30", "plant.frontseat.rc3_dz_us=30")
    dock = Dock(*early)
    dock.run(2.0)
    station = dialect.MAVLink(
        None, srcSystem=255, srcComponent=190
    )  # reads all that is told so early: it comes by here
    every = dialect.MAVLink_param_request_list_message(1, 1).pack(station)
    dock.plant.receive(Frame(t_ns=dock.t_ns, port="autopilot", data=every))
    dock.run(1.0)
    assert dock.survey.link.parameters.values["RC1_DZ"] == 0.0
    assert dock.survey.stage == "booting" and not dock.survey.fixable
    assert not {m.get_type() for m in dock.said} & {"PARAM_REQUEST_READ", "PARAM_SET"}
    dock.run(25.0)
    assert dock.survey.stage == "done"
    found = bad(checks_of(dock.survey))
    assert found == {"RC1_DZ": Result.FAIL, "RC3_DZ": Result.FAIL}
    dock.survey.fix()
    dock.run(2.0)
    assert dock.plant.frontseat.rover.parameters["RC1_DZ"] == 0.0
    assert bad(dock.look()) == {}


def test_an_autopilot_that_restarts_during_a_check_is_looked_at_anew() -> None:
    dock = Dock("plant.frontseat.setup_s=1")
    dock.run(6.0)
    assert dock.survey.stage in ("asking", "counting")
    dock.plant.frontseat.reboot(dock.t_ns)
    dock.run(1.7)
    assert dock.survey.stage == "booting"
    dock.run(25.0)
    assert dock.survey.stage == "done" and bad(checks_of(dock.survey)) == {}


def test_the_safety_switch_is_told_and_left_alone() -> None:
    dock = Dock("plant.frontseat.parameters={BRD_SAFETY_DEFLT: 1}")
    checks = dock.look()
    assert bad(checks) == {"BRD_SAFETY_DEFLT": Result.WARN, "arming": Result.WARN}
    assert of(checks, "arming").found == "refused: Hardware safety switch"
    assert "until the safety switch is pressed" in of(checks, "BRD_SAFETY_DEFLT").todo
    assert dock.survey.fix() == []


def test_a_transmitter_that_is_switched_off_is_lost_though_its_channels_stay() -> None:
    dock = Dock()
    checks = dock.look()
    assert of(checks, "transmitter").found == "8 channels, no signal strength"
    assert of(checks, "arming").found == "its checks pass"
    assert of(checks, "motors after a crash").found == "the sticks are back after 2.9 s (RC_OVERRIDE_TIME)"
    dock.plant.frontseat.set_receiver(False)
    dock.run(1.0)
    checks = dock.look()
    assert bad(checks) == {"transmitter": Result.WARN, "arming": Result.WARN}
    assert of(checks, "transmitter").found == "lost: it has been heard before"
    assert of(checks, "arming").found == "refused: Radio failsafe on"


def test_a_boat_without_a_receiver_is_told_how_it_is_armed() -> None:
    checks = Dock("plant.frontseat.rc_receiver=false").look()
    assert bad(checks) == {"transmitter": Result.WARN, "arming": Result.WARN}
    assert "how to arm such a boat" in of(checks, "transmitter").todo
    assert of(checks, "motors after a crash").found == "neutral within 1 s (FS_THR_ENABLE)"


@pytest.mark.parametrize(("tolerate", "result"), [("", Result.FAIL), ("unbounded", Result.WARN)])
def test_motors_that_nothing_stops_after_a_crash_fail_unless_that_is_taken_on(tolerate: str, result: Result) -> None:
    dock = Dock(
        "plant.frontseat.rc_receiver=false",
        "plant.frontseat.parameters={FS_THR_ENABLE: 0}",
        f"supervisor.readback.tolerate=[{tolerate}]",
    )
    check = of(dock.look(), "motors after a crash")
    assert check.result is result
    assert check.found == "run on: FS_THR_ENABLE is 0, and no transmitter is heard"


@pytest.mark.parametrize(
    ("config", "overrides"),
    [
        ("sitl", ()),
        ("sitl", ("links.autopilot.output=set_servo",)),
        ("sitl", ("links.autopilot.output=manual_control",)),
        ("sitl", ("supervisor.engage=auto",)),
        ("sitl-px4", ()),
    ],
)
def test_nothing_that_arms_or_moves_a_motor_is_ever_said(config: str, overrides: tuple[str, ...]) -> None:
    dock = Dock(*overrides, config=config)
    dock.look()
    dock.survey.fix()
    dock.run(5.0)
    kinds = {message.get_type() for message in dock.said}
    assert kinds <= {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "PARAM_REQUEST_READ", "PARAM_SET", "REQUEST_DATA_STREAM"}
    commands = {message.command for message in dock.said if message.get_type() == "COMMAND_LONG"}
    harmless = {dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_RUN_PREARM_CHECKS}
    assert commands <= {dialect.MAV_CMD_SET_MESSAGE_INTERVAL, *harmless}


@pytest.mark.parametrize("version", ["1.15", "1.16"])
def test_a_px4_in_its_own_simulation_passes_at_rest_without_a_transmitter(version: str) -> None:
    sitl = ("plant.frontseat.px4_outputs=sitl", f"plant.frontseat.px4_version='{version}'")
    checks = Dock(*sitl, "plant.frontseat.rc_receiver=false", "vehicle.pwm.astern_us=1000", config="sitl-px4").look()
    assert Result.FAIL not in bad(checks).values()
    radio = of(checks, "RC_CHANNELS")
    assert radio.result is Result.WARN and radio.todo.startswith("no transmitter heard")
    outputs = of(checks, "ACTUATOR_OUTPUT_STATUS")
    assert outputs.result is (Result.PASS if version == "1.15" else Result.WARN)
    assert version == "1.15" or "while disarmed" in outputs.todo
    assert {of(checks, name).result for name in ("position", "firmware")} == {Result.PASS}


def test_outputs_that_an_armed_px4_does_not_tell_fail() -> None:
    dock = Dock("plant.frontseat.px4_outputs=sitl", "plant.frontseat.parameters={PWM_MAIN_FUNC2: 0}", config="sitl-px4")
    dock.run(5.0)
    assert dock.plant.frontseat.arm(True)
    outputs = of(dock.look(), "ACTUATOR_OUTPUT_STATUS")
    assert outputs.result is Result.FAIL and "a motor function on a spare output" in outputs.todo


def test_an_autopilot_of_another_make_fails() -> None:
    dock = Dock(config="sitl-px4")
    dock.config = load_config("sitl")
    check = of(dock.look(), "heartbeat")
    assert check.result is Result.FAIL and check.found.startswith("autopilot 12")


def test_a_sensor_that_is_silent_fails_unless_another_can_take_its_place() -> None:
    checks = Dock(dead="anemometer").look()
    assert bad(checks) == {"wind: anemometer.MWV": Result.FAIL}
    assert "links.anemometer.endpoint" in of(checks, "wind: anemometer.MWV").todo
    checks = Dock("links.anemometer=null", dead="anemometer").look()
    assert bad(checks) == {"wind: anemometer.MWV": Result.WARN}
    both = "sources.heading=[ins.BINARY, autopilot.ATTITUDE]"
    checks = Dock(both, "sources.position=[ins.BINARY]", config="sitl-vn300", dead="ins").look()
    assert of(checks, "heading: ins.BINARY").result is Result.WARN
    assert of(checks, "heading, 2. choice: autopilot.ATTITUDE").result is Result.PASS
    assert of(checks, "position: ins.BINARY").result is Result.FAIL


def test_a_sensor_of_a_plugin_is_looked_at_as_any_other(tmp_path: Path) -> None:
    boat = str(write_line_wind(tmp_path))
    assert of(Dock(config=boat).look(), "wind: mast.WIND").result is Result.PASS
    silent = of(Dock(config=boat, dead="mast").look(), "wind: mast.WIND")
    assert silent.result is Result.FAIL and "(links.sensors.mast.endpoint)" in silent.todo


def test_the_anemometers_firmware_is_checked() -> None:
    dock = Dock("links.anemometer.firmware=arduino_anemometer")
    check = of(dock.look(), "anemometer firmware")
    assert check.result is Result.FAIL and "tells no version" in check.found


def test_readiness_transmitter_and_arming_are_warnings() -> None:
    dock = Dock("plant.frontseat.ready_after_s=300", "plant.frontseat.rc_receiver=false")
    checks = dock.look()
    assert of(checks, "position").result is Result.WARN and of(checks, "transmitter").result is Result.WARN
    dock = Dock()
    dock.run(5.0)
    assert dock.plant.frontseat.arm(True)
    assert of(dock.look(), "state").result is Result.WARN


@pytest.mark.parametrize(("config", "message"), [("sitl", "RAW_IMU"), ("sitl-px4", "HIGHRES_IMU")])
def test_a_silent_accelerometer_is_a_warning_with_either_autopilot(config: str, message: str) -> None:
    rate = of(Dock(config=config, lost=[message]).look(), message)
    assert (rate.found, rate.result) == ("0.0 Hz", Result.WARN)


@pytest.mark.parametrize(
    ("override", "item", "words"),
    [
        ("links.autopilot.streams_hz.RAW_IMU=2", "acceleration: autopilot.RAW_IMU", "at least 5 Hz are needed"),
        ("estimator.ekf.stale_after_s=0.1", "position: autopilot.GPS_RAW_INT", "estimator.ekf.stale_after_s"),
        ("estimator.wind.stale_after_s=0.2", "wind: anemometer.MWV", "raise the sensor's own rate"),
    ],
)
def test_a_source_in_use_that_is_too_slow_for_the_estimator_is_a_warning(override: str, item: str, words: str) -> None:
    slow = of(Dock(override).look(), item)
    assert slow.result is Result.WARN
    assert words in slow.todo


def test_a_slow_accelerometer_that_nothing_uses_is_none() -> None:
    checks = Dock("links.autopilot.streams_hz.RAW_IMU=2", "estimator.ekf.accelerometer=false").look()
    assert of(checks, "acceleration: autopilot.RAW_IMU").result is Result.PASS


def test_a_copter_is_refused_by_name() -> None:
    dock = Dock()
    sent = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, 3, 0, 0, 4, 3).pack(sent))
    dock.survey = Survey(dock.config)
    dock.survey.step(Inputs(t_ns=S, frames=(Frame(t_ns=S, port="autopilot", data=beat),)))
    assert dock.survey.stage == "waiting" and dock.survey.link.stranger is not None
    assert describe(dock.survey.link.stranger) == "this vehicle is no boat: quadrotor"


@pytest.mark.parametrize(
    ("kind", "make", "words"),
    [
        (dialect.MAV_TYPE_ONBOARD_CONTROLLER, 8, "onboard computer, no autopilot"),
        (dialect.MAV_TYPE_QUADROTOR, 3, "quadrotor"),
        (dialect.MAV_TYPE_GENERIC, 3, "generic"),
        (dialect.MAV_TYPE_GCS, 8, "ground station, no autopilot"),
        (dialect.MAV_TYPE_SURFACE_BOAT, 8, "surface boat, no autopilot"),
    ],
)
@pytest.mark.parametrize("last", [True, False])
def test_what_is_no_boat_and_has_its_ids_fails_whenever_it_was_heard(
    kind: int, make: int, words: str, last: bool
) -> None:
    dock = Dock()
    sent = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(dialect.MAVLink_heartbeat_message(kind, make, 0, 0, 4, 3).pack(sent))
    dock.run(25.0 if last else 5.0)
    dock.survey.step(Inputs(t_ns=dock.t_ns, frames=(Frame(t_ns=dock.t_ns, port="autopilot", data=beat),)))
    dock.run(0.0 if last else 20.0)
    check = of(checks_of(dock.survey), "heartbeat")
    assert (check.result, check.found) == (Result.FAIL, f"this vehicle is no boat: {words}")
    assert "no other vehicle has this one's system id" in check.todo


@pytest.mark.parametrize(
    ("corners", "result", "words"),
    [
        ("[40.42, -86.93], [40.42, -86.91], [40.43, -86.91], [40.43, -86.93]", Result.PASS, "inside"),
        ("[40.42, -86.92], [40.42, -86.91], [40.43, -86.91]", Result.WARN, "the boat is 325 m outside the geofence"),
        ("[-86.93, 40.42], [-86.91, 40.42], [-86.91, 40.43]", Result.WARN, "outside the geofence"),
    ],
)
def test_a_boat_outside_the_fence_is_told(corners: str, result: Result, words: str) -> None:
    check = of(Dock(f"supervisor.geofence=[{corners}]").look(), "fence")
    assert check.result is result and words in check.found
    assert bool(check.todo) is (result is Result.WARN)


def test_a_fence_without_a_position_is_unverified_and_without_a_fence_there_is_no_row() -> None:
    fence = "supervisor.geofence=[[40.42, -86.93], [40.42, -86.91], [40.43, -86.91]]"
    checks = Dock(fence, lost=("GPS_RAW_INT", "GLOBAL_POSITION_INT")).look()
    assert of(checks, "fence").result is Result.UNVERIFIED
    assert not [check for check in Dock().look() if check.item == "fence"]


def test_the_model_must_be_of_this_vehicle_and_step() -> None:
    model = of(computer_checks(load_config("sitl")), "model")
    assert model.result is Result.PASS and model.found == "wamv16-lagnet.npz, lagnet of wamv16"
    for override, words in (
        ("vehicle.name=dinghy", "dinghy"),
        ("controller.model=bream-nnsem", "bream"),
        ("controller.mpc.first_step_s=0.25", "0.25"),
    ):
        model = of(computer_checks(load_config("sitl", (override,))), "model")
        assert model.result is Result.FAIL and words in model.found, override
    assert of(computer_checks(load_config("sitl", ("controller.name=sd-mpc",))), "model").result is Result.PASS


@pytest.mark.parametrize(("free_mb", "result"), [(100, Result.FAIL), (500, Result.WARN), (50_000, Result.PASS)])
def test_room_for_the_log(free_mb: int, result: Result, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    usage = computer.shutil.disk_usage(tmp_path)
    monkeypatch.setattr(computer.shutil, "disk_usage", lambda path: usage._replace(free=free_mb * 1_000_000))
    config = load_config("sitl", (f"recorder.directory={tmp_path / 'not' / 'made' / 'yet'}",))
    assert of(computer_checks(config), "log space").result is result


def test_a_check_in_plain_types() -> None:
    check = Check(section="rates", item="ATTITUDE", result=Result.WARN, found="9.0 Hz", wanted="20 Hz", todo="x")
    assert as_json(check)["result"] == "warn" and as_json(replace(check, todo=""))["todo"] == ""
