"""The servers over real sockets, a pseudo terminal, and as processes from the command line."""

from __future__ import annotations

import asyncio
import os
import pty
import signal
import socket
import subprocess
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from asvhil.config import Config, load_config
from asvhil.errors import ConfigError, LinkError
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.links.clock import Clock
from asvhil.simplant.hil.server import ArduPilotJsonServer, Px4HilServer
from tests.support.hil_clients import NEUTRAL, JsonAutopilot, Px4, as_ardupilot_reads, serving, servo_frame
from tests.support.ports import free_port

pytestmark = pytest.mark.real_time

FREE = ("plant.hil.neutral_first_s=0", "plant.links.anemometer=null")
FAST = "plant.hil.px4.speed=0"
AHEAD = (1700, 1700)


def config(*overrides: str) -> Config:
    return load_config("sitl", (*FREE, *overrides))


def json_server(*overrides: str) -> ArduPilotJsonServer:
    return ArduPilotJsonServer(config(*overrides), "udpin:127.0.0.1:0", Clock())


def px4_server(*overrides: str) -> Px4HilServer:
    return Px4HilServer(config(*overrides), "tcpin:127.0.0.1:0", Clock())


# --- ArduPilot over UDP -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate_hz", "channels"), [(400, 16), (1200, 16), (1200, 32)])
async def test_lockstep_over_udp(rate_hz: int, channels: int) -> None:
    def client(address: str) -> None:
        with JsonAutopilot(address, rate_hz=rate_hz, channels=channels) as autopilot:
            for count in range(1, 2 * rate_hz + 1):
                state = as_ardupilot_reads(autopilot.frame(AHEAD))
                assert state["timestamp"] == pytest.approx(count / rate_hz, abs=count * 1e-9)
            assert state["velocity"][0] > 0.5

    server = json_server()
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    assert server.backend.counters.frames == 2 * rate_hz
    assert server.backend.counters.duplicates == server.backend.counters.lost == 0


async def test_a_slow_reader_that_sends_frames_again_never_steps_the_boat_twice() -> None:
    """The autopilot waits about a second for an answer that it has not read in time, and then says the same again."""

    def client(address: str) -> None:
        with JsonAutopilot(address) as autopilot:
            autopilot.run(100, AHEAD)
            for _ in range(20):
                autopilot.post(AHEAD)
                replies = [autopilot.resend(), autopilot.recv()]  # both answers wait in the socket
                assert replies[0] == replies[1]
            time.sleep(1.0)
            assert autopilot.resend() == replies[0]
            assert as_ardupilot_reads(autopilot.frame(AHEAD))["timestamp"] == pytest.approx(121 / 400)

    server = json_server()
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    assert (server.backend.counters.frames, server.backend.counters.duplicates) == (121, 21)


async def test_loss_restart_garbage_and_truncated_frames_over_udp() -> None:
    def client(address: str) -> None:
        with JsonAutopilot(address) as autopilot:
            start = as_ardupilot_reads(autopilot.frame(AHEAD))
            autopilot.run(400, AHEAD)
            for data in (b"", b"garbage", servo_frame(7)[:39], servo_frame(7, channels=32)[:-1], bytes(40)):
                autopilot.send(data)
            assert autopilot.silent()
            autopilot.count += 5
            assert as_ardupilot_reads(autopilot.frame(AHEAD))["timestamp"] == pytest.approx(402 / 400)
            autopilot.count = -1
            assert as_ardupilot_reads(autopilot.frame(AHEAD)) == start

    server = json_server()
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    counters = server.backend.counters
    assert (counters.lost, counters.restarts) == (5, 1)
    assert counters.bad >= 4  # an empty datagram is not handed on


async def test_a_server_that_starts_again_goes_on_with_the_same_autopilot() -> None:
    first = json_server()
    async with serving(first) as address:
        autopilot = JsonAutopilot(address)
        await asyncio.to_thread(autopilot.run, 300)
    again = ArduPilotJsonServer(config(), f"udpin:{address}", Clock())
    async with serving(again):
        state = await asyncio.to_thread(autopilot.run, 1)
    assert state["timestamp"] == pytest.approx(1 / 400)
    assert again.backend.counters.lost == 0
    with autopilot:
        pass


