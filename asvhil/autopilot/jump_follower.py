"""What the filter of an autopilot makes of a sensor that jumps."""

from __future__ import annotations

RETRY_NS = 10_000_000_000  # AP_NavEKF3.h: posRetryTimeUseVel_ms and magFailTimeLimit_ms are 10000
Jump = tuple[float, float, float]  # north, east (m), heading (rad)
SOUND_JUMP: Jump = (0.0, 0.0, 0.0)


class JumpFollower:
    """A filter with innovation gates: it follows a jump of its sensor only after that has lasted `RETRY_NS`."""

    __slots__ = ("_asked", "_since_ns", "value")

    def __init__(self) -> None:
        self.value = SOUND_JUMP
        self._asked = self.value
        self._since_ns = 0

    def step(self, t_ns: int, asked: Jump) -> Jump:
        """The part of a jump that the filter has accepted by now."""
        if asked != self._asked:
            self._asked, self._since_ns = asked, t_ns
        if t_ns - self._since_ns >= RETRY_NS:
            self.value = asked
        return self.value
