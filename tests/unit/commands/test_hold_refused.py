"""`asvhil hold` at a daemon that a test has say what it likes: what cannot be granted is refused before the hold."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from asvhil.io.mavlink.frames import dialect
from asvhil.supervisor.reasons import Reason, describe, explain
from tests.support.command_line import Said, call
from tests.support.page_daemon import PageDaemon, page_daemon
from tests.support.ports import free_port

pytestmark = pytest.mark.real_time
HOLD = dialect.MAV_CMD_DO_REPOSITION
STILL = {"ST_SPEED": 0.0, "ST_COURSE": 10.0, "ST_WAY": 0.0, "ST_FOLLOW": 0.0, "ST_POLICY": 0.0, "ST_SPEED_MAX": 0.8}


class HoldBench:
    def __init__(self, daemon: PageDaemon, port: int, folder: Path) -> None:
        self.daemon = daemon
        self._sets = ("--set", f"links.operator.endpoint=udpin:127.0.0.1:{port}", "--config", "sitl")
        self._folder = folder

    async def hold(self, *arguments: str, typed: str | None = None) -> Said:
        return await asyncio.to_thread(call, "hold", *arguments, *self._sets, cwd=self._folder, typed=typed)

    def refuses(self, mav_cmd: int | None = None, words: str = "vehicle is not armed", **values: float) -> None:
        """Refuse a command, or settings of these values, and grant the rest."""

        def answers(message: Any) -> list[Any]:
            if message.get_type() == "PARAM_SET":
                return self.daemon.warning(words) if values.get(message.param_id) == message.param_value else []
            if message.get_type() == "HEARTBEAT":
                return []
            result = 2 if message.command == mav_cmd else 0
            return [*(self.daemon.warning(words) if result else []), self.daemon.ack(message.command, result)]

        self.daemon.answers = answers


@pytest.fixture
async def bench(tmp_path: Path) -> AsyncIterator[HoldBench]:
    port = free_port()
    async with page_daemon(port) as daemon:
        daemon.parameters = dict(STILL)
        made = HoldBench(daemon, port, tmp_path)
        made.refuses()
        yield made


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--drift", "5@90"), "the daemon refuses a station at 5.00 m/s, 0.80 m/s at most; nothing has changed"),
        (("--drift", "0.81@90"), "0.80 m/s at most; nothing has changed"),
        (("--drift", "0.3@90", "--way", "2e6"), "ST_WAY must be 0 to 1e+06, not 2e+06; nothing has changed"),
        (("--follow", "1"), "--follow 1: that is the boat itself; nothing has changed"),
    ],
)
async def test_a_motion_that_cannot_be_granted_is_refused_before_the_hold(
    bench: HoldBench, arguments: tuple[str, ...], words: str
) -> None:
    said = await bench.hold(*arguments)
    assert said.status == 2 and words in said.err and bench.daemon.heard == []


@pytest.mark.parametrize("speed", ["0.8", "0.3"])
async def test_a_course_as_fast_as_may_be_is_asked_for_after_the_hold(bench: HoldBench, speed: str) -> None:
    said = await bench.hold("--drift", f"{speed}@90")
    assert said.status == 0 and f"moving: {speed}@90" in said.out, said
    settings = [heard for heard in bench.daemon.heard if heard != "HEARTBEAT"]
    assert settings == [HOLD, ("ST_COURSE", 90.0), ("ST_WAY", 0.0), ("ST_SPEED", float(speed))]


async def test_a_daemon_of_before_that_tells_no_highest_speed_is_asked_all_the_same(bench: HoldBench) -> None:
    bench.daemon.parameters.pop("ST_SPEED_MAX")
    said = await bench.hold("--drift", "0.3@90")
    assert said.status == 0 and "moving: 0.3@90" in said.out, said
    bench.daemon.parameters.pop("ST_SPEED")
    bench.daemon.heard.clear()
    said = await bench.hold("--drift", "0.3@90")
    assert said.status == 2 and "no answer; is `asvhil run` up" in said.err and bench.daemon.heard == []


async def test_a_setting_that_is_refused_after_the_hold_all_the_same_is_told_with_what_is_held(
    bench: HoldBench,
) -> None:
    bench.refuses(words="no", ST_FOLLOW=42.0)
    said = await bench.hold("--follow", "42")
    held = "the hold was granted, and a new station is held, at rest; `asvhil release` ends it"
    assert said.status == 2 and f"{held}: the daemon refused ST_FOLLOW = 42: no" in said.err, said


async def test_a_hold_that_is_refused_leaves_the_heading_policy_as_it_was(bench: HoldBench) -> None:
    bench.daemon.parameters["ST_POLICY"] = 3.0
    bench.refuses(HOLD)
    said = await bench.hold("--policy", "fixed", "--heading", "30")
    assert said.status == 2 and "the daemon refused: vehicle is not armed" in said.err
    assert bench.daemon.heard == [("ST_POLICY", 0.0), HOLD, ("ST_POLICY", 3.0)]


async def test_a_hold_that_is_interrupted_leaves_the_heading_policy_as_it_was(
    bench: HoldBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    bench.daemon.parameters["ST_POLICY"] = 3.0
    monkeypatch.setattr("asvhil.links.operator_client.send_and_wait", interrupted)
    said = await bench.hold("--policy", "fixed", "--heading", "30")
    assert said.status != 0 and bench.daemon.heard == [("ST_POLICY", 0.0), ("ST_POLICY", 3.0)]


async def test_a_refusal_is_told_too_where_the_policy_cannot_be_put_back(bench: HoldBench) -> None:
    bench.daemon.parameters["ST_POLICY"] = 3.0
    bench.refuses(HOLD, ST_POLICY=3.0)
    said = await bench.hold("--policy", "fixed", "--heading", "30")
    assert said.status == 2 and "the daemon refused: vehicle is not armed; the heading policy is fixed now" in said.err


async def test_a_daemon_that_falls_silent_after_the_hold_is_told_with_the_hold(bench: HoldBench) -> None:
    bench.daemon.parameters.pop("ST_FOLLOW")
    bench.refuses(ST_FOLLOW=42.0)
    said = await bench.hold("--follow", "42")
    assert said.status == 2 and "the hold was granted, and then: " in said.err and "no answer" in said.err


async def test_a_distance_that_is_never_granted_is_refused_before_the_hold(bench: HoldBench) -> None:
    said = await bench.hold("--at", "40.4264,-86.9212", "--within", "2500")
    assert said.status == 2 and "--within 2500: a station is 2000 m away at most" in said.err
    assert bench.daemon.heard == []


@pytest.mark.parametrize("limit", ["100 m unless the hold command names more", "200 m by the hold command"])
async def test_a_station_farther_than_may_be_is_meant_once_a_person_says_so(bench: HoldBench, limit: str) -> None:
    far = explain(Reason.STATION_UNCONFIRMED, metres=287.0, limit=limit)
    bench.refuses(HOLD, describe(far))
    for typed, holds in ((None, 1), ("n\n", 1), ("y\n", 2)):
        bench.daemon.heard.clear()
        said = await bench.hold("--at", "40.4264,-86.9212", typed=typed)
        assert said.status == 2 and bench.daemon.heard == [HOLD] * holds
        assert ("The station is 287 m from the boat. Is that meant?" in said.out) is (typed is not None)
