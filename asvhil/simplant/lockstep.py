"""Plant and backseat in one process in virtual time, still through the MAVLink and NMEA bytes. No sockets."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from asvhil.backseat.backseat import Backseat
from asvhil.backseat.build import build_backseat
from asvhil.config import Config
from asvhil.config.ports import OPERATOR
from asvhil.logs.recorder import Recorder
from asvhil.operator.encoding import FINAL_TICKS, encode_release
from asvhil.simplant.plant import Plant, with_lines_read
from asvhil.types import Frame, Inputs, Outputs

EPOCH_NS = 1_700_000_000_000_000_000  # virtual time starts at a fixed instant, so that two runs are alike


class Lockstep:
    """A backseat and a plant on one virtual clock. `tick` advances both by one tick of the backseat."""

    def __init__(self, config: Config, recorder: Recorder | None = None) -> None:
        config.check_faults()
        self.config = config
        self.plant = Plant(with_lines_read(config), EPOCH_NS)
        self.backseat: Backseat = build_backseat(config)
        self._recorder = recorder
        self.period_ns = round(1e9 / config.daemon.tick_hz)
        self._injected: list[Frame] = []
        self.t_ns = EPOCH_NS
        self.ticks = 0

    def inject(self, port: str, data: bytes, peer: str = "") -> None:
        """Bytes from elsewhere (an operator, an attacker) that arrive before the next tick."""
        self._injected.append(Frame(t_ns=self.t_ns, port=port, data=data, peer=peer))

    def receive(self) -> tuple[Frame, ...]:
        """What has arrived by this tick: what was injected, then what the plant sends up to now."""
        frames = (*self._injected, *self.plant.advance(self.t_ns))
        self._injected.clear()
        return frames

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        """Hand the frames that the backseat sends to the plant."""
        for frame in frames:
            self.plant.receive(frame)

    def tick(self) -> tuple[Inputs, Outputs]:
        """Advance the plant to the next tick, step the backseat, hand its frames to the plant."""
        self.t_ns += self.period_ns
        inputs = Inputs(t_ns=self.t_ns, frames=self.receive())
        if self._recorder is not None:
            self._recorder.write_inputs(inputs)
        start_ns = time.perf_counter_ns()
        outputs = self.backseat.step(inputs)
        step_ns = time.perf_counter_ns() - start_ns
        self.deliver(outputs.frames)
        if self._recorder is not None:
            self._recorder.write_outputs(outputs)
            self._recorder.write_timing(inputs.t_ns, step_ns, overrun=False)
        self.ticks += 1
        return inputs, outputs

    def run(self, duration_s: float, on_tick: Callable[[Outputs], None] | None = None) -> None:
        """Tick for a span of virtual time and let go at the end, as the daemon does."""
        for outputs in self._run(round(duration_s * self.config.daemon.tick_hz)):
            if on_tick is not None:
                on_tick(outputs)

    def _run(self, ticks: int) -> Iterator[Outputs]:
        for _ in range(ticks):
            yield self.tick()[1]
        self.inject(OPERATOR, encode_release(self.config.links.autopilot))
        for _ in range(FINAL_TICKS):
            yield self.tick()[1]
