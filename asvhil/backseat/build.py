"""The one constructor that every mode uses: live, in lockstep, in replay."""

from __future__ import annotations

import functools
from functools import partial
from pathlib import Path

from asvhil.autopilot.mavlink_autopilot import MavlinkAutopilot
from asvhil.autopilot.motor_check import MotorCheck
from asvhil.autopilot.readback import Readback
from asvhil.backseat.actuation import Actuation
from asvhil.backseat.backseat import Backseat
from asvhil.backseat.cadence import Cadence, EveryPeriod, EveryTicks
from asvhil.backseat.command import Command
from asvhil.backseat.perception import Perception
from asvhil.config import Config, EstimatorConfig, VesselConfig, find_shipped
from asvhil.config.ports import ANEMOMETER
from asvhil.config.registry import AUTOPILOTS, CONTROLLERS, ESTIMATORS
from asvhil.controller.procedure import Procedure
from asvhil.controller.protocol import Controller
from asvhil.controller.pwm import Limiter, PulseLimiter, command_of_pulse
from asvhil.dynamics.corrected import CorrectedModel
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model
from asvhil.dynamics.rigid_body import SimplifiedDynamics, ThrustCurve
from asvhil.dynamics.weights import load_model
from asvhil.errors import ModelError, OtherHullError
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.learning import Learner
from asvhil.estimator.model_watch import ModelWatch
from asvhil.estimator.monitor import ModelMonitor
from asvhil.estimator.protocol import StateEstimator
from asvhil.estimator.wave_filter import WaveFilter
from asvhil.estimator.weather import WeatherHeading
from asvhil.estimator.wind import WindFilter
from asvhil.estimator.wind_load import WindFromLoad
from asvhil.io.sensors.decoder import Decoder
from asvhil.io.sensors.firmware import FirmwareWatch
from asvhil.motion.watch import MotionWatch
from asvhil.operator.operations import Operations
from asvhil.operator.session import OperatorSession
from asvhil.operator.station_parameters import LIMIT_PARAMETERS, STATION_PARAMETERS
from asvhil.operator.tunables import Tunables
from asvhil.supervisor.battery_watch import BatteryWatch
from asvhil.supervisor.docking import DockingWatch
from asvhil.supervisor.energy import EnergyWatch
from asvhil.supervisor.heading_cost import HeadingCostWatch
from asvhil.supervisor.station_motion import fastest_mps
from asvhil.supervisor.supervisor import Supervisor

REMEMBERED = 8  # models
HELD_S = 1e-3  # a time constant so short that a low-pass takes each sample over whole


def model_file(config: Config) -> Path | None:
    """The file of the learned model that the controller needs, None for one that needs none. ConfigError if missing."""
    kind = CONTROLLERS.find(config.controller.name).model
    if not kind:
        return None
    name = config.controller.model or f"{config.vehicle.name}-{kind}"
    what = f"model file (controller.model; {config.controller.name} needs one)"
    # A model that no key names is that of the boat: one of another boat's is not what was meant.
    return find_shipped(name, "models", ".npz", what, typed=bool(config.controller.model))


def build_model(config: Config, file: Path | None = None) -> Dynamics:
    """The vessel model of `build_plain_model`, with the factors that are learned on station where that is enabled."""
    model = build_plain_model(config, file)
    return _corrected(model) if config.learning.enabled else model


def build_plain_model(config: Config, file: Path | None = None) -> Dynamics:
    """The vessel model that the estimator and the controller share; `file` instead of the config's, as in replay.

    Raises ModelError where the file is damaged, of another kind, vehicle or step than the config asks for, and
    OtherHullError where it is of another hull and `controller.on_other_hull` is `refuse`.
    """
    file = file or model_file(config)
    if file is None:
        return _physics(config.believed_vessel)
    kind = CONTROLLERS.find(config.controller.name).model
    choice = config.controller.on_other_hull
    vessel = None if choice == "use" else config.vehicle.vessel
    try:
        model = load_model(file, vehicle=config.vehicle.name, vessel=vessel, dt_s=config.controller.mpc.first_step_s)
    except OtherHullError:
        if choice == "refuse":
            raise
        return _physics(config.believed_vessel)
    if model.name != kind:
        raise ModelError(f"{file}: holds a model of kind {model.name}, but {config.controller.name} needs {kind}")
    return model


