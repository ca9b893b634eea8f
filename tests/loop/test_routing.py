"""The daemon between an autopilot and ground stations on real sockets: routing, signatures, slow and dead links."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from pathlib import Path

import pytest

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect, message_id, source
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Phase
from tests.support.ports import free_port
from tests.support.routing import GCS_HEARTBEAT, HEARTBEAT, Peer, Running, config, peer, router
from tests.support.waiting import until

pytestmark = pytest.mark.real_time


async def test_a_ground_station_reaches_the_autopilot_and_the_daemon(tmp_path: Path) -> None:
    autopilot_port, qgc_port, dashboard_port = free_port(), free_port(), free_port()
    settings = config(
        f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
        f"links.ground_stations.qgc.endpoint=udpin:127.0.0.1:{qgc_port}",
        f"links.ground_stations.dashboard.endpoint=udpout:127.0.0.1:{dashboard_port}",
        "links.ground_stations.dashboard.allow_out=[HEARTBEAT, COMMAND_LONG]",
        f"links.ground_stations.gone.endpoint=tcp:127.0.0.1:{free_port(socket.SOCK_STREAM)}",
    )
    log = tmp_path / "log.mcap"
    async with (
        peer(f"udpin:127.0.0.1:{dashboard_port}", 254, 190) as dashboard,
        Running(settings, log) as running,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot,
        peer(f"udpout:127.0.0.1:{qgc_port}", 255, 190) as qgc,
    ):

        async def talk() -> None:
            await autopilot.say(HEARTBEAT)
            await autopilot.say(dialect.MAVLink_attitude_message(1, 0, 0, 0.5, 0, 0, 0))
            await qgc.say(GCS_HEARTBEAT)

        def met() -> bool:
            return bool(
                qgc.named("ATTITUDE")
                and any(source(frame) == (255, 190) for frame in autopilot.frames)
                and any(source(frame) == (1, 191) for frame in qgc.frames)
                and any(source(frame) == (255, 190) for frame in dashboard.frames)
            )

        await until(met, meanwhile=talk)
        asked = await qgc.say(dialect.MAVLink_param_request_list_message(1, 1))
        await until(lambda: asked in autopilot.frames)  # unchanged, to the byte
        value = await autopilot.say(dialect.MAVLink_param_value_message(b"RC1_DZ", 30.0, 2, 1, 0))
        answered = await autopilot.say(dialect.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190))
        await qgc.say_raw(encode_hold(settings.links.autopilot, None, None, None))
        await until(lambda: value in qgc.frames and answered in qgc.frames and bool(qgc.named("STATUSTEXT")))
        acks = [(m.command, m.result) for m in qgc.named("COMMAND_ACK") if m.get_srcComponent() == 191]
        assert acks == [(dialect.MAV_CMD_DO_REPOSITION, dialect.MAV_RESULT_TEMPORARILY_REJECTED)]
        assert {message_id(frame) for frame in dashboard.frames} == {0}
        assert asked not in dashboard.frames and answered not in dashboard.frames
        assert value not in autopilot.frames and HEARTBEAT not in autopilot.frames
        assert "refused" in running.links["ground.gone"]
        assert running.links["ground.qgc"] == "up"
        assert running.outputs is not None and running.outputs.health.link_ok
    assert asked in [frame.data for frame in LogFile(log).frames("autopilot", "forwarded")]
    assert replay(log).mismatch is None


async def test_slow_and_dead_links_do_not_delay_the_others(tmp_path: Path) -> None:
    autopilot_port, fast_port, slow_port = free_port(), free_port(), free_port(socket.SOCK_STREAM)
    settings = config(
        f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
        f"links.ground_stations.fast.endpoint=udpin:127.0.0.1:{fast_port}",
        f"links.ground_stations.slow.endpoint=tcpin:127.0.0.1:{slow_port}",
    )
    flood = 12_000
    async with (
        Running(settings, tmp_path / "log.mcap") as running,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot,
        peer(f"udpout:127.0.0.1:{fast_port}", 255, 190) as fast,
    ):
        await until(
            lambda: bool(fast.frames),
            meanwhile=lambda: asyncio.gather(autopilot.say(HEARTBEAT), fast.say(GCS_HEARTBEAT)),
        )
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as sloth:
            sloth.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            sloth.connect(("127.0.0.1", slow_port))
            before = len(fast.frames)
            text = dialect.MAVLink_statustext_message(6, b"x" * 50)
            for _ in range(flood // 100):
                for _ in range(100):
                    await autopilot.say(text)
                await asyncio.sleep(0.004)
            await until(lambda: len(fast.frames) - before >= flood)
            assert "forwarded frames found no room" in running.links["ground.slow"]
            assert running.links["ground.fast"] == "up"


async def test_the_other_links_work_while_the_autopilots_cable_is_unplugged(tmp_path: Path) -> None:
    """Hot unplug of the serial line: ground stations keep the daemon, and have the vehicle again once it is back."""
    cable, qgc_port = tmp_path / "cable", free_port()
    settings = config(
        f"links.autopilot.endpoint=serial:{cable}:115200",
        f"links.ground_stations.qgc.endpoint=udpin:127.0.0.1:{qgc_port}",
        "links.reconnect_max_s=0.4",
    )
    async with (
        Running(settings, tmp_path / "log.mcap") as running,
        peer(f"udpout:127.0.0.1:{qgc_port}", 255, 190) as qgc,
    ):

        def from_component(component_id: int) -> list[bytes]:
            return [frame for frame in qgc.frames if source(frame) == (1, component_id)]

        for _ in range(2):
            async with peer(f"pty:{cable}", 1, 1) as autopilot:
                qgc.frames.clear()
                autopilot.frames.clear()
                await until(
                    lambda: running.links.get("autopilot", "").startswith("up") and bool(from_component(1)),
                    meanwhile=lambda autopilot=autopilot: asyncio.gather(
                        autopilot.say(HEARTBEAT), qgc.say(GCS_HEARTBEAT)
                    ),  # type: ignore[misc]
                )
                asked = await qgc.say(dialect.MAVLink_param_request_list_message(1, 1))
                await until(lambda autopilot=autopilot, asked=asked: asked in autopilot.frames)  # type: ignore[misc]
                assert running.outputs is not None and running.outputs.health.link_ok
            await until(lambda: not running.links["autopilot"].startswith(("up", "connecting")))
            qgc.frames.clear()
            await until(lambda: bool(from_component(191)))
            await qgc.say_raw(encode_hold(settings.links.autopilot, None, None, None))
            await until(lambda: bool(qgc.named("COMMAND_ACK")))
            assert qgc.named("COMMAND_ACK")[0].result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
            assert running.links["ground.qgc"] == "up"
    assert replay(tmp_path / "log.mcap").mismatch is None


async def test_gotos_are_claimed_or_passed_on(tmp_path: Path) -> None:
    autopilot_port, qgc_port = free_port(), free_port()
    for claim in (False, True):
        settings = config(
            f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
            f"links.ground_stations.qgc.endpoint=udpin:127.0.0.1:{qgc_port}",
            f"links.operator.claim_goto={str(claim).lower()}",
        )
        async with (
            Running(settings, tmp_path / f"{claim}.mcap"),
            peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot,
            peer(f"udpout:127.0.0.1:{qgc_port}", 255, 190) as qgc,
        ):

            async def talk(autopilot: Peer = autopilot, qgc: Peer = qgc) -> None:
                await autopilot.say(HEARTBEAT)
                await qgc.say(GCS_HEARTBEAT)

            await until(lambda qgc=qgc: {source(f) for f in qgc.frames} >= {(1, 1), (1, 191)}, meanwhile=talk)  # type: ignore[misc]
            goto = await qgc.say(
                dialect.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, 0, 404237000, -869212000, 0)
            )
            arm = await qgc.say(dialect.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
            await until(lambda autopilot=autopilot, arm=arm: arm in autopilot.frames)  # type: ignore[misc]
            assert (goto in autopilot.frames) is not claim
            if claim:
                await until(lambda qgc=qgc: bool(qgc.named("COMMAND_ACK")))  # type: ignore[misc]
                (ack,) = qgc.named("COMMAND_ACK")
                assert (ack.command, ack.get_srcComponent()) == (192, 1)
                assert ack.result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
            else:
                await asyncio.sleep(0.3)
                assert qgc.named("COMMAND_ACK") == []


async def test_others_wait_for_a_congested_serial_line_and_the_override_does_not(tmp_path: Path) -> None:
    """A serial line that takes no more: what a ground station says is left out, so that ours finds the way free."""
    master_fd, slave_fd = os.openpty()
    os.set_blocking(master_fd, False)
    qgc_port = free_port()
    settings = config(
        f"links.autopilot.endpoint=serial:{os.ttyname(slave_fd)}:57600",
        f"links.ground_stations.qgc.endpoint=udpin:127.0.0.1:{qgc_port}",
    )
    try:
        async with (
            Running(settings, tmp_path / "log.mcap") as running,
            peer(f"udpout:127.0.0.1:{qgc_port}", 255, 190) as qgc,
        ):
            await until(lambda: running.links.get("autopilot") == "up")
            for _ in range(40):
                for _ in range(50):
                    await qgc.say(dialect.MAVLink_statustext_message(6, b"y" * 50))
                await asyncio.sleep(0.01)
            await until(lambda: "forwarded frames found no room" in running.links["autopilot"])
            endpoint = running.daemon.links["autopilot"]._endpoint
            assert endpoint is not None and endpoint.congested and endpoint.unsent == 0
            assert endpoint._stream.pending_bytes < 2000  # type: ignore[attr-defined]
    finally:
        os.close(master_fd)
        os.close(slave_fd)


async def test_only_the_named_senders_are_listened_to(tmp_path: Path) -> None:
    autopilot_port = free_port()
    settings = config(f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}", "links.autopilot.senders=['1/1']")
    async with (
        Running(settings, tmp_path / "log.mcap") as running,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 2) as other,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot,
    ):
        await until(
            lambda: "of other senders" in running.links.get("autopilot", ""), meanwhile=lambda: other.say(HEARTBEAT)
        )
        assert running.outputs is not None and not running.outputs.health.link_ok
        await until(lambda: running.outputs.health.link_ok, meanwhile=lambda: autopilot.say(HEARTBEAT))


def test_an_override_of_somebody_else_takes_the_boat_from_us() -> None:
    """A forwarded override that the autopilot obeys shows in its channels, and the supervisor lets go."""
    settings = config()
    loop = Lockstep(settings)
    held_ns: int | None = None
    for _ in range(400):
        _, outputs = loop.tick()
        if outputs.phase is Phase.HOLD:
            held_ns = outputs.t_ns if held_ns is None else held_ns
            if outputs.t_ns > held_ns + 3_000_000_000:
                break
    assert outputs.phase is Phase.HOLD
    pirate = dialect.MAVLink(None, srcSystem=settings.plant.frontseat.mygcs_system_id, srcComponent=190)
    message = dialect.MAVLink_rc_channels_override_message(1, 1, 1900, 65535, 1100, *[65535] * 5)
    for _ in range(60):
        loop.plant.frontseat.receive(
            Frame(t_ns=loop.t_ns + 1_000_000, port="autopilot", data=bytes(message.pack(pirate)))
        )
        _, outputs = loop.tick()
        if outputs.phase is Phase.STANDBY:
            break
    assert outputs.phase is Phase.STANDBY and outputs.health.code == Reason.OVERRIDE_NOT_FOLLOWED


def test_messages_that_do_not_exist(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"key links\.ground_stations\.qgc\.block_out: no MAVLink message .* ATTITUDE\?"
    ):
        router(
            tmp_path,
            "links.ground_stations.qgc.endpoint=udpin:127.0.0.1:0",
            "links.ground_stations.qgc.block_out=[ATITUDE]",
        )


async def test_ticks_are_cut_when_something_is_heard(tmp_path: Path) -> None:
    autopilot_port = free_port()
    settings = config(
        f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
        "daemon.cut_on=arrival",
        "daemon.tick_hz=10",
        "daemon.control_hz=10",
    )
    log = tmp_path / "log.mcap"
    async with Running(settings, log) as running, peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot:
        start_s = time.monotonic()

        async def talk() -> None:
            for _ in range(10):
                await autopilot.say(HEARTBEAT)
                await asyncio.sleep(0.01)

        # Twice what the timer alone would give.
        await until(lambda: running.daemon.ticks > 20 + 2 * 10 * (time.monotonic() - start_s), meanwhile=talk)
    assert replay(log).mismatch is None
