"""The one constructor that every mode uses: live, in lockstep, in replay."""

from __future__ import annotations

from asvhil.backseat import Backseat, Controller
from asvhil.config import Config
from asvhil.controller.manoeuvres import Manoeuvres
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.monitor import ModelMonitor
from asvhil.estimator.wind import WindFilter
from asvhil.io.ardurover import ArduRoverLink
from asvhil.io.nmea import NmeaCodec
from asvhil.io.operator import OperatorLink
from asvhil.supervisor import Supervisor


def build_model(config: Config) -> Dynamics:
    """The vessel model that the estimator and the controller share."""
    return SimplifiedDynamics(config.controller.vessel or config.vehicle.vessel)


def build_controller(config: Config, model: Dynamics) -> Controller:
    """The controller that `controller.name` asks for."""
    keeper = StationMpc(model, config.controller.mpc, 1.0 / config.daemon.control_hz)
    if config.controller.name == "manoeuvres":
        return Manoeuvres(config.controller.manoeuvres, keeper)
    return keeper


def build_backseat(config: Config) -> Backseat:
    """A backseat that is ready for its first `step`."""
    model = build_model(config)
    pwm = config.vehicle.pwm
    return Backseat(
        model=model,
        link=ArduRoverLink(config.links.autopilot, pwm),
        anemometer=NmeaCodec("anemometer"),
        operator=OperatorLink(config.links.autopilot),
        ekf=Ekf(config.estimator.ekf, model),
        wind=WindFilter(config.estimator.wind),
        monitor=ModelMonitor(config.estimator.monitor, model, 1.0 / config.daemon.control_hz),
        supervisor=Supervisor(config.supervisor, pwm),
        controller=build_controller(config, model),
        pwm=pwm,
        control_mode=config.supervisor.control_mode,
        ticks_per_control=config.daemon.ticks_per_control,
    )