@functools.lru_cache(maxsize=REMEMBERED)
def _physics(vessel: VesselConfig) -> SimplifiedDynamics:
    """The same object for equal vessels: what is made of a model is remembered by it."""
    return SimplifiedDynamics(vessel)


@by_model
def _corrected(model: Dynamics) -> CorrectedModel:
    """The same object for the same model, as `_physics`."""
    return CorrectedModel(model)


def model_replaced(config: Config, model: Dynamics) -> bool:
    """Whether the physics stand in for a learned model, which is of another hull."""
    plain = model.model if isinstance(model, CorrectedModel) else model
    return bool(CONTROLLERS.find(config.controller.name).model) and isinstance(plain, SimplifiedDynamics)


def build_model_watch(config: Config, model: Dynamics) -> ModelWatch:
    """What tells of a model that does not fit the boat."""
    monitor = ModelMonitor(config.estimator.monitor, model, 1.0 / config.daemon.control_hz)
    return ModelWatch(config.estimator.monitor, monitor, replaced=model_replaced(config, model))


def build_controller(config: Config, model: Dynamics) -> Controller:
    """The controller that `controller.name` asks for, within the station keeping procedure where that is enabled."""
    kind, procedure = CONTROLLERS.find(config.controller.name), config.controller.procedure
    controller: Controller = kind.make(config.controller.settings, config, model)
    if kind.keeps_station and procedure.enabled:
        focus = getattr(controller, "favour_position", None)
        return Procedure(procedure, config.believed_vessel, controller, focus)
    return controller


def build_estimator(config: Config, model: Dynamics) -> StateEstimator:
    """The state estimator that `estimator.kind` asks for."""
    estimator: StateEstimator = ESTIMATORS.find(config.estimator.kind).make(config.estimator.settings, config, model)
    return estimator


def build_wind(config: EstimatorConfig) -> WindFilter:
    """The wind filter; one that holds the last sample where readings are used as they come."""
    held = {"time_constant_s": HELD_S, "speed_time_constant_s": HELD_S, "stuck_after_s": None}
    filters = ESTIMATORS.find(config.kind).filters_wind
    return WindFilter(config.wind if filters else config.wind.model_copy(update=held))


def build_wind_load(config: Config) -> WindFromLoad | None:
    """What makes a wind of the disturbance; None for an estimator that has none."""
    disturbance = ESTIMATORS.find(config.estimator.kind).disturbance
    return WindFromLoad(config.believed_vessel) if disturbance else None


def build_wave_filter(config: Config, model: Dynamics) -> WaveFilter | None:
    """What takes waves out of the estimate; None for an estimator without a model, and where it is off."""
    waves = config.estimator.waves
    if waves.mode == "off" or not ESTIMATORS.find(config.estimator.kind).disturbance:
        return None
    return WaveFilter(waves, model, config.believed_vessel, 1.0 / config.daemon.tick_hz)


def build_weather(config: Config, model: Dynamics) -> WeatherHeading:
    """What finds the heading that the weather wants: also where it is fixed, since operators may change that."""
    return WeatherHeading(model, config.supervisor.heading.time_constant_s)


def build_learner(config: Config, model: Dynamics, estimator: StateEstimator) -> Learner | None:
    """What learns on station, and corrects the model of an estimator; None where that is not enabled."""
    if not (isinstance(model, CorrectedModel) and isinstance(estimator, Ekf)):
        return None
    lag_s = 0.0 if model.model.n_motor else config.controller.mpc.unmodelled_lag_s
    return Learner(config.learning, model, 1.0 / config.daemon.tick_hz, lag_s, estimator.set_factors)


def build_cadence(config: Config) -> Cadence:
    """When controls are due: by count where a timer cuts the ticks, by time where arrivals do."""
    daemon = config.daemon
    if daemon.cut_on == "timer":
        return EveryTicks(daemon.ticks_per_control)
    return EveryPeriod(round(1e9 / daemon.control_hz), round(0.5e9 / daemon.tick_hz))


def build_link(config: Config) -> MavlinkAutopilot:
    """The conversation with the autopilot, by `links.autopilot.profile`."""
    autopilot: MavlinkAutopilot = AUTOPILOTS.find(config.links.autopilot.profile).make(config)
    return autopilot


