"""The shell in one process: a step that raises, links that come and go, an inbox that floods."""

import asyncio
import contextlib
import errno
import socket
from collections import deque
from pathlib import Path
from typing import Any

import pytest

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, load_config
from asvhil.daemon.daemon import RELEASES, Daemon
from asvhil.errors import AsvhilError
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.links.clock import Clock
from asvhil.links.endpoint import INBOX_FRAMES, Endpoint, open_endpoint
from asvhil.links.reconnecting import ReconnectingLink
from asvhil.logs.opening import open_recorder
from asvhil.logs.reader import LogFile
from asvhil.logs.recorder import Recorder
from asvhil.types import Frame, Inputs, Outputs
from tests.support.waiting import until

pytestmark = pytest.mark.real_time


def config(*overrides: str) -> Config:
    return load_config("sitl", ("links.anemometer=null", "links.operator.endpoint=udpin:127.0.0.1:0", *overrides))


@contextlib.contextmanager
def recorder_at(settings: Config, path: Path):  # type: ignore[no-untyped-def]
    recorder: Recorder = open_recorder(settings, path, "live")
    try:
        yield recorder
    finally:
        recorder.close()


async def test_a_step_that_raises_ends_in_neutral_and_release(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as autopilot:
        autopilot.bind(("127.0.0.1", 0))
        autopilot.setblocking(False)
        settings = config(f"links.autopilot.endpoint=udpout:127.0.0.1:{autopilot.getsockname()[1]}")
        with recorder_at(settings, tmp_path / "log.mcap") as recorder:
            backseat = build_backseat(settings)
            step = backseat.step
            daemon = Daemon(settings, recorder, Clock(), backseat=backseat)

            def broken(inputs: Inputs) -> Outputs:
                if daemon.ticks == 10:
                    raise ZeroDivisionError("a bug")
                return step(inputs)

            backseat.step = broken  # type: ignore[method-assign]
            with pytest.raises(AsvhilError, match=r"motors released: ZeroDivisionError: a bug"):
                await daemon.run(5.0)
        received = []
        with contextlib.suppress(BlockingIOError):
            while True:
                received += [decode(data) for data in FrameSplitter().receive(autopilot.recv(4096))]
    overrides = [(m.chan1_raw, m.chan3_raw) for m in received if m and m.get_type() == "RC_CHANNELS_OVERRIDE"]
    assert overrides == RELEASES * [(1500, 1500), (0, 0)]
    assert not LogFile(tmp_path / "log.mcap").truncated


async def test_a_serial_line_is_unplugged_and_plugged_in_again(tmp_path: Path) -> None:
    clock, inbox, path = Clock(), deque[Frame](), tmp_path / "line"
    link = ReconnectingLink("anemometer", f"serial:{path}:115200", config(), clock, inbox)
    reader = asyncio.create_task(link.run())
    try:
        for round_ in range(2):
            await until(lambda: link.state not in ("connecting", "up"))  # says why it is not there
            plug = await open_endpoint(f"pty:{path}", "plug", clock.now_ns)
            await until(lambda: link.state == "up")
            data = b"hello %d" % round_

            async def arrived(plug=plug, data=data) -> bool:  # type: ignore[no-untyped-def]
                await plug.send(data)
                return any(data in frame.data for frame in inbox)

            for _ in range(100):
                if await arrived():
                    break
                await asyncio.sleep(0.02)
            else:
                raise AssertionError("nothing arrived")
            await plug.close()
    finally:
        reader.cancel()
        await asyncio.gather(reader, return_exceptions=True)


async def test_a_link_is_opened_again_after_any_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without file descriptors the reader of the autopilot's link ended for good, and nobody was told."""
    real, left = socket.socket, [3]

    def rare(*args: Any, **given: Any) -> socket.socket:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError(errno.EMFILE, "Too many open files")
        return real(*args, **given)

    link = ReconnectingLink("operator", "udpin:127.0.0.1:0", config(), Clock(), deque())
    monkeypatch.setattr("asvhil.links.link.socket.socket", rare)
    reader = asyncio.create_task(link.run())
    try:
        await until(lambda: "too many open files" in link.state)
        assert link.state.startswith("udpin:127.0.0.1:0")
        await until(lambda: link.state == "up")
    finally:
        reader.cancel()
        await asyncio.gather(reader, return_exceptions=True)


async def test_an_error_that_nobody_thought_of_is_the_state_of_its_link(monkeypatch: pytest.MonkeyPatch) -> None:
    async def broken(*args: Any) -> Endpoint:
        raise RuntimeError("can't start\nnew thread")

    link = ReconnectingLink("gnss", "serial:/dev/null:9600", config(), Clock(), deque())
    with monkeypatch.context() as patched:
        patched.setattr("asvhil.links.reconnecting.open_endpoint", broken)
        reader = asyncio.create_task(link.run())
        await until(lambda: link.state == "serial:/dev/null:9600: can't start new thread")
        assert not reader.done()
        reader.cancel()
        await asyncio.gather(reader, return_exceptions=True)


async def test_a_flooded_inbox_drops_the_oldest_and_counts() -> None:
    clock, inbox = Clock(), deque[Frame]()
    inbox.extend(Frame(t_ns=0, port="operator", data=b"old") for _ in range(INBOX_FRAMES))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    link = ReconnectingLink("operator", f"udpin:127.0.0.1:{port}", config(), clock, inbox)
    reader = asyncio.create_task(link.run())
    try:
        await until(lambda: link.state == "up")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"new", ("127.0.0.1", port))
            await until(lambda: inbox[-1].data == b"new")
        assert len(inbox) == INBOX_FRAMES and link.overflowed == 1
    finally:
        reader.cancel()
        await asyncio.gather(reader, return_exceptions=True)


async def test_commands_to_a_link_that_is_down_are_dropped_and_counted() -> None:
    link = ReconnectingLink("autopilot", "tcp:127.0.0.1:1", config(), Clock(), deque())
    await link.send(Frame(t_ns=0, port="autopilot", data=b"x"))
    assert link.unsent == 1


def test_ignored_checksums_stop_the_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAV_IGNORE_CRC", "1")
    settings = config()
    with recorder_at(settings, tmp_path / "log.mcap") as recorder, pytest.raises(AsvhilError, match="MAV_IGNORE_CRC"):
        Daemon(settings, recorder, Clock())
