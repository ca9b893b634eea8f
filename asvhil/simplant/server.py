"""The simulated vehicle on the network, in real time: a plant, its clock and its links."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections import deque
from collections.abc import Callable

from asvhil.config import Config
from asvhil.errors import LinkError
from asvhil.links.clock import Clock
from asvhil.links.endpoint import INBOX_FRAMES, Endpoint, open_endpoint
from asvhil.simplant.plant import Plant, Truth
from asvhil.types import Frame

LOOP_S = 0.005
MAX_LAG_S = 1.0


class PlantServer:
    """Steps a plant along the clock and carries its frames. If the host stalls, the plant's time stops too."""

    def __init__(self, config: Config, clock: Clock, on_truth: Callable[[Truth], None] | None = None) -> None:
        config.check_faults()
        self._config = config
        self._clock = clock
        self._on_truth = on_truth
        self._inbox: deque[Frame] = deque(maxlen=INBOX_FRAMES)
        self._stop = asyncio.Event()
        self.plant: Plant | None = None

    def stop(self) -> None:
        self._stop.set()

    async def run(self, duration_s: float | None = None) -> None:
        """Serve until stopped, or for a time. Raises LinkError where a link cannot be opened or is lost."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.stop)
        specs = self._config.plant.links.endpoints
        endpoints: dict[str, Endpoint] = {}
        readers: list[asyncio.Task[None]] = []
        try:
            for port, spec in specs.items():
                endpoints[port] = await open_endpoint(spec, port, self._clock.now_ns)
            readers = [asyncio.create_task(self._read(endpoint)) for endpoint in endpoints.values()]
            await self._serve(endpoints, readers, duration_s)
        finally:
            for reader in readers:
                reader.cancel()
            await asyncio.gather(*readers, return_exceptions=True)
            for endpoint in endpoints.values():
                await endpoint.close()
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    async def _read(self, endpoint: Endpoint) -> None:
        while True:
            self._inbox.append(await endpoint.recv())

    async def _serve(
        self, endpoints: dict[str, Endpoint], readers: list[asyncio.Task[None]], duration_s: float | None
    ) -> None:
        start_ns = self._clock.now_ns()
        behind_ns = 0  # how far the plant is behind the clock, by stalls of the host
        plant = self.plant = Plant(self._config, start_ns)
        while not self._stop.is_set():
            for reader in readers:
                if reader.done() and reader.exception() is not None:
                    raise LinkError(str(reader.exception()))
            while self._inbox:
                plant.receive(self._inbox.popleft())
            t_ns = self._clock.now_ns() - behind_ns
            lag_ns = t_ns - plant.truth.t_ns - round(MAX_LAG_S * 1e9)
            if lag_ns > 0:
                behind_ns += lag_ns
                t_ns -= lag_ns
            for frame in plant.advance(t_ns):
                if frame.port in endpoints:  # frames of a sensor without a line are dropped
                    await endpoints[frame.port].send(frame.data)
            if self._on_truth is not None:
                self._on_truth(plant.truth)
            if duration_s is not None and t_ns - start_ns >= duration_s * 1e9:
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), LOOP_S)
