"""Actuation: from a decision to the motors. When the controller solves, its limits, and whether the motors follow."""

from __future__ import annotations

import math

from asvhil.autopilot.motor_check import MotorCheck
from asvhil.autopilot.protocol import Autopilot
from asvhil.backseat.cadence import Cadence
from asvhil.controller.protocol import Controller
from asvhil.controller.pwm import Limiter
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Explanation
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.types import Control, Estimate, Frame, FrontseatStatus, Note, Phase, Wind, changed


class Actuation:
    """In each tick: `inspect` the motors before the decision, then `solve` and `drive`.

    `pulses_us` is what the motors get from us, None where they are not ours. `sent` and `control_ok` are for the next
    decision: what this tick sent, and whether its solution can be used (None where there was none).
    """

    def __init__(
        self,
        *,
        autopilot: Autopilot,
        check: MotorCheck,
        cadence: Cadence,
        controller: Controller,
        limiter: Limiter,
        neutral_us: int,
        control_mode: str,
    ) -> None:
        self._autopilot = autopilot
        self._check = check
        self._cadence = cadence
        self._controller = controller
        self._limiter = limiter
        self._neutral_us = neutral_us
        self._control_mode = control_mode
        self._command = (0.0, 0.0)
        self.pulses_us: tuple[int, int] | None = None
        self.sent: MotorPulses | None = None
        self.control_ok: bool | None = None
        self._driven = self._released = False  # what this tick sent to the motors

    # --- what the motors do --------------------------------------------------------------------------------

    def on_status(self, status: FrontseatStatus) -> None:
        """A report of the autopilot."""
        self._check.on_status(status)

    def on_station_sticks(self, sticks: StationSticks) -> None:
        """Sticks of a ground station that the autopilot obeys."""
        self._check.on_station_sticks(sticks)

    def inspect(self, t_ns: int) -> None:
        """Judge what was reported of the motors, before anything is decided in this tick."""
        self._check.step(t_ns)

    @property
    def fault(self) -> Explanation | None:
        """Why the motors do not, or would not, follow the commands."""
        return self._check.fault

    @property
    def unverified(self) -> Explanation | None:
        """What it means if the motors' sticks do not show our commands; None once they have."""
        return self._check.unverified

    @property
    def notes(self) -> tuple[Note, ...]:
        """What was found of the motors and of the autopilot's parameters."""
        return self._check.notes

    # --- what they are to do -------------------------------------------------------------------------------

    def solve(
        self, t_ns: int, decision: Decision, estimate: Estimate | None, wind: Wind | None, *, fresh: bool
    ) -> Control | None:
        """A new solution when one is due; otherwise None. In FAILSAFE it is tried too, and not sent: it may recover.

        `fresh`: the tick has brought something from the autopilot or a sensor.
        """
        self.control_ok = None
        if decision.station_changed and decision.station is not None:
            self._controller.new_station()
        elif decision.station_changed:
            self._controller.reset()
        if decision.begun:
            self._cadence.restart()
        if decision.station is None or estimate is None or not estimate.valid:
            self._cadence.restart()
            self._command = (0.0, 0.0)
            return None
        if not self._cadence.advance(t_ns, fresh):
            return None
        control = self._controller.step(estimate, wind, decision.station)
        if control.ok and not all(map(math.isfinite, control.command)):
            control = changed(control, ok=False)  # as neutral it would pass for a hold
        self._command = control.command if control.ok else (0.0, 0.0)
        self.control_ok = control.ok
        return control

    def drive(self, t_ns: int, decision: Decision) -> list[Frame]:
        """The motors in this tick: sent in every tick, from a command no older than one control period."""
        if decision.drive and self.control_ok is not False:
            self.pulses_us = self._limiter.step(t_ns, self._command)
        elif decision.drive or decision.neutral:
            self.pulses_us = self._limiter.neutral()
        else:
            self._limiter.reset()
            self.pulses_us = None
        self._driven, self._released = self.pulses_us is not None, decision.release
        frames: list[Frame] = []
        self.sent = None
        if self.pulses_us is not None:
            frames += self._autopilot.drive(t_ns, *self.pulses_us)
            self.sent = MotorPulses(t_ns=t_ns, us=self.pulses_us, sticks_us=self._autopilot.driven_sticks_us)
        held = decision.phase in (Phase.HOLD, Phase.FAILSAFE)
        self._check.note_output(t_ns, self.pulses_us if held else None)
        if decision.release:
            frames += self._autopilot.release(t_ns)
            self.pulses_us = None
        if decision.prepare:
            frames += self._autopilot.request_mode(t_ns, self._control_mode)
            frames += self._autopilot.request_arming(t_ns)
        if decision.ask_mode is not None:
            frames += self._autopilot.request_mode(t_ns, decision.ask_mode)
        return frames

    def last_words(self, t_ns: int) -> list[list[Frame]]:
        """What another process is to send, step by step, if this one dies before the next tick; changes nothing."""
        if not (self._driven or self._released):
            return []
        return self._autopilot.last_words(t_ns, neutral=self._driven)

    def release_to_pilot(self, t_ns: int) -> list[Frame]:
        """Neutral and release, for a shell that can no longer step the backseat.

        Neutral alone where the last override stands after a release: sent with one, it would have no effect.
        """
        neutral = self._autopilot.drive(t_ns, self._neutral_us, self._neutral_us)
        return neutral if self._autopilot.keeps_override else [*neutral, *self._autopilot.release(t_ns)]
