"""The autopilot's mode: taken where it may be, and given back as it was. A mode that somebody else chooses stands."""

from __future__ import annotations

from asvhil.supervisor.reasons import Explanation, Reason, explain

NOT_CHOSEN = "INITIALISING"  # a mode that is never asked for


class ModeRequest:
    """Remembers the mode before the control mode was asked for, and which mode to ask for now.

    `mode` is the one that the autopilot last reported.
    """

    def __init__(self, control_mode: str, timeout_s: float) -> None:
        self._control_mode = control_mode
        self._timeout_ns = round(timeout_s * 1e9)
        self._before: str | None = None
        self._taking_ns: int | None = None
        self._restoring: tuple[int, str] | None = None

    def note(self, mode: str) -> None:
        """The control mode is going to be asked for while this one stands."""
        if mode not in (self._control_mode, NOT_CHOSEN):
            self._before = mode

    def take(self, t_ns: int, mode: str) -> None:
        """Begin to ask for the control mode."""
        self.forget()
        self.note(mode)
        self._taking_ns = t_ns

    def taken(self) -> None:
        """The control mode stands, and what stood before it is kept in mind."""
        self._taking_ns = self._restoring = None

    def forget(self) -> None:
        """Ask for nothing any more, and give nothing back."""
        self._before = self._taking_ns = self._restoring = None

    def give_back(self, t_ns: int) -> None:
        """Begin to ask for what stood before, if it was us who changed it."""
        before = self._before
        self.forget()
        self._restoring = None if before is None else (t_ns, before)

    def failure(self, t_ns: int, mode: str) -> Explanation | None:
        """Why taking the control mode has failed; None while it has not."""
        if mode not in (self._control_mode, self._before, NOT_CHOSEN):
            return explain(Reason.MODE_CHANGED, mode=mode)
        if self._taking_ns is not None and t_ns - self._taking_ns >= self._timeout_ns:
            return explain(Reason.MODE_NOT_ENTERED, mode=self._control_mode)
        return None

    def advance(self, t_ns: int, mode: str | None) -> str | None:
        """The mode to ask for in this tick, and an end to giving back once it is done; `mode` None: not known."""
        if self._taking_ns is not None:
            return self._control_mode
        if self._restoring is None:
            return None
        since_ns, before = self._restoring
        if mode != self._control_mode or t_ns - since_ns >= self._timeout_ns:
            self._restoring = None  # done, or the pilot's own choice, or in vain
            return None
        return before
