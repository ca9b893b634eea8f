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
from asvhil.config.estimator import EkfConfig, EstimatorConfig, FirConfig, MonitorConfig, WindFilterConfig
from asvhil.config.links import AutopilotLinkConfig, InsLinkConfig, NmeaLinkConfig
from asvhil.config.loading import config_from_json, find_config, find_shipped, load_config
from asvhil.config.plant import (
    AnemometerSensorConfig,
    CurrentConfig,
    FaultConfig,
    FrontseatConfig,
    GnssSensorConfig,
    HilConfig,
    InsDeviceConfig,
    NmeaDeviceConfig,
    PlantConfig,
    Px4HilConfig,
    SensorsConfig,
    WavesConfig,
    WeatherConfig,
    WindConfig,
)
from asvhil.config.root import Config
from asvhil.config.shell import StationConfig, SupervisorConfig
from asvhil.config.sources import QUANTITIES, Quantity, SourceConfig, SourcesConfig
from asvhil.config.vehicle import PwmConfig, VesselConfig

__all__ = [
    "LEARNED",
    "QUANTITIES",
    "AnemometerSensorConfig",
    "AutopilotLinkConfig",
    "BacksteppingConfig",
    "Config",
    "ControllerConfig",
    "CurrentConfig",
    "EkfConfig",
    "EstimatorConfig",
    "FaultConfig",
    "FirConfig",
    "FrontseatConfig",
    "GnssSensorConfig",
    "HilConfig",
    "InsDeviceConfig",
    "InsLinkConfig",
    "LoiterConfig",
    "ManoeuvresConfig",
    "MonitorConfig",
    "MpcConfig",
    "MpcWeights",
    "NmeaDeviceConfig",
    "NmeaLinkConfig",
    "PlantConfig",
    "ProcedureConfig",
    "PwmConfig",
    "Px4HilConfig",
    "Quantity",
    "Section",
    "SensorsConfig",
    "SlidingModeConfig",
    "SourceConfig",
    "SourcesConfig",
    "StationConfig",
    "SteeringConfig",
    "SupervisorConfig",
    "VesselConfig",
    "WavesConfig",
    "WeatherConfig",
    "WindConfig",
    "WindFilterConfig",
    "config_from_json",
    "find_config",
    "find_shipped",
    "load_config",
]
