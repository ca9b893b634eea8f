"""Repeated requests: answered as before, not executed again, and never against a later command of another."""

from __future__ import annotations

import math

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.io.mavlink.signing import sign
from asvhil.operator.session import OperatorRequest, OperatorSession
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Frame, HoldCommand, MoveCommand, ParameterChange, ReleaseCommand

S = 1_000_000_000
ACCEPTED, REJECTED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_TEMPORARILY_REJECTED
REFUSAL = explain(Reason.NOT_ARMED)


def hold(confirmation: int = 0) -> object:
    return dialect.MAVLink_command_long_message(1, 191, 92, confirmation, 1, 0, 0, 0, 0, 0, 0)


def release(confirmation: int = 0) -> object:
    return dialect.MAVLink_command_long_message(1, 191, 92, confirmation, 0, 0, 0, 0, 0, 0, 0)


def goto(lon: int = -869212000) -> object:
    return dialect.MAVLink_command_int_message(1, 191, 0, 192, 0, 0, -1, 0, 0, math.nan, 404237000, lon, 0)


def setting(value: float) -> object:
    return dialect.MAVLink_param_set_message(1, 191, b"W_NEAR_POS", value, 9)


def setpoint(lat: int) -> object:
    return dialect.MAVLink_set_position_target_global_int_message(0, 1, 191, 6, 0b110111111000, lat, 1, *[0.0] * 9)


