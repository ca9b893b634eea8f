"""Daemons that die in the middle of a hold, and how long the simulated autopilot's motors go on.

A process that has imported everything forks a daemon in half a second; each is a daemon of its own, with its own log.
"""

from __future__ import annotations

import asyncio
import contextlib
import ctypes
import json
import os
import random
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, load_config
from asvhil.daemon.daemon import Daemon
from asvhil.links.clock import Clock
from asvhil.logs.opening import open_recorder
from asvhil.simplant.plant import Truth
from asvhil.simplant.server import PlantServer
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.ports import free_port
from tests.support.waiting import until

LINKS = ("udp", "udpout", "tcp", "serial")
DEATHS = ("SIGKILL", "SIGSEGV", "null pointer", "out of memory", "os._exit")
EATEN_BYTES = 200_000_000
AFTER_S = 1.0  # watched after a death
NEUTRAL, OFF = (1500, 1500), (0, 0)


def config_of(link: str, folder: Path, *overrides: str) -> Config:
    """The simulated boat on one kind of link."""
    tcp, udp, pty = free_port(), free_port(), folder.resolve() / "autopilot"
    ends = {
        "udp": (f"udpin:127.0.0.1:{udp}", f"udpout:127.0.0.1:{udp}"),
        "udpout": (f"udpout:127.0.0.1:{udp}", f"udpin:127.0.0.1:{udp}"),
        "tcp": (f"tcp:127.0.0.1:{tcp}", f"tcpin:127.0.0.1:{tcp}"),
        "serial": (f"serial:{pty}:115200", f"pty:{pty}"),
    }[link]
    keys = (f"links.autopilot.endpoint={ends[0]}", f"plant.links.autopilot={ends[1]}", "links.anemometer=null")
    keys = (*keys, "plant.links.anemometer=null", "links.reconnect_max_s=0.2")
    return load_config(
        "sitl", (PLAIN_CONTROLLER, *keys, f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}", *overrides)
    )


def die(how: str, words: int) -> None:
    """End this process as it should not end, and write when."""

    def tell() -> None:
        os.write(words, b"%d\n" % time.monotonic_ns())

    match how:
        case "null pointer":
            tell()
            ctypes.string_at(0)
        case "out of memory":
            eaten = bytearray(os.urandom(4096)) * (EATEN_BYTES // 4096)
            tell()
            os.kill(os.getpid(), signal.SIGKILL)
            del eaten
        case "os._exit":
            tell()
            os._exit(7)


class Nursery:
    """Forks daemons of one config on demand."""

    def __init__(self, config: Config, folder: Path) -> None:
        """To be made before there is an event loop or a thread."""
        self._living = 0
        self._orders, orders = os.pipe()
        answers, self._answers = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(orders)
            os.close(answers)
            self._serve(config, folder)
        os.close(self._orders)
        os.close(self._answers)
        self._to, self._from = os.fdopen(orders, "w"), os.fdopen(answers)

    def fork(self) -> int:
        """The process id of a new daemon."""
        self._living = int(self._ask("fork"))
        return self._living

    def wait(self, pid: int) -> int:
        """The end of a daemon: its wait status."""
        status = int(self._ask(f"wait {pid}"))
        self._living = 0
        return status

    def died_ns(self) -> int:
        """When the last daemon ended itself (time.monotonic_ns)."""
        return int(self._from.readline())

    def close(self) -> None:
        """End it, and the daemon that lives."""
        if self._living:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._living, signal.SIGKILL)
        self._to.close()
        self._from.close()
        os.waitpid(self._pid, 0)

    def _ask(self, order: str) -> str:
        print(order, file=self._to, flush=True)
        return self._from.readline()

    def _serve(self, config: Config, folder: Path) -> None:
        backseat = build_backseat(config)
        runs = 0
        with os.fdopen(self._orders) as orders:
            for order in orders:
                runs += 1
                if order.startswith("fork"):
                    pid = os.fork()
                    if pid == 0:
                        self._be_daemon(config, backseat, folder / f"{os.getpid()}-{runs}.mcap")
                    answer = pid
                else:
                    _, answer = os.waitpid(int(order.split()[1]), 0)
                os.write(self._answers, b"%d\n" % answer)
        os._exit(0)

    def _be_daemon(self, config: Config, backseat: Any, log: Path) -> None:
        code = 1
        try:
            for number, how in zip((signal.SIGUSR1, signal.SIGUSR2, signal.SIGALRM), DEATHS[2:], strict=True):
                signal.signal(number, lambda *_, how=how: die(how, self._answers))
            recorder = open_recorder(config, log, "live")
            asyncio.run(Daemon(config, recorder, Clock(), backseat=backseat).run())
            recorder.close()
            code = 0
        finally:
            os._exit(code)


