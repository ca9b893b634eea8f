"""The PARAM protocol's client against the simulated ArduRover, lossy links, and both ways of sending integers."""

import random
import struct
from collections import Counter

import pytest

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.autopilot.ardurover_parameters import OPTIONAL, requirements
from asvhil.autopilot.ardurover_wiring import FUNCTIONS
from asvhil.autopilot.requirements import judge
from asvhil.config import load_config
from asvhil.io.mavlink.frames import decode, dialect, message_id
from asvhil.io.mavlink.parameter_client import ATTEMPTS, ParameterClient, from_wire, to_wire
from asvhil.simplant.plant import Plant
from asvhil.types import Cause, Frame

S = 1_000_000_000
TICK_NS = 50_000_000


def value(name: str, number: float, kind: int = dialect.MAV_PARAM_TYPE_REAL32) -> dialect.MAVLink_param_value_message:
    return dialect.MAVLink_param_value_message(name.encode(), number, kind, 900, 65535)


class Wire:
    """A link and a simulated vehicle; frames either way are lost by chance."""

    def __init__(self, *overrides: str, loss: float = 0.0) -> None:
        config = load_config("sitl", overrides)
        self.link = ArduRoverAutopilot(config.links.autopilot, config.vehicle.pwm)
        self.plant = Plant(config, 0)
        self.t_ns = 0
        self.sent: Counter[str] = Counter()
        self._loss, self._chance = loss, random.Random(4)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * S / TICK_NS)):
            self.t_ns += TICK_NS
            for frame in self.plant.advance(self.t_ns):
                if frame.port == "autopilot" and self._chance.random() >= self._loss:
                    self.link.receive(frame)
            for frame in self.link.data_to_send(self.t_ns):
                message = decode(frame.data)
                assert message is not None
                self.sent[message.get_type()] += 1
                if self._chance.random() >= self._loss:
                    self.plant.receive(frame)

    def wrong(self) -> dict[str, str]:
        return {f.name: f.text for f in self.link.findings if f.wrong}


@pytest.mark.parametrize("firmware", ["4.6", "4.7"])
def test_all_that_matters_is_read_soon_after_boot_and_all_is_well(firmware: str) -> None:
    wire = Wire(f"plant.frontseat.firmware='{firmware}'")
    wire.run(5.0)
    assert wire.wrong() == {}
    unread = {finding.name for finding in wire.link.findings if finding.value is None}
    assert unread <= OPTIONAL and len(unread) == 2  # of the other firmware
    wire.run(10.0)
    assert wire.link.parameters.complete
    assert wire.link.parameters.silent == tuple(f.name for f in wire.link.findings if f.name in unread)


def test_what_does_not_exist_is_not_asked_for_without_end() -> None:
    wire = Wire("links.autopilot.streams_hz={HEARTBEAT: 5}")
    wire.run(10.0)
    before = wire.sent["PARAM_REQUEST_READ"]
    wire.run(20.0)
    assert wire.sent["PARAM_REQUEST_READ"] == before
    wire.run(300.0)
    rounds = wire.sent["PARAM_REQUEST_READ"] - before
    known = len(wire.link.parameters.values)
    # A refresh each minute, and the absent one after half a minute, one, two and four.
    assert rounds <= 6 * known + 4 * ATTEMPTS


def test_a_third_of_all_frames_lost_only_takes_longer() -> None:
    wire = Wire(loss=0.33)
    wire.run(70.0)
    assert {f.name for f in wire.link.findings if f.unverified} <= OPTIONAL
    assert set(FUNCTIONS) <= set(wire.link.parameters.values)
    assert wire.wrong() == {}


def test_a_change_by_another_station_is_heard_at_once() -> None:
    wire = Wire()
    wire.run(5.0)
    wire.plant.frontseat.receive(_set("RC1_DZ", 30.0, wire.t_ns))
    wire.run(0.1)
    assert wire.wrong() == {"RC1_DZ": "RC1_DZ is 30, not 0: dead zone bends commands"}


def test_a_change_whose_news_was_lost_is_found_within_a_minute() -> None:
    wire = Wire()
    wire.run(5.0)
    wire.plant.frontseat.rover.parameters.set("RC1_DZ", 30.0)
    wire.run(1.0)
    assert wire.wrong() == {}
    wire.run(61.0)
    assert list(wire.wrong()) == ["RC1_DZ"]


