"""The whole config, and the checks that span its sections."""

from __future__ import annotations

import contextlib
from typing import Any

from pydantic import Field, model_validator

from asvhil.config.base import Section
from asvhil.config.controllers import ControllerConfig
from asvhil.config.daemon import DaemonConfig, RecorderConfig
from asvhil.config.estimator import EstimatorConfig
from asvhil.config.links import LinksConfig
from asvhil.config.plant import PlantConfig
from asvhil.config.registry import AUTOPILOTS
from asvhil.config.sources import SourcesConfig, check_sources
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
    supervisor: SupervisorConfig = Field(default=SupervisorConfig(), description="Who has the motors.")
    daemon: DaemonConfig = Field(default=DaemonConfig(), description="The daemon's rates.")
    recorder: RecorderConfig = Field(default=RecorderConfig(), description="The log.")
    plant: PlantConfig = Field(default=PlantConfig(), description="The simulated boat.")

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, tree: Any) -> Any:
        """Without a control mode, that of the autopilot's profile."""
        # The validation reports what is missing or wrong.
        with contextlib.suppress(KeyError, TypeError, AttributeError, ConfigError):
            mode = AUTOPILOTS.find(tree["links"]["autopilot"].get("profile", "ardurover")).control_mode
            return {**tree, "supervisor": {"control_mode": mode, **tree.get("supervisor", {})}}
        return tree

    @model_validator(mode="after")
    def _check_across(self) -> Config:
        if self.supervisor.engage == "auto" and self.supervisor.station is None:
            raise ValueError("supervisor.station is needed where supervisor.engage is auto")
        pwm = self.vehicle.pwm
        link = self.links.autopilot
        kind = AUTOPILOTS.get(link.profile)
        if kind is not None and self.supervisor.control_mode not in kind.modes:
            names = ", ".join(kind.modes)
            raise ValueError(f"supervisor.control_mode must be one of {link.profile}: {names}")
        if link.output == "manual_control" and not (pwm.astern_us >= 1000 and pwm.ahead_us <= 2000):
            raise ValueError("links.autopilot.output manual_control reaches 1000 to 2000 us: vehicle.pwm goes beyond")
        overridden = (pwm.port_channel, pwm.starboard_channel) if link.overrides_sticks else ()
        for channel in overridden:
            if channel in self.supervisor.stick_channels:
                raise ValueError(f"supervisor.stick_channels must not hold the motor channel {channel}")
        check_sources(self.sources, self.links, self.estimator.ekf.history_s, self.estimator.ekf.stale_after_s)
        return self

    @property
    def plant_vessel(self) -> VesselConfig:
        """Physics of the simulated boat."""
        return self.plant.vessel or self.vehicle.vessel

    @property
    def believed_vessel(self) -> VesselConfig:
        """Physics that estimator and controller assume."""
        return self.controller.vessel or self.vehicle.vessel