async def test_what_the_operator_is_told() -> None:
    server = ArduPilotJsonServer(load_config("sitl", FREE[1:]), "udpin:127.0.0.1:0", Clock())
    assert server.status() == "waits for ArduPilot"
    lines: list[str] = []
    task = asyncio.create_task(server.run(None, lines.append))
    while not server.address:
        await asyncio.sleep(0.01)

    def client() -> None:
        with JsonAutopilot(server.address) as autopilot:
            autopilot.run(10)
            autopilot.resend()
            autopilot.send(b"x")

    await asyncio.to_thread(client)
    for _ in range(100):
        if lines and "1 bad" in lines[-1]:
            break
        await asyncio.sleep(0.05)
    server.stop()
    await task
    assert "moored until the outputs have been neutral" in lines[-1]
    assert "400 Hz, outputs 1500, 1500 us, 1 duplicates, 1 bad (1 bytes where 40" in lines[-1]


# --- PX4 over TCP and a serial line -----------------------------------------------------------------------------


async def test_px4_lockstep_over_tcp() -> None:
    def client(address: str) -> None:
        with Px4.connect(address) as px4:
            px4.boot()
            px4.run(100)
            px4.drive(0.6, 0.6)
            px4.run(900)
            times_us = [sample.time_usec for sample in px4.of("HIL_SENSOR")]
            assert times_us == [4000 * k for k in range(1, len(times_us) + 1)]
            assert len(px4.of("COMMAND_ACK")) == 1 and len(px4.of("HIL_STATE_QUATERNION")) > 700
            assert len(px4.of("HIL_GPS")) >= 20
            assert px4.of("HIL_STATE_QUATERNION")[-1].vx > 50

    server = px4_server(FAST)
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    counters = server.backend.counters
    assert counters.samples - counters.answers <= 2 + counters.unanswered


async def test_px4_that_leaves_and_comes_back_finds_the_boat_at_its_start() -> None:
    def client(address: str) -> list[float]:
        with Px4.connect(address) as px4:
            px4.boot()
            px4.drive(0.6, 0.6)
            px4.run(500)
            return [sample.time_usec for sample in px4.of("HIL_SENSOR")][:500]

    server = px4_server(FAST)
    async with serving(server) as address:
        first = await asyncio.to_thread(client, address)
        for _ in range(100):
            if not server.backend.connected:
                break
            await asyncio.sleep(0.05)
        assert server.status() == "waits for PX4"
        stopped_ns = server.plant.t_ns
        await asyncio.sleep(0.1)
        assert server.plant.t_ns == stopped_ns
        assert await asyncio.to_thread(client, address) == first
    assert server.backend.counters.restarts == 1


async def test_a_rover_that_answers_each_third_sample_gets_on() -> None:
    def client(address: str) -> None:
        with Px4.connect(address, answer_every=3) as px4:
            px4.boot()
            px4.run(600)

    server = px4_server(FAST)
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    assert server.backend.counters.answers >= 200


async def test_px4_garbage_and_pieces_over_tcp() -> None:
    def client(address: str) -> None:
        with Px4.connect(address) as px4:
            px4.send_bytes(bytes(range(0xFD)) * 12)  # no start of a frame in it
            px4.boot()
            px4.run(50)
            message = mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
            data = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1))
            for byte in data:
                px4.send_bytes(bytes([byte]))
            px4.send_bytes(data[:-3])
            px4.run(50)

    server = px4_server(FAST)
    async with serving(server) as address:
        await asyncio.to_thread(client, address)
    assert server.backend.counters.garbage_bytes >= 3000


class SerialSocket:
    """The master end of a pseudo terminal, as far as a client needs a socket."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def settimeout(self, seconds: float) -> None:
        pass

    def sendall(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._fd, data) :]

    def recv(self, size: int) -> bytes:
        return os.read(self._fd, size)

    def close(self) -> None:
        pass


async def test_a_board_on_a_serial_line_in_real_time() -> None:
    """The board waits for heartbeats before it says anything; it has no lockstep."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    speed = termios.tcgetattr(slave)
    speed[4] = speed[5] = termios.B921600
    termios.tcsetattr(slave, termios.TCSANOW, speed)

    def board() -> None:
        splitter, found = FrameSplitter(), []
        while not found:
            found = [decode(frame).get_type() for frame in splitter.receive(os.read(master, 4096))]
        assert found == ["HEARTBEAT"]
        px4 = Px4(SerialSocket(master), lockstep=False)  # type: ignore[arg-type]
        px4.boot()
        px4.drive(0.5, 0.5)
        px4.run(100)

    server = Px4HilServer(config(), f"serial:{os.ttyname(slave)}:921600", Clock())
    os.close(slave)
    try:
        async with serving(server):
            await asyncio.to_thread(board)
            for _ in range(1000):  # the last answers are still on the line
                if server.backend.counters.answers >= 99:
                    break
                await asyncio.sleep(0.01)
    finally:
        os.close(master)
    assert server.backend.counters.answers >= 99 and not server.backend.lockstep
    assert "real time, armed, outputs 1700, 1700 us" in server.status()


