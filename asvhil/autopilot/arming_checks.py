"""Why an autopilot would not arm: its own checks before arming, by SYS_STATUS and by what it says of them. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.texts import TextReader

CHECKS = int(dialect.MAV_SYS_STATUS_PREARM_CHECK)
# What its texts begin with: of the checks that it makes all the time, and of those at an attempt to arm. The last two
# are PX4's.
BEFORE, AT_ARMING = ("PreArm: ", "Preflight Fail: "), ("Arm: ", "Arming denied: ")
ROUND_NS = 2_000_000_000  # texts within this are of one round of checks
STANDS_NS = 35_000_000_000  # an ArduRover repeats what fails every 30 s
ATTEMPT_NS = 10_000_000_000
ASK_NS = 10_000_000_000
OLD_NS = 15_000_000_000  # what was told longer ago may have been mended; more often would be a nuisance to stations


class ArmingChecks:
    """Collects what fails. `is_due`: it is time to ask (MAV_CMD_RUN_PREARM_CHECKS); SYS_STATUS tells no reasons."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """The autopilot has started anew."""
        self._ok: bool | None = None
        self._texts = TextReader()
        self._fails: list[str] = []  # what is told
        self._round: list[str] = []  # what this round of texts has named so far
        self._round_ns = 0
        self._attempt: tuple[int, str] | None = None
        self._asked_ns: int | None = None

    @property
    def ok(self) -> bool | None:
        """Whether all checks pass, by SYS_STATUS; None where it does not tell."""
        return self._ok

    def on_sys_status(self, enabled: int, health: int) -> None:
        """SYS_STATUS: bits of the sensors that are in use, and of those that are well."""
        self._ok = bool(health & CHECKS) if enabled & CHECKS else None
        if self._ok is not False:
            self._fails, self._round = [], []

    def on_text(self, t_ns: int, message: Any) -> None:
        """STATUSTEXT of the autopilot."""
        text = self._texts.receive(message)
        if text is None:
            return
        for prefix in BEFORE:
            if text.startswith(prefix):
                if t_ns - self._round_ns > ROUND_NS:
                    self._round_ns, self._round = t_ns, []
                fault = text.removeprefix(prefix)
                if fault not in self._round:
                    self._round.append(fault)
                if not set(self._round) <= set(self._fails):
                    self._fails = list(self._round)  # else what the last round told stands, until this one is over
        for prefix in AT_ARMING:
            if text.startswith(prefix):
                self._attempt = t_ns, text.removeprefix(prefix)

    def fault(self, t_ns: int) -> str:
        """Why it would not arm, in the autopilot's words; empty where it would, as far as is known."""
        if self._attempt is not None and t_ns - self._attempt[0] < ATTEMPT_NS:
            return self._attempt[1]
        if self._ok is not False:
            return ""
        if t_ns - self._round_ns > ROUND_NS:
            self._fails = list(self._round)
        fails = self._fails if t_ns - self._round_ns < STANDS_NS else []
        more = f" (and {len(fails) - 1} more)" if len(fails) > 1 else ""
        return f"{fails[0]}{more}" if fails else "its checks before arming fail"

    def is_due(self, t_ns: int) -> bool:
        """Whether to ask what fails now; it counts as asked then."""
        told = self._fails and t_ns - self._round_ns < OLD_NS
        if self._ok is not False or told or (self._asked_ns is not None and t_ns - self._asked_ns < ASK_NS):
            return False
        self._asked_ns = t_ns
        return True
