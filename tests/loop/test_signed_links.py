"""Signed links between a daemon, an autopilot and ground stations, and keys that cannot be used."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections import Counter
from pathlib import Path

import pytest

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import Parser, dialect
from asvhil.io.mavlink.signing import Signer, SigningClock, derive_key, is_signed, sign, timestamp_of
from asvhil.links.keyfile import read_state
from asvhil.links.operator_client import send_and_wait
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.operator.encoding import encode_release
from tests.support.ports import free_port
from tests.support.routing import HEARTBEAT, KEY_TEXT, Running, config, peer, router
from tests.support.waiting import until

pytestmark = pytest.mark.real_time


async def test_signed_links(tmp_path: Path) -> None:
    key_file, log = tmp_path / "key", tmp_path / "log.mcap"
    key_file.write_text(KEY_TEXT)
    autopilot_port, operator_port = free_port(), free_port()
    settings = config(
        f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot_port}",
        f"links.autopilot.signing={{key_file: {key_file}, link_id: 3}}",
        f"links.operator.endpoint=udpin:127.0.0.1:{operator_port}",
        f"links.operator.signing={{key_file: {key_file}}}",
    )
    key = derive_key(KEY_TEXT)
    signer = Signer(key, 0, SigningClock())
    now_ns = time.time_ns
    good: list[bytes] = []
    async with (
        Running(settings, log) as running,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as autopilot,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as attacker,
    ):
        autopilot.seal = lambda data: signer.sign(data, now_ns())
        evil = attacker.pack(HEARTBEAT)

        async def talk() -> None:
            good.append(await autopilot.say(HEARTBEAT))
            stamp = timestamp_of(now_ns())
            await attacker.say_raw(evil)
            await attacker.say_raw(sign(evil, b"z" * 32, 0, stamp))
            await attacker.say_raw(good[0])
            await attacker.say_raw(sign(evil, key, 0, stamp + 3600 * 100_000))
            await attacker.say_raw(sign(evil, key, 9, stamp - 3600 * 100_000))

        def heard() -> bool:
            return len(good) > 20 and set(running.daemon.router.rejected("autopilot")) == {
                "unsigned",
                "wrongly signed",
                "replayed",
                "future-dated",
                "too old",
            }

        await until(heard, meanwhile=talk)
        assert running.outputs is not None and running.outputs.health.link_ok
        assert "is this computer's clock right?" in running.links["autopilot"]
        words = await asyncio.to_thread(
            send_and_wait,
            encode_release(settings.links.autopilot),
            settings.links.operator.endpoint,
            dialect.MAV_CMD_NAV_GUIDED_ENABLE,
            signing=settings.links.operator.signing,
        )
        assert words == (0, "")
        await until(lambda: len(autopilot.frames) > 8, meanwhile=talk)
    receiver = dialect.MAVLink(None)
    receiver.signing.secret_key, receiver.signing.timestamp = key, timestamp_of(now_ns())
    assert all(is_signed(frame) and frame[-13] == 3 for frame in autopilot.frames)
    assert all(receiver.parse_buffer(frame) for frame in autopilot.frames)
    taken = [data for f in LogFile(log).frames("autopilot", "in") for data in Parser().receive(f.peer, f.data)]
    assert taken == good[-len(taken) :] and len(taken) >= len(good) - 1
    assert not any(is_signed(frame.data) for frame in LogFile(log).frames("autopilot", "out"))
    assert replay(log).mismatch is None
    assert key not in log.read_bytes() and KEY_TEXT.encode() not in log.read_bytes()
    state = read_state(Path(f"{key_file}.autopilot.timestamps"))
    last = int.from_bytes(good[-1][-12:-6], "little")
    assert state.streams == {(1, 1, 0): last} and state.last >= last

    # After a restart, what was recorded before is not heard again.
    async with (
        Running(settings, tmp_path / "second.mcap") as running,
        peer(f"udpout:127.0.0.1:{autopilot_port}", 1, 1) as attacker,
    ):
        rejected: Counter[str] = running.daemon.router.rejected("autopilot")
        old = itertools.cycle(good)
        await until(lambda: rejected["replayed"] > 10, meanwhile=lambda: attacker.say_raw(next(old)))
        assert running.outputs is not None and not running.outputs.health.link_ok


def test_keys_that_cannot_be_used(tmp_path: Path) -> None:
    key = tmp_path / "key"
    override = f"links.autopilot.signing.key_file={key}"
    with pytest.raises(ConfigError, match=f"{key}: the signing key cannot be read"):
        router(tmp_path, override)
    key.write_text("\n")
    with pytest.raises(ConfigError, match=f"{key}: the signing key is empty"):
        router(tmp_path, override)
    key.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match=f"{key}: not text"):
        router(tmp_path, override)
    key.write_text("x" * 5000)
    with pytest.raises(ConfigError, match="too long"):
        router(tmp_path, override)
    key.write_text("secret words")
    key.chmod(0o644)
    made = router(tmp_path, override)
    assert made.warnings == [f"{key}: others may read the signing key; chmod 600 it"]
    key.chmod(0o600)
    assert router(tmp_path, override).warnings == []
    state = tmp_path / "key.autopilot.timestamps"
    assert state.stat().st_mode & 0o777 == 0o600
    for text in (
        "",
        "{",
        '{"last": -1, "streams": {}}',
        '{"last": 1, "streams": {"1/1": 4}}',
        '{"last": 1}',
        "[]",
        "\xe9",
    ):
        state.write_text(text)
        with pytest.raises(ConfigError, match=f"{state}: signing timestamps"):
            router(tmp_path, override)
    with pytest.raises(ConfigError, match="cannot be written"):
        router(tmp_path, override, f"links.autopilot.signing.state_file={tmp_path}/no/such/folder")
