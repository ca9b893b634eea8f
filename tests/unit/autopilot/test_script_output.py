"""The script as the way to the motors: when a session begins, what its orders say, and what ends it."""

import pytest

from asvhil.autopilot.ardurover_wiring import wiring_of
from asvhil.autopilot.script_output import ScriptOutput
from asvhil.autopilot.script_protocol import ORDER, VERSION, Order, ScriptReason
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.supervisor.reasons import Reason, explain

S = 1_000_000_000
PWM = PwmConfig(astern_us=1100, neutral_us=1480, ahead_us=1900)
START = 0xBEEF


def output(**changes: object) -> ScriptOutput:
    link = AutopilotLinkConfig(
        endpoint="udpin:127.0.0.1:0", output="script", **{"autopilot_system_id": 7, "system_id": 7, **changes}
    )
    return ScriptOutput(link, PWM, wiring_of(link, PWM, {}))


def told(way: ScriptOutput, t_ns: int, **sign: int) -> None:
    """An alive sign over the wire."""
    sender = dialect.MAVLink(None, srcSystem=7, srcComponent=1)
    reason, start = sign.get("reason", ScriptReason.READY), sign.get("start", START)
    why = 100 * sign.get("version", VERSION) + reason
    for name, value in (("ASV_USED", 0), ("ASV_DROP", 0), ("ASV_START", start), ("ASV_WHY", why)):
        message = dialect.MAVLink_named_value_float_message(0, name.encode(), float(value))
        way.on_named_value(t_ns, decode(message.pack(sender)))


def ready(t_ns: int = S) -> ScriptOutput:
    """One that could begin at `t_ns`."""
    way = output()
    way.on_connect(t_ns)
    told(way, t_ns)
    way.on_vehicle(armed=True, mode="HOLD")
    way.data_to_send(t_ns)
    return way


