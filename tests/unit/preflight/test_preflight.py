"""`asvhil check` against the simulated vehicle in virtual time: each mistake is found, named, mended, and gone."""

import random
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_id
from asvhil.preflight import computer
from asvhil.preflight.checks import checks_of
from asvhil.preflight.computer import computer_checks
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result, as_json, folded, worst
from asvhil.simplant.lockstep import EPOCH_NS
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import describe
from asvhil.types import Frame, Inputs
from tests.support.plugins import write_line_wind

TICK_NS = 50_000_000
S = 1_000_000_000

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


class Dock:
    """A simulated vehicle and a survey on one virtual clock; all that the survey says is kept."""

    def __init__(self, *overrides: str, config: str = "sitl", lost: Collection[str] = (), dead: str = "") -> None:
        self.config = load_config(config, overrides)
        self.plant = Plant(self.config, EPOCH_NS)
        self.t_ns = EPOCH_NS
        self.said: list[dialect.MAVLink_message] = []
        self._lost = {getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in lost}
        self._dead = dead
        self.survey = Survey(self.config)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * S / TICK_NS)):
            self.t_ns += TICK_NS
            frames = [f for f in self.plant.advance(self.t_ns) if f.port != self._dead and not self._is_lost(f)]
            for frame in self.survey.step(Inputs(t_ns=self.t_ns, frames=tuple(frames))):
                if frame.port == "autopilot":
                    self.said += [m for d in FrameSplitter().receive(frame.data) if (m := decode(d)) is not None]
                self.plant.receive(frame)

    def _is_lost(self, frame: Frame) -> bool:
        return frame.port == "autopilot" and message_id(frame.data) in self._lost

    def look(self) -> list[Check]:
        """A survey from the first heartbeat to the end: what it made of the vehicle."""
        self.survey = Survey(self.config)
        self.run(25.0)
        assert self.survey.stage == "done"
        return checks_of(self.survey)


def bad(checks: list[Check]) -> dict[str, Result]:
    """What did not pass; a simulated vehicle has no date, so the clock of this computer is left out."""
    return {c.item: c.result for c in checks if c.result is not Result.PASS and c.item != "clock of this computer"}


def of(checks: list[Check], item: str) -> Check:
    (found,) = [check for check in checks if check.item == item]
    return found


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


@pytest.mark.parametrize("name", [*WRONG, *NEWER])
def test_each_wrong_parameter_is_found_and_named_mended_and_passes_the_second_time(name: str) -> None:
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
    assert bad(dock.look()) == {}, "the second run"