class Station:
    """A ground station that numbers its frames, and the daemon's session."""

    def __init__(self) -> None:
        self.session = OperatorSession(load_config("sitl").links.autopilot, parameters=("W_NEAR_POS",))
        self.mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
        self.t_ns = 100 * S

    def frame(self, message: object, number: int | None = None, key: bytes | None = None) -> bytes:
        if number is not None:
            self.mav.seq = number
        data = bytes(message.pack(self.mav))  # type: ignore[attr-defined]
        self.mav.seq = (self.mav.seq + 1) % 256
        return data if key is None else sign(data, key, 0, self.t_ns // 10_000)

    def hear(
        self,
        data: bytes,
        after_s: float = 0.0,
        refusal: Explanation | None = None,
        peer: str = "gcs:1",
        via: str = "",
    ) -> tuple[list[OperatorRequest], list[int], list[str]]:
        """What a frame asks for, and the acknowledgements and texts that answer it."""
        self.t_ns += round(after_s * S)
        asked = self.session.receive(Frame(t_ns=self.t_ns, port="operator", data=data, peer=peer, via=via))
        for request in asked:
            self.session.answer(self.t_ns, request, refusal)
        found = [decode(d) for f in self.session.data_to_send(self.t_ns) for d in FrameSplitter().receive(f.data)]
        acks = [m.result for m in found if m.get_type() == "COMMAND_ACK"]  # type: ignore[union-attr]
        return asked, acks, [m.text for m in found if m.get_type() == "STATUSTEXT"]  # type: ignore[union-attr]


@pytest.mark.parametrize("refusal", [None, REFUSAL])
def test_a_command_with_a_higher_confirmation_gets_its_answer_again(refusal: Explanation | None) -> None:
    station = Station()
    first = station.hear(station.frame(hold(0)), refusal=refusal)
    assert len(first[0]) == 1
    for confirmation, after_s in ((1, 0.8), (2, 3.0), (3, 3.0), (4, 9.0)):
        again = station.hear(station.frame(hold(confirmation)), after_s)
        assert again == ([], first[1], first[2])
    # Where the first was lost, the second is the first.
    assert len(Station().hear(Station().frame(hold(1)))[0]) == 1
    # A new command of the same content begins with confirmation 0 again.
    assert len(station.hear(station.frame(hold(0)), 0.5)[0]) == 1


@pytest.mark.parametrize("message", [hold(), goto(), release()])
@pytest.mark.parametrize("number", [0, 77])
def test_the_same_bytes_from_the_same_peer_are_the_same_command(message: object, number: int) -> None:
    station = Station()
    data = station.frame(message, number)
    assert len(station.hear(data)[0]) == 1
    for _ in range(4):  # as `asvhil hold` repeats what has not been answered
        assert station.hear(data, 0.5) == ([], [ACCEPTED], [])
    assert len(station.hear(data, 6.0)[0]) == 1


def test_signed_anew_it_is_the_same_command_still() -> None:
    station = Station()
    assert len(station.hear(station.frame(goto(), 5, key=bytes(32)))[0]) == 1
    station.t_ns += S // 2
    assert station.hear(station.frame(goto(), 5, key=bytes(32)))[0] == []


def test_another_content_another_sender_and_another_program_are_new_commands() -> None:
    station = Station()
    assert len(station.hear(station.frame(goto(), 0))[0]) == 1
    assert len(station.hear(station.frame(goto(-869213000), 0), 0.1)[0]) == 1
    assert len(station.hear(station.frame(goto(), 0), 0.1)[0]) == 1  # back to the first station
    assert len(station.hear(station.frame(goto(), 0), 1.5, peer="gcs:2")[0]) == 1  # `asvhil hold`, called again
    station.mav.srcSystem = 254
    assert len(station.hear(station.frame(goto(), 0), 0.1)[0]) == 1


def test_a_copy_by_another_link_is_the_same_command() -> None:
    station = Station()
    data = station.frame(goto(), 9)
    assert len(station.hear(data, via="ground.wifi")[0]) == 1
    assert station.hear(data, 1.5, via="ground.radio") == ([], [ACCEPTED], [])


def test_what_was_refused_may_be_asked_for_again() -> None:
    station = Station()
    data = station.frame(goto(), 0)
    assert station.hear(data, refusal=REFUSAL)[1] == [REJECTED]
    assert station.hear(data, 0.5) == ([], [REJECTED], [describe(REFUSAL)])
    assert len(station.hear(data, 1.1)[0]) == 1


def test_a_second_copy_in_the_same_tick_is_answered_once() -> None:
    station = Station()
    data = station.frame(hold(), 3)
    asked, acks, _ = station.hear(data + data)
    assert len(asked) == 1 and acks == [ACCEPTED]


def test_a_release_that_comes_again_does_not_end_the_hold_that_came_between() -> None:
    station = Station()
    assert isinstance(station.hear(station.frame(release(0)))[0][0].command, ReleaseCommand)
    assert isinstance(station.hear(station.frame(hold(0)), 0.3)[0][0].command, HoldCommand)
    assert station.hear(station.frame(release(1)), 0.3) == ([], [ACCEPTED], [])


def test_a_hold_that_comes_after_the_release_that_was_sent_later_is_refused() -> None:
    station = Station()
    late, last = station.frame(hold(), 20), station.frame(release(), 22)
    assert len(station.hear(last)[0]) == 1
    asked, acks, texts = station.hear(late, 0.4)
    assert (asked, acks, texts) == ([], [REJECTED], [describe(explain(Reason.REQUEST_LATE))])
    assert len(station.hear(station.frame(hold(), 23), 0.1)[0]) == 1
    # A release is always as good as its word, and so is a hold some seconds later.
    assert len(station.hear(station.frame(release(), 10), 0.1)[0]) == 1
    assert len(station.hear(station.frame(hold(), 5), 6.0)[0]) == 1


def test_a_setting_that_comes_again_does_not_undo_what_was_set_since() -> None:
    station = Station()
    data = station.frame(setting(3.0), 8)
    assert station.hear(data)[0][0].command == ParameterChange(t_ns=station.t_ns, name="W_NEAR_POS", value=3.0)
    assert station.hear(data, 0.7)[0] == []
    assert len(station.hear(station.frame(setting(4.0), 9), 0.1)[0]) == 1
    assert len(station.hear(station.frame(setting(3.0), 10), 0.1)[0]) == 1


def test_a_refused_setting_that_comes_again_is_answered_with_its_reason_again() -> None:
    station = Station()
    data = station.frame(setting(-1.0), 8)
    asked, _, texts = station.hear(data, refusal=REFUSAL)
    assert len(asked) == 1 and texts == [describe(REFUSAL)]
    for _ in range(3):
        assert station.hear(data, 0.5) == ([], [], [describe(REFUSAL)])
    assert station.hear(station.frame(setting(3.0), 9), 0.1)[2] == []
    assert len(station.hear(data, 0.1)[0]) == 1, "another one was set since"


def test_set_points_out_of_order_do_not_move_the_station_back() -> None:
    station = Station()
    frames = [station.frame(setpoint(404237000 + n), 250 + n) for n in range(6)]  # over the turn of the numbers
    frames += [station.frame(setpoint(404237000 + n), n) for n in range(6, 12)]
    kinds = [type(request.command) for n in (0, 1, 3, 2, 5, 4) for request in station.hear(frames[n], 0.1)[0]]
    assert kinds == [HoldCommand, *[MoveCommand] * 3]
    assert len(station.hear(frames[8], 0.1)[0]) == 1
