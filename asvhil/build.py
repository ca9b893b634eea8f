"""The one constructor that every mode uses: live, in lockstep, in replay."""

from __future__ import annotations

from pathlib import Path

from asvhil.backseat import Backseat, Controller
from asvhil.config import LEARNED, Config, find_shipped
from asvhil.controller.backstepping import Backstepping
from asvhil.controller.loiter import Loiter
from asvhil.controller.manoeuvres import Manoeuvres
from asvhil.controller.procedure import Procedure
from asvhil.controller.sliding_mode import SlidingMode
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import load_model
from asvhil.errors import ModelError
from asvhil.estimator.ekf import Ekf
from asvhil.estimator.monitor import ModelMonitor
from asvhil.estimator.wind import WindFilter
from asvhil.io.ardurover import ArduRoverLink
from asvhil.io.nmea import NmeaCodec
from asvhil.io.operator import OperatorLink
from asvhil.supervisor import Supervisor


def model_file(config: Config) -> Path | None:
    """The file of the learned model that the controller needs, None for one that needs none. ConfigError if missing."""
    kind = LEARNED.get(config.controller.name)
    if kind is None:
        return None
    name = config.controller.model or f"{config.vehicle.name}-{kind}"
    return find_shipped(name, "models", (".npz",), f"model file (controller.model; {config.controller.name} needs one)")


def build_model(config: Config, file: Path | None = None) -> Dynamics:
    """The vessel model that the estimator and the controller share; `file` instead of the config's, as in replay.

    Raises ModelError where the file is damaged, of another kind, vehicle or step than the config asks for.
    """
    file = file or model_file(config)
    if file is None:
        return SimplifiedDynamics(config.controller.vessel or config.vehicle.vessel)
    kind = LEARNED[config.controller.name]
    model = load_model(file, vehicle=config.vehicle.name, dt_s=config.controller.mpc.first_step_s)
    if model.name != kind:
        raise ModelError(f"{file}: holds a model of kind {model.name}, but {config.controller.name} needs {kind}")
    return model


def build_controller(config: Config, model: Dynamics) -> Controller:
    """The controller that `controller.name` asks for, within the station keeping procedure where that is enabled."""
    section, vessel = config.controller, config.controller.vessel or config.vehicle.vessel
    keeper: Controller
    match section.name:
        case "backstepping":
            keeper = Backstepping(vessel, section.backstepping)
        case "sliding-mode":
            keeper = SlidingMode(vessel, section.sliding_mode)
        case "loiter":
            keeper = Loiter(section.loiter)
        case _:
            mpc, make_solver = choose_solver(section)
            keeper = StationMpc(model, mpc, 1.0 / config.daemon.control_hz, make_solver)
    if section.name == "manoeuvres":
        return Manoeuvres(section.manoeuvres, keeper)
    if section.procedure.enabled:
        focus = keeper.favour_position if isinstance(keeper, StationMpc) else None
        return Procedure(section.procedure, vessel, keeper, focus)
    return keeper


def build_backseat(
    config: Config, file: Path | None = None, *, model: Dynamics | None = None, controller: Controller | None = None
) -> Backseat:
    """A backseat that is ready for its first `step`; `file` is a model file to use instead of the config's.

    A `model` or `controller` that is given, as by a study, is used as it is.
    """
    model = model or build_model(config, file)
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
        controller=controller or build_controller(config, model),
        pwm=pwm,
        control_mode=config.supervisor.control_mode,
        ticks_per_control=config.daemon.ticks_per_control,
    )
