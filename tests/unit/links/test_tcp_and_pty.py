"""The TCP server, serial ports and pseudo-terminals: who is served, and what a stale reader finds."""

from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path

import pytest

from asvhil.errors import LinkError
from asvhil.links.endpoint import open_endpoint
from tests.support.endpoints import Clock, pair, recv_exactly, run
from tests.support.waiting import until

pytestmark = pytest.mark.real_time


def test_tcpin_serves_the_newest_client(tmp_path: Path) -> None:
    async def body() -> None:
        near, old = await pair("tcp", tmp_path)
        new = await open_endpoint(f"tcp:{near.address}", "new", Clock())
        with pytest.raises(LinkError):
            await asyncio.wait_for(old.recv(), 1.0)
        await near.send(b"for the new one")
        assert await recv_exactly(new, 15) == b"for the new one"
        await new.close()
        await old.close()
        await asyncio.sleep(0.02)
        await near.send(b"nobody there")
        assert near.unsent == 1
        await near.close()

    run(body)


def test_pty_gives_nothing_stale_to_the_next_reader(tmp_path: Path) -> None:
    async def body() -> None:
        link = await open_endpoint(f"pty:{tmp_path}/wind", "wind", Clock())
        await link.send(b"before anybody")
        assert link.unsent == 1
        for i in range(10):
            fd = os.open(tmp_path / "wind", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            await link.send(b"fresh %d" % i)
            got = b""
            while len(got) < 7:
                try:
                    got += os.read(fd, 100)
                except BlockingIOError:
                    await asyncio.sleep(0.001)
            assert got == b"fresh %d" % i
            os.write(fd, b"bye\r\n")  # raw mode: no translation, no echo
            await link.send(b"left unread")
            os.close(fd)
            assert await recv_exactly(link, 5) == b"bye\r\n"
            await until(lambda: link._stream is None, pause_s=0.001)  # type: ignore[attr-defined]
            await link.send(b"stale")
        assert link.unsent == 11
        cpu_s = time.process_time()
        await asyncio.sleep(0.1)
        assert time.process_time() - cpu_s < 0.05
        await link.close()
        await asyncio.sleep(0.03)
        assert link._timer is None  # type: ignore[attr-defined]

    run(body)


def test_a_wake_up_of_a_serial_port_without_data_is_not_an_unplug(tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair("serial", tmp_path)
        far._stream._readable()  # type: ignore[attr-defined]
        await near.send(b"still here")
        assert await recv_exactly(far, 10) == b"still here"
        await near.close()
        await far.close()

    run(body)


def test_pty_symlink_replaces_a_dead_one_and_goes_only_if_it_is_ours(tmp_path: Path) -> None:
    async def body() -> None:
        path = tmp_path / "anemometer"
        path.symlink_to("/dev/pts/does-not-exist")
        first = await open_endpoint(f"pty:{path}", "a", Clock())
        assert os.readlink(path) == first.address and os.listdir(tmp_path) == ["anemometer"]
        second = await open_endpoint(f"pty:{path}", "b", Clock())
        await first.close()
        assert os.readlink(path) == second.address
        await second.close()
        assert os.listdir(tmp_path) == []
        path.write_text("a file of the user's")
        with pytest.raises(LinkError, match="not a symlink"):
            await open_endpoint(f"pty:{path}", "c", Clock())
        assert path.read_text() == "a file of the user's"

    run(body)
