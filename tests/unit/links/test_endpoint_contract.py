"""One contract for every kind of link, on real sockets, pseudo terminals and memory; loopback and free ports only."""

from __future__ import annotations

import asyncio
import gc
import os
import random
import socket
import struct
import time
import tty
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.errors import ConfigError, LinkError
from asvhil.links.endpoint import Endpoint, memory_pair, open_endpoint, parse_spec
from tests.support.waiting import until

pytestmark = pytest.mark.real_time

KINDS = ["udp", "udp6", "tcp", "tcp6", "serial", "memory"]
DATAGRAMS = {"udp", "udp6", "memory"}
QUEUE_BYTES = 512 * 1024
SEND_BYTES = 256 * 1024


class Clock:
    """A clock that a test sets; it notes each time it was read."""

    def __init__(self, t_ns: int = 1_000) -> None:
        self.t_ns = t_ns
        self.reads = 0

    def __call__(self) -> int:
        self.reads += 1
        return self.t_ns


def run(body: Callable[[], Awaitable[None]]) -> None:
    """Run a test's coroutine; whatever asyncio complains about, also while objects are collected, fails the test."""
    noise: list[str] = []

    async def guarded() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: noise.append(str(context)))
        await asyncio.wait_for(body(), 10.0)
        assert asyncio.all_tasks() == {asyncio.current_task()}

    asyncio.run(guarded())
    gc.collect(1)  # what a test leaves is young
    assert not noise


async def recv_soon(link: Endpoint, timeout_s: float = 2.0) -> bytes:
    return (await asyncio.wait_for(link.recv(), timeout_s)).data


async def recv_exactly(link: Endpoint, n: int) -> bytes:
    data = b""
    while len(data) < n:
        data += await recv_soon(link)
    return data


async def pair(kind: str, folder: Path, clock: Callable[[], int] = Clock()) -> tuple[Endpoint, Endpoint]:  # noqa: B008
    """Two ends of a link that have met: the first is named "near" and waits or serves, the second "far" calls."""
    if kind == "memory":
        return memory_pair("near", "far", clock)
    host = "[::1]" if kind.endswith("6") else "127.0.0.1"
    if kind == "serial":
        near = await open_endpoint(f"pty:{folder}/port", "near", clock)
        far_spec = f"serial:{folder}/port:115200"
    else:
        call, serve = ("udpout", "udpin") if kind.startswith("udp") else ("tcp", "tcpin")
        near = await open_endpoint(f"{serve}:{host}:0", "near", clock)
        far_spec = f"{call}:{near.address}"
    far = await open_endpoint(far_spec, "far", clock)
    await far.send(b"hello")
    assert await recv_exactly(near, 5) == b"hello"
    return near, far


def ends(near: Endpoint, far: Endpoint, direction: str) -> tuple[Endpoint, Endpoint]:
    return (near, far) if direction == "outward" else (far, near)