def test_a_reboot_has_everything_read_again() -> None:
    wire = Wire()
    wire.run(8.0)
    wire.plant.frontseat.rover.parameters.set("MOT_SLEWRATE", 100.0)
    wire.plant.frontseat.receive(_command(dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, wire.t_ns))
    wire.run(8.0)
    assert wire.link.reboots == 1
    assert wire.wrong() == {"MOT_SLEWRATE": "MOT_SLEWRATE is 100, not 0: outputs lag behind"}


def test_a_value_is_written_and_read_back_through_a_lossy_link() -> None:
    wire = Wire("plant.frontseat.mygcs_system_id=255", loss=0.3)
    wire.run(10.0)
    parameters = wire.link.parameters
    parameters.write("SYSID_MYGCS", 1.0)
    assert parameters.writing == {"SYSID_MYGCS"}
    wire.run(3.0)
    assert not parameters.writing and not parameters.unwritten
    assert parameters.values["SYSID_MYGCS"] == 1.0
    assert wire.plant.frontseat.rover.parameters["SYSID_MYGCS"] == 1.0


def test_a_value_that_the_vehicle_does_not_take_is_given_up() -> None:
    wire = Wire()
    wire.run(5.0)
    wire.link.parameters.write("RC1_DZ", 500.0)  # beyond its range: it becomes 200
    wire.run(5.0)
    assert wire.link.parameters.unwritten == {"RC1_DZ"} and not wire.link.parameters.writing
    assert wire.sent["PARAM_SET"] == ATTEMPTS


def test_the_daemons_link_never_writes_by_itself() -> None:
    wire = Wire("plant.frontseat.mygcs_system_id=255", "plant.frontseat.rc1_dz_us=30")
    wire.run(90.0)
    assert wire.sent["PARAM_SET"] == 0 and wire.sent["PARAM_REQUEST_READ"] > 30


def test_values_that_are_no_numbers_and_names_of_others_are_left_alone() -> None:
    client = ParameterClient([("A", "B")], 1)
    for name, number in (("A", float("nan")), ("A", float("inf")), ("C", 1.0)):
        client.receive(0, value(name, number))
    assert dict(client.values) == {}
    client.receive(0, value("B", 2.0))
    assert dict(client.values) == {"B": 2.0} and client.complete
    assert client.data_to_send(0) == []
    requests = [message for i in range(3) for message in client.data_to_send(61 * S + i * S)]
    assert [message.param_id for message in requests] == ["B", "B", "B"]  # never the other name again


@pytest.mark.parametrize(
    ("kind", "number", "data"),
    [
        (dialect.MAV_PARAM_TYPE_INT32, -3, b"\xfd\xff\xff\xff"),
        (dialect.MAV_PARAM_TYPE_UINT8, 200, b"\xc8\0\0\0"),
        (dialect.MAV_PARAM_TYPE_INT16, -300, b"\xd4\xfe\0\0"),
        (dialect.MAV_PARAM_TYPE_REAL32, 0.5, struct.pack("<f", 0.5)),
    ],
)
def test_integers_by_their_bytes(kind: int, number: float, data: bytes) -> None:
    (wire,) = struct.unpack("<f", data)
    assert from_wire(wire, kind, bytewise=True) == number
    assert struct.pack("<f", to_wire(number, kind, bytewise=True)) == data
    assert from_wire(float(number), kind, bytewise=False) == number == to_wire(number, kind, bytewise=False)


def test_an_integer_that_does_not_fit_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="300 does not fit"):
        to_wire(300.0, dialect.MAV_PARAM_TYPE_INT8, bytewise=True)


# --- what the values must be --------------------------------------------------------------------------------


def good() -> dict[str, float]:
    wire = Wire()
    wire.run(4.0)
    return dict(wire.link.parameters.values)


