"""Watches mode, arming and sticks while the motors are ours, for signs that the pilot wants the boat back."""

from __future__ import annotations

from collections import deque

from asvhil.config import SupervisorConfig
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import MotorPulses
from asvhil.types import FrontseatStatus

ECHO_TOLERANCE_US = 40  # dead zones of an autopilot bend small commands by up to 30 us
STICKS = (1, 2, 3, 4)


class PilotWatch:
    """Holds the autopilot's reports against how the sticks stood at the start, and against what we have sent since."""

    def __init__(self, config: SupervisorConfig, *, overrides_sticks: bool) -> None:
        """`overrides_sticks`: the motor commands stand in the place of the pilot's, and show as such in RC_CHANNELS."""
        self._config = config
        self._overrides_sticks = overrides_sticks
        # Where the sticks are the pilot's own, any movement of them is theirs.
        self._stick_channels = config.stick_channels if overrides_sticks else tuple({*STICKS, *config.stick_channels})
        self._echo_ns = round(config.override_echo_s * 1e9)
        self._engaged_ns = 0
        self._stick_baseline: dict[int, int] = {}
        self._sent: deque[MotorPulses] = deque()

    def begin(self, t_ns: int, status: FrontseatStatus) -> None:
        """The motors are ours from now on: as the sticks stand now they are at rest."""
        self._engaged_ns = t_ns
        self._sent.clear()
        baseline = {channel: _channel(status, channel) for channel in self._stick_channels}
        self._stick_baseline = {channel: value for channel, value in baseline.items() if value}

    def note_sent(self, pulses: MotorPulses) -> None:
        """Remember what was sent, to tell the echo of our override from the pilot's sticks."""
        self._sent.append(pulses)
        horizon_ns = pulses.t_ns - 2 * self._echo_ns
        while len(self._sent) > 1 and self._sent[1].t_ns <= horizon_ns:  # the one that stood at the horizon is kept
            self._sent.popleft()

    def act(self, status: FrontseatStatus | None) -> Explanation | None:
        """What the pilot has done to have the boat back; None while there is nothing."""
        if status is None:
            return None
        if not status.armed:
            return explain(Reason.DISARMED)
        if status.mode != self._config.control_mode:
            return explain(Reason.MODE_CHANGED, mode=status.mode)
        for channel, baseline_us in self._stick_baseline.items():
            now_us = _channel(status, channel)
            if now_us and abs(now_us - baseline_us) > self._config.stick_threshold_us:
                return explain(Reason.STICK_MOVED, channel=channel)
        return None

    def sticks_taken(self, t_ns: int, status: FrontseatStatus | None) -> Explanation | None:
        """Which of the motors' own channels shows something else than our commands: somebody else has the boat."""
        if status is None:
            return None
        told_ns = status.rc_ns or t_ns
        if told_ns - self._engaged_ns < self._echo_ns:
            return None  # the echo of the first overrides may still be on its way
        echoed_us = self._echoed_us(told_ns)
        if not self._overrides_sticks or status.sticks_us is None or not echoed_us:
            return None
        of_motors = zip(status.motor_channels, status.sticks_us, zip(*echoed_us, strict=True), strict=True)
        for channel, now_us, sent_us in of_motors:
            if now_us and not min(sent_us) - ECHO_TOLERANCE_US <= now_us <= max(sent_us) + ECHO_TOLERANCE_US:
                return explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=channel)
        return None

    def hidden(self, status: FrontseatStatus) -> int | None:
        """A channel whose movement is to end a hold, but that our commands hide: it moves a motor of this boat."""
        watched = self._config.stick_channels if self._overrides_sticks else ()
        return next((channel for channel in watched if channel in status.motor_channels), None)

    def _echoed_us(self, told_ns: int) -> list[tuple[int, int]]:
        """What a report may show: sent within the time of an echo before it, or standing when that time began."""
        found = []
        for pulses in reversed(self._sent):
            if pulses.t_ns <= told_ns:
                found.append(pulses.us)
            if pulses.t_ns <= told_ns - self._echo_ns:
                break
        return found


def _channel(status: FrontseatStatus, channel: int) -> int:
    """RC value of a channel in us, 0 where unknown."""
    return status.rc_us[channel - 1] if len(status.rc_us) >= channel else 0