@pytest.mark.parametrize(
    ("config", "name", "value"),
    [
        *(("sitl", name, value) for name, value in WIRING.items()),
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
    assert dock.survey.fixable == [] and dock.survey.fix() == []
    dock.run(3.0)
    assert all(message.get_type() != "PARAM_SET" for message in dock.said)


@pytest.mark.parametrize(
    ("config", "parameters"),
    [
        *(("sitl", {name: value}) for name, value in FOLLOWED.items()),
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


@pytest.mark.parametrize(("value", "written"), [(245, 21), (1023, 543), (53, 21)])
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


def test_all_wrong_at_once_are_mended_at_once() -> None:
    values = ", ".join(f"{name}: {value}" for name, value in WRONG.items())
    dock = Dock(f"plant.frontseat.parameters={{{values}}}")
    assert set(WRONG) <= set(bad(dock.look()))
    dock.survey.fix()
    dock.run(10.0)
    assert bad(dock.look()) == {}


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


def test_nothing_is_written_without_being_asked_to() -> None:
    dock = Dock("plant.frontseat.mygcs_system_id=255")
    dock.look()
    assert all(message.get_type() != "PARAM_SET" for message in dock.said)


def test_a_px4_is_looked_over_by_its_own_parameters() -> None:
    checks = Dock(config="sitl-px4").look()
    assert worst([c for c in checks if c.section in ("vehicle", "parameters", "sensors")]) is not Result.FAIL
    assert of(checks, "heartbeat").found == "PX4, boat"
    assert any(c.item == "COM_OBL_RC_ACT" for c in checks)


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


def test_messages_that_do_not_come_or_come_too_slowly_are_named() -> None:
    checks = Dock(lost=("SERVO_OUTPUT_RAW", "SYSTEM_TIME")).look()
    assert bad(checks) == {"SERVO_OUTPUT_RAW": Result.FAIL, "SYSTEM_TIME": Result.WARN}
    assert of(checks, "SERVO_OUTPUT_RAW").found == "0.0 Hz"
    dock = Dock()
    count = iter(range(10**9))
    advance = dock.plant.advance

    def one_of_three(frame: Frame) -> bool:
        is_attitude = frame.port == "autopilot" and message_id(frame.data) == dialect.MAVLINK_MSG_ID_ATTITUDE
        return not is_attitude or next(count) % 3 == 0

    dock.plant.advance = lambda t_ns: [f for f in advance(t_ns) if one_of_three(f)]  # type: ignore[method-assign]
    checks = dock.look()
    assert bad(checks) == {"ATTITUDE": Result.FAIL} and of(checks, "ATTITUDE").found in (
        "6.4 Hz",
        "6.6 Hz",
        "6.7 Hz",
        "6.8 Hz",
    )


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


def test_a_link_that_carries_nothing_to_the_autopilot_fails() -> None:
    dock = Dock()
    dock.plant.receive = lambda frame: None  # type: ignore[method-assign]
    checks = dock.look()
    assert of(checks, "TIMESYNC").result is Result.FAIL
    assert of(checks, "all").found == "none answered"
    assert of(checks, "firmware").found == "not told"


def test_a_third_of_all_frames_lost_is_no_wrong_parameter() -> None:
    dock = Dock()
    count = iter(range(10**9))
    advance = dock.plant.advance
    dock.plant.advance = lambda t_ns: [f for f in advance(t_ns) if next(count) % 3]  # type: ignore[method-assign]
    checks = dock.look()
    assert not any(c.result is Result.FAIL for c in checks if c.section == "parameters")


class LossyDock(Dock):
    """A dock whose link loses a share of all frames, each way."""

    def __init__(self, loss: float, seed: int, *overrides: str) -> None:
        super().__init__(*overrides)
        chance = random.Random(seed)
        advance, receive = self.plant.advance, self.plant.receive
        self.plant.advance = lambda t_ns: [  # type: ignore[method-assign]
            frame for frame in advance(t_ns) if frame.port != "autopilot" or chance.random() >= loss
        ]
        self.plant.receive = lambda frame: receive(frame) if chance.random() >= loss else None  # type: ignore[method-assign]

    def look(self) -> list[Check]:
        self.survey = Survey(self.config)
        while self.survey.stage != "done":
            self.run(1.0)
        return checks_of(self.survey)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("loss", [0.02, 0.1, 0.4])
def test_a_lossy_link_makes_no_finding_and_nothing_to_write(loss: float, seed: int) -> None:
    dock = LossyDock(loss, seed)
    checks = dock.look()
    wrong = {c.item for c in checks if c.result in (Result.FAIL, Result.WARN) and c.section != "rates"}
    late = {c.item for c in checks if c.section == "rates" and c.result is not Result.PASS}  # not granted in time
    assert wrong <= {"clock of this computer", *(f"acceleration: autopilot.{name}" for name in late)}
    assert dock.survey.fixable == [] and dock.survey.fix() == []


@pytest.mark.parametrize("name", ["SERVO3_MIN", "SERVO1_TRIM", "RC3_MIN", "SYSID_MYGCS", "PILOT_STEER_TYPE"])
def test_a_parameter_that_does_not_answer_is_unverified_and_writes_nothing(name: str) -> None:
    dock = Dock()
    advance = dock.plant.advance

    def passes(frame: Frame) -> bool:
        message = decode(frame.data) if frame.port == "autopilot" else None
        return getattr(message, "param_id", "") != name

    dock.plant.advance = lambda t_ns: [f for f in advance(t_ns) if passes(f)]  # type: ignore[method-assign]
    checks = dock.look()
    assert bad(checks) == {name: Result.UNVERIFIED} and worst(checks) is Result.UNVERIFIED
    assert of(checks, name).found == "not known" and "proves nothing" in of(checks, name).todo
    assert dock.survey.fix() == []
    dock.run(3.0)
    assert all(message.get_type() != "PARAM_SET" for message in dock.said)


def test_a_version_that_does_not_come_is_unverified_and_one_that_is_refused_is_said() -> None:
    checks = Dock(lost=("AUTOPILOT_VERSION",)).look()
    assert bad(checks) == {"firmware": Result.UNVERIFIED}
    dock = Dock()
    dock.plant.frontseat._commands.pop(dialect.MAV_CMD_REQUEST_MESSAGE)
    assert bad(dock.look()) == {"firmware": Result.WARN}


def test_a_refusal_to_another_station_is_not_the_vehicles_answer_to_us() -> None:
    dock = Dock(lost=("AUTOPILOT_VERSION",))
    advance = dock.plant.advance
    refusal = dialect.MAVLink_command_ack_message(dialect.MAV_CMD_REQUEST_MESSAGE, 3, 0, 0, 255, 190)
    data = bytes(refusal.pack(dialect.MAVLink(None, srcSystem=1, srcComponent=1)))
    dock.plant.advance = lambda t_ns: [*advance(t_ns), Frame(t_ns=t_ns, port="autopilot", data=data)]  # type: ignore[method-assign]
    assert of(dock.look(), "firmware").result is Result.UNVERIFIED


def test_who_else_is_on_the_link_is_listed() -> None:
    dock = Dock()
    advance = dock.plant.advance
    camera = dialect.MAVLink(None, srcSystem=1, srcComponent=100)
    station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    twin = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
    beats = [
        (camera, dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GENERIC, 0, 0, 0, 4, 3)),
        (station, dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)),
        (twin, dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_ONBOARD_CONTROLLER, 8, 0, 0, 4, 3)),
    ]

    def advance_all(t_ns: int) -> list[Frame]:
        others = [
            Frame(t_ns=t_ns, port="autopilot", data=bytes(beat.pack(mav)), peer="10.0.0.7:1")
            for mav, beat in beats
            if t_ns % S < TICK_NS
        ]
        return [*advance(t_ns), *others]

    dock.plant.advance = advance_all  # type: ignore[method-assign]
    checks = dock.look()
    assert of(checks, "also on the link").found == "camera 1/100, ground station 255/190"
    assert bad(checks) == {"our own id": Result.WARN}


def test_a_copter_is_refused_by_name() -> None:
    dock = Dock()
    sent = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_QUADROTOR, 3, 0, 0, 4, 3).pack(sent))
    dock.survey = Survey(dock.config)
    dock.survey.step(Inputs(t_ns=S, frames=(Frame(t_ns=S, port="autopilot", data=beat),)))
    assert dock.survey.stage == "waiting" and dock.survey.link.stranger is not None
    assert describe(dock.survey.link.stranger) == "this vehicle is no boat: quadrotor"


def test_the_model_must_be_of_this_vehicle_and_step() -> None:
    model = of(computer_checks(load_config("sitl")), "model")
    assert model.result is Result.PASS and model.found == "wamv16-nnsem.npz, nnsem of wamv16"
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
