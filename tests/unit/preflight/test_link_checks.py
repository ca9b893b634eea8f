"""Preflight of the link: rates, loss, and answers that do not come."""

import random

import pytest

from asvhil.io.mavlink.frames import decode, dialect, message_id
from asvhil.preflight.checks import checks_of
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result, worst
from asvhil.preflight.wiring import yaml_to_pin
from asvhil.types import Frame
from tests.support.dock import TICK_NS, Dock, S, bad, of


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
    assert wrong <= {f"acceleration: autopilot.{name}" for name in late}
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
    motors = {"SERVO3_MIN": ["starboard motor"], "SERVO1_TRIM": ["port motor"], "RC3_MIN": ["starboard motor"]}
    assert bad(checks) == dict.fromkeys([name, *motors.get(name, [])], Result.UNVERIFIED)
    assert worst(checks) is Result.UNVERIFIED and bool(yaml_to_pin(dock.survey)) is (name not in motors)
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


def test_a_clock_that_is_off_is_told_and_the_date_of_a_simulation_is_none() -> None:
    dock = Dock()
    checks = dock.look()
    assert of(checks, "clock of this computer").found == "a simulated boat, where it is always 1 January 2026"
    assert of(checks, "clock of this computer").result is Result.PASS
    dock.survey.unix_ns = (1_795_000_000 * S, 1_795_000_060 * S)
    checks = checks_of(dock.survey)
    assert of(checks, "clock of this computer").found == "+60.0 s from GNSS time"
    assert bad(checks) == {"clock of this computer": Result.WARN}
