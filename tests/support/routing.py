"""Ground stations and autopilots as peers of a daemon on real sockets."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path

from asvhil.config import Config, load_config
from asvhil.daemon.daemon import Daemon
from asvhil.io.mavlink.frames import Parser, decode, dialect
from asvhil.links.clock import Clock
from asvhil.links.endpoint import Endpoint, open_endpoint
from asvhil.links.router import MavlinkRouter
from asvhil.logs.opening import open_recorder
from asvhil.types import Outputs

KEY_TEXT = "correct horse battery staple"


class Peer:
    """One end of a link in the test: what it hears, frame by frame, and what it says."""

    def __init__(self, link: Endpoint, system_id: int, component_id: int) -> None:
        self._link = link
        self._mav = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        self._parser = Parser()
        self.frames: list[bytes] = []
        self.seal: Callable[[bytes], bytes] = lambda data: data
        self._reader = asyncio.create_task(self._read())

    async def _read(self) -> None:
        while True:
            frame = await self._link.recv()
            self.frames += self._parser.receive(frame.peer, frame.data)

    def pack(self, message) -> bytes:  # type: ignore[no-untyped-def]
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return data

    async def say(self, message) -> bytes:  # type: ignore[no-untyped-def]
        data = self.seal(self.pack(message))
        await self._link.send(data)
        return data

    async def say_raw(self, data: bytes) -> None:
        await self._link.send(data)

    def named(self, name: str) -> list:  # type: ignore[type-arg]
        return [m for m in map(decode, self.frames) if m is not None and m.get_type() == name]

    async def close(self) -> None:
        self._reader.cancel()
        await asyncio.gather(self._reader, return_exceptions=True)
        await self._link.close()


@contextlib.asynccontextmanager
async def peer(spec: str, system_id: int, component_id: int) -> AsyncIterator[Peer]:
    made = Peer(await open_endpoint(spec, "peer", Clock().now_ns), system_id, component_id)
    try:
        yield made
    finally:
        await made.close()


class Running:
    """A daemon in this process, with what its last tick gave."""

    def __init__(self, config: Config, log: Path) -> None:
        self.outputs: Outputs | None = None
        self.links: dict[str, str] = {}
        self._recorder = open_recorder(config, log, "live")
        self.daemon = Daemon(config, self._recorder, Clock(), self._note)

    def _note(self, outputs: Outputs, links: dict[str, str]) -> None:
        self.outputs, self.links = outputs, links

    async def __aenter__(self) -> Running:
        self._task = asyncio.create_task(self.daemon.run(30.0))
        return self

    async def __aexit__(self, *_: object) -> None:
        self.daemon.stop()
        try:
            await self._task
        finally:
            self._recorder.close()


def config(*overrides: str) -> Config:
    return load_config(
        "sitl",
        ("links.anemometer=null", "links.operator.endpoint=udpin:127.0.0.1:0", "controller.name=loiter", *overrides),
    )


HEARTBEAT = dialect.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3)
GCS_HEARTBEAT = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


def router(tmp_path: Path, *overrides: str) -> MavlinkRouter:
    return MavlinkRouter(config(*overrides).links, start_ns=0, unix_ns=lambda: 0)