@pytest.mark.parametrize(
    ("changes", "texts", "cause"),
    [
        ({"SYSID_MYGCS": 255}, ["SYSID_MYGCS is 255, not 1: overrides are ignored"], Cause.IGNORED),
        ({"RC_OPTIONS": 34}, ["RC_OPTIONS is 34, not 32: overrides are ignored"], Cause.IGNORED),
        ({"RC_OVERRIDE_TIME": 0}, ["RC_OVERRIDE_TIME is 0, not 1: wrong time-out"], Cause.IGNORED),
        ({"RC_OVERRIDE_TIME": -1}, ["RC_OVERRIDE_TIME is -1, not 1: wrong time-out"], Cause.UNBOUNDED),
        ({"RC_OVERRIDE_TIME": 10}, ["RC_OVERRIDE_TIME is 10, not 1: wrong time-out"], Cause.UNBOUNDED),
        ({"RC3_DZ": 30}, ["RC3_DZ is 30, not 0: dead zone bends commands"], Cause.DEAD_ZONE),
        ({"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, [], None),
        ({"SERVO5_FUNCTION": 73}, ["SERVO5_FUNCTION is 73, not 0: two port motors"], Cause.STUCK),
        ({"SERVO3_FUNCTION": 0}, ["SERVO3_FUNCTION is 0, not 74: no starboard motor"], Cause.STUCK),
        ({"SERVO1_FUNCTION": 0}, ["SERVO1_FUNCTION is 0, not 73: no port motor"], Cause.STUCK),
        ({"SERVO1_MAX": 1800}, ["SERVO1_MAX is 1800, not 1900: full ahead cut off"], Cause.SCALED),
        ({"SERVO1_MIN": 1200, "SERVO1_REVERSED": 1},
         ["SERVO1_MIN is 1200, not 1100: full ahead cut off"], Cause.SCALED),
        ({"SERVO3_TRIM": 1610}, ["SERVO3_TRIM is 1610, not 1500: another neutral"], Cause.SCALED),
        ({"SERVO3_TRIM": 1580, "SERVO1_REVERSED": 1, "RC3_REVERSED": 1}, [], None),
        ({"RC1_MAX": 1590}, ["RC1_MAX is 1590, not 2000: no travel"], Cause.SCALED),
        ({"RC1_MAX": 1900, "RC3_MIN": 1100, "RC3_TRIM": 1520, "RCMAP_ROLL": 3, "RCMAP_THROTTLE": 1}, [], None),
        ({"RCMAP_ROLL": 3}, ["RCMAP_THROTTLE is 3, not 1: both on one stick"], Cause.SWAPPED),
        ({"FS_THR_VALUE": 1101}, ["FS_THR_VALUE is 1101, not 1090: astern is RC loss"], Cause.STUCK),
        ({"MOT_THST_ASYM": 1.6, "MOT_THST_EXPO": 0.3}, [], None),
        ({"MOT_THST_ASYM": 3.1}, ["MOT_THST_ASYM is 3.1, not 1: commands are bent"], Cause.SCALED),
        ({"MOT_THST_EXPO": -0.6}, ["MOT_THST_EXPO is -0.6, not 0: commands are bent"], Cause.SCALED),
        ({"MOT_PWM_TYPE": 3}, ["MOT_PWM_TYPE is 3: no pulse widths"], Cause.SCALED),
        ({"ARMING_RUDDER": 2}, ["ARMING_RUDDER is 2, not 0: the port stick arms"], None),
        ({"SYSID_ENFORCE": 1}, ["SYSID_ENFORCE is 1, not 0: stations are not heard"], None),
        ({"FS_THR_ENABLE": 0}, ["FS_THR_ENABLE is 0, not 1: no radio fail-safe"], None),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line_that_fits_a_statustext(
    changes: dict[str, float], texts: list[str], cause: Cause | None
) -> None:
    config = load_config("field")
    values = good() | changes
    found = [f for f in judge(requirements(config.links.autopilot, config.vehicle.pwm, values), values) if f.wrong]
    assert [f.text for f in found] == texts
    assert {f.requirement.cause for f in found} <= {cause}
    assert all(len(f.text) <= 50 for f in found)
    right = values | {f.name: f.wanted for f in found if f.fixable}
    again = judge(requirements(config.links.autopilot, config.vehicle.pwm, right), right)
    assert [f.text for f in again if f.wrong] == [f.text for f in found if f.requirement.wiring]


def test_what_has_not_answered_proves_nothing() -> None:
    config = load_config("field")
    known = good()
    required = {f.name for f in judge(requirements(config.links.autopilot, config.vehicle.pwm, known), known)}
    for name in required & set(known):
        values = {key: value for key, value in known.items() if key != name}
        found = judge(requirements(config.links.autopilot, config.vehicle.pwm, values), values)
        assert [f.text for f in found if f.wrong] == [], name
        assert {f.name for f in found if f.unverified} - OPTIONAL == {name} - OPTIONAL


@pytest.mark.parametrize("loss", [0.02, 0.1, 0.4])
def test_a_lossy_link_is_asked_until_nearly_all_is_known_and_the_absent_are_left_alone(loss: float) -> None:
    wire = Wire(loss=loss)
    wire.run(26.0)
    assert wire.wrong() == {} and wire.link.unread_parameters == ()
    assert wire.link.parameters.complete and set(wire.link.parameters.silent) <= OPTIONAL


def test_a_name_that_never_answers_is_told_and_asked_for_again_later() -> None:
    client = ParameterClient([("A",), ("B",)], 1)
    asked: list[tuple[float, str]] = []
    for ms in range(0, 100_000, 50):
        for message in client.data_to_send(ms * 1_000_000):
            asked.append((ms / 1000.0, message.param_id))
            if message.param_id == "A":
                client.receive(ms * 1_000_000, value("A", 1.0))
    tries = [at for at, name in asked if name == "B"]
    assert client.silent == ("B",) and client.complete and len(tries) == 3 * ATTEMPTS
    assert 25.0 < tries[ATTEMPTS] - tries[ATTEMPTS - 1] < 35.0
    assert 55.0 < tries[2 * ATTEMPTS] - tries[2 * ATTEMPTS - 1] < 65.0  # the wait doubles


def test_what_does_not_answer_is_noted_by_name_and_the_note_goes_once_it_does() -> None:
    wire = Wire()
    receive = wire.link.receive
    lost = "SERVO3_MIN"
    wire.link.receive = lambda f: receive(f) if getattr(decode(f.data), "param_id", "") != lost else []  # type: ignore
    wire.run(6.0)
    assert [(n.subject, n.text) for n in wire.link.notes] == [
        ("unread parameters", "SERVO3_MIN: no answer yet, unverified")
    ]
    wire.link.receive = receive  # type: ignore[method-assign]
    wire.run(35.0)
    assert wire.link.notes == ()


def test_a_name_that_the_autopilot_says_it_has_not_is_not_asked_for_again() -> None:
    client = ParameterClient([("A",), ("B",)], 1)
    client.on_error(dialect.MAVLink_param_error_message(1, 191, b"A", -1, dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST))
    asked = {m.param_id for i in range(200) for m in client.data_to_send(i * S)}
    assert asked == {"B"} and client.silent == ("B",)
    client.restart()  # with another firmware, perhaps
    assert {m.param_id for i in range(200, 210) for m in client.data_to_send(i * S)} == {"A", "B"}


def test_a_value_that_is_never_read_back_may_have_been_written_and_is_not_known() -> None:
    client = ParameterClient([("A",)], 1)
    client.receive(0, value("A", 1.0))
    client.write("A", 2.0)
    sent = [m for i in range(20) for m in client.data_to_send(i * S // 2)]
    assert [m.get_type() for m in sent[:ATTEMPTS]] == ["PARAM_SET"] * ATTEMPTS
    assert client.unconfirmed == {"A"} and not client.unwritten and not client.writing
    assert dict(client.values) == {} and sent[ATTEMPTS].get_type() == "PARAM_REQUEST_READ"


def test_an_answer_that_was_on_its_way_does_not_make_a_write_refused() -> None:
    client = ParameterClient([("A",)], 1)
    client.receive(0, value("A", 1.0))
    client.write("A", 2.0)
    assert client.data_to_send(S)[0].get_type() == "PARAM_SET"
    client.receive(S, value("A", 1.0))  # of a request before
    client.receive(2 * S, value("A", 2.0))
    assert not client.writing and not client.unwritten and not client.unconfirmed


def _set(name: str, number: float, t_ns: int) -> Frame:
    message = dialect.MAVLink_param_set_message(1, 1, name.encode(), number, dialect.MAV_PARAM_TYPE_REAL32)
    return _frame(message, t_ns)


def _command(command: int, t_ns: int) -> Frame:
    return _frame(dialect.MAVLink_command_long_message(1, 1, command, 0, 1, 0, 0, 0, 0, 0, 0), t_ns)


def _frame(message: dialect.MAVLink_message, t_ns: int) -> Frame:
    data = bytes(message.pack(dialect.MAVLink(None, srcSystem=255, srcComponent=190)))
    assert message_id(data) == message.get_msgId()
    return Frame(t_ns=t_ns, port="autopilot", data=data, peer="station")