@dataclass
class Death:
    """One death: how, and when (s after it) both motors were neutral for good; None: not within a second.

    `stall_s` is the longest time for which the boat itself stood still meanwhile, since the computer was busy.
    """

    how: str
    neutral_s: float | None
    before_us: tuple[int, int]
    stall_s: float
    moved_s: list[float] = field(default_factory=list)  # changes of the outputs


class Watched:
    """A plant in this process, whose motors are watched."""

    def __init__(self, config: Config, nursery: Nursery, seed: int) -> None:
        self._nursery = nursery
        self._random = random.Random(seed)
        self.changes: list[tuple[int, tuple[int, int]]] = [(0, NEUTRAL)]
        self._seen_ns = self._stall_ns = 0
        self.server = PlantServer(config, Clock(), self._see)

    def _see(self, truth: Truth) -> None:
        now_ns = time.monotonic_ns()
        self._stall_ns, self._seen_ns = max(self._stall_ns, now_ns - self._seen_ns), now_ns
        if truth.outputs_us != self.changes[-1][1]:
            self.changes.append((now_ns, truth.outputs_us))

    @property
    def outputs_us(self) -> tuple[int, int]:
        return self.changes[-1][1]

    def _turn(self) -> bool:
        return self.outputs_us not in (NEUTRAL, OFF)

    async def held(self) -> int:
        """A daemon that drives the motors: its process id."""
        pid = await asyncio.to_thread(self._nursery.fork)
        await until(self._turn, 30.0, pause_s=0.01)
        await asyncio.sleep(self._random.uniform(0.0, 1.0))
        await until(self._turn, 30.0, pause_s=0.002)
        return pid

    async def die(self, how: str) -> Death:
        """Have a daemon hold, and die at a random moment."""
        pid = await self.held()
        before_us, start_ns, self._stall_ns = self.outputs_us, time.monotonic_ns(), 0
        number = {
            "SIGKILL": signal.SIGKILL,
            "SIGSEGV": signal.SIGSEGV,
            "null pointer": signal.SIGUSR1,
            "out of memory": signal.SIGUSR2,
            "os._exit": signal.SIGALRM,
        }[how]
        os.kill(pid, number)
        if how in DEATHS[2:]:
            start_ns = await asyncio.to_thread(self._nursery.died_ns)
        await asyncio.sleep(AFTER_S)
        await asyncio.to_thread(self._nursery.wait, pid)
        after = [(t_ns, us) for t_ns, us in self.changes if t_ns > start_ns]
        moved_s = [round((t_ns - start_ns) * 1e-9, 4) for t_ns, _ in after]
        neutral = bool(after) and after[-1][1] == NEUTRAL
        del self.changes[:-1]
        return Death(how, moved_s[-1] if neutral else None, before_us, round(self._stall_ns * 1e-9, 4), moved_s)


def deaths_of(link: str, folder: Path, hows: list[str], seed: int, told: Callable[[Death], None]) -> None:
    """Have daemons die, one after the other, on one kind of link."""
    folder.mkdir(exist_ok=True, parents=True)
    config = config_of(link, folder)
    nursery = Nursery(config, folder)

    async def run() -> None:
        watched = Watched(config, nursery, seed)
        server = asyncio.create_task(watched.server.run())
        try:
            for how in hows:
                told(await watched.die(how))
                for log in folder.glob("*.mcap"):
                    log.unlink()
        finally:
            watched.server.stop()
            with contextlib.suppress(asyncio.CancelledError):
                await server

    try:
        asyncio.run(run())
    finally:
        nursery.close()


def as_json(death: Death) -> str:
    return json.dumps(death.__dict__)
