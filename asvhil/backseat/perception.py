"""Perception: frames to what is known of the boat and the wind, by the end of a tick."""

from __future__ import annotations

from asvhil.config import PwmConfig
from asvhil.controller.pwm import command_of_pulse
from asvhil.dynamics.protocol import Dynamics
from asvhil.estimator import sensor_health
from asvhil.estimator.ekf import NAMES
from asvhil.estimator.learned_words import LearningNotes
from asvhil.estimator.learning import Learner
from asvhil.estimator.model_watch import ModelWatch
from asvhil.estimator.protocol import StateEstimator
from asvhil.estimator.wave_filter import WaveFilter
from asvhil.estimator.weather import WeatherHeading
from asvhil.estimator.wind import WindFilter
from asvhil.estimator.wind_load import WindFromLoad
from asvhil.geo import LocalFrame
from asvhil.io.sensors.decoder import Decoder
from asvhil.io.sensors.firmware import FirmwareWatch
from asvhil.io.sensors.sources import Switch
from asvhil.supervisor.reasons import Explanation
from asvhil.types import (
    ApparentWind,
    BowWind,
    Estimate,
    Frame,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    Inputs,
    Learned,
    Measurement,
    Note,
    Position,
    PredictionError,
    Station,
    TrueWind,
    WaveMotion,
    Wind,
    YawRate,
    record,
)

NOT_THE_ESTIMATORS = frozenset({FrontseatStatus, ApparentWind, BowWind, TrueWind})
WATCHED: dict[str, type] = {
    NAMES["position"]: Position,
    NAMES["velocity"]: GroundVelocity,
    NAMES["heading"]: Heading,
    NAMES["yaw_rate"]: YawRate,
}
PLACED = frozenset({NAMES["position"], NAMES["heading"], NAMES["yaw_rate"]})  # what validity asks for
# How a sensor that the estimate lacks is told: a source that is heard and not believed is not one that is silent.
LACKS = {
    sensor_health.SILENT: "silent",
    sensor_health.FROZEN: "frozen",
    sensor_health.REJECTED: "rejected, though heard",
}
DEAD = frozenset({sensor_health.SILENT, sensor_health.FROZEN})
NONE_AILS: frozenset[type] = frozenset()
REMEMBERED_NS = 30_000_000_000  # for so long a measured wind is a better guess than the disturbance


@record
class Perceived:
    """What is known by the end of the frames of a tick.

    `statuses` are those of the autopilot that came in this tick, `status` is the last so far. `wind` is the one to
    show, `usable_wind` the one to predict with: of a sensor, and valid. `frame` is the local NED frame. None: not
    known. The `waves` have been taken out of the estimate. `measurements` are those of the boat's motion that came in
    this tick, `ailing` the kinds of these whose sensor is silent or frozen. `bow_rad`: the heading with the weather's
    mean force on the bow, where the station's follows it, and `bow_push_mps2` that force there.
    """

    t_ns: int
    statuses: tuple[FrontseatStatus, ...]
    status: FrontseatStatus | None
    estimate: Estimate | None
    wind: Wind | None
    usable_wind: Wind | None
    frame: LocalFrame | None
    waves: WaveMotion | None = None
    measurements: tuple[Measurement, ...] = ()
    ailing: frozenset[type] = frozenset()
    bow_rad: float | None = None
    bow_push_mps2: float = 0.0


