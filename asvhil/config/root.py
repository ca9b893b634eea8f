"""The whole config."""

from __future__ import annotations

import contextlib
from typing import Any

from pydantic import model_validator

from asvhil.config.autopilots import CONTROL_MODE, MODES
from asvhil.config.base import Section
from asvhil.config.controller import ControllerConfig
from asvhil.config.estimator import EstimatorConfig
from asvhil.config.links import LinksConfig
from asvhil.config.plant import PlantConfig
from asvhil.config.shell import DaemonConfig, RecorderConfig, SupervisorConfig
from asvhil.config.sources import SourcesConfig, check_sources
from asvhil.config.vehicle import VehicleConfig, VesselConfig


class Config(Section):
    """The whole of it: what every mode is built from."""

    vehicle: VehicleConfig
    links: LinksConfig
    sources: SourcesConfig = SourcesConfig()
    estimator: EstimatorConfig = EstimatorConfig()
    controller: ControllerConfig = ControllerConfig()
    supervisor: SupervisorConfig = SupervisorConfig()
    daemon: DaemonConfig = DaemonConfig()
    recorder: RecorderConfig = RecorderConfig()
    plant: PlantConfig = PlantConfig()

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, tree: Any) -> Any:
        """The control mode of the autopilot's profile where none is given."""
        with contextlib.suppress(KeyError, TypeError, AttributeError):  # what is missing is told by the validation
            mode = CONTROL_MODE[tree["links"]["autopilot"].get("profile", "ardurover")]
            return {**tree, "supervisor": {"control_mode": mode, **tree.get("supervisor", {})}}
        return tree

    @model_validator(mode="after")
    def _check_across(self) -> Config:
        if self.supervisor.engage == "auto" and self.supervisor.station is None:
            raise ValueError("supervisor.station is needed where supervisor.engage is auto")
        pwm = self.vehicle.pwm
        link = self.links.autopilot
        if self.supervisor.control_mode not in MODES[link.profile]:
            names = ", ".join(MODES[link.profile])
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
        """What the simulated boat is."""
        return self.plant.vessel or self.vehicle.vessel

    @property
    def believed_vessel(self) -> VesselConfig:
        """What estimator and controller take the boat for."""
        return self.controller.vessel or self.vehicle.vessel
