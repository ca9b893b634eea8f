"""The backseat: a pure function of recorded bytes. Decode, estimate, supervise, control, encode; no clock, no I/O."""

from __future__ import annotations

from asvhil.autopilot.protocol import Autopilot
from asvhil.backseat.actuation import Actuation
from asvhil.backseat.command import Command
from asvhil.backseat.doubt import doubt
from asvhil.backseat.perception import Perceived, Perception
from asvhil.config.ports import OPERATOR
from asvhil.geo import LocalFrame
from asvhil.motion.watch import MotionWatch
from asvhil.operator.operations import Readings
from asvhil.supervisor.battery_watch import BatteryWatch
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.docking import DockingWatch
from asvhil.supervisor.energy import EnergyWatch
from asvhil.supervisor.heading_cost import HeadingCostWatch
from asvhil.supervisor.reasons import Explanation, describe
from asvhil.supervisor.situation import Situation, StationSticks
from asvhil.types import DockingWindow, EnergyUse, Frame, FrontseatStatus, Health, Inputs, Learned, Note, Outputs, Phase


class Backseat:
    """One boat's estimation and control. The same object live, in lockstep and in replay; `step` is its only verb."""

    def __init__(
        self,
        *,
        autopilot: Autopilot,
        perception: Perception,
        motion: MotionWatch,
        battery: BatteryWatch,
        heading_cost: HeadingCostWatch | None,
        docking: DockingWatch | None,
        energy: EnergyWatch | None,
        command: Command,
        actuation: Actuation,
        near_m: float,
    ) -> None:
        self._autopilot = autopilot
        self._motion = motion
        self._battery = battery
        self._heading_cost = heading_cost
        self._docking = docking
        self._energy = energy
        self._perception = perception
        self._command = command
        self._actuation = actuation
        self._near_m = near_m
        self._station_sticks: tuple[StationSticks, ...] = ()  # heard in this tick
        self._told: tuple[Explanation, str, str] | None = None  # the last reason, its text and code: it stands for long

    @property
    def frame(self) -> LocalFrame | None:
        """The local NED frame, once the first position is known."""
        return self._perception.frame

    @property
    def vehicle(self) -> FrontseatStatus | None:
        """What the autopilot has last said of itself; for those who look on."""
        return self._perception.status

    def step(self, inputs: Inputs) -> Outputs:
        """Everything that one tick does. Never raises on the content of the frames."""
        t_ns = inputs.t_ns
        seen = self._take_in(inputs)
        self._actuation.inspect(t_ns)
        situation = self._situation(seen)
        decision = self._command.step(situation)
        fresh = any(frame.port != OPERATOR for frame in inputs.frames)
        control = self._actuation.solve(t_ns, decision, seen.estimate, seen.usable_wind, fresh=fresh)
        frames = self._actuation.drive(t_ns, decision)
        self._perception.note_pulses(self._actuation.pulses_us, seen.usable_wind)
        learned = self._learn(seen, decision)
        model_error = self._perception.check_model(seen) if control is not None else None
        self._motion.note_station(decision.station, decision.point, decision.heading_policy)
        self._perception.note_station(decision.station)
        self._perception.note_current(*self._motion.current)
        cost: tuple[Note, ...] = ()
        if self._heading_cost is not None:
            # A heading that follows the weather is off it within its dead band, or on the way to it.
            asked_for = decision.station if decision.heading_policy == "fixed" else None
            cost = self._heading_cost.step(t_ns, asked_for, self._perception.push_at, self._perception.push_at_rest)
        docking: DockingWindow | None = None
        if self._docking is not None:
            held = decision.station if decision.phase is Phase.HOLD else None
            docking = self._docking.step(t_ns, seen.estimate, held, put=decision.station_changed)
        pulses_us = self._actuation.pulses_us
        energy: EnergyUse | None = None
        if self._energy is not None:
            energy = self._energy.step(
                t_ns, seen.status, pulses_us, held=decision.phase in (Phase.HOLD, Phase.FAILSAFE)
            )
        outside = (*self._autopilot.notes, *self._actuation.notes, *self._perception.notes(t_ns))
        notes = (*outside, *decision.notes, *self._motion.notes, *self._battery.notes, *cost, *self._command.notes)
        frames += self._autopilot.data_to_send(t_ns)
        frames += self._perception.data_to_send(t_ns)
        switches, sources = self._perception.switches(t_ns), self._perception.sources(t_ns)
        readings = Readings(wind=seen.wind, pulses_us=pulses_us, sources=sources, docking=docking, energy=energy)
        frames += self._command.data_to_send(situation, decision, control, switches, notes, readings)
        return Outputs(
            t_ns=t_ns,
            phase=decision.phase,
            frames=tuple(frames),
            estimate=seen.estimate,
            wind=seen.wind,
            station=decision.station,
            control=control,
            pwm_us=pulses_us,
            health=self._health(decision, seen, notes, sources),
            origin_deg=None if seen.frame is None else (seen.frame.lat_deg, seen.frame.lon_deg),
            model_error=model_error,
            autopilot_clock=self._autopilot.clock,
            waves=seen.waves,
            docking=docking,
            learned=learned,
            energy=energy,
        )

    def release_to_pilot(self, t_ns: int) -> list[Frame]:
        """Neutral and release, for a shell that can no longer call `step`."""
        return self._actuation.release_to_pilot(t_ns)

    def last_words(self, t_ns: int) -> list[list[Frame]]:
        """What another process is to send to the motors, step by step, if this one dies before its next `step`.

        Changes nothing, so that a replay does not need it; empty while the motors are not ours.
        """
        return self._actuation.last_words(t_ns)

    # --- stages --------------------------------------------------------------------------------------------

    def _take_in(self, inputs: Inputs) -> Perceived:
        """Every frame: what operators ask for to `command`, the rest to perception."""
        for frame in inputs.frames:
            if frame.port == OPERATOR:
                self._command.receive(frame)
                self._autopilot.receive_of_operator(frame)
        seen = self._perception.step(inputs)
        self._station_sticks = self._autopilot.take_station_sticks()
        for sticks in self._station_sticks:
            self._actuation.on_station_sticks(sticks)
        for status in seen.statuses:
            self._actuation.on_status(status)
        return seen

    def _situation(self, seen: Perceived) -> Situation:
        """What this tick is decided by."""
        motion = self._motion.step(
            seen.t_ns,
            seen.measurements,
            self._perception.command,
            seen.usable_wind,
            seen.estimate,
            seen.ailing,
            seen.waves,
        )
        self._battery.step(seen.t_ns, seen.status)
        beat_ns, heard_ns = self._autopilot.autopilot_heartbeat_ns, self._autopilot.autopilot_heard_ns
        station_ns = self._autopilot.station_heard_ns
        return Situation(
            t_ns=seen.t_ns,
            status=seen.status,
            statuses=seen.statuses,
            heartbeat_age_s=None if beat_ns is None else (seen.t_ns - beat_ns) * 1e-9,
            heard_age_s=None if heard_ns is None else (seen.t_ns - heard_ns) * 1e-9,
            stranger=self._autopilot.stranger,
            slow=self._autopilot.slow_stream,
            estimate=seen.estimate,
            frame=seen.frame,
            fault=self._actuation.fault or self._battery.fault,
            unverified=self._actuation.unverified,
            motion=motion or self._perception.mismatch,
            lacks=self._perception.lacks,
            control_ok=self._actuation.control_ok,
            sent=self._actuation.sent,
            station_age_s=None if station_ns is None else (seen.t_ns - station_ns) * 1e-9,
            station_sticks=self._station_sticks,
            bow_rad=seen.bow_rad,
            bow_push_mps2=seen.bow_push_mps2,
        )

    def _learn(self, seen: Perceived, decision: Decision) -> Learned | None:
        """What is learned of the model by the boat's motion, where that can be trusted."""
        if not self._perception.learns:
            return None
        motors_ok = self._actuation.fault is None and self._actuation.unverified is None and not self._motion.notes
        return self._perception.learn(
            seen,
            doubt(
                seen,
                decision.phase,
                decision.station,
                near_m=self._near_m,
                sensors_ok=not self._perception.sensors_in_doubt(seen.t_ns),
                motors_ok=motors_ok,
            ),
            held=decision.station is not None,
        )

    def _health(
        self, decision: Decision, seen: Perceived, notes: tuple[Note, ...], sources: tuple[tuple[str, str], ...]
    ) -> Health:
        solved_ok, why = self._actuation.control_ok, decision.why
        if self._told is None or self._told[0] is not why:
            self._told = why, describe(why), why.reason.value
        return Health(
            reason=self._told[1],
            code=self._told[2],
            link_ok=decision.link_ok,
            estimate_ok=seen.estimate is not None and seen.estimate.valid,
            wind_ok=seen.usable_wind is not None,
            control_ok=decision.control_ok if solved_ok is None else solved_ok,
            model_ok=self._perception.model_ok,
            counters=(
                *self._autopilot.counters(),
                *self._perception.counters(),
                *self._command.counters(),
            ),
            sources=sources,
            notes=notes,
        )