def every_kind(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("kind", KINDS)(test)


def both_ways(test: Callable[..., None]) -> Callable[..., None]:
    return pytest.mark.parametrize("direction", ["outward", "inward"])(every_kind(test))


# --- bytes ------------------------------------------------------------------------------------------------


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


# --- going away -------------------------------------------------------------------------------------------


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


# --- too much ---------------------------------------------------------------------------------------------


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


# --- UDP --------------------------------------------------------------------------------------------------


def test_udpin_answers_the_asker_and_tells_the_rest_to_all(tmp_path: Path) -> None:
    async def body() -> None:
        near, autopilot = await pair("udp", tmp_path)
        station = await open_endpoint(f"udpout:{near.address}", "station", Clock())
        await station.send(b"who?")
        asked = await near.recv()
        await near.send(b"me", asked.peer)
        assert await recv_soon(station) == b"me"
        await near.send(b"to all")
        assert await recv_soon(station) == b"to all"
        assert await recv_soon(autopilot) == b"to all"  # and not b"me" before it
        await near.send(b"nobody", "127.0.0.1:9")
        assert near.unsent == 1
        for link in (near, autopilot, station):
            await link.close()

    run(body)


def test_udpin_is_not_disturbed_by_a_garbage_peer(tmp_path: Path) -> None:
    async def body() -> None:
        near, autopilot = await pair("udp", tmp_path)
        garbage = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        garbage.connect(("127.0.0.1", int(near.address.rpartition(":")[2])))
        rng = random.Random(4)
        heard: dict[str, list[bytes]] = {}
        for i in range(30):
            garbage.send(rng.randbytes(rng.randrange(0, 300)))
            await autopilot.send(b"\xfd" + bytes([i]))
            while b"\xfd" + bytes([i]) not in heard.get(autopilot_name(heard), []):
                frame = await asyncio.wait_for(near.recv(), 2.0)
                heard.setdefault(frame.peer, []).append(frame.data)
        assert heard[autopilot_name(heard)] == [b"\xfd" + bytes([i]) for i in range(30)]
        garbage.close()  # from now on, sends to it come back as ICMP errors
        for i in range(5):
            await near.send(bytes([i]))
            assert await recv_soon(autopilot) == bytes([i])
        await near.close()
        await autopilot.close()

    def autopilot_name(heard: dict[str, list[bytes]]) -> str:
        return next((peer for peer, data in heard.items() if b"\xfd\x00" in data), "")

    run(body)


def test_udpin_counts_sends_before_anybody_was_heard_and_after_ten_silent_seconds(tmp_path: Path) -> None:
    async def body() -> None:
        clock = Clock()
        near = await open_endpoint("udpin:127.0.0.1:0", "near", clock)
        await near.send(b"nobody yet")
        assert near.unsent == 1
        far = await open_endpoint(f"udpout:{near.address}", "far", clock)
        await far.send(b"hello")
        peer = (await near.recv()).peer
        clock.t_ns += 10_000_000_000
        await near.send(b"just in time")
        assert await recv_soon(far) == b"just in time"
        clock.t_ns += 1
        await near.send(b"too late")
        assert near.unsent == 2
        await near.send(b"an answer is never too late", peer)
        assert await recv_soon(far) == b"an answer is never too late"
        await near.close()
        await far.close()

    run(body)


def test_udpin_remembers_the_sixteen_latest_peers(tmp_path: Path) -> None:
    async def body() -> None:
        near = await open_endpoint("udpin:127.0.0.1:0", "near", Clock())
        callers = [await open_endpoint(f"udpout:{near.address}", str(i), Clock()) for i in range(18)]
        for i in [*range(16), 0, 16, 17]:  # 0 speaks again, so 1 and 2 are the oldest when 16 and 17 come
            await callers[i].send(b"here")
            await near.recv()
        await near.send(b"all")
        await asyncio.sleep(0.05)
        got = [i for i, caller in enumerate(callers) if caller._frames]  # type: ignore[attr-defined]
        assert got == [0, *range(3, 18)]
        for link in [near, *callers]:
            await link.close()

    run(body)


def test_udpout_survives_a_peer_that_is_not_there_yet_and_one_that_restarts() -> None:
    async def body() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            ip_port = probe.getsockname()[1]
        link = await open_endpoint(f"udpout:127.0.0.1:{ip_port}", "autopilot", Clock())
        for _ in range(2):
            reading = asyncio.create_task(link.recv())
            for _ in range(3):
                await link.send(b"anyone?")
                await asyncio.sleep(0.01)
            assert not reading.done()
            await link.send(b"the ICMP error of this one is pending")
            peer = await open_endpoint(f"udpin:127.0.0.1:{ip_port}", "late", Clock())
            await link.send(b"first that can arrive")
            assert await recv_soon(peer) == b"first that can arrive"
            await peer.send(b"reply")
            assert (await asyncio.wait_for(reading, 2.0)).data == b"reply"
            await peer.close()
        await link.close()

    run(body)


# --- TCP server, pty --------------------------------------------------------------------------------------


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


# --- opening ----------------------------------------------------------------------------------------------


async def refused(spec: str) -> str:
    with pytest.raises(LinkError) as caught:
        await open_endpoint(spec, "x", Clock())
    message = str(caught.value)
    assert message.startswith(spec + ": ") and "\n" not in message
    return message


def test_opening_errors_name_the_spec_and_the_cause(tmp_path: Path) -> None:
    async def body() -> None:
        for kind in ("udpin", "tcpin"):
            holder = await open_endpoint(f"{kind}:127.0.0.1:0", "holder", Clock())
            assert "another program has this port" in await refused(f"{kind}:{holder.address}")
            assert "no interface" in await refused(f"{kind}:192.0.2.1:14560")
            gone = holder.address
            await holder.close()
        assert "no server listens there" in await refused(f"tcp:{gone}")
        for scheme in ("udpin", "udpout", "tcp", "tcpin"):
            assert "does not resolve" in await refused(f"{scheme}:no-such-host.invalid:5760")
            assert "does not resolve" in await refused(f"{scheme}:{'a' * 70}:5760")
        assert "is it plugged in" in await refused(f"serial:{tmp_path}/ttyUSB7:115200")
        (tmp_path / "file").touch()
        await refused(f"serial:{tmp_path}/file:115200")
        assert "symlink" in await refused(f"pty:{tmp_path}/no/such/folder")
        near, far = await pair("serial", tmp_path)
        assert "another program has it open" in await refused(far.spec)
        await near.close()
        await far.close()

    run(body)


@pytest.mark.parametrize(
    ("spec", "fields"),
    [
        ("udpin:0.0.0.0:14560", ("udpin", "0.0.0.0", 14560, "", 0)),
        ("udpin:127.0.0.1:0", ("udpin", "127.0.0.1", 0, "", 0)),
        ("udpout:[::1]:14550", ("udpout", "::1", 14550, "", 0)),
        ("tcp:boat.local:5760", ("tcp", "boat.local", 5760, "", 0)),
        ("tcpin:localhost:65535", ("tcpin", "localhost", 65535, "", 0)),
        ("serial:/dev/ttyACM0:115200", ("serial", "", 0, "/dev/ttyACM0", 115200)),
        ("serial:/dev/by-path/pci-0:00:14.0-port0:57600", ("serial", "", 0, "/dev/by-path/pci-0:00:14.0-port0", 57600)),
        ("serial:anemometer:115200", ("serial", "", 0, "anemometer", 115200)),
        ("pty:run/anemometer", ("pty", "", 0, "run/anemometer", 0)),
    ],
)
def test_good_specs(spec: str, fields: tuple[str, str, int, str, int]) -> None:
    parsed = parse_spec(spec)
    assert (parsed.scheme, parsed.host, parsed.ip_port, parsed.path, parsed.baud) == fields
    assert parsed.text == spec


@pytest.mark.parametrize(
    ("spec", "hint"),
    [
        ("", "udpin:HOST:PORT"),
        ("udp:127.0.0.1:14560", "udpin:HOST:PORT"),
        ("serail:/dev/ttyACM0:115200", "serial:PATH:BAUD"),
        ("/dev/ttyACM0", "serial:PATH:BAUD"),
        ("memory", "pairs"),
        ("memory:x", "pairs"),
        ("udpin:14560", "udpin:HOST:PORT"),
        ("udpin::14560", "udpin:HOST:PORT"),
        ("udpin:127.0.0.1:", "0..65535"),
        ("udpin:127.0.0.1:70000", "0..65535"),
        ("udpin:127.0.0.1:-1", "0..65535"),
        ("udpout:127.0.0.1:0", "1..65535"),
        ("tcp:127.0.0.1:0", "1..65535"),
        ("tcp:127.0.0.1:http", "1..65535"),
        ("tcp:127.0.0.1:1\u0663", "1..65535"),
        ("tcp:::1:5760", "brackets"),
        ("tcp:[::g]:5760", "IPv6"),
        ("tcp:two words:5760", "host name"),
        ("tcp:-x:5760", "host name"),
        ("serial:/dev/ttyACM0", "serial:PATH:BAUD"),
        ("serial::115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0:fast", "baud"),
        ("serial:/dev/ttyACM0:0", "baud"),
        ("/dev/ttyACM0:115200", "serial:PATH:BAUD"),
        ("/dev/ttyACM0,115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0,115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0@115200", "serial:PATH:BAUD"),
        ("serial:/dev/ttyACM0:115200:8N1", "baud"),
        ("serial:/dev/ttyACM0:115200,8N1", "baud"),
        ("serial:/dev/ttyACM0:115_200", "baud"),
        ("serial:/dev/ttyACM0:115200 ", "baud"),
        ("serial:/dev/ttyACM0:1e5", "baud"),
        ("serial:/dev/ttyACM0:115200.0", "baud"),
        ("udpin:[::]", "udpin:HOST:PORT"),
        ("udpin:[::]14550", "udpin"),
        ("udpin:::14550", "brackets"),
        ("udpin:*:14550", "host name"),
        ("udp:[::]:14550", "udpin:HOST:PORT"),
        ("udpin:0.0.0.0:14550,", "0..65535"),
        ("UDPIN:0.0.0.0:14550", "udpin:HOST:PORT"),
        ("pty:", "pty:PATH"),
        ("pty", "pty:PATH"),
        ("pty:a\nb", "control"),
    ],
)
def test_bad_specs(spec: str, hint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_spec(spec)
    message = str(caught.value)
    assert repr(spec) in message and hint in message and "\n" not in message

    async def body() -> None:
        with pytest.raises(ConfigError):
            await open_endpoint(spec, "x", Clock())

    run(body)


@given(
    st.text(max_size=40)
    | st.builds(
        ":".join, st.tuples(st.sampled_from(["udpin", "udpout", "tcp", "tcpin", "serial", "pty"]), st.text(max_size=30))
    )
)
def test_any_text_is_a_spec_or_a_config_error_in_one_line(spec: str) -> None:
    try:
        assert parse_spec(spec).text == spec
    except ConfigError as exc:
        assert len(str(exc).splitlines()) == 1
