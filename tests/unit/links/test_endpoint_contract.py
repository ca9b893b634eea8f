"""One contract for every kind of link, on real sockets, pseudo terminals and memory; loopback and free ports only."""

from __future__ import annotations

import asyncio
import os
import random
import socket
import struct
import time
import tty
from collections.abc import Callable
from pathlib import Path

import pytest

from asvhil.errors import LinkError
from asvhil.links.endpoint import Endpoint, open_endpoint
from tests.support.endpoints import DATAGRAMS, Clock, both_ways, ends, every_kind, pair, recv_exactly, recv_soon, run

pytestmark = pytest.mark.real_time
QUEUE_BYTES = 512 * 1024
SEND_BYTES = 256 * 1024


# --- bytes ------------------------------------------------------------------------------------------------------------


@every_kind
def test_bytes_arrive_unchanged_and_in_order_both_ways_at_once(kind: str, tmp_path: Path) -> None:
    async def pump(sender: Endpoint, receiver: Endpoint, seed: int) -> None:
        rng = random.Random(seed)
        sends = [rng.randbytes(rng.randrange(1, 1400)) for _ in range(900)] + [bytes(range(256))]
        whole = b"".join(sends)
        got = bytearray()

        async def write() -> None:
            sent = 0
            for data in sends:
                await sender.send(data)
                sent += len(data)
                while sent - len(got) > 32_000:
                    await asyncio.sleep(0)

        async def read() -> None:
            frames = 0
            while len(got) < len(whole):
                frame = await recv_soon(receiver)
                if kind in DATAGRAMS:
                    assert frame == sends[frames]
                else:
                    assert len(frame) <= 4096
                frames += 1
                got.extend(frame)

        await asyncio.gather(write(), read())
        assert bytes(got) == whole
        assert receiver.dropped == 0 and sender.unsent == 0

    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        await asyncio.gather(pump(near, far, 1), pump(far, near, 2))
        await near.close()
        await far.close()

    run(body)


@both_ways
def test_frames_are_stamped_on_arrival_with_the_clock_handed_in(kind: str, direction: str, tmp_path: Path) -> None:
    async def body() -> None:
        clock = Clock()
        near, far = await pair(kind, tmp_path, clock)
        sender, receiver = ends(near, far, direction)
        clock.t_ns = 5_000_000_007
        await sender.send(b"\xfd\x09\x00")
        await asyncio.sleep(0.05)
        clock.t_ns = 9_000_000_000
        frame = await asyncio.wait_for(receiver.recv(), 2.0)
        assert (frame.t_ns, frame.data) == (5_000_000_007, b"\xfd\x09\x00")
        assert frame.port == ("far" if direction == "outward" else "near")
        if kind.startswith("udp"):
            host, _, number = frame.peer.rpartition(":")
            assert host == ("[::1]" if kind == "udp6" else "127.0.0.1") and int(number) > 0
        else:
            assert frame.peer == ""
        await near.close()
        await far.close()

    run(body)


