"""`asvhil hold` and `release` reach the daemon wherever it listens, and say what is wrong where they do not."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from typing import TypeVar

import pytest

from asvhil.config import load_config
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode, dialect, sequence
from asvhil.links.clock import Clock
from asvhil.links.endpoint import open_endpoint
from asvhil.links.operator_client import REASON_S, REMARK, send_and_wait, set_parameter
from asvhil.operator.encoding import encode_hold, encode_parameter
from asvhil.operator.session import OperatorSession
from asvhil.supervisor.reasons import WORDS, Reason, describe, explain
from asvhil.types import Frame

CONFIG = load_config("sitl").links.autopilot
HOLD = encode_hold(CONFIG, None, None, None)
SPEED = "ST_SPEED"
TOO_FAST = explain(Reason.STATION_TOO_FAST, speed=5.0, most=0.8)
Answer = Callable[[OperatorSession, Frame], Awaitable[list[Frame]]]
Result = TypeVar("Result")


async def granted(session: OperatorSession, frame: Frame) -> list[Frame]:
    for request in session.receive(frame):
        session.answer(frame.t_ns, request, None)
    return session.data_to_send(frame.t_ns)


async def ask(spec: str, answer: Answer = granted, called: str = "", timeout_s: float = 2.0) -> tuple[int, str]:
    """A hold command to a daemon that listens on a spec; `called`: as the client has it, PORT for the port."""

    def hold(endpoint: str) -> tuple[int, str]:
        return send_and_wait(HOLD, endpoint, dialect.MAV_CMD_DO_REPOSITION, timeout_s)

    return await at_daemon(spec, answer, called, hold)


async def at_daemon(spec: str, answer: Answer, called: str, client: Callable[[str], Result]) -> Result:
    """What a client gets from a daemon that listens on a spec."""
    link = await open_endpoint(spec, "operator", Clock().now_ns)
    port = link.address.rpartition(":")[2]
    session = OperatorSession(CONFIG, parameters=(SPEED,))

    async def serve() -> None:
        while True:
            for frame in await answer(session, await link.recv()):
                await link.send(frame.data, frame.peer)

    server = asyncio.create_task(serve())
    try:
        endpoint = (called or spec.rpartition(":")[0] + ":PORT").replace("PORT", port)
        return await asyncio.to_thread(client, endpoint)
    finally:
        server.cancel()
        await asyncio.gather(server, return_exceptions=True)
        await link.close()


@pytest.mark.parametrize(
    "spec",
    [
        "udpin:127.0.0.1:0",
        "udpin:0.0.0.0:0",
        "udpin:[::1]:0",
        "udpin:[::]:0",
        "udpin:localhost:0",
        "tcpin:127.0.0.1:0",
        "tcpin:0.0.0.0:0",
        "tcpin:[::1]:0",
        "tcpin:[::]:0",
        "tcpin:localhost:0",
    ],
)
async def test_every_port_that_the_daemon_can_listen_on_is_reached(spec: str) -> None:
    assert await ask(spec) == (0, "")


@pytest.mark.parametrize("spec", ["udpin:127.0.0.1:0", "tcpin:127.0.0.1:0"])
async def test_an_answer_in_pieces_and_among_others_is_heard(spec: str) -> None:
    noise = bytes(dialect.MAVLink_command_ack_message(192, 4).pack(dialect.MAVLink(None, 7, 1)))

    async def in_pieces(session: OperatorSession, frame: Frame) -> list[Frame]:
        data = noise + b"".join(answer.data for answer in await granted(session, frame))
        return [
            Frame(t_ns=0, port="operator", data=data[at : at + 9], peer=frame.peer) for at in range(0, len(data), 9)
        ]

    assert await ask(spec, in_pieces) == (0, "")


async def test_its_repetitions_are_one_request_and_a_second_call_is_another() -> None:
    heard: list[Frame] = []
    asked = []

    async def late(session: OperatorSession, frame: Frame) -> list[Frame]:
        heard.append(frame)
        requests = session.receive(frame)
        asked.extend(requests)
        for request in requests:
            session.answer(frame.t_ns, request, None)
        answers = session.data_to_send(frame.t_ns)
        return answers if len(heard) > 2 else []  # the first two are lost

    assert await ask("udpin:127.0.0.1:0", late) == (0, "")
    assert len(heard) == 3 and len({frame.data for frame in heard}) == 1 and len(asked) == 1
    await asyncio.sleep(0.11)
    await ask("udpin:127.0.0.1:0", late)
    assert sequence(heard[-1].data) != sequence(heard[0].data)


@pytest.mark.parametrize("scheme", ["udpin", "tcpin"])
def test_without_a_daemon_it_ends_in_one_line(scheme: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM if scheme == "tcpin" else socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        endpoint = f"{scheme}:127.0.0.1:{taken.getsockname()[1]}"
    with pytest.raises(LinkError) as error:
        send_and_wait(HOLD, endpoint, 192, 0.3)
    text = str(error.value)
    assert text.startswith(f"{endpoint}: ") and "is `asvhil run` up" in text and "\n" not in text


@pytest.mark.parametrize("spec", ["udpout:127.0.0.1:14660", "tcp:127.0.0.1:5760", "serial:/dev/ttyUSB0:57600"])
def test_where_the_daemon_does_not_listen_it_says_so(spec: str) -> None:
    with pytest.raises(LinkError, match=r"the daemon does not listen there; .*must be udpin: or tcpin:"):
        send_and_wait(HOLD, spec, 192, 0.3)


async def test_another_program_on_the_port_is_told() -> None:
    async def other(session: OperatorSession, frame: Frame) -> list[Frame]:
        data = bytes(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(dialect.MAVLink(None, 255, 190)))
        return [Frame(t_ns=0, port="operator", data=data, peer=frame.peer)]

    with pytest.raises(LinkError, match=r"MAVLink component 255/190 answers there, and no daemon"):
        await ask("udpin:127.0.0.1:0", other, timeout_s=0.6)


async def set_speed(*told: Callable[[list[Frame]], list[Frame]]) -> tuple[float, str]:
    """A speed of 5 m/s that is refused, where the answers come as `told` has them, those of each repetition in turn."""
    changes = list(told)

    async def refused(session: OperatorSession, frame: Frame) -> list[Frame]:
        for request in session.receive(frame):
            session.answer(frame.t_ns, request, TOO_FAST)
        answers = session.data_to_send(frame.t_ns, value_of=lambda name: 0.3)
        answers = [f for f in answers if decode(f.data).get_type() in ("STATUSTEXT", "PARAM_VALUE")]  # type: ignore[union-attr]
        answers = [Frame(t_ns=0, port=f.port, data=f.data, peer=frame.peer) for f in answers]
        return changes.pop(0)(answers) if changes else answers

    def client(endpoint: str) -> tuple[float, str]:
        return set_parameter(encode_parameter(CONFIG, SPEED, 5.0), endpoint, SPEED, 5.0)

    return await at_daemon("udpin:127.0.0.1:0", refused, "", client)


@pytest.mark.parametrize(
    "told",
    [
        [],
        [lambda answers: answers[::-1]],  # the value first
        [lambda answers: answers[1:]],  # the reason is lost: it comes with the next answer
        [lambda answers: answers[1:] * 2, lambda answers: []],  # as another operator's change is told
    ],
)
async def test_a_refused_setting_is_told_with_its_reason(told: list[Callable[[list[Frame]], list[Frame]]]) -> None:
    assert await set_speed(*told) == (pytest.approx(0.3), describe(TOO_FAST))


async def test_what_a_daemon_tells_of_itself_is_no_reason_of_a_refusal() -> None:
    for words in ("wind from nowhere", "battery: 18 %, below 20 %"):
        mav = dialect.MAVLink(None, CONFIG.system_id, CONFIG.component_id)
        remark = bytes(dialect.MAVLink_statustext_message(4, words.encode()).pack(mav))

        def told(answers: list[Frame], remark: bytes = remark) -> list[Frame]:
            return [Frame(t_ns=0, port="operator", data=remark, peer=answers[0].peer), *answers[1:]]

        assert await set_speed(told) == (pytest.approx(0.3), describe(TOO_FAST)), "which comes with the next answer"


def test_no_refusal_of_a_setting_reads_as_what_a_daemon_tells_of_itself() -> None:
    refusals = [Reason.NO_STATION_HELD, Reason.STATION_TOO_FAST, Reason.HEADING_OF_WEATHER, Reason.PARAMETER_READ_ONLY]
    refusals += [Reason.PARAMETER_OUT_OF_RANGE, Reason.PARAMETER_CONFLICT]
    texts = [WORDS[reason].text.replace("{name}", SPEED) for reason in refusals]
    assert not [text for text in texts if REMARK.fullmatch(text)]


async def test_a_setting_that_is_answered_late_has_the_value_that_was_told() -> None:
    async def late(session: OperatorSession, frame: Frame) -> list[Frame]:
        await asyncio.sleep(1.0)
        for request in session.receive(frame):
            session.answer(frame.t_ns, request, None)
        answers = session.data_to_send(frame.t_ns, value_of=lambda name: 0.3)
        return [Frame(t_ns=0, port=f.port, data=f.data, peer=frame.peer) for f in answers]

    def client(endpoint: str) -> tuple[float, str]:
        return set_parameter(encode_parameter(CONFIG, SPEED, 5.0), endpoint, SPEED, 5.0)

    assert await at_daemon("udpin:127.0.0.1:0", late, "", client) == (pytest.approx(0.3), "")


async def test_the_reason_of_a_setting_is_not_waited_for_without_end() -> None:
    began_s = asyncio.get_running_loop().time()
    assert await set_speed(*[lambda answers: answers[1:]] * 9) == (pytest.approx(0.3), "")
    assert asyncio.get_running_loop().time() - began_s < REASON_S + 0.7
