"""Whether the boat is adrift: a failure has ended the hold, and nobody has taken the motors since. Sans-IO."""

from __future__ import annotations

from asvhil.supervisor.decision import Decision
from asvhil.supervisor.disarmed import BY_ITSELF
from asvhil.supervisor.mode_request import NOT_CHOSEN
from asvhil.supervisor.reasons import Reason
from asvhil.types import FrontseatStatus, Phase

# Whoever ended the hold so has the motors, or nobody wants them to turn.
ENDED_BY_PEOPLE = {
    *(Reason.RELEASED, Reason.DISARMED, Reason.MODE_CHANGED, Reason.STICK_MOVED, Reason.STATION_STICK),
    *(Reason.OVERRIDE_NOT_FOLLOWED, Reason.TRANSMITTER_HEARD),
}

# Of an autopilot that has disarmed by itself: what a boot or a fail-safe makes of its mode is nobody's choice, so the
# mode must have been heard for so long, without a silence that may be one more boot, before another one is.
SETTLED_NS, SILENT_NS = 10_000_000_000, 2_000_000_000


class DriftWatch:
    """`step` in each tick; `adrift` from then on until a person acts, or a hold begins.

    A person disarms, chooses a mode, or releases. An autopilot that has disarmed by itself is not disarmed by a person
    any more: it is armed anew, has a mode chosen once it is heard again, or an operator releases.
    """

    def __init__(self) -> None:
        self.adrift = False
        self._mode = ""  # the autopilot's when that began
        self._disarmed_itself = False  # since then
        self._mode_ns = self._told_ns = 0  # of one that is: since when it has that mode, and when it was told last
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
            self._mode, self._told_ns = status.mode if status is not None else "", 0
        elif self.adrift and status is not None and self._is_taken(status):
            self.adrift = False

    def release(self) -> None:
        """An operator has released: somebody knows of the boat, and looks after it."""
        self.adrift = False

    def _is_taken(self, status: FrontseatStatus) -> bool:
        """Whether somebody has the boat, or has made sure that nothing turns."""
        if status.disarmed_itself and not status.armed:
            self._disarmed_itself = True
            return self._is_mode_chosen(status)
        return self._disarmed_itself or not status.armed or status.mode != self._mode

    def _is_mode_chosen(self, status: FrontseatStatus) -> bool:
        """Whether the mode of one that has disarmed by itself is another one than it has had for a while since."""
        goes_on = self._told_ns > 0 and status.t_ns - self._told_ns <= SILENT_NS
        self._told_ns = status.t_ns
        if goes_on and status.mode == self._mode:
            return False
        is_choice = NOT_CHOSEN not in (self._mode, status.mode)
        chosen = goes_on and is_choice and status.t_ns - self._mode_ns >= SETTLED_NS
        self._mode, self._mode_ns = status.mode, status.t_ns
        return chosen