@pytest.mark.parametrize("kind", ["udp", "udp6", "memory"])
def test_datagrams_stay_whole_and_empty_sends_are_nothing(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        for size in (1, 279, 1400, 9000, 65000):
            data = random.Random(size).randbytes(size)
            await far.send(b"")
            await far.send(data)
            assert await recv_soon(near) == data
            await near.send(data)
            assert await recv_soon(far) == data
        await near.close()
        await far.close()

    run(body)


def test_a_cancelled_recv_loses_nothing(tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair("udp", tmp_path)
        for i in range(50):
            reading = asyncio.create_task(near.recv())
            await asyncio.sleep(0)
            await far.send(bytes([i]))
            if i % 2:
                await asyncio.sleep(0.001)
            reading.cancel()
            try:
                data = (await reading).data
            except asyncio.CancelledError:
                data = await recv_soon(near)
            assert data == bytes([i])
        await near.close()
        await far.close()

    run(body)


# --- going away -------------------------------------------------------------------------------------------------------


@both_ways
def test_close_ends_a_pending_recv_and_is_idempotent(kind: str, direction: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        link, other = ends(near, far, direction)
        pending = asyncio.create_task(link.recv())
        await asyncio.sleep(0.01)
        await asyncio.gather(link.close(), link.close())
        await link.close()
        with pytest.raises(LinkError, match="closed"):
            await asyncio.wait_for(pending, 1.0)
        with pytest.raises(LinkError):
            await asyncio.wait_for(link.recv(), 1.0)
        with pytest.raises(LinkError):
            await link.send(b"late")
        await other.close()

    run(body)


@every_kind
def test_frames_that_were_not_read_are_discarded_by_close(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        await far.send(b"never read")
        await asyncio.sleep(0.02)
        await near.close()
        with pytest.raises(LinkError):
            await asyncio.wait_for(near.recv(), 1.0)
        await far.close()

    run(body)


@pytest.mark.parametrize("kind", ["tcp", "tcp6", "serial", "memory"])
def test_a_link_that_knows_is_lost_within_a_second_of_its_peer(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        pending = asyncio.create_task(far.recv())
        await asyncio.sleep(0.01)
        await near.close()
        with pytest.raises(LinkError) as caught:
            await asyncio.wait_for(pending, 1.0)
        assert str(caught.value).startswith(far.spec + ": ")
        with pytest.raises(LinkError):
            await far.send(b"anyone?")
        await far.close()

    run(body)


@pytest.mark.parametrize("kind", ["tcp", "memory"])
def test_last_words_are_read_before_the_loss(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        await near.send(b"last words")
        await near.close()
        await asyncio.sleep(0.02)
        assert await recv_soon(far) == b"last words"
        with pytest.raises(LinkError):
            await asyncio.wait_for(far.recv(), 1.0)
        await far.close()

    run(body)


@pytest.mark.parametrize("kind", ["udp", "udp6", "tcp", "tcp6", "serial"])
def test_the_waiting_end_survives_its_peer_and_serves_the_next(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        call = {"udp": "udpout", "tcp": "tcp", "serial": "serial"}[kind.rstrip("6")]
        where = f"{tmp_path}/port:9600" if kind == "serial" else near.address
        for i in range(5):
            await far.close()
            await near.send(b"into the void")
            await asyncio.sleep(0.03 * (i % 2))
            far = await open_endpoint(f"{call}:{where}", "far", Clock())
            await far.send(b"back")
            assert await recv_exactly(near, 4) == b"back"
            await near.send(b"welcome")
            assert await recv_exactly(far, 7) == b"welcome"
        await far.close()
        await near.close()

    run(body)


# --- too much ---------------------------------------------------------------------------------------------------------


@both_ways
def test_a_megabyte_that_nobody_reads_stays_bounded(kind: str, direction: str, tmp_path: Path) -> None:
    async def body() -> None:
        near, far = await pair(kind, tmp_path)
        sender, receiver = ends(near, far, direction)
        noise = random.Random(3).randbytes(1_000_000)
        for i in range(0, len(noise), 200):
            await sender.send(noise[i : i + 200])
            if i % 8_000 == 0:
                await asyncio.sleep(0.0005 if kind == "serial" else 0)
        await asyncio.sleep(0.1)
        await sender.send(b"last")
        await asyncio.sleep(0.1)
        assert receiver.dropped > 0
        kept, frames = b"", 0
        while not kept.endswith(b"last"):
            kept += await recv_soon(receiver)
            frames += 1
        assert len(kept) <= QUEUE_BYTES and frames <= 4096
        assert kept[-1004:] == noise[-1000:] + b"last"
        await near.close()
        await far.close()

    run(body)


async def stuck(kind: str, folder: Path) -> tuple[Endpoint, int, Callable[[], None]]:
    """A link whose other end is a bare descriptor that nobody reads; and how to close it."""
    if kind == "pty":
        link = await open_endpoint(f"pty:{folder}/port", "near", Clock())
        fd = os.open(f"{folder}/port", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        return link, fd, lambda: os.close(fd)
    if kind == "serial":
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        link = await open_endpoint(f"serial:{os.ttyname(slave)}:115200", "far", Clock())
        os.close(slave)
        return link, master, lambda: os.close(master)
    if kind == "tcpin":
        link = await open_endpoint("tcpin:127.0.0.1:0", "near", Clock())
        peer = socket.create_connection(("127.0.0.1", int(link.address.rpartition(":")[2])))
        peer.sendall(b"x")
        await recv_soon(link)
    else:
        with socket.create_server(("127.0.0.1", 0)) as server:
            link = await open_endpoint(f"tcp:127.0.0.1:{server.getsockname()[1]}", "far", Clock())
            peer, _ = server.accept()
    peer.setblocking(False)
    return link, peer.fileno(), peer.close


@pytest.mark.parametrize("kind", ["tcp", "tcpin", "serial", "pty"])
def test_a_reader_too_slow_costs_whole_sends_never_memory_or_time(kind: str, tmp_path: Path) -> None:
    async def body() -> None:
        link, fd, close_fd = await stuck(kind, tmp_path)
        count, size = 20_000, 1_000  # 20 MB: more than any kernel buffer on the way
        longest_s = 0.0
        for i in range(count):
            started_s = time.monotonic()
            await link.send(struct.pack("<I", i) + bytes([i % 251]) * (size - 4))
            longest_s = max(longest_s, time.monotonic() - started_s)
            if i % 100 == 0:
                await asyncio.sleep(0)
        assert longest_s < 0.5
        stream = link._stream  # type: ignore[attr-defined]
        assert stream.pending_bytes <= SEND_BYTES
        assert link.unsent > 0
        # An idle loop on a stuck link sleeps.
        cpu_s = time.process_time()
        await asyncio.sleep(0.1)
        assert time.process_time() - cpu_s < 0.05
        # Now the reader wakes up: it finds whole records, in order, up to the very last.
        got = bytearray()
        while not (len(got) >= size and got[-size:-996] == struct.pack("<I", count - 1)):
            try:
                got += os.read(fd, 65536)
            except BlockingIOError:
                await asyncio.sleep(0.001)
        assert len(got) % size == 0
        numbers = []
        for at in range(0, len(got), size):
            (i,) = struct.unpack_from("<I", got, at)
            assert got[at + 4 : at + size] == bytes([i % 251]) * (size - 4)
            numbers.append(i)
        assert numbers == sorted(set(numbers))
        assert len(numbers) + link.unsent == count
        await link.close()
        close_fd()

    run(body)


def test_a_stuck_serial_port_closes_within_a_second(tmp_path: Path) -> None:
    async def body() -> None:
        link, _, close_fd = await stuck("serial", tmp_path)
        for _ in range(1000):
            await link.send(bytes(100))
        pending = asyncio.create_task(link.recv())
        await asyncio.sleep(0)
        started_s = time.monotonic()
        await link.close()
        assert time.monotonic() - started_s < 1.0
        with pytest.raises(LinkError):
            await pending
        assert link.unsent > 0
        close_fd()

    run(body)