def order(packed: list[bytes]) -> tuple[int, ...]:
    """(order, start, count, port, starboard) of one TUNNEL."""
    (data,) = packed
    m = decode(data)
    assert m is not None
    assert (m.get_srcSystem(), m.get_srcComponent(), m.target_system, m.target_component) == (7, 191, 7, 1)
    return ORDER.unpack(bytes(m.payload[: ORDER.size]))[1:]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"component_id": 190}, "^key links.autopilot.component_id: output script needs one from 191 to 194$"),
        ({"component_id": 195}, "component_id: output script needs one from 191 to 194"),
        ({"system_id": 8}, "^key links.autopilot.system_id: output script needs that of the autopilot$"),
    ],
)
def test_an_identity_that_the_script_does_not_listen_to(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        output(**changes)


def test_orders_of_a_session() -> None:
    way = ready()
    assert order(way.drive(1600, 1420)) == (Order.DRIVE, START, 1, 1600, 1420)
    assert order(way.drive(1601, 1421)) == (Order.DRIVE, START, 2, 1601, 1421)
    assert order(way.release(2 * S)) == (Order.RELEASE, START, 3, 1480, 1480)
    assert way.release(2 * S) == []
    assert way.drive(1600, 1420) == []  # its start is used up
    told(way, 3 * S, start=START + 1)
    assert order(way.drive(1600, 1420)) == (Order.DRIVE, START + 1, 1, 1600, 1420)


def test_the_last_words_follow_the_orders_and_change_nothing() -> None:
    way = ready()
    assert way.last_words(neutral=True) == []
    way.drive(1600, 1420)
    steps = [order(step) for step in way.last_words(neutral=True)]
    assert steps == [(Order.DRIVE, START, count, 1480, 1480) for count in range(2, 6)] + [
        (Order.RELEASE, START, count, 1480, 1480) for count in range(6, 9)
    ]
    assert [order(step)[0] for step in way.last_words(neutral=False)] == [Order.RELEASE] * 3
    assert order(way.drive(1600, 1420))[2] == 2


@pytest.mark.parametrize(("armed", "mode"), [(False, "HOLD"), (True, "MANUAL"), (False, "MANUAL")])
def test_no_session_begins_before_the_script_could_take_it(armed: bool, mode: str) -> None:
    way = ready()
    way.on_vehicle(armed=armed, mode=mode)
    assert way.drive(1600, 1420) == []
    way.on_vehicle(armed=True, mode="HOLD")
    assert len(way.drive(1600, 1420)) == 1


def test_none_begins_before_the_script_is_heard_nor_after_a_disarming() -> None:
    way = output()
    way.on_vehicle(armed=True, mode="HOLD")
    assert way.drive(1600, 1420) == []
    way = output()
    told(way, S)
    assert way.drive(1600, 1420) == [], "nor before the vehicle is"
    way = ready()
    way.on_disarmed(S)
    assert way.drive(1600, 1420) == []


def test_a_connection_anew_forgets_session_and_sign() -> None:
    way = ready()
    way.drive(1600, 1420)
    way.on_connect(5 * S)
    assert way.drive(1600, 1420) == [] and way.release(5 * S) == [] and way.last_words(neutral=True) == []
    told(way, 5 * S)  # after a reboot the same number may come again
    assert order(way.drive(1600, 1420))[1:3] == (START, 1)


def test_silence() -> None:
    way = output()
    assert way.fault(0) == explain(Reason.SCRIPT_SILENT)
    way.on_connect(S)
    assert way.fault(3 * S) is None and way.fault(3 * S + 1) == explain(Reason.SCRIPT_SILENT)
    told(way, 3 * S)
    assert way.fault(5 * S) is None and way.fault(5 * S + 1) == explain(Reason.SCRIPT_SILENT)


def test_another_version() -> None:
    way = ready()
    told(way, S, version=VERSION + 1)
    assert way.fault(S) == explain(Reason.SCRIPT_VERSION, found=VERSION + 1, needed=VERSION)


def test_a_session_that_the_script_does_not_take() -> None:
    way = ready()
    way.drive(1600, 1420)
    assert way.fault(S + 1_500_000_000) is None
    assert way.fault(S + 1_500_000_001) == explain(Reason.SCRIPT_STARVED)
    told(way, 2 * S, reason=ScriptReason.DRIVING, start=START + 1)
    assert way.fault(4 * S) is None


def test_what_ends_a_session_stands_until_the_release() -> None:
    way = ready()
    way.drive(1600, 1420)
    told(way, S, reason=ScriptReason.STICK, start=START + 1)
    told(way, S + 700_000_000, reason=ScriptReason.STICK, start=START + 1)
    assert way.fault(2 * S) is None  # it may be of before
    told(way, S + 800_000_000, reason=ScriptReason.DRIVING, start=START + 1)
    told(way, S + 900_000_000, reason=ScriptReason.STICK, start=START + 1)
    ended = explain(Reason.SCRIPT_LET_GO, why="the pilot has, or had, a stick off its centre")
    assert way.fault(2 * S) == ended
    told(way, 2 * S, reason=ScriptReason.DRIVING, start=START + 2)
    assert way.fault(2 * S) == ended
    way.release(2 * S)
    assert way.fault(2 * S) is None


def test_a_late_reason_ends_a_session_of_which_the_sign_has_not_told() -> None:
    way = ready()
    way.drive(1600, 1420)
    told(way, S + 700_000_001, reason=99, start=START + 1)
    assert way.fault(S + 800_000_000) == explain(Reason.SCRIPT_LET_GO, why="an unknown reason")


def test_values_of_other_scripts_say_nothing_of_ours() -> None:
    other = decode(dialect.MAVLink_named_value_float_message(0, b"DEPTH", 3.0).pack(dialect.MAVLink(None, srcSystem=7)))
    way = ready()
    way.drive(1600, 1420)
    way.on_named_value(S, other)
    told(way, S, reason=ScriptReason.STICK, start=START + 1)  # perhaps of before
    way.on_named_value(S + 900_000_000, other)
    assert way.fault(S + 900_000_000) is None


def test_a_session_begins_without_what_ended_the_one_before() -> None:
    way = ready()
    way.drive(1600, 1420)
    told(way, S, reason=ScriptReason.DRIVING, start=START + 1)
    way.release(S)
    told(way, 3 * S, start=START + 1)
    assert way.fault(3 * S) is None, "a sign of after the release ends nothing"
    way.data_to_send(3 * S)
    way.drive(1600, 1420)
    told(way, 4 * S, start=START + 1)
    assert way.fault(4 * S + 500_000_000) is None
    assert way.fault(4 * S + 600_000_000) == explain(Reason.SCRIPT_STARVED)


def test_a_reason_that_was_lost_ends_no_session_that_goes_on() -> None:
    """Of the sign only the next start came, twice: what stands beside it is the reason of before the session."""
    way = ready()
    way.drive(1600, 1420)
    sender = dialect.MAVLink(None, srcSystem=7, srcComponent=1)
    message = dialect.MAVLink_named_value_float_message(0, b"ASV_START", float(START + 1))
    for t_ns in (S + S // 2, 2 * S):
        way.on_named_value(t_ns, decode(message.pack(sender)))
        assert way.fault(t_ns) is None
    told(way, 2 * S + S // 2, reason=ScriptReason.DRIVING, start=START + 1)
    assert way.fault(3 * S) is None
    told(way, 3 * S, start=START + 2)  # but one that was driving and is ready again has lost it
    assert way.fault(3 * S) == explain(Reason.SCRIPT_LET_GO, why="ready for a start")


def test_nothing_else_is_said_or_told() -> None:
    way = ready()
    assert (way.hazard, way.refused, way.data_to_send(S)) == ("", "", [])
