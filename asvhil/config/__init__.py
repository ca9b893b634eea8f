"""The config: its sections, one module for each subject, and the way from YAML text to a validated `Config`."""

from asvhil.config.base import Section
from asvhil.config.battery import BatteryConfig
from asvhil.config.controller import (
    BacksteppingConfig,
    LoiterConfig,
    ManoeuvresConfig,
    MpcConfig,
    MpcWeights,
    ProcedureConfig,
    SlidingModeConfig,
    SoftLimits,
    SteeringConfig,
)
from asvhil.config.controllers import ControllerConfig
from asvhil.config.estimator import (
    CompassConfig,
    EkfConfig,
    EstimatorConfig,
    FirConfig,
    MonitorConfig,
    TrustConfig,
    WaveFilterConfig,
    WindFilterConfig,
)
from asvhil.config.heading import HeadingConfig
from asvhil.config.learning import LearningConfig
from asvhil.config.links import AutopilotLinkConfig, OperatorLinkConfig
from asvhil.config.loading import (
    config_from_json,
    find_config,
    find_shipped,
    load_config,
    overridden,
    override_value,
)
from asvhil.config.motion import MotionConfig
from asvhil.config.moving import MovingConfig
from asvhil.config.plant import FrontseatConfig, HilConfig, PlantConfig, Px4HilConfig
from asvhil.config.plant_faults import OF_ONE_DEVICE, FaultConfig, GlitchConfig, GlitchesConfig
from asvhil.config.plant_hull import BlendermannConfig, PlantMotorsConfig, TiltConfig
from asvhil.config.plant_sensors import (
    AnemometerSensorConfig,
    FusedVelocityConfig,
    GnssSensorConfig,
    HeadingSensorConfig,
    InsDeviceConfig,
    NmeaDeviceConfig,
    SensorsConfig,
)
from asvhil.config.plant_weather import CurrentConfig, WavesConfig, WeatherConfig, WindConfig, WindSpreadConfig
from asvhil.config.power import PowerConfig
from asvhil.config.registry import (
    AutopilotKind,
    ControllerKind,
    EstimatorKind,
    LinkKind,
    OperatorParameter,
    OutputKind,
    SearchRange,
    SensorKind,
)
from asvhil.config.root import Config
from asvhil.config.sensors import QUANTITIES, InsLinkConfig, NmeaLinkConfig, Quantity, SensorLinkConfig
from asvhil.config.sources import SourceConfig, SourcesConfig
from asvhil.config.supervisor import ReadbackConfig, StationConfig, SupervisorConfig
from asvhil.config.vehicle import CouplingConfig, MotorOutputConfig, PwmConfig, VesselConfig

__all__ = [
    "OF_ONE_DEVICE",
    "QUANTITIES",
    "AnemometerSensorConfig",
    "AutopilotKind",
    "AutopilotLinkConfig",
    "BacksteppingConfig",
    "BatteryConfig",
    "BlendermannConfig",
    "CompassConfig",
    "Config",
    "ControllerConfig",
    "ControllerKind",
    "CouplingConfig",
    "CurrentConfig",
    "EkfConfig",
    "EstimatorConfig",
    "EstimatorKind",
    "FaultConfig",
    "FirConfig",
    "FrontseatConfig",
    "FusedVelocityConfig",
    "GlitchConfig",
    "GlitchesConfig",
    "GnssSensorConfig",
    "HeadingConfig",
    "HeadingSensorConfig",
    "HilConfig",
    "InsDeviceConfig",
    "InsLinkConfig",
    "LearningConfig",
    "LinkKind",
    "LoiterConfig",
    "ManoeuvresConfig",
    "MonitorConfig",
    "MotionConfig",
    "MotorOutputConfig",
    "MovingConfig",
    "MpcConfig",
    "MpcWeights",
    "NmeaDeviceConfig",
    "NmeaLinkConfig",
    "OperatorLinkConfig",
    "OperatorParameter",
    "OutputKind",
    "PlantConfig",
    "PlantMotorsConfig",
    "PowerConfig",
    "ProcedureConfig",
    "PwmConfig",
    "Px4HilConfig",
    "Quantity",
    "ReadbackConfig",
    "SearchRange",
    "Section",
    "SensorKind",
    "SensorLinkConfig",
    "SensorsConfig",
    "SlidingModeConfig",
    "SoftLimits",
    "SourceConfig",
    "SourcesConfig",
    "StationConfig",
    "SteeringConfig",
    "SupervisorConfig",
    "TiltConfig",
    "TrustConfig",
    "VesselConfig",
    "WaveFilterConfig",
    "WavesConfig",
    "WeatherConfig",
    "WindConfig",
    "WindFilterConfig",
    "WindSpreadConfig",
    "config_from_json",
    "find_config",
    "find_shipped",
    "load_config",
    "overridden",
    "override_value",
]
