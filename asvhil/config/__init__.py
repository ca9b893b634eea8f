"""The config: sections by subject, one file each, and how YAML becomes one."""

from asvhil.config.base import Section
from asvhil.config.controller import (
    LEARNED,
    BacksteppingConfig,
    ControllerConfig,
    LoiterConfig,
    ManoeuvresConfig,
    MpcConfig,
    MpcWeights,
    ProcedureConfig,
    SlidingModeConfig,
    SteeringConfig,
)
from asvhil.config.estimator import EkfConfig, MonitorConfig, WindFilterConfig
from asvhil.config.links import AutopilotLinkConfig
from asvhil.config.loading import config_from_json, find_config, find_shipped, load_config
from asvhil.config.plant import (
    AnemometerSensorConfig,
    CurrentConfig,
    FrontseatConfig,
    GnssSensorConfig,
    SensorsConfig,
    WeatherConfig,
    WindConfig,
)
from asvhil.config.root import Config
from asvhil.config.shell import StationConfig, SupervisorConfig
from asvhil.config.vehicle import PwmConfig, VesselConfig

__all__ = [
    "LEARNED",
    "AnemometerSensorConfig",
    "AutopilotLinkConfig",
    "BacksteppingConfig",
    "Config",
    "ControllerConfig",
    "CurrentConfig",
    "EkfConfig",
    "FrontseatConfig",
    "GnssSensorConfig",
    "LoiterConfig",
    "ManoeuvresConfig",
    "MonitorConfig",
    "MpcConfig",
    "MpcWeights",
    "ProcedureConfig",
    "PwmConfig",
    "Section",
    "SensorsConfig",
    "SlidingModeConfig",
    "StationConfig",
    "SteeringConfig",
    "SupervisorConfig",
    "VesselConfig",
    "WeatherConfig",
    "WindConfig",
    "WindFilterConfig",
    "config_from_json",
    "find_config",
    "find_shipped",
    "load_config",
]
