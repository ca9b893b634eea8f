"""The backseat: a pure function of recorded bytes. Decode, estimate, supervise, control, encode; no clock, no I/O."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from asvhil.autopilot.protocol import Autopilot
from asvhil.backseat.actuation import Actuation
from asvhil.backseat.command import PORT as OPERATOR
from asvhil.backseat.command import Command
from asvhil.config import PwmConfig
from asvhil.controller.pwm import command_of_pulse
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator.monitor import ModelMonitor
from asvhil.estimator.protocol import StateEstimator
from asvhil.estimator.wind import WindFilter
from asvhil.estimator.wind_load import WindFromLoad
from asvhil.geo import LocalFrame
from asvhil.io.sensors.firmware import FirmwareWatch
from asvhil.io.sensors.protocol import SensorCodec
from asvhil.io.sensors.sources import SourceSelector
from asvhil.supervisor.reasons import describe
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.supervisor import Decision
from asvhil.types import (
    Attitude,
    BowWind,
    Estimate,
    Frame,
    FrontseatStatus,
    GnssFix,
    Health,
    Imu,
    Inputs,
    Measurement,
    Note,
    Outputs,
    TrueWind,
    Wind,
    WindSample,
)

REMEMBERED_NS = 30_000_000_000  # for so long a wind that was told is a better guess than the disturbance


class Backseat:
    """One boat's estimation and control. The same object live, in lockstep and in replay; `step` is its only verb."""

    def __init__(
        self,
        *,
        model: Dynamics,
        autopilot: Autopilot,
        sensors: Mapping[str, SensorCodec],
        firmware: FirmwareWatch,
        selector: SourceSelector,
        estimator: StateEstimator,
        wind: WindFilter,
        wind_load: WindFromLoad | None,
        monitor: ModelMonitor,
        pwm: PwmConfig,
        command: Command,
        actuation: Actuation,
    ) -> None:
        self._model = model
        self._autopilot = autopilot
        self._sensors = sensors
        self._firmware = firmware
        self._selector = selector
        self._estimator = estimator
        self._wind = wind
        self._wind_load = wind_load
        self._monitor = monitor
        self._model_ok = True
        self._pwm = pwm
        self._command = command
        self._actuation = actuation
        self._status: FrontseatStatus | None = None
        self._forcing_wind: Wind | None = None
        self._wind_ns = -REMEMBERED_NS
        self._readers: dict[str, Callable[[Frame], Sequence[tuple[str, Measurement]]]] = {
            "autopilot": autopilot.read,
            **{port: codec.read for port, codec in sensors.items()},
        }

    @property
    def frame(self) -> LocalFrame | None:
        """The local NED frame, once the first position is known."""
        return self._estimator.frame

    def step(self, inputs: Inputs) -> Outputs:
        """Everything that one tick does. Never raises on the content of the frames."""
        t_ns = inputs.t_ns
        self._take_in(inputs)
        wind = self._wind.wind(t_ns)
        usable_wind = wind if wind is not None and wind.valid else None
        if (usable_wind is None) != (self._forcing_wind is None):
            # Before the estimate, so that the controller gets wind and disturbance of one mind.
            self._force(usable_wind)
        estimate = self._estimator.estimate(t_ns)
        if usable_wind is not None:
            self._wind_ns = t_ns
        elif estimate is not None and self._wind_load is not None and t_ns - self._wind_ns > REMEMBERED_NS:
            wind = self._wind_load.wind(estimate)
        self._actuation.inspect(t_ns)
        situation = self._situation(t_ns, estimate)
        decision = self._command.step(situation)
        fresh = any(frame.port != OPERATOR for frame in inputs.frames)
        control = self._actuation.solve(t_ns, decision, estimate, usable_wind, fresh=fresh)
        frames = self._actuation.drive(t_ns, decision)
        model_input = self._model_input()
        self._force(usable_wind)
        model_error = None
        if control is not None and estimate is not None:
            model_error = self._monitor.step(estimate, model_input, usable_wind)
            self._model_ok = model_error is None or model_error.ok
        firmware = self._firmware.note()
        own = () if firmware is None else (firmware,)
        sensors = (*self._estimator.notes(t_ns), *self._wind.notes(t_ns))
        notes = (*self._autopilot.notes, *self._actuation.notes, *sensors, *own)
        frames += self._autopilot.poll(t_ns)
        frames += self._firmware.poll(t_ns)
        frames += self._command.data_to_send(situation, decision, control, self._selector.switches(t_ns), notes)
        return Outputs(
            t_ns=t_ns,
            phase=decision.phase,
            frames=tuple(frames),
            estimate=estimate,
            wind=wind,
            station=decision.station,
            control=control,
            pwm_us=self._actuation.pulses_us,
            health=self._health(t_ns, decision, estimate, wind, notes),
            origin_deg=None if self.frame is None else (self.frame.lat_deg, self.frame.lon_deg),
            model_error=model_error,
            autopilot_clock=self._autopilot.clock,
        )

    def release_to_pilot(self, t_ns: int) -> list[Frame]:
        """Neutral and release, for a shell that can no longer call `step`."""
        return self._actuation.release_to_pilot(t_ns)

    # --- stages --------------------------------------------------------------------------------------------

    def _take_in(self, inputs: Inputs) -> None:
        """Decode every frame: each measurement to its estimator, what operators ask for to `command`."""
        for frame in inputs.frames:
            if frame.port == OPERATOR:
                self._command.receive(frame)
                continue
            if frame.port == self._firmware.port:
                self._firmware.read(frame)
            reader = self._readers.get(frame.port)
            for message, measurement in reader(frame) if reader else ():
                for chosen in self._selector.select(frame.port, message, measurement):
                    self._measure(chosen)

    def _measure(self, measurement: Measurement) -> None:
        match measurement:
            case Attitude():
                self._estimator.on_attitude(measurement)
            case GnssFix():
                self._estimator.on_gnss(measurement)
            case Imu():
                self._estimator.on_imu(measurement)
            case FrontseatStatus():
                self._status = measurement
                self._actuation.on_status(measurement)
            case WindSample():
                estimate = self._estimator.estimate(measurement.t_ns)
                if estimate is not None:
                    self._wind.on_sample(measurement, estimate)
            case BowWind():
                estimate = self._estimator.estimate(measurement.t_ns)
                if estimate is not None:
                    self._wind.on_bow_wind(measurement, estimate)
            case TrueWind():
                self._wind.on_true_wind(measurement)
            case _:
                pass

    def _model_input(self) -> tuple[float, float]:
        """The model's input under what drives the boat from now on: our pulses, or else the autopilot's outputs."""
        pulses = self._actuation.pulses_us
        if pulses is None:
            status = self._status
            outputs = status.outputs_us if status is not None else ()
            channels = (self._pwm.port_channel, self._pwm.starboard_channel)
            port_us, starboard_us = (outputs[c - 1] if len(outputs) >= c else 0 for c in channels)
            pulses = (port_us, starboard_us)
        command = (command_of_pulse(self._pwm, pulses[0]), command_of_pulse(self._pwm, pulses[1]))
        return self._model.input_of_command(command)

    def _force(self, wind: Wind | None) -> None:
        """What drives the estimator's prediction from now on."""
        self._forcing_wind = wind
        self._estimator.set_forcing(self._model_input(), None if wind is None else (wind.vn_mps, wind.ve_mps))

    def _situation(self, t_ns: int, estimate: Estimate | None) -> Situation:
        """What this tick is decided by."""
        heard_ns = self._autopilot.autopilot_heartbeat_ns
        return Situation(
            t_ns=t_ns,
            status=self._status,
            heartbeat_age_s=None if heard_ns is None else (t_ns - heard_ns) * 1e-9,
            estimate=estimate,
            frame=self._estimator.frame,
            fault=self._actuation.fault,
            unverified=self._actuation.unverified,
            control_ok=self._actuation.control_ok,
            sent=self._actuation.sent,
        )

    def _health(
        self, t_ns: int, decision: Decision, estimate: Estimate | None, wind: Wind | None, notes: tuple[Note, ...]
    ) -> Health:
        solved_ok = self._actuation.control_ok
        return Health(
            reason=describe(decision.why),
            code=decision.why.reason.value,
            link_ok=decision.link_ok,
            estimate_ok=estimate is not None and estimate.valid,
            wind_ok=wind is not None and wind.valid,
            control_ok=decision.control_ok if solved_ok is None else solved_ok,
            model_ok=self._model_ok,
            counters=(
                *self._autopilot.counters(),
                *(counter for codec in self._sensors.values() for counter in codec.counters()),
                *self._command.counters(),
                *self._estimator.counters(),
            ),
            sources=self._selector.current(t_ns),
            notes=notes,
        )
