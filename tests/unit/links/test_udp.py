"""UDP endpoints: whom they answer, how many peers they remember, and peers that come and go."""

from __future__ import annotations

import asyncio
import random
import socket
from pathlib import Path

import pytest

from asvhil.links.endpoint import open_endpoint
from asvhil.links.udp import NEWCOMER_NS, UdpIn
from tests.support.endpoints import Clock, pair, recv_soon, run

pytestmark = pytest.mark.real_time


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


def test_udpin_lets_nobody_take_the_place_of_a_peer_that_is_proven(tmp_path: Path) -> None:
    """A flood of datagrams by many addresses cut the motors' commands off for seconds."""

    async def body() -> None:
        near = await open_endpoint("udpin:127.0.0.1:0", "near", Clock())
        assert isinstance(near, UdpIn)
        boat = await open_endpoint(f"udpout:{near.address}", "boat", Clock())
        await boat.send(b"frame")
        near.note_proven((await near.recv()).peer)
        callers = [await open_endpoint(f"udpout:{near.address}", str(i), Clock()) for i in range(20)]
        for caller in callers:
            await caller.send(b"\0")
            await near.recv()
        await near.send(b"motors")
        assert await recv_soon(boat) == b"motors"
        assert not any(caller._frames for caller in callers)  # type: ignore[attr-defined]
        handover = near.handover()
        assert handover is not None and len(handover.peers) == 1
        for link in [near, boat, *callers]:
            await link.close()

    run(body)


def test_udpin_answers_a_newcomers_first_datagram_beside_sixteen_peers_that_are_proven(tmp_path: Path) -> None:
    """Each `asvhil hold` is several peers: after some of them every first answer was lost, and the request repeated."""

    async def body() -> None:
        near = await open_endpoint("udpin:127.0.0.1:0", "near", Clock())
        assert isinstance(near, UdpIn)
        callers = [await open_endpoint(f"udpout:{near.address}", str(i), Clock()) for i in range(40)]
        for caller in callers:
            await caller.send(b"question")
            peer = (await near.recv()).peer
            near.note_proven(peer)
            await near.send(b"answer", peer)
            assert await recv_soon(caller) == b"answer"
        assert len(near._peers) <= 17
        for link in [near, *callers]:
            await link.close()

    run(body)


def test_udpin_answers_a_newcomer_whom_peers_that_are_proven_talk_over(tmp_path: Path) -> None:
    async def body() -> None:
        near = await open_endpoint("udpin:127.0.0.1:0", "near", Clock())
        assert isinstance(near, UdpIn)
        now_ns = near._now_ns()
        for number in range(16):
            near._heard(f"proven {number}", ("127.0.0.1", 9), now_ns)
            near.note_proven(f"proven {number}")
        newcomer = await open_endpoint(f"udpout:{near.address}", "newcomer", Clock())
        await newcomer.send(b"question")
        frame = await near.recv()

        def talk(late_ns: int) -> None:
            for number in range(16):
                near._heard(f"proven {number}", ("127.0.0.1", 9), frame.t_ns + late_ns)

        talk(NEWCOMER_NS - 1)
        await near.send(b"answer", frame.peer)
        assert await recv_soon(newcomer) == b"answer"
        for number in range(40):
            near._heard(f"stranger {number}", ("127.0.0.1", 9), frame.t_ns)
            talk(0)
            assert len(near._peers) == 17, "one place, for the last one"
            assert f"stranger {number}" in near._peers
        talk(NEWCOMER_NS)
        assert list(near._peers) == [f"proven {number}" for number in range(16)]
        for link in (near, newcomer):
            await link.close()

    run(body)


def test_udpin_that_was_flooded_before_still_finds_its_peer(tmp_path: Path) -> None:
    async def body() -> None:
        near = await open_endpoint("udpin:127.0.0.1:0", "near", Clock())
        assert isinstance(near, UdpIn)
        boat = await open_endpoint(f"udpout:{near.address}", "boat", Clock())
        await boat.send(b"frame")
        peer = (await near.recv()).peer
        for number in range(20):
            near._heard(f"127.0.0.1:{number + 1}", ("127.0.0.1", 9), near._now_ns())
        near.note_proven(peer)  # it was pushed out before its frame was looked at
        await boat.send(b"frame")
        await near.recv()
        await near.send(b"motors")
        assert await recv_soon(boat) == b"motors"
        for link in (near, boat):
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