class Perception:
    """Decoder, state and wind estimation, and the watch over model and firmware.

    In each tick `step` comes first, and `note_pulses` once the pulses of the motors are known: they drive the
    estimator's prediction from then on.
    """

    def __init__(
        self,
        *,
        decoder: Decoder,
        firmware: FirmwareWatch,
        estimator: StateEstimator,
        wind: WindFilter,
        wind_load: WindFromLoad | None,
        waves: WaveFilter | None,
        model_watch: ModelWatch,
        weather: WeatherHeading,
        learner: Learner | None,
        model: Dynamics,
        pwm: PwmConfig,
    ) -> None:
        self._decoder = decoder
        self._firmware = firmware
        self._estimator = estimator
        self._wind = wind
        self._wind_load = wind_load
        self._waves = waves
        self._model_watch = model_watch
        self._weather = weather
        self._learner = learner
        self._learning_notes = LearningNotes()
        self._learned: Learned | None = None
        self._model = model
        self._pwm = pwm
        self._status: FrontseatStatus | None = None
        self._statuses: list[FrontseatStatus] = []
        self._measurements: list[Measurement] = []
        self._sensor_notes: tuple[Note, ...] = ()
        self._pulses_us: tuple[int, int] | None = None
        self._forcing_wind: Wind | None = None
        self._wind_ns = -REMEMBERED_NS
        self._model_input = (0.0, 0.0)
        self._driving_us: tuple[int, int] | None = None  # the pulses of command and model input
        self.command = (0.0, 0.0)  # of the motors since the last tick, ours or the autopilot's

    @property
    def frame(self) -> LocalFrame | None:
        """The local NED frame, once the first position is known."""
        return self._estimator.frame

    @property
    def status(self) -> FrontseatStatus | None:
        """The autopilot's status, the last so far."""
        return self._status

    def step(self, inputs: Inputs) -> Perceived:
        """Take in the frames of a tick; those of other ports than the autopilot's and the sensors' are ignored."""
        t_ns = inputs.t_ns
        self._statuses.clear()
        self._measurements.clear()
        for frame in inputs.frames:
            self._on_frame(frame)
        wind = self._wind.wind(t_ns)
        usable_wind = wind if wind is not None and wind.valid else None
        if (usable_wind is None) != (self._forcing_wind is None):
            # Before the estimate, so that the controller gets wind and disturbance of one mind.
            self._set_forcing(usable_wind)
        estimate = self._estimator.estimate(t_ns)
        if self._waves is not None:
            estimate = self._waves.step(estimate)
        self._sensor_notes = self._estimator.notes(t_ns)
        if usable_wind is not None:
            self._wind_ns = t_ns
        elif estimate is not None and self._wind_load is not None and t_ns - self._wind_ns > REMEMBERED_NS:
            wind = self._wind_load.wind(estimate)
        return Perceived(
            t_ns=t_ns,
            statuses=tuple(self._statuses),
            status=self._status,
            estimate=estimate,
            wind=wind,
            usable_wind=usable_wind,
            frame=self._estimator.frame,
            waves=None if self._waves is None else self._waves.waves,
            bow_rad=self._weather.step(t_ns, estimate, usable_wind),
            bow_push_mps2=self._weather.push_mps2,
            measurements=tuple(self._measurements),
            ailing=_ailing(self._sensor_notes) if self._sensor_notes else NONE_AILS,
        )

    def note_pulses(self, pulses_us: tuple[int, int] | None, wind: Wind | None) -> None:
        """The pulses (us) that are sent from now on, None where the autopilot has the motors, and the usable wind."""
        self._pulses_us = pulses_us
        self._set_forcing(wind)

    def note_current(self, current_mps: tuple[float, float], std_mps: float) -> None:
        """The current (north, east) that the watch over the motion has made out, and its standard deviation."""
        self._weather.note_current(current_mps, std_mps)
        self._model_watch.note_current(current_mps, std_mps)

    def push_at(self, psi_rad: float) -> tuple[float, float] | None:
        """The weather's mean push (m/s^2) ahead and to starboard at a heading; None where it is not known."""
        return self._weather.push_at(psi_rad)

    def push_at_rest(self, psi_rad: float) -> tuple[float, float] | None:
        """The same without the water's drag on a boat that moves with its station."""
        return self._weather.push_at_rest(psi_rad)

    def check_model(self, seen: Perceived) -> PredictionError | None:
        """In a control tick, after `note_pulses`: the errors of the model's prediction, once its horizon is filled."""
        if seen.estimate is None:
            return None
        return self._model_watch.step(seen.estimate, self._model_input, seen.usable_wind)

    def learn(self, seen: Perceived, doubt: str, *, held: bool = True) -> Learned | None:
        """In each tick, after `note_pulses`: what is learned of the model; `doubt`: why not now."""
        if self._learner is not None:
            if not held:
                self._learner.rest()
            self._learned = self._learner.step(seen.estimate, self._model_input, seen.usable_wind, doubt)
        return self._learned

    @property
    def learns(self) -> bool:
        """Whether the model is corrected while a station is held."""
        return self._learner is not None

    def sensors_in_doubt(self, t_ns: int) -> bool:
        """Whether the health of any sensor, the anemometer too, has something to tell."""
        return bool(self._sensor_notes or self._wind.notes(t_ns))

    @property
    def lacks(self) -> str:
        """Which sensors of place and heading the estimate does without, and why; empty where it has them all."""
        if not self._sensor_notes:
            return ""
        return ", ".join(
            f"{note.subject} {LACKS[note.text]}"
            for note in self._sensor_notes
            if note.subject in PLACED and note.text in LACKS
        )

    @property
    def model_ok(self) -> bool:
        """Whether the boat behaves as the model says."""
        return self._model_watch.ok

    @property
    def mismatch(self) -> Explanation | None:
        """Why a hold is to end for a model that does not fit the boat."""
        return self._model_watch.fault

    def note_station(self, station: Station | None) -> None:
        """The station that is held from now on, None where none is."""
        self._model_watch.note_held(held=station is not None)
        self._weather.note_motion((0.0, 0.0) if station is None else (station.vn_mps, station.ve_mps))

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """The sensors that are not as they should be, the anemometer's firmware, and a model that does not fit."""
        firmware = self._firmware.note()
        own = () if firmware is None else (firmware,)
        learned = () if self._learned is None else self._learning_notes.step(self._learned)
        return (*self._sensor_notes, *self._wind.notes(t_ns), *own, *self._model_watch.notes, *learned)

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """Questions to the sensors."""
        return self._firmware.data_to_send(t_ns)

    def sources(self, t_ns: int) -> tuple[tuple[str, str], ...]:
        """The source in use for each quantity, empty where none is heard."""
        return self._decoder.sources(t_ns)

    def switches(self, t_ns: int) -> list[Switch]:
        """The changes of source since the last call."""
        return self._decoder.switches(t_ns)

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of the sensor links and of the estimator."""
        return (*self._decoder.counters(), *self._estimator.counters())

    def _on_frame(self, frame: Frame) -> None:
        if frame.port == self._firmware.port:
            self._firmware.receive(frame)
        measurements = self._decoder.decode(frame)
        if measurements:
            self._estimator.on_measurements(measurements)
        for measurement in measurements:
            if type(measurement) in NOT_THE_ESTIMATORS:
                self._on_wind_or_status(measurement)
            else:
                self._measurements.append(measurement)

    def _on_wind_or_status(self, measurement: Measurement) -> None:
        """Wind, and the autopilot's status."""
        match measurement:
            case FrontseatStatus():
                self._status = measurement
                self._statuses.append(measurement)
            case ApparentWind():
                estimate = self._estimator.estimate(measurement.t_ns)
                if estimate is not None:
                    self._wind.on_apparent_wind(measurement, estimate)
            case BowWind():
                estimate = self._estimator.estimate(measurement.t_ns)
                if estimate is not None:
                    self._wind.on_bow_wind(measurement, estimate)
            case TrueWind():
                self._wind.on_true_wind(measurement)
            case _:
                pass

    def _set_forcing(self, wind: Wind | None) -> None:
        """What drives the estimator's prediction from now on: our pulses, or else the autopilot's outputs; and wind."""
        pulses = self._pulses_us
        if pulses is None:
            reported = self._status.motors_us if self._status is not None else None
            pulses = reported or (0, 0)
        if pulses != self._driving_us:
            self._driving_us = pulses
            self.command = (command_of_pulse(self._pwm, pulses[0]), command_of_pulse(self._pwm, pulses[1]))
            self._model_input = self._model.input_of_command(self.command)
        self._forcing_wind = wind
        if self._waves is not None:
            self._waves.set_forcing(self._model_input, wind)
        self._estimator.set_forcing(self._model_input, None if wind is None else (wind.vn_mps, wind.ve_mps))


def _ailing(notes: tuple[Note, ...]) -> frozenset[type]:
    """The kinds of measurements whose sensor is told to be silent or frozen."""
    return frozenset(WATCHED[note.subject] for note in notes if note.text in DEAD and note.subject in WATCHED)
