"""Routing: who gets what, by the rules of the protocol, and gates that let in whom they should."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from asvhil.config.mavlink import MavlinkLinkConfig
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect, message_number, target
from asvhil.io.mavlink.routing import MAX_SENDERS, Hops, LinkRules, RoutingTable
from asvhil.io.mavlink.signature_filter import Senders, SignatureFilter
from asvhil.io.mavlink.signing import SigningClock, Verifier, sign
from asvhil.types import Frame

AUTOPILOT, GCS, CAMERA, US = (1, 1), (255, 190), (1, 100), (1, 191)
ALL = LinkRules()
MS = 1_000_000


def pack(message, sender: tuple[int, int], seq: int = 0, v1: bool = False) -> bytes:  # type: ignore[no-untyped-def]
    mav = dialect.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])
    mav.seq = seq
    return bytes(message.pack(mav, force_mavlink1=v1))


def heartbeat(sender: tuple[int, int], seq: int = 0) -> bytes:
    return pack(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), sender, seq)


def command(sender: tuple[int, int], to: tuple[int, int], seq: int = 0, v1: bool = False) -> bytes:
    return pack(dialect.MAVLink_command_long_message(*to, 400, 0, 1, 0, 0, 0, 0, 0, 0), sender, seq, v1)


def router(**rules: LinkRules) -> RoutingTable:
    links = {"autopilot": ALL, "qgc": ALL, "dashboard": ALL} | rules
    made = RoutingTable(links, {US})
    assert made.route("autopilot", heartbeat(AUTOPILOT), 0) == Hops(("qgc", "dashboard"), True)
    assert made.route("qgc", heartbeat(GCS), 0) == Hops(("autopilot", "dashboard"), True)
    return made


# --- targets -----------------------------------------------------------------------------------------------------


def _arguments(message) -> list[object]:  # type: ignore[no-untyped-def]
    values: list[object] = []
    for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        length = message.array_lengths[message.ordered_fieldnames.index(name)]
        if name in ("target_system", "target_component"):
            values.append(7 if name == "target_system" else 9)
        elif kind == "char":
            values.append(b"abc" if length else b"a")
        else:
            values.append([1] * length if length else 1)
    return values


@pytest.mark.parametrize("v1", [False, True])
def test_the_target_of_every_message_of_the_dialect_is_found(v1: bool) -> None:
    seen = 0
    for msg_id, message in dialect.mavlink_map.items():
        if v1 and msg_id > 255:
            continue
        expected = (
            7 if "target_system" in message.fieldnames else 0,
            9 if {"target_system", "target_component"} <= set(message.fieldnames) else 0,
        )
        frame = pack(message(*_arguments(message)), AUTOPILOT, v1=v1)
        extension = v1 and target(frame) == (0, 0)  # MAVLink 1 has no extension fields
        assert extension or target(frame) == expected, message.msgname
        seen += target(frame) != (0, 0)
    assert seen > 50


def test_a_target_that_is_cut_off_with_its_zeros_is_everybody() -> None:
    frame = pack(dialect.MAVLink_param_request_list_message(0, 0), GCS)
    assert frame[1] == 1 and target(frame) == (0, 0)
    frame = pack(dialect.MAVLink_param_request_list_message(1, 0), GCS)
    assert frame[1] == 1 and target(frame) == (1, 0)


# --- hops --------------------------------------------------------------------------------------------------------


def test_a_targeted_frame_goes_where_its_target_was_heard() -> None:
    made = router()
    assert made.route("qgc", command(GCS, AUTOPILOT), 0) == Hops(("autopilot",), False)
    assert made.route("qgc", command(GCS, AUTOPILOT, v1=True), 0) == Hops(("autopilot",), False)
    assert made.route("autopilot", command(AUTOPILOT, GCS), 0) == Hops(("qgc",), False)
    assert made.route("qgc", command(GCS, US), 0) == Hops((), True)
    assert made.route("qgc", command(GCS, (1, 0)), 0) == Hops(("autopilot",), True)
    assert made.route("qgc", command(GCS, (0, 0)), 0) == Hops(("autopilot", "dashboard"), True)


def test_nothing_goes_back_to_where_it_came_from() -> None:
    made = router()
    assert made.route("autopilot", heartbeat(CAMERA), 0).links == ("qgc", "dashboard")
    assert made.route("autopilot", command(CAMERA, AUTOPILOT), 0) == Hops((), False)
    assert made.counts["unroutable"] == 1


def test_a_target_that_was_never_heard_gets_nothing() -> None:
    made = router()
    assert made.route("qgc", command(GCS, (42, 1)), 0) == Hops((), False)
    assert made.route("qgc", command(GCS, CAMERA, 1), 0) == Hops((), False)
    made.route("dashboard", heartbeat(CAMERA), 0)
    assert made.route("qgc", command(GCS, CAMERA, 2), 0) == Hops(("dashboard",), False)
    assert made.route("qgc", command(GCS, (1, 0), 3), 0) == Hops(("autopilot", "dashboard"), True)


def test_our_own_name_is_nobody_elses() -> None:
    made = router()
    assert made.route("qgc", command(US, AUTOPILOT), 0) == Hops((), False)
    assert made.route("qgc", heartbeat(US), 0) == Hops((), False)
    assert made.counts["own"] == 2
    assert made.route("dashboard", command(GCS, US), 0).links == ()  # and we were not learned there


def test_a_copy_by_another_link_is_dropped_and_a_repetition_is_not() -> None:
    made = router()
    frame = command(GCS, AUTOPILOT, 9)
    assert made.route("qgc", frame, 0).links == ("autopilot",)
    assert made.route("dashboard", frame, 100 * MS) == Hops((), False)
    assert made.counts["duplicate"] == 1
    assert made.route("qgc", frame, 150 * MS).links == ("autopilot",)
    assert made.route("dashboard", frame, 400 * MS).links == ("autopilot",)
    never = RoutingTable({"autopilot": ALL, "qgc": ALL, "dashboard": ALL}, {US}, duplicates_ns=0)
    never.route("autopilot", heartbeat(AUTOPILOT), 0)
    assert [never.route(link, frame, 0).links for link in ("qgc", "dashboard")] == [("autopilot",)] * 2


def test_lists_of_messages() -> None:
    heartbeats, commands = frozenset({0}), frozenset({message_number("COMMAND_LONG")})
    assert router(dashboard=LinkRules(allow_out=heartbeats)).route("qgc", command(GCS, (0, 0)), 0).links == (
        "autopilot",
    )
    blocked = router(autopilot=LinkRules(block_out=commands))
    assert blocked.route("qgc", command(GCS, AUTOPILOT), 0) == Hops((), False)
    only = router(qgc=LinkRules(block_in=commands))
    assert only.route("qgc", command(GCS, AUTOPILOT), 0) == Hops((), False)
    assert only.route("qgc", command(GCS, US), 0) == Hops((), True)  # lists are for forwarding
    deaf = router(qgc=LinkRules(allow_in=heartbeats))
    assert deaf.route("qgc", command(GCS, AUTOPILOT), 0) == Hops((), False)


def test_our_own_frames_reach_all_but_the_named_links() -> None:
    made = router()
    assert made.originate(heartbeat(US), besides=("autopilot",)) == ("qgc", "dashboard")
    assert made.originate(command(US, GCS)) == ("qgc",)
    quiet = router(qgc=LinkRules(block_out=frozenset({message_number("COMMAND_LONG")})))
    assert quiet.originate(command(US, (0, 0)), besides=("autopilot",)) == ("dashboard",)


def test_what_is_remembered_is_bounded_and_the_talkative_stay() -> None:
    made = router()
    for number in range(3 * MAX_SENDERS):
        made.route("dashboard", heartbeat((2 + number // 255, 1 + number % 255)), number * MS)
        if number % 900 == 0:
            made.route("autopilot", heartbeat(AUTOPILOT, number // 900), number * MS)
    assert len(made._heard) == MAX_SENDERS and len(made._recent) <= 4096
    assert made.route("qgc", command(GCS, AUTOPILOT), 4000 * MS).links == ("autopilot",)


@given(st.lists(st.tuples(st.sampled_from(["autopilot", "qgc", "dashboard"]), st.integers(0, 3), st.integers(0, 3))))
def test_no_frame_returns_and_targets_are_kept(steps: list[tuple[str, int, int]]) -> None:
    senders = [AUTOPILOT, GCS, CAMERA, (2, 1)]
    made = RoutingTable({"autopilot": ALL, "qgc": ALL, "dashboard": ALL}, {US})
    heard: dict[tuple[int, int], set[str]] = {}
    for number, (link, sender, to) in enumerate(steps):
        hops = made.route(link, command(senders[sender], senders[to], number % 256), number * 1000 * MS)
        heard.setdefault(senders[sender], set()).add(link)
        assert set(hops.links) == heard.get(senders[to], set()) - {link} and not hops.local


# --- gates -------------------------------------------------------------------------------------------------------


def test_senders() -> None:
    assert GCS in Senders(())
    some = Senders(("1/1", "255/*", "*/190", "7"))
    assert [pair in some for pair in ((1, 1), (1, 2), (255, 3), (9, 190), (7, 200), (8, 1))] == [
        True,
        False,
        True,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize("text", ["", "1/", "256/1", "1/300", "a/b", "1/1/1", "-1/1", "1 /1"])
def test_senders_that_make_no_sense_are_refused(text: str) -> None:
    with pytest.raises(ValidationError, match="SYSTEM/COMPONENT"):
        MavlinkLinkConfig(senders=(text,))


def test_a_gate_lets_in_whom_it_should() -> None:
    key = bytes(32)
    signature_filter = SignatureFilter(("1/1",), Verifier(key, SigningClock(), max_ahead_s=None))
    good, unsigned = sign(heartbeat(AUTOPILOT), key, 0, 5), heartbeat(AUTOPILOT)
    stranger = sign(heartbeat(CAMERA), key, 0, 6)
    data = b"noise" + unsigned + good + stranger + good
    assert signature_filter.receive(Frame(t_ns=0, port="autopilot", data=data[:30]), 0) == []
    assert signature_filter.receive(Frame(t_ns=0, port="autopilot", data=data[30:]), 0) == [good]
    assert signature_filter.rejected == {"unsigned": 1, "of other senders": 1, "replayed": 1}
    assert signature_filter.verifier is not None and list(signature_filter.verifier.state().streams) == [(1, 1, 0)]


def test_a_message_that_does_not_exist_is_named() -> None:
    assert message_number("RADIO_STATUS") == 109
    with pytest.raises(ConfigError, match=r"no MAVLink message is named 'HEARTBEET', did you mean HEARTBEAT\?"):
        message_number("HEARTBEET")
