"""Neutral for a boat without an RC receiver, so that it can be armed: an ArduRover takes overrides for radio."""

from __future__ import annotations

from asvhil.config import SupervisorConfig
from asvhil.supervisor.pilot_watch import PilotWatch
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import Situation
from asvhil.types import FrontseatStatus, Radio


class ArmingHelp:
    """Neutral is sent for a bounded time after a hold command that found the boat disarmed, and for that alone.

    Never where a receiver is, or has been, heard: there the pilot arms with sticks of his own. The hold itself takes a
    second command, so that arming never starts a motor.
    """

    def __init__(self, config: SupervisorConfig, pilot: PilotWatch, *, overrides_sticks: bool) -> None:
        self._config = config
        self._pilot = pilot
        self._able = overrides_sticks and config.arming_neutral_s > 0.0
        self._until_ns: int | None = None

    @property
    def active(self) -> bool:
        """Whether neutral is being sent."""
        return self._until_ns is not None

    def suits(self, status: FrontseatStatus | None) -> bool:
        """Whether neutral is what the boat lacks to be armed."""
        return self._able and status is not None and not status.armed and status.radio is Radio.ABSENT

    def begin(self, t_ns: int, status: FrontseatStatus) -> Explanation:
        """Send neutral from now on, or for longer. Returns what to do meanwhile, in the place of a hold."""
        if self._until_ns is None:
            self._pilot.begin(t_ns, status)
        seconds = self._config.arming_neutral_s
        self._until_ns = t_ns + round(seconds * 1e9)
        return explain(Reason.ARM_NOW, seconds=seconds, mode=self._config.control_mode)

    def end(self) -> None:
        """Send it no more."""
        self._until_ns = None

    def failure(self, situation: Situation) -> Explanation | None:
        """Why it is to be sent no longer, where the link is alive; None while it is."""
        status = situation.status
        assert status is not None and self._until_ns is not None
        if status.radio is Radio.UNKNOWN:
            return explain(Reason.WAITING_FOR_AUTOPILOT)  # it has been restarted
        if status.radio is not Radio.ABSENT:
            return explain(Reason.TRANSMITTER_HEARD)
        if status.armed and status.mode != self._config.control_mode:
            return explain(Reason.MODE_CHANGED, mode=status.mode)
        if situation.fault is not None:
            return situation.fault
        if situation.t_ns >= self._until_ns:
            return explain(Reason.NEUTRAL_ENDED, seconds=self._config.arming_neutral_s)
        theirs = self._pilot.station_stick(status, situation.station_sticks)
        return theirs or self._pilot.sticks_taken(situation.t_ns, status)