# --- links ------------------------------------------------------------------------------------------------------


async def test_sensors_speak_on_their_own_links_in_the_plants_time() -> None:
    server = ArduPilotJsonServer(config(), "udpin:127.0.0.1:0", Clock())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(5.0)
        link = f"udpout:127.0.0.1:{ear.getsockname()[1]}"
        server = ArduPilotJsonServer(config(f"plant.links.anemometer={link}"), "udpin:127.0.0.1:0", Clock())
        async with serving(server) as address:
            with JsonAutopilot(address) as autopilot:
                await asyncio.to_thread(autopilot.run, 400)
                sentences = [ear.recv(200) for _ in range(5)]
    assert all(sentence.startswith(b"$WIMWV,") for sentence in sentences)


async def test_a_port_that_is_taken_is_one_line() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        endpoint = f"udpin:127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(LinkError, match="another program has this port"):
            await ArduPilotJsonServer(config(), endpoint, Clock()).run(1.0)


@pytest.mark.parametrize("endpoint", ["tcpin:127.0.0.1:0", "udpout:127.0.0.1:9002", "serial:/dev/null:57600"])
def test_ardupilot_speaks_on_udp_alone(endpoint: str) -> None:
    with pytest.raises(ConfigError, match="is spoken on udpin here"):
        ArduPilotJsonServer(config(), endpoint, Clock())


@pytest.mark.parametrize(
    ("endpoint", "words"),
    [("udpin:127.0.0.1:1", "is spoken on tcpin or serial or pty here"), ("4560", "unknown kind '4560'")],
)
def test_px4_speaks_on_streams_alone(endpoint: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Px4HilServer(config(), endpoint, Clock())


# --- the command ------------------------------------------------------------------------------------------------


@contextmanager
def command(*arguments: str, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    child = subprocess.Popen(
        [sys.executable, "-m", "asvhil", "plant", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
    )
    try:
        yield child
    finally:
        if child.poll() is None:
            child.kill()
        child.communicate()


def test_the_command_is_the_physics_of_an_ardupilot_until_interrupted(tmp_path: Path) -> None:
    port = free_port(socket.SOCK_DGRAM)
    sets = ("--set", "plant.links.anemometer=null", "--set", f"plant.hil.ardupilot.endpoint=udpin:127.0.0.1:{port}")
    with command("sitl", "--ardupilot-json", *sets, cwd=tmp_path) as child:
        assert child.stdout is not None and child.stderr is not None
        assert child.stdout.readline() == f"wamv16 for ArduPilot's JSON physics interface on udpin:127.0.0.1:{port}\n"
        with JsonAutopilot(f"127.0.0.1:{port}") as autopilot:
            reply = b""
            autopilot.post(NEUTRAL)
            for _ in range(50):  # what is sent before it listens is lost, and said again
                try:
                    reply = autopilot.resend()
                    break
                except (ConnectionRefusedError, TimeoutError):
                    time.sleep(0.1)
            assert as_ardupilot_reads(reply)["timestamp"] == pytest.approx(1 / 400)
        child.send_signal(signal.SIGINT)
        assert child.wait(10.0) == 0
        assert child.stderr.read() == ""


def test_the_command_ends_after_its_duration(tmp_path: Path) -> None:
    endpoint = f"tcpin:127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    sets = ("--set", "plant.links.anemometer=null", "--duration", "0.3", "--quiet")
    with command("sitl", "--px4-hil", "--endpoint", endpoint, *sets, cwd=tmp_path) as child:
        assert child.communicate(timeout=20.0) == ("", "")
        assert child.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--ardupilot-json", "--px4-hil"], "give --ardupilot-json or --px4-hil, not both"),
        (["--endpoint", "udpin:127.0.0.1:9002"], "--endpoint goes with --ardupilot-json or --px4-hil"),
        (["--px4-hil", "--endpoint", "serial:/dev/none:57600"], "no such file or directory"),
        (["--ardupilot-json", "--set", "plant.faults=[{kind: gnss}]"], "plant.faults.0.kind"),
    ],
)
def test_bad_arguments_are_one_line(arguments: list[str], words: str, tmp_path: Path) -> None:
    with command("sitl", *arguments, "--set", "plant.links.anemometer=null", "--quiet", cwd=tmp_path) as child:
        stdout, stderr = child.communicate(timeout=30.0)
    assert child.returncode == 2
    assert words in stderr and stderr.count("\n") == 1 and "Traceback" not in stderr and stdout == ""
