"""The plant as physics of an autopilot, on the network: ArduPilot's interface on UDP, PX4's on TCP or a serial line."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable

from asvhil.config import Config
from asvhil.errors import ConfigError
from asvhil.links.clock import Clock
from asvhil.links.endpoint import INBOX_FRAMES, Endpoint, open_endpoint, parse_spec
from asvhil.links.tcp import TcpServer
from asvhil.simplant.hil.ardupilot_json import PORT, ArduPilotJson
from asvhil.simplant.hil.plant import HilPlant
from asvhil.simplant.hil.px4 import Px4Hil
from asvhil.types import Frame

STATUS_S = 0.2
IDLE_NS = 100_000_000  # a client that leaves says nothing: look that often


class HilServer(ABC):
    """What both servers share: links, signals, and an end that leaves nothing behind."""

    schemes: tuple[str, ...]

    def __init__(self, config: Config, endpoint: str, clock: Clock) -> None:
        """Raises ConfigError where the endpoint is of a kind that the autopilot does not speak on."""
        if parse_spec(endpoint).scheme not in self.schemes:
            raise ConfigError(f"link {endpoint!r}: {self.title} is spoken on {' or '.join(self.schemes)} here")
        self._config = config
        self._endpoint = endpoint
        self._clock = clock
        self._stop = asyncio.Event()
        self._links: dict[str, Endpoint] = {}
        self.address = ""  # where it listens, once it does

    @property
    @abstractmethod
    def title(self) -> str:
        """The name of the interface."""

    @property
    @abstractmethod
    def plant(self) -> HilPlant:
        """The boat."""

    @abstractmethod
    async def _serve(self, link: Endpoint) -> None:
        """Answer for ever; LinkError when the link is gone."""

    @abstractmethod
    def status(self) -> str:
        """One line for the operator."""

    def stop(self) -> None:
        """End `run` soon; what Ctrl-C does."""
        self._stop.set()

    async def run(self, duration_s: float | None = None, on_status: Callable[[str], None] | None = None) -> None:
        """Serve until stopped, or for a time, with a line for the operator now and then.

        Raises LinkError where a link cannot be opened or is lost.
        """
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.stop)
        tasks: list[asyncio.Task[object]] = []
        try:
            for port, spec in self._specs().items():
                self._links[port] = await open_endpoint(spec, port, self._clock.now_ns)
            link = self._links[PORT]
            self.address = link.address
            tasks = [asyncio.create_task(self._serve(link)), asyncio.create_task(self._stop.wait())]
            if on_status is not None:
                tasks.append(asyncio.create_task(self._report(on_status)))
            done, _ = await asyncio.wait(tasks, timeout=duration_s, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            for endpoint in self._links.values():
                await endpoint.close()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    def _specs(self) -> dict[str, str]:
        """The links to open: the autopilot's, and those of the sensors that the companion reads itself."""
        return self._config.plant.links.endpoints | {PORT: self._endpoint}

    async def _send(self, frames: list[Frame]) -> None:
        for frame in frames:
            link = self._links.get(frame.port)
            if link is not None:  # a sensor without a link speaks to nobody
                await link.send(frame.data, frame.peer)

    async def _report(self, show: Callable[[str], None]) -> None:
        last_ns, last_t_ns = self._clock.now_ns(), 0
        while True:
            await asyncio.sleep(STATUS_S)
            now_ns, t_ns = self._clock.now_ns(), self.plant.t_ns
            speed = max(0.0, (t_ns - last_t_ns) / (now_ns - last_ns))
            last_ns, last_t_ns = now_ns, t_ns
            moored = ", moored until the outputs have been neutral for a while" if self.plant.moored else ""
            show(f"{t_ns * 1e-9:.1f} s, {speed:.1f} times real time{moored}; {self.status()}")


class ArduPilotJsonServer(HilServer):
    """Answers servo frames as they come; the autopilot sets the pace."""

    schemes = ("udpin",)
    title = "ArduPilot's JSON physics interface"

    def __init__(self, config: Config, endpoint: str, clock: Clock) -> None:
        super().__init__(config, endpoint, clock)
        self.backend = ArduPilotJson(config)

    @property
    def plant(self) -> HilPlant:
        return self.backend.plant

    async def _serve(self, link: Endpoint) -> None:
        receive = self.backend.receive
        while True:
            frame = await link.recv()
            await self._send(receive(frame))

    def status(self) -> str:
        counters, outputs_us = self.backend.counters, self.backend.outputs_us
        if not counters.frames:
            return f"waits for ArduPilot{'; ' + counters.why_bad if counters.why_bad else ''}"
        parts = [f"{self.backend.rate_hz} Hz", f"outputs {outputs_us[0]}, {outputs_us[1]} us"]
        for name in ("duplicates", "lost", "restarts", "strangers"):
            if count := getattr(counters, name):
                parts.append(f"{count} {name}")
        if counters.bad:
            parts.append(f"{counters.bad} bad ({counters.why_bad})")
        return ", ".join(parts)


class Px4HilServer(HilServer):
    """Sends sensors when they are due or the last ones have been answered."""

    schemes = ("tcpin", "serial", "pty")
    title = "PX4's simulator interface"

    def __init__(self, config: Config, endpoint: str, clock: Clock) -> None:
        super().__init__(config, endpoint, clock)
        self.backend = Px4Hil(config)
        self._inbox: deque[Frame] = deque(maxlen=INBOX_FRAMES)
        self._arrived = asyncio.Event()

    @property
    def plant(self) -> HilPlant:
        return self.backend.plant

    async def _serve(self, link: Endpoint) -> None:
        reader = asyncio.create_task(self._read(link))
        session = 0
        try:
            while True:
                if reader.done():
                    reader.result()
                session = self._follow(link, session)
                await self._exchange()
        finally:
            reader.cancel()
            await asyncio.gather(reader, return_exceptions=True)

    def _follow(self, link: Endpoint, session: int) -> int:
        """A new client is an autopilot that has started; a serial line has one for good."""
        now = link.session if isinstance(link, TcpServer) else 1
        if now != session:
            if now:
                self.backend.connect(self._clock.now_ns())
            else:
                self.backend.disconnect()
        return now

    async def _exchange(self) -> None:
        backend, clock = self.backend, self._clock
        while self._inbox:
            await self._send(backend.receive(self._inbox.popleft()))
        await self._send(backend.poll(clock.now_ns()))
        self._arrived.clear()
        if self._inbox:
            return
        wait_ns = min(backend.next_ns - clock.now_ns(), IDLE_NS)
        if wait_ns <= 0:
            await asyncio.sleep(0)
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(wait_ns * 1e-9):
                await self._arrived.wait()

    async def _read(self, link: Endpoint) -> None:
        while True:
            frame = await link.recv()
            self._inbox.append(frame)
            self._arrived.set()

    def status(self) -> str:
        backend, counters = self.backend, self.backend.counters
        if not backend.connected:
            return "waits for PX4"
        pace = "lockstep" if backend.lockstep else "real time"
        if backend.silent:
            parts = [pace, "PX4 sends no controls (disarmed, or no module drives an output): motors off"]
        elif not counters.answers:
            parts = [pace, "PX4 has sent no controls yet"]
        else:
            parts = [pace, "armed" if backend.armed else "disarmed"]
        if backend.armed:
            parts.append(f"outputs {backend.outputs_us[0]}, {backend.outputs_us[1]} us")
        for name in ("unanswered", "duplicates", "silences", "restarts"):
            if count := getattr(counters, name):
                parts.append(f"{count} {name}")
        return ", ".join(parts)
