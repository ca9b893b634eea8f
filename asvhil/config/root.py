"""The whole config, and the checks that span its sections."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationInfo, model_validator

from asvhil.config.autopilots import needed_mode
from asvhil.config.base import Section, is_stored, known_only
from asvhil.config.controllers import ControllerConfig
from asvhil.config.daemon import DaemonConfig, RecorderConfig
from asvhil.config.estimator import EstimatorConfig
from asvhil.config.learning import LearningConfig
from asvhil.config.links import LinksConfig
from asvhil.config.plant import PlantConfig
from asvhil.config.plant_faults import Device, needed_device
from asvhil.config.plugins import PluginFile, loaded
from asvhil.config.ports import GNSS
from asvhil.config.registry import AUTOPILOTS, CONTROLLERS, ESTIMATORS, LINKS, OUTPUTS, SENSORS, SOLVERS, Registry
from asvhil.config.sources import SourcesConfig, check_sources, with_streams_of
from asvhil.config.supervisor import SupervisorConfig
from asvhil.config.vehicle import VehicleConfig, VesselConfig
from asvhil.errors import ConfigError


class Config(Section):
    """The whole config: what every mode (boat, simulation, replay) is built from."""

    vehicle: VehicleConfig = Field(description="The boat.")
    links: LinksConfig = Field(description="The links.")
    sources: SourcesConfig = Field(default=SourcesConfig(), description="Which sensor each quantity is taken from.")
    estimator: EstimatorConfig = Field(default=EstimatorConfig(), description="State and wind estimation.")
    controller: ControllerConfig = Field(default=ControllerConfig(), description="Control.")
    learning: LearningConfig = Field(default=LearningConfig(), description="Learning on station.")
    supervisor: SupervisorConfig = Field(default=SupervisorConfig(), description="Who has the motors.")
    daemon: DaemonConfig = Field(default=DaemonConfig(), description="The daemon's rates.")
    recorder: RecorderConfig = Field(default=RecorderConfig(), description="The log.")
    plant: PlantConfig = Field(default=PlantConfig(), description="The simulated boat.")
    plugins: tuple[PluginFile, ...] = Field(
        default=(),
        description=(
            "Python files with controllers, sensors and the like of your own, see docs/extending.md; their code is run "
            "when the config is loaded."
        ),
    )

    left_out_if_empty = ("plugins",)

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, tree: Any) -> Any:
        """Without a control mode, that of the way to the motors, or of the autopilot's profile."""
        # The validation reports what is missing or wrong.
        with contextlib.suppress(KeyError, TypeError, AttributeError, ConfigError):
            link = tree["links"]["autopilot"]
            autopilot = AUTOPILOTS.find(link.get("profile", "ardurover"))
            way = OUTPUTS.get(link.get("output", autopilot.outputs[0]))
            mode = (needed_mode(autopilot, way) if way is not None else "") or autopilot.control_mode
            return {**tree, "supervisor": {"control_mode": mode, **tree.get("supervisor", {})}}
        return tree

    @model_validator(mode="after")
    def _check_across(self, info: ValidationInfo) -> Config:
        if self.supervisor.engage == "auto" and self.supervisor.station is None:
            raise ValueError("supervisor.station is needed where supervisor.engage is auto")
        power = self.vehicle.power
        if self.plant.frontseat.current_sensor and (power is None or power.power_curve is None):
            raise ValueError("plant.frontseat.current_sensor: the current comes from vehicle.power.power_curve; set it")
        link = self.links.autopilot
        kind = AUTOPILOTS.get(link.profile)
        if kind is not None and self.supervisor.control_mode not in kind.modes:
            names = ", ".join(kind.modes)
            raise ValueError(f"supervisor.control_mode must be one of {link.profile}: {names}")
        if not is_stored(info):  # a log of before can still be replayed
            self._check_control_mode()
        if self.learning.enabled:
            self._check_learning()
        if not known_only(info):
            object.__setattr__(self, "links", with_streams_of(self.sources, self.links))  # frozen, but not built yet
            try:
                self.check_plugins()
            except ConfigError as error:
                raise ValueError(str(error)) from None
            check_sources(self.sources, self.links, self.estimator.ekf.history_s, self.estimator.ekf.stale_after_s)
        return self

    def _check_control_mode(self) -> None:
        """ValueError where the motors do not obey in this mode."""
        link, mode = self.links.autopilot, self.supervisor.control_mode
        autopilot, way = AUTOPILOTS.get(link.profile), OUTPUTS.get(link.output)
        needed = needed_mode(autopilot, way) if autopilot is not None and way is not None else ""
        if needed and mode != needed:
            raise ValueError(
                f"supervisor.control_mode is {mode}, but motors obey links.autopilot.output {link.output} "
                f"in {needed} alone: set {needed}, or leave the key out"
            )

    def check_faults(self) -> None:
        """ConfigError where a fault of the simulated boat is that of a device which it has not: nothing would fail.

        For whoever builds that boat: a real one is run with whatever its config has left of simulations.
        """
        for fault in self.plant.faults:
            problem = self.why_no_fault(fault.kind, needed_device(fault))
            if problem:
                raise ConfigError(f"plant.faults: {problem}")
        for kind, device in self.plant.glitches.needed_devices if self.plant.glitches is not None else ():
            problem = self.why_no_fault(kind, device)
            if problem:
                raise ConfigError(f"plant.glitches: {problem}")

    def why_no_fault(self, kind: str, device: str | None) -> str:
        """Why the simulated boat cannot have a fault of one device, in words; empty where it can."""
        if device is None or device in self.plant_devices:
            return ""
        has, key = ", ".join(self.plant_devices), GNSS if device == "nmea" else device
        return f"{kind} is a fault of the device {device}, and this boat has {has} alone (links.{key} gives it one)"

    def _check_learning(self) -> None:
        """ValueError where nothing that is learned would be used."""
        controller, estimator = CONTROLLERS.get(self.controller.name), self.estimator.kind
        if controller is not None and not controller.solves:
            names = ", ".join(kind.name for kind in CONTROLLERS if kind.solves)
            raise ValueError(
                f"learning.enabled: {controller.name} predicts with no vessel model, so there is nothing to correct; "
                f"leave it false, or choose as controller.name one of {names}"
            )
        if estimator != "ekf":
            raise ValueError(f"learning.enabled: the estimator {estimator} has no vessel model; it needs ekf")

    def content_hash(self) -> str:
        """As of every section; of a plug-in its name and content count, not the folder that it is in."""
        if not self.plugins:
            return super().content_hash()
        plugins = tuple(PluginFile(file=Path(one.file).name, sha256=one.sha256) for one in self.plugins)
        return Section.content_hash(self.model_copy(update={"plugins": plugins}))

    def chosen(self) -> list[tuple[Registry[Any], str]]:
        """All kinds that this config uses, by registry and name; those too whose settings alone stand in it."""
        links, plant = self.links, self.plant.links
        specs = (
            *links.endpoints.values(),
            *(station.endpoint for station in links.ground_stations.values()),
            *(spec for spec in (plant.autopilot, plant.anemometer, plant.ins, plant.gnss) if spec is not None),
            *plant.sensors.values(),
        )
        found: list[tuple[Registry[Any], str]] = [
            (CONTROLLERS, self.controller.name),
            (SOLVERS, self.controller.solver),
            (ESTIMATORS, self.estimator.kind),
            *((SENSORS, link.kind) for link in links.sensors.values()),
            (AUTOPILOTS, links.autopilot.profile),
            (OUTPUTS, links.autopilot.output),
            *((LINKS, spec.partition(":")[0]) for spec in specs),
        ]
        for section in (self.controller, self.estimator):
            kinds = (section.registry.at_key(key) for key in section.model_extra or {})
            found += ((section.registry, kind.name) for kind in kinds if kind is not None)
        return list(dict.fromkeys(found))

    def check_plugins(self) -> None:
        """ConfigError where a plug-in is not loaded, or a kind in use is of one that `plugins` does not name."""
        for one in self.plugins:
            if loaded(one.sha256) is None:
                raise ConfigError(f"the plug-in {one.file} is not loaded")
        mine = {one.sha256 for one in self.plugins}
        for registry, name in self.chosen():
            origin = registry.origin(name)
            if origin.file and origin.sha256 not in mine:
                raise ConfigError(f"the {registry.what} {name} is that of {origin}, which is not among the plugins")

    @property
    def plant_devices(self) -> tuple[Device, ...]:
        """The devices with position and heading of the simulated boat: those with either end of a line."""
        lines, plant = self.links, self.plant.links
        found: list[Device] = ["autopilot"]
        if lines.ins is not None or plant.ins is not None:
            found.append("ins")
        if lines.gnss is not None or plant.gnss is not None:
            found.append("nmea")
        return tuple(found)

    @property
    def plant_vessel(self) -> VesselConfig:
        """Physics of the simulated boat."""
        return self.plant.vessel or self.vehicle.vessel

    @property
    def believed_vessel(self) -> VesselConfig:
        """Physics that estimator and controller assume."""
        return self.controller.vessel or self.vehicle.vessel
