"""The backseat: a pure function of recorded bytes. Decode, estimate, supervise, control, encode; no clock, no I/O."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from asvhil.autopilot.motor_check import MotorCheck
from asvhil.autopilot.protocol import Autopilot
from asvhil.backseat.cadence import Cadence
from asvhil.config import PwmConfig
from asvhil.controller.protocol import Controller
from asvhil.controller.pwm import PulseLimiter, command_of_pulse
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator.monitor import ModelMonitor
from asvhil.estimator.protocol import StateEstimator
from asvhil.estimator.wind import WindFilter
from asvhil.estimator.wind_load import WindFromLoad
from asvhil.geo import LocalFrame
from asvhil.io.sensors.firmware import FirmwareWatch
from asvhil.io.sensors.protocol import SensorCodec
from asvhil.io.sensors.sources import SourceSelector
from asvhil.operator.operations import Operations
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.supervisor import Decision, Supervisor
from asvhil.types import (
    Attitude,
    BowWind,
    Control,
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
    Phase,
    Station,
    TrueWind,
    Wind,
    WindSample,
)

OPERATOR = "operator"

REMEMBERED_NS = 30_000_000_000  # for so long a wind that was told is a better guess than the disturbance


class Backseat:
    """One boat's estimation and control. The same object live, in lockstep and in replay; `step` is its only verb."""

    def __init__(
        self,
        *,
        model: Dynamics,
        link: Autopilot,
        sensors: Mapping[str, SensorCodec],
        firmware: FirmwareWatch,
        selector: SourceSelector,
        operations: Operations,
        estimator: StateEstimator,
        wind: WindFilter,
        wind_load: WindFromLoad | None,
        monitor: ModelMonitor,
        supervisor: Supervisor,
        motors: MotorCheck,
        controller: Controller,
        pwm: PwmConfig,
        control_mode: str,
        cadence: Cadence,
    ) -> None:
        self._model = model
        self._link = link
        self._sensors = sensors
        self._firmware = firmware
        self._notes: tuple[Note, ...] = ()
        self._selector = selector
        self._operations = operations
        self._estimator = estimator
        self._wind = wind
        self._wind_load = wind_load
        self._monitor = monitor
        self._model_ok = True
        self._supervisor = supervisor
        self._motors = motors
        self._controller = controller
        self._pwm = pwm
        self._control_mode = control_mode
        self._cadence = cadence
        self._limiter = PulseLimiter(pwm)
        self._status: FrontseatStatus | None = None
        self._command = (0.0, 0.0)
        self._pulses_us: tuple[int, int] | None = None
        self._forcing_wind: Wind | None = None
        self._wind_ns = -REMEMBERED_NS
        self._station: Station | None = None
        self._readers: dict[str, Callable[[Frame], Sequence[tuple[str, Measurement]]]] = {
            "autopilot": link.read,
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
        known = self._known(t_ns, estimate)
        answers, begun = self._operations.answer(known)
        if begun:
            self._cadence.restart()
        decision = self._supervisor.step(known)
        if decision.station is None and self._station is not None:
            self._controller.reset()
        self._station = decision.station
        fresh = any(frame.port != OPERATOR for frame in inputs.frames)
        control = self._control(t_ns, decision, estimate, usable_wind, fresh)
        motor_frames = self._actuate(t_ns, decision, control)
        model_input = self._model_input()
        self._force(usable_wind)
        model_error = None
        if control is not None and estimate is not None:
            model_error = self._monitor.step(estimate, model_input, usable_wind)
            self._model_ok = model_error is None or model_error.ok
        firmware = self._firmware.note()
        own = () if firmware is None else (firmware,)
        sensors = (*self._estimator.notes(t_ns), *self._wind.notes(t_ns))
        self._notes = (*self._link.notes, *self._motors.notes, *sensors, *own)
        polled = (*self._link.poll(t_ns), *self._firmware.poll(t_ns))
        switches = self._selector.switches(t_ns)
        reports = self._operations.report(t_ns, decision, estimate, control, switches, self._notes)
        frames = [*motor_frames, *answers, *polled, *reports]
        return Outputs(
            t_ns=t_ns,
            phase=decision.phase,
            frames=tuple(frames),
            estimate=estimate,
            wind=wind,
            station=decision.station,
            control=control,
            pwm_us=self._pulses_us,
            health=self._health(t_ns, decision, estimate, wind),
            origin_deg=None if known.frame is None else (known.frame.lat_deg, known.frame.lon_deg),
            model_error=model_error,
            autopilot_clock=self._link.clock,
        )

    def surrender(self, t_ns: int) -> list[Frame]:
        """Neutral and release, for a shell that can no longer call `step`."""
        neutral_us = self._pwm.neutral_us
        return [*self._link.drive(t_ns, neutral_us, neutral_us), *self._link.release(t_ns)]

    # --- stages --------------------------------------------------------------------------------------------

    def _take_in(self, inputs: Inputs) -> None:
        """Decode every frame: each measurement to its estimator, what the operator asks to `operations`."""
        for frame in inputs.frames:
            if frame.port == OPERATOR:
                self._operations.take(frame)
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
                self._motors.on_status(measurement)
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

    def _control(
        self, t_ns: int, decision: Decision, estimate: Estimate | None, wind: Wind | None, fresh: bool
    ) -> Control | None:
        """A new solution when one is due; otherwise None. In FAILSAFE it is tried too, and not sent: it may recover."""
        if decision.station is None or estimate is None or not estimate.valid:
            self._cadence.restart()
            self._command = (0.0, 0.0)
            return None
        if not self._cadence.due(t_ns, fresh):
            return None
        control = self._controller.step(estimate, wind, decision.station)
        self._command = control.command if control.ok else (0.0, 0.0)
        self._supervisor.note_control(control.ok)
        return control

    def _actuate(self, t_ns: int, decision: Decision, control: Control | None) -> list[Frame]:
        """The motors in this tick: said in every tick, from a command no older than one control period."""
        failed = control is not None and not control.ok
        if decision.drive and not failed:
            self._pulses_us = self._limiter.step(t_ns, self._command)
        elif decision.drive or decision.neutral:
            self._pulses_us = self._limiter.neutral()
        else:
            self._limiter.reset()
            self._pulses_us = None
        frames: list[Frame] = []
        if self._pulses_us is not None:
            frames += self._link.drive(t_ns, *self._pulses_us)
            self._supervisor.note_sent(t_ns, self._pulses_us)
        driving = decision.phase in (Phase.HOLD, Phase.FAILSAFE)
        self._motors.drove(t_ns, self._pulses_us if driving else None)
        if decision.release:
            frames += self._link.release(t_ns)
            self._pulses_us = None
        if decision.prepare:
            frames += self._link.request_mode(t_ns, self._control_mode)
            frames += self._link.request_arming(t_ns)
        if decision.ask_mode is not None:
            frames += self._link.request_mode(t_ns, decision.ask_mode)
        return frames

    def _model_input(self) -> tuple[float, float]:
        """The model's input under what drives the boat from now on: our pulses, or else the autopilot's outputs."""
        pulses = self._pulses_us
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

    def _known(self, t_ns: int, estimate: Estimate | None) -> Situation:
        """What this tick is decided by."""
        return Situation(
            t_ns=t_ns,
            status=self._status,
            heartbeat_age_s=self._heartbeat_age_s(t_ns),
            estimate=estimate,
            frame=self._estimator.frame,
            fault=self._motors.step(t_ns),
            unheard=self._motors.unheard,
        )

    def _heartbeat_age_s(self, t_ns: int) -> float | None:
        heard_ns = self._link.autopilot_heartbeat_ns
        return None if heard_ns is None else (t_ns - heard_ns) * 1e-9

    def _health(self, t_ns: int, decision: Decision, estimate: Estimate | None, wind: Wind | None) -> Health:
        age_s = self._heartbeat_age_s(t_ns)
        return Health(
            reason=decision.reason,
            link_ok=self._supervisor.link_ok(age_s),
            estimate_ok=estimate is not None and estimate.valid,
            wind_ok=wind is not None and wind.valid,
            control_ok=self._supervisor.control_ok,
            model_ok=self._model_ok,
            counters=(
                *self._link.counters(),
                *(counter for codec in self._sensors.values() for counter in codec.counters()),
                *self._operations.counters(),
                *self._estimator.counters(),
            ),
            sources=self._selector.current(t_ns),
            notes=self._notes,
        )
