"""The page's controls at a daemon that a test has say what it likes: order, refusals, and what stands after them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.dashboard import daemon_client
from asvhil.dashboard.controls import read_control
from asvhil.dashboard.daemon_client import NO_ANSWER, DaemonClient
from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.steady_clock import steady_s
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.state_arrays import BoatState, state_arrays
from tests.support.page_daemon import NEUTRAL, PageDaemon, page_daemon
from tests.support.ports import free_port

pytestmark = pytest.mark.real_time
HOLD = dialect.MAV_CMD_DO_REPOSITION
NO_STATION = "no station is held: send a hold command first"
MOVE = {"action": "move", "n_m": 900.0, "e_m": 0.0}
DRIFT = {"action": "drift", "speed_mps": 5.0, "course_deg": 33.0}
AT_REST = {"ST_SPEED": 0.0, "ST_COURSE": 10.0, "ST_WAY": 0.0, "ST_FOLLOW": 0.0}


class ClientBench:
    """A client that runs, its daemon, and a clock in a hurry: a tenth of the waiting."""

    def __init__(self, daemon: PageDaemon, client: DaemonClient) -> None:
        self.daemon, self.client = daemon, client

    async def ask(self, **body: Any) -> tuple[bool, str]:
        return await self.client.ask(read_control(body))

    def begin(self, **body: Any) -> asyncio.Task[tuple[bool, str]]:
        return asyncio.create_task(self.ask(**body))

    async def heard(self, what: Any) -> None:
        async with asyncio.timeout(2.0):
            while what not in self.daemon.heard:
                await asyncio.sleep(0.005)


@pytest.fixture
async def bench(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[ClientBench]:
    for name in ("AGAIN_S", "ANSWER_S", "SHOWN_S"):
        monkeypatch.setattr(daemon_client, name, getattr(daemon_client, name) / 10.0)
    port = free_port()
    config = load_config("sitl", (f"links.operator.endpoint=udpin:127.0.0.1:{port}",))
    async with page_daemon(port) as daemon:
        picture = BoatPicture()
        client = DaemonClient(config, picture)
        running = asyncio.create_task(client.run())
        async with asyncio.timeout(2.0):
            while client._link is None:
                await asyncio.sleep(0.005)
        for message in state_arrays(0, BoatState()):  # so that it is not taken for silent
            picture.receive(steady_s(), message)
        yield ClientBench(daemon, client)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


@pytest.mark.parametrize(("action", "mav_cmd"), [("neutral", NEUTRAL), ("release", dialect.MAV_CMD_NAV_GUIDED_ENABLE)])
async def test_what_stops_the_motors_is_sent_before_all_that_was_asked_for_earlier(
    bench: ClientBench, action: str, mav_cmd: int
) -> None:
    bench.daemon.answers = lambda message: [bench.daemon.ack(mav_cmd, 0)] if bench.daemon.heard[-1] == mav_cmd else []
    earlier = [bench.begin(**body) for body in (MOVE, {"action": "hold"}, DRIFT)]
    await bench.heard("SET_POSITION_TARGET_LOCAL_NED")
    assert await bench.ask(action=action) == (True, "granted")
    assert [await task for task in earlier] == [(False, f"overtaken by {action}")] * 3
    await asyncio.sleep(3 * daemon_client.AGAIN_S)
    assert set(bench.daemon.heard) == {"SET_POSITION_TARGET_LOCAL_NED", mav_cmd}, "no hold was sent"
    assert bench.daemon.heard[-1] == mav_cmd, "and nothing was sent again"


async def test_a_hold_under_way_is_not_sent_again_after_neutral_and_one_asked_for_later_is_done(
    bench: ClientBench,
) -> None:
    earlier = bench.begin(action="hold")
    await bench.heard(HOLD)
    bench.daemon.answers = lambda message: [bench.daemon.ack(message.command, 0)]
    assert await bench.ask(action="neutral") == (True, "granted")
    assert await earlier == (False, "overtaken by neutral")
    assert bench.daemon.heard[-1] == NEUTRAL
    assert await bench.ask(action="hold") == (True, "granted")


async def test_the_same_refusal_of_a_set_point_which_is_told_once_answers_the_next_one_soon(
    bench: ClientBench,
) -> None:
    said = [bench.daemon.warning(NO_STATION)]
    bench.daemon.answers = lambda message: said.pop() if said else []
    assert await bench.ask(**MOVE) == (False, NO_STATION)
    began_s = time.monotonic()
    assert await bench.ask(**MOVE) == (False, NO_STATION)
    assert time.monotonic() - began_s < 0.75 * daemon_client.ANSWER_S
    assert await bench.ask(action="heading", heading_deg=7) == (False, NO_STATION), "another one, after all the time"


async def test_a_control_that_nobody_answers_may_still_be_done(bench: ClientBench) -> None:
    assert await bench.ask(action="hold") == (False, NO_ANSWER)
    assert await bench.ask(**DRIFT) == (False, "no answer from the daemon: nothing has changed")
    assert bench.daemon.heard[-1] == HOLD


async def test_to_stay_is_refused_where_no_station_is_held_though_no_speed_is_told(bench: ClientBench) -> None:
    bench.daemon.parameters = dict(AT_REST)
    bench.daemon.answers = lambda message: bench.daemon.warning(NO_STATION)
    assert await bench.ask(action="stay") == (False, NO_STATION)


@pytest.mark.parametrize("changes", [{}, {"ST_SPEED": 0.2, "ST_WAY": 30.0}, {"ST_SPEED": 0.2, "ST_FOLLOW": 42.0}])
async def test_a_motion_whose_speed_is_refused_leaves_all_as_it_was(
    bench: ClientBench, changes: dict[str, float]
) -> None:
    too_fast = "a station at 5.00 m/s, 1.00 m/s at most"
    before = AT_REST | changes
    bench.daemon.parameters = dict(before)
    bench.daemon.answers = lambda message: (
        bench.daemon.warning(too_fast) if (message.param_id, message.param_value) == ("ST_SPEED", 5.0) else []
    )
    assert await bench.ask(**DRIFT) == (False, too_fast)
    assert bench.daemon.parameters == pytest.approx(before)
    moved = before["ST_SPEED"] > 0.0 and not before["ST_FOLLOW"]
    assert (("ST_COURSE", 33.0) in bench.daemon.heard) is not moved, "a station that moves keeps its course throughout"


async def test_what_cannot_be_put_back_is_told(bench: ClientBench) -> None:
    bench.daemon.parameters = dict(AT_REST)

    def answers(message: Any) -> list[Any]:
        heard = bench.daemon.heard
        return bench.daemon.warning("no") if heard[-1][0] == "ST_SPEED" or ("ST_SPEED", 5.0) in heard else []

    bench.daemon.answers = answers
    assert await bench.ask(**DRIFT) == (False, "no; set all the same: ST_WAY, ST_COURSE")


async def test_a_refused_hold_is_told_in_the_daemons_words_each_time_also_where_they_come_late(
    bench: ClientBench,
) -> None:
    words = "not armed: neutral is sent for 30 s, arm it in MANUAL and hold again"
    refused = [bench.daemon.ack(HOLD, 1)]
    for answer in (bench.daemon.warning(words) + refused, refused + bench.daemon.warning(words)):
        bench.daemon.answers = lambda message, answer=answer: answer
        assert await bench.ask(action="hold") == (False, words)


async def test_a_place_is_refused_in_words_while_the_station_follows_a_leader(bench: ClientBench) -> None:
    bench.daemon.parameters = AT_REST | {"ST_FOLLOW": 42.0}
    assert await bench.ask(action="follow", system_id=42) == (True, "granted")
    assert await bench.ask(**MOVE) == (False, "the station follows system 42: have it stay, then move it")
    bench.daemon.answers = lambda message: []
    bench.daemon.parameters["ST_FOLLOW"] = 0.0
    assert await bench.ask(action="stay") == (True, "granted")
    await asyncio.sleep(daemon_client.AGAIN_S)
    await bench.ask(**MOVE)
    assert bench.daemon.heard[-1] == "SET_POSITION_TARGET_LOCAL_NED"
