"""Whether the boat is adrift: a failure has ended the hold, and nobody has taken the motors since. Sans-IO."""

from __future__ import annotations

from asvhil.supervisor.decision import Decision
from asvhil.supervisor.disarmed import BY_ITSELF
from asvhil.supervisor.reasons import Reason
from asvhil.types import FrontseatStatus, Phase

# Whoever ended the hold so has the motors, or nobody wants them to turn.
ENDED_BY_PEOPLE = {
    *(Reason.RELEASED, Reason.DISARMED, Reason.MODE_CHANGED, Reason.STICK_MOVED, Reason.STATION_STICK),
    *(Reason.OVERRIDE_NOT_FOLLOWED, Reason.TRANSMITTER_HEARD),
}


class DriftWatch:
    """`step` in each tick; `adrift` from then on until a person disarms, chooses a mode or arms anew, or a hold."""

    def __init__(self) -> None:
        self.adrift = False
        self._mode = ""  # the autopilot's when that began
        self._disarmed_itself = False  # since then: its mode is nobody's choice
        self._phase = Phase.STANDBY
        self._reason: Reason | None = None

    def step(self, status: FrontseatStatus | None, decision: Decision) -> None:
        """One tick."""
        held, reason = self._phase in (Phase.HOLD, Phase.FAILSAFE), decision.why.reason
        named = reason in BY_ITSELF and reason is not self._reason
        self._phase, self._reason = decision.phase, reason
        if decision.phase is not Phase.STANDBY:
            self.adrift = False
        elif named or (held and reason not in ENDED_BY_PEOPLE):
            self.adrift, self._disarmed_itself = True, False
            self._mode = status.mode if status is not None else ""
        elif self.adrift and status is not None and self._is_taken(status):
            self.adrift = False

    def _is_taken(self, status: FrontseatStatus) -> bool:
        """Whether somebody has the boat, or has made sure that nothing turns."""
        if status.disarmed_itself and not status.armed:
            self._disarmed_itself = True
            return False
        return self._disarmed_itself or not status.armed or status.mode != self._mode