def build_decoder(config: Config) -> Decoder:
    """The decoder for whoever reads a log: the conversation with the autopilot is listened to, and not gone on with."""
    return Decoder.from_config(config, build_link(config).receive)


def build_perception(config: Config, model: Dynamics, link: MavlinkAutopilot) -> Perception:
    """Decoder and estimation; the frames of the autopilot go through its conversation, `link`."""
    estimator = build_estimator(config, model)
    return Perception(
        decoder=Decoder.from_config(config, link.receive),
        firmware=build_firmware_watch(config),
        estimator=estimator,
        wind=build_wind(config.estimator),
        wind_load=build_wind_load(config),
        waves=build_wave_filter(config, model),
        model_watch=build_model_watch(config, model),
        weather=build_weather(config, model),
        learner=build_learner(config, model, estimator),
        model=model,
        pwm=config.vehicle.pwm,
    )


def build_motor_check(config: Config, link: MavlinkAutopilot) -> MotorCheck:
    """The check of whether the motors follow the commands."""
    supervisor, neutral_us = config.supervisor, config.vehicle.pwm.neutral_us
    readback, overrides = supervisor.readback, config.links.autopilot.overrides_sticks
    test = Readback(readback, neutral_us, overrides_sticks=overrides, rest_us=supervisor.stick_threshold_us)
    return MotorCheck(link, test, readback.tolerate)


def build_command(config: Config, controller: Controller) -> Command:
    """Operators and the supervisor; operators may tune `controller` while it runs."""
    links, vessel = config.links, config.believed_vessel
    most_mps = fastest_mps(vessel, config.supervisor.moving)
    supervisor = Supervisor(
        config.supervisor,
        overrides_sticks=links.autopilot.overrides_sticks,
        fastest_mps=most_mps,
        weak_astern=vessel.weak_astern,
    )
    tunables = Tunables(config.controller, controller)
    names = (*STATION_PARAMETERS, *LIMIT_PARAMETERS, *tunables.names)
    session = OperatorSession(links.autopilot, links.operator, names)
    return Command(Operations(session, tunables, most_mps), supervisor)


def build_firmware_watch(config: Config) -> FirmwareWatch:
    """What minds the version of the anemometer's firmware."""
    link = config.links.anemometer
    return FirmwareWatch(ANEMOMETER, link.firmware if link is not None else None)


def build_heading_cost(config: Config) -> HeadingCostWatch | None:
    """What tells the cost of a station's heading, in W too where the boat's power is known; None if not asked for."""
    if not config.supervisor.heading_cost:
        return None
    power, curve = config.vehicle.power, ThrustCurve(config.believed_vessel.thrust_curve)

    def power_of(thrust_n: float) -> float | None:
        command = curve.command(0.5 * thrust_n)
        return None if power is None else power.drawn_w((command, command))

    return HeadingCostWatch(config.believed_vessel, power_of)


def build_backseat(
    config: Config,
    file: Path | None = None,
    *,
    model: Dynamics | None = None,
    controller: Controller | None = None,
    limiter: Limiter | None = None,
) -> Backseat:
    """A backseat that is ready for its first `step`; `file` is a model file to use instead of the config's.

    A `model` or `controller` that is given, as by a study, is used as it is; so is a `limiter`, as by an edited log.
    """
    config.check_plugins()
    model = model or build_model(config, file)
    pwm, power, link = config.vehicle.pwm, config.vehicle.power, build_link(config)
    controller = controller or build_controller(config, model)
    return Backseat(
        autopilot=link,
        perception=build_perception(config, model, link),
        motion=MotionWatch(config),
        battery=BatteryWatch(config.supervisor.battery),
        heading_cost=build_heading_cost(config),
        docking=DockingWatch() if config.supervisor.docking else None,
        energy=None if power is None else EnergyWatch(power, partial(command_of_pulse, pwm)),
        command=build_command(config, controller),
        actuation=Actuation(
            autopilot=link,
            check=build_motor_check(config, link),
            cadence=build_cadence(config),
            controller=controller,
            limiter=limiter or PulseLimiter(pwm),
            neutral_us=pwm.neutral_us,
            control_mode=config.supervisor.control_mode,
        ),
        near_m=config.controller.mpc.far_radius_m,
    )
