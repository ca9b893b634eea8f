"""The asyncio shell on the companion computer: links, the tick, one worker thread for the step, and the log."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import MappingProxyType

from asvhil.backseat.backseat import Backseat
from asvhil.backseat.build import build_backseat
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT, GROUND, OPERATOR
from asvhil.daemon.allowance import Allowance
from asvhil.daemon.computer import ComputerStatus
from asvhil.daemon.guardian import Guardian
from asvhil.daemon.link_states import LinkStates
from asvhil.daemon.own_notes import OwnNotes
from asvhil.daemon.signals import handle_signals
from asvhil.daemon.systemd import ServiceManager
from asvhil.errors import AsvhilError, ConfigError
from asvhil.io.mavlink.frames import refuse_ignored_crc
from asvhil.io.mavlink.signing import SigningState
from asvhil.io.sensors.dropped import dropped_of
from asvhil.links.clock import Clock
from asvhil.links.reconnecting import ReconnectingLink
from asvhil.links.router import MavlinkRouter, save_states
from asvhil.logs.recorder import Recorder
from asvhil.operator.encoding import FINAL_TICKS, encode_release, encode_solve_time
from asvhil.types import Frame, FrontseatStatus, Inputs, Outputs

RELEASES, RELEASE_S = 3, 0.05
SWITCH_S = 0.0005
ARRIVALS_AT_ONCE = 20
COMPUTER_NS = 1_000_000_000
LAST_TASKS_S = 2.0
SOLVE_REPORT_NS = 500_000_000


class Daemon:
    """Runs one backseat against its links until stopped. The log holds all inputs and outputs of the backseat."""

    def __init__(
        self,
        config: Config,
        recorder: Recorder,
        clock: Clock,
        on_tick: Callable[[Outputs, dict[str, str]], None] | None = None,
        backseat: Backseat | None = None,
        watches: Mapping[str, Callable[[], str]] = MappingProxyType({}),
    ) -> None:
        """`on_tick` gets the outputs and each link's state. `backseat` is used in place of one built of the config.

        `watches`, by subject, tell what is wrong outside, such as with the display; operators and the log are told.
        """
        refuse_ignored_crc()
        self._config = config
        self._recorder = recorder
        self._clock = clock
        self._on_tick = on_tick
        self._backseat: Backseat = backseat or build_backseat(config)
        self._inbox: deque[Frame] = deque()
        self._stop = asyncio.Event()
        self._wake = asyncio.Event()  # set to cut a tick before its time
        self._on_arrival = config.daemon.cut_on == "arrival"
        self._allowance = Allowance(config.daemon.arrival_hz_max, ARRIVALS_AT_ONCE)
        self.router = MavlinkRouter(
            config.links, start_ns=clock.now_ns(), unix_ns=time.time_ns, on_forward=recorder.write_forwarded
        )
        own: dict[str, Callable[[], str]] = {"log": lambda: recorder.trouble}
        self.guardian = Guardian() if config.daemon.guardian else None
        if self.guardian is not None:
            own["guardian"] = lambda: "" if self.guardian is None else self.guardian.trouble
        self._notes = OwnNotes(config.links.autopilot, {**own, **watches})
        self._service = ServiceManager(os.environ)
        self._computer = ComputerStatus(config.links.autopilot, recorder.path.parent)
        self._looking: asyncio.Task[None] | None = None
        self._looked_ns = 0
        self._saving: asyncio.Task[None] | None = None
        # Not asyncio's own, whose end takes one thread more: where there is none the process would not end.
        self._side = ThreadPoolExecutor(2, thread_name_prefix="side")
        self._logged: dict[str, str] = {}
        specs = config.links.endpoints | self.router.ground_specs
        self.links = {
            port: ReconnectingLink(port, spec, config, clock, self._inbox, self._receive)
            for port, spec in specs.items()
        }
        self._link_states = LinkStates(self.links)
        self.router.attach(self.links)
        self.ticks = 0
        self.overruns = 0
        self._slowest_ns = 0
        self._solve_reported_ns = 0

    @property
    def vehicle(self) -> FrontseatStatus | None:
        """What the autopilot has last said of itself."""
        return self._backseat.vehicle

    def stop(self) -> None:
        """Request the end of `run`, with a release of the motors. May be called from a signal handler of the loop."""
        self._stop.set()
        self._wake.set()

    async def run(self, duration_s: float | None = None) -> None:
        """Tick until stopped, or for a time (s). Raises AsvhilError when the backseat failed, motors released first."""
        loop = asyncio.get_running_loop()
        signals = handle_signals(loop, stop=self.stop, hang_up=self._hang_up)
        if self.guardian is not None:
            self.guardian.start()
        readers = [asyncio.create_task(link.run(), name=port) for port, link in self.links.items()]
        for text in self.router.warnings:
            self._recorder.write_log(self._clock.now_ns(), "warning", text)
        # Otherwise the recorder's thread could hold the interpreter lock for 5 ms while an answer waits to be sent.
        sys.setswitchinterval(SWITCH_S)
        gc.collect()
        gc.freeze()  # objects of start-up live as long as the process: leaving them out keeps collection pauses short
        try:
            with ThreadPoolExecutor(1, thread_name_prefix="step") as worker:
                await self._tick_until_stopped(loop, worker, duration_s)
                await self._release_and_end(loop, worker)
                self._stand_down()
        except Exception as error:
            await self._release_to_pilot()
            self._stand_down()
            raise AsvhilError(f"the backseat failed, motors released: {type(error).__name__}: {error}") from error
        except BaseException:
            await self._release_to_pilot()
            self._stand_down()
            raise
        finally:
            for reader in readers:
                reader.cancel()
            await asyncio.gather(*readers, return_exceptions=True)
            for port, link in self.links.items():
                if link.losses:
                    self._recorder.write_log(self._clock.now_ns(), "warning", f"link {port}: {link.losses}")
            for text in self.router.take_all_news():
                self._recorder.write_log(self._clock.now_ns(), "warning", text)
            # The log before all that may take long, or fails without memory or threads.
            self._recorder.close()
            if self.guardian is not None:
                self.guardian.close()
            for task in (self._looking, self._saving):
                if task is not None:
                    await asyncio.wait((task,), timeout=LAST_TASKS_S)
            self._save_now(self.router.states())
            self._side.shutdown(wait=False)
            signals.restore()
            self._service.stopping()

    def _hang_up(self) -> None:
        """The terminal is gone, which nobody may have wanted."""
        if self._config.daemon.terminal_lost == "release":
            self.stop()
        else:
            self._notes.note("terminal", "hung up: the run goes on without it")

    async def _receive(self, frame: Frame) -> list[Frame]:
        """The frames for the backseat out of one received frame."""
        if self._on_arrival and frame.port != OPERATOR and not frame.port.startswith(GROUND):
            self._wake.set()
        return await self.router.receive(frame)

    async def _send(self, frame: Frame) -> None:
        for leaving in self.router.outgoing(frame):
            await self.links[leaving.port].send(leaving)

    async def _look_at_computer(self) -> None:
        """Tell the backseat of the computer, for operators; on a thread since its disk may stall."""
        try:
            data = await asyncio.get_running_loop().run_in_executor(self._side, self._computer.encode)
        except (OSError, RuntimeError):  # no file descriptor, no thread: it is asked again
            return
        self._inbox.append(Frame(t_ns=self._clock.now_ns(), port=OPERATOR, data=data))

    async def _save(self, states: dict[Path, SigningState]) -> None:
        """Write signing timestamps to the disk, on a thread since a disk may stall."""
        with contextlib.suppress(RuntimeError):  # no thread
            await asyncio.get_running_loop().run_in_executor(self._side, self._save_now, states)

    def _save_now(self, states: dict[Path, SigningState]) -> None:
        try:
            save_states(states)
        except ConfigError as error:
            self._recorder.write_log(self._clock.now_ns(), "warning", str(error))

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
                await asyncio.wait_for(self._wake.wait(), max(due_s - loop.time(), 0.0))
                await asyncio.sleep(self._allowance.take_s(loop.time()))
                due_s = min(due_s, loop.time())

    async def _release_and_end(self, loop: asyncio.AbstractEventLoop, worker: ThreadPoolExecutor) -> None:
        """Shut down by an operator's release, so that the log has it as an input and replay gets it too."""
        self._ask_for_release()
        for _ in range(FINAL_TICKS):
            await self._tick(loop, worker, overrun=False)
            await asyncio.sleep(1.0 / self._config.daemon.tick_hz)  # neutral and release in one go are a release alone

    def _ask_for_release(self) -> None:
        data = encode_release(self._config.links.autopilot)
        self._inbox.append(Frame(t_ns=self._clock.now_ns(), port=OPERATOR, data=data))

    async def _tick(self, loop: asyncio.AbstractEventLoop, worker: ThreadPoolExecutor, *, overrun: bool) -> None:
        self._inbox += self._notes.take_frames(self._clock.now_ns())
        frames = tuple(self._inbox)
        self._inbox.clear()
        self._wake.clear()
        inputs = Inputs(t_ns=self._clock.now_ns(), frames=frames)
        self._recorder.write_inputs(inputs)
        outputs, last_words, step_ns = await loop.run_in_executor(worker, self._timed_step, inputs)
        if last_words:
            self._tell_guardian(last_words)  # before anything moves
        for frame in outputs.frames:
            await self._send(frame)
        if not last_words:
            self._tell_guardian([])  # after the last release
        self._recorder.write_outputs(outputs)
        self._recorder.write_timing(inputs.t_ns, step_ns, overrun)
        self.ticks += 1
        if outputs.control is not None:
            self._report_solve_time(outputs.t_ns, step_ns)
        states = self._states(outputs)
        self._note_links(states)
        self._log_changes(outputs, states)
        self._log_router(outputs.t_ns)
        if outputs.t_ns - self._looked_ns >= COMPUTER_NS and (self._looking is None or self._looking.done()):
            self._looked_ns = outputs.t_ns
            self._looking = asyncio.create_task(self._look_at_computer())
        self._show(outputs, states)
        self._service.tick(f"{outputs.phase}: {outputs.health.reason}")

    def _show(self, outputs: Outputs, states: dict[str, str]) -> None:
        """Tell who looks on. If that fails, the run goes on without."""
        if self._on_tick is None:
            return
        try:
            self._on_tick(outputs, states)
        except (Exception, SystemExit) as error:  # rich ends the program where a pipe is closed
            self._on_tick = None
            self._notes.note("display", f"failed: {type(error).__name__}: {error}")

    def _report_solve_time(self, t_ns: int, step_ns: int) -> None:
        """Give the backseat its own solution time, as a frame: the core has no clock to measure it."""
        self._slowest_ns = max(self._slowest_ns, step_ns)
        if t_ns - self._solve_reported_ns >= SOLVE_REPORT_NS:
            data = encode_solve_time(self._config.links.autopilot, self._slowest_ns * 1e-6)
            self._inbox.append(Frame(t_ns=self._clock.now_ns(), port=OPERATOR, data=data))
            self._solve_reported_ns, self._slowest_ns = t_ns, 0

    def _timed_step(self, inputs: Inputs) -> tuple[Outputs, list[list[Frame]], int]:
        start_ns = time.perf_counter_ns()
        outputs = self._backseat.step(inputs)
        step_ns = time.perf_counter_ns() - start_ns
        return outputs, [] if self.guardian is None else self._backseat.last_words(inputs.t_ns), step_ns

    def _tell_guardian(self, steps: list[list[Frame]]) -> None:
        """Give it what to send if this process dies; end a hold that has none, where the config says so."""
        if self.guardian is None:
            return
        link = self.links[AUTOPILOT]
        handover = link.handover
        blind = bool(steps) and handover is None and link.state == "up"
        self.guardian.note_no_link("cannot send on this kind of link" if blind else "")
        deaths = self.guardian.deaths
        self.guardian.tell(self.router.last_words(steps), handover)
        lost = self.guardian.deaths > deaths or not self.guardian.watches
        if lost and steps and self._config.daemon.guardian_lost == "release":
            self._ask_for_release()

    def _stand_down(self) -> None:
        if self.guardian is not None:
            self.guardian.stand_down()

    def _states(self, outputs: Outputs) -> dict[str, str]:
        """The state of each link. Behind a semicolon stands what changes often."""
        counters = dict(outputs.health.counters)
        found = {}
        for port in self.links:
            state = self._link_states.state(port, outputs.t_ns, counters)
            counted = self._link_states.bytes_text(port) if "bad bytes" in state else ""
            found[port] = "; ".join(part for part in (state, counted, self.router.remarks(port)) if part)
        return found

    def _note_links(self, states: dict[str, str]) -> None:
        """Tell operators of the links, without what changes often. One to ground stations may be down for long."""
        told = {port: state.partition(";")[0] for port, state in states.items()}
        well = all(state == "up" or port.startswith(GROUND) for port, state in told.items())
        self._notes.state("links", ", ".join(f"{port} {state}" for port, state in told.items()), ok=well)

    def _log_router(self, t_ns: int) -> None:
        """Log the router's remarks, and save its signing timestamps when that is due."""
        for text in self.router.take_news(t_ns):
            self._recorder.write_log(t_ns, "warning", text)
        if self.router.take_save_due(t_ns) and (self._saving is None or self._saving.done()):
            self._saving = asyncio.create_task(self._save(self.router.states()))

    def _log_changes(self, outputs: Outputs, states: dict[str, str]) -> None:
        """Log what has changed: phase and reason, link states, sources, notes, causes of dropped data."""
        now = {f"link {port}": state.partition(";")[0] for port, state in states.items()}
        now["phase"] = f"{outputs.phase}: {outputs.health.reason}"
        now |= {f"source of {quantity}:": name or "none" for quantity, name in outputs.health.sources}
        now |= {f"{note.subject}:": note.text for note in outputs.health.notes}
        for port, causes in dropped_of(outputs.health.counters).items():  # not the counts, which change in each tick
            now[f"{port} has dropped:"] = ", ".join(causes)
        fine = {f"{note.subject}:" for note in outputs.health.notes if note.ok}
        for key, text in now.items():
            if self._logged.get(key) != text:
                chosen = key.startswith("source") and (text != "none" or key not in self._logged)
                good = chosen or key == "phase" or key in fine or text in ("up", "connecting")
                level = "info" if good else "warning"
                self._recorder.write_log(outputs.t_ns, level, f"{key} {text}")
        self._logged = now

    async def _release_to_pilot(self) -> None:
        """Send neutral and release, several times: datagrams get lost, and some outputs keep their last value."""
        for _ in range(RELEASES):
            for frame in self._backseat.release_to_pilot(self._clock.now_ns()):
                await self._send(frame)
            await asyncio.sleep(RELEASE_S)
