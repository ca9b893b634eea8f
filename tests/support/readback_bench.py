"""A readback that is told, moment by moment, what is sent to the motors and what an autopilot reports."""

from __future__ import annotations

from collections.abc import Callable

from asvhil.autopilot.readback import Fault, Readback
from asvhil.config import ReadbackConfig
from asvhil.types import FrontseatStatus

MS = 1_000_000
T_NS = 1_000_000 * MS  # when the motors are taken
TOLERANCE_US = 8
STEP_MS = 200  # from a command to the next
AFTER_MS = 150  # from a command to the report that answers it, and can answer no other with a lag of 100 ms
Pair = tuple[int, int]


class ReadbackBench:
    """Times are in ms since the motors are taken by the first command."""

    def __init__(self, **options: bool | float) -> None:
        config = ReadbackConfig(lag_s=0.1, tolerance_us=TOLERANCE_US)
        self.watch = Readback(config, 1500.0, **options)  # type: ignore[arg-type]

    def sent(self, ms: float, us: Pair) -> None:
        self.watch.note_sent(T_NS + round(ms * MS), us)

    def reports(
        self, ms: float, *, outputs: Pair | None = None, sticks: Pair | None = None, sticks_ms: float | None = None
    ) -> None:
        """New values of outputs, sticks or both, of one time or of two."""
        t_ns = T_NS + round(ms * MS)
        self.watch.on_status(
            FrontseatStatus(
                t_ns=t_ns,
                armed=True,
                mode="MANUAL",
                ready=True,
                rc_us=(),
                outputs_us=(),
                sticks_us=sticks,
                motors_us=outputs,
                rc_ns=t_ns if sticks_ms is None else T_NS + round(sticks_ms * MS),
                outputs_ns=t_ns,
            )
        )

    def judge(self, ms: float) -> Fault | None:
        return self.watch.judge(T_NS + round(ms * MS))

    def play(
        self,
        commands: list[Pair],
        outputs: Callable[[int, Pair], Pair],
        sticks: Callable[[int, Pair], Pair | None] = lambda _, us: us,
        *,
        from_ms: float = 0.0,
    ) -> float | None:
        """Commands, each with its report after it. When a fault was found (ms); None where there was none."""
        for n, us in enumerate(commands):
            ms = from_ms + n * STEP_MS
            self.sent(ms, us)
            self.reports(ms + AFTER_MS, outputs=outputs(n, us), sticks=sticks(n, us))
            if self.judge(ms + AFTER_MS) is not None:
                return ms + AFTER_MS
        return None


def swinging(count: int) -> list[Pair]:
    """Commands of which each is far from the one before, and from neutral."""
    return [(1500 + 20 * (10 + n % 7), 1500 - 25 * (8 + n % 5)) for n in range(count)]


def followed(_: int, us: Pair) -> Pair:
    return us
