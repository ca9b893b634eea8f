"""The asyncio shell on the companion computer: links, the tick, one worker thread for the step, and the log."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import signal
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from asvhil.backseat import Backseat
from asvhil.build import build_backseat
from asvhil.clock import Clock
from asvhil.config import Config
from asvhil.errors import AsvhilError, LinkError
from asvhil.io.endpoint import Endpoint, open_endpoint
from asvhil.io.mavlink import refuse_ignored_crc
from asvhil.io.operator import encode_release
from asvhil.io.recorder import Recorder
from asvhil.types import Frame, Inputs, Outputs

INBOX_FRAMES = 20_000  # four seconds of a flooded link; beyond it the oldest are dropped and counted
FINAL_TICKS = 3


class Link:
    """One configured port: opens its endpoint, reads it, and opens it again with bounded back-off when it is gone."""

    def __init__(self, port: str, spec: str, config: Config, clock: Clock, inbox: deque[Frame]) -> None:
        self.port = port
        self._spec = spec
        self._first_s = config.links.reconnect_first_s
        self._max_s = config.links.reconnect_max_s
        self._clock = clock
        self._inbox = inbox
        self._endpoint: Endpoint | None = None
        self.state = "connecting"
        self.unsent = 0
        self.overflowed = 0

    async def run(self) -> None:
        """Read frames into the inbox until cancelled."""
        wait_s = self._first_s
        try:
            while True:
                try:
                    self._endpoint = await open_endpoint(self._spec, self.port, self._clock.now_ns)
                    self.state = "up"
                    while True:
                        frame = await self._endpoint.recv()
                        wait_s = self._first_s
                        if len(self._inbox) >= INBOX_FRAMES:
                            self._inbox.popleft()
                            self.overflowed += 1
                        self._inbox.append(frame)
                except LinkError as error:
                    self.state = str(error)
                await self._close()
                await asyncio.sleep(wait_s)
                wait_s = min(2.0 * wait_s, self._max_s)
        finally:
            await self._close()

    async def send(self, frame: Frame) -> None:
        """Send now or never: a motor command is worth nothing later."""
        endpoint = self._endpoint
        if endpoint is None:
            self.unsent += 1
            return
        try:
            await endpoint.send(frame.data, frame.peer)
        except LinkError as error:
            self.unsent += 1
            self.state = str(error)

    @property
    def losses(self) -> str:
        """What was not sent or not read, in words; empty where nothing was."""
        return f"{self.unsent} sends and {self.overflowed} frames dropped" if self.unsent or self.overflowed else ""

    async def _close(self) -> None:
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None:
            self.unsent += endpoint.unsent
            self.overflowed += endpoint.dropped
            with contextlib.suppress(LinkError):
                await endpoint.close()


class Daemon:
    """Runs one backseat against its links until told to stop; the log holds all that it was given and all it did."""

    def __init__(
        self,
        config: Config,
        recorder: Recorder,
        clock: Clock,
        on_tick: Callable[[Outputs, dict[str, str]], None] | None = None,
    ) -> None:
        refuse_ignored_crc()
        self._config = config
        self._recorder = recorder
        self._clock = clock
        self._on_tick = on_tick
        self._backseat: Backseat = build_backseat(config)
        self._inbox: deque[Frame] = deque()
        self._stop = asyncio.Event()
        self._spoken: dict[str, str] = {}
        specs = {"autopilot": config.links.autopilot.endpoint, "operator": config.links.operator.endpoint}
        if config.links.anemometer is not None:
            specs["anemometer"] = config.links.anemometer.endpoint
        self._links = {port: Link(port, spec, config, clock, self._inbox) for port, spec in specs.items()}
        self.ticks = 0
        self.overruns = 0

    def stop(self) -> None:
        """Ask for neutral, release and the end; safe from a signal handler on the loop."""
        self._stop.set()

    async def run(self, duration_s: float | None = None) -> None:
        """Tick until stopped, or for a time. Raises AsvhilError when the backseat failed; motors are released first."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self.stop)
        readers = [asyncio.create_task(link.run(), name=port) for port, link in self._links.items()]
        gc.collect()
        gc.freeze()  # what start-up built lives as long as the process: keep the collector's pauses short
        try:
            with ThreadPoolExecutor(1, thread_name_prefix="step") as worker:
                await self._tick_until_stopped(loop, worker, duration_s)
                await self._let_go(loop, worker)
        except Exception as error:
            await self._surrender()
            raise AsvhilError(f"the backseat failed, motors released: {type(error).__name__}: {error}") from error
        finally:
            for reader in readers:
                reader.cancel()
            await asyncio.gather(*readers, return_exceptions=True)
            for port, link in self._links.items():
                if link.losses:
                    self._recorder.write_log(self._clock.now_ns(), "warning", f"link {port}: {link.losses}")
            for number in (signal.SIGINT, signal.SIGTERM):
                loop.remove_signal_handler(number)

    async def _tick_until_stopped(
        self, loop: asyncio.AbstractEventLoop, worker: ThreadPoolExecutor, duration_s: float | None
    ) -> None:
        period_s = 1.0 / self._config.daemon.tick_hz
        due_s = loop.time()
        end_s = None if duration_s is None else due_s + duration_s
        while not self._stop.is_set():
            late_s = loop.time() - due_s
            if late_s > period_s:
                missed = int(late_s / period_s)
                self.overruns += missed
                due_s += missed * period_s
            await self._tick(loop, worker, overrun=late_s > period_s)
            due_s += period_s
            if end_s is not None and due_s >= end_s:
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), max(due_s - loop.time(), 0.0))

    async def _let_go(self, loop: asyncio.AbstractEventLoop, worker: ThreadPoolExecutor) -> None:
        """The shutdown is an operator's release, so that replay sees it too."""
        data = encode_release(self._config.links.autopilot)
        self._inbox.append(Frame(t_ns=self._clock.now_ns(), port="operator", data=data))
        for _ in range(FINAL_TICKS):
            await self._tick(loop, worker, overrun=False)

    async def _tick(self, loop: asyncio.AbstractEventLoop, worker: ThreadPoolExecutor, *, overrun: bool) -> None:
        frames = tuple(self._inbox)
        self._inbox.clear()
        inputs = Inputs(t_ns=self._clock.now_ns(), frames=frames)
        self._recorder.write_inputs(inputs)
        outputs, step_ns = await loop.run_in_executor(worker, self._timed_step, inputs)
        for frame in outputs.frames:
            await self._links[frame.port].send(frame)
        self._recorder.write_outputs(outputs)
        self._recorder.write_timing(inputs.t_ns, step_ns, overrun)
        self.ticks += 1
        self._speak(outputs)
        if self._on_tick is not None:
            self._on_tick(outputs, {port: link.state for port, link in self._links.items()})

    def _timed_step(self, inputs: Inputs) -> tuple[Outputs, int]:
        start_ns = time.perf_counter_ns()
        outputs = self._backseat.step(inputs)
        return outputs, time.perf_counter_ns() - start_ns

    def _speak(self, outputs: Outputs) -> None:
        """Log what changed: phase and reason, and the state of each link."""
        now = {f"link {port}": link.state for port, link in self._links.items()}
        now["phase"] = f"{outputs.phase}: {outputs.health.reason}"
        for key, text in now.items():
            if self._spoken.get(key) != text:
                level = "info" if text == "up" or key == "phase" or text == "connecting" else "warning"
                self._recorder.write_log(outputs.t_ns, level, f"{key} {text}")
        self._spoken = now

    async def _surrender(self) -> None:
        for frame in self._backseat.surrender(self._clock.now_ns()):
            await self._links[frame.port].send(frame)
