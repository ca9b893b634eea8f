"""YAML text to a validated, frozen config. Every mistake is one line that names the file and the key."""

from __future__ import annotations

import hashlib
import json
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from asvhil.errors import ConfigError
from asvhil.io.endpoints.spec import parse_spec

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]
Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
ServoUs = Annotated[int, Field(ge=500, le=2500)]


def _checked_link(spec: str) -> str:
    try:
        parse_spec(spec)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return spec


LinkSpecText = Annotated[str, AfterValidator(_checked_link)]
MavlinkId = Annotated[int, Field(ge=1, le=255)]


class Section(BaseModel):
    """A part of the config: unknown keys are refused and nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


# --- the vehicle -----------------------------------------------------------------------------------------


class VesselConfig(Section):
    """A 3-DOF vessel with two fixed motors: Fossen (2011) parameters, each positive as a magnitude."""

    mass_kg: Positive
    added_mass_surge_kg: NonNegative
    added_mass_sway_kg: NonNegative
    inertia_yaw_kgm2: Positive
    added_inertia_yaw_kgm2: NonNegative
    surge_drag_n_per_mps: NonNegative
    surge_drag_n_per_mps2: NonNegative
    sway_drag_n_per_mps: NonNegative
    sway_drag_n_per_mps2: NonNegative
    yaw_drag_nm_per_radps: NonNegative
    yaw_drag_nm_per_radps2: NonNegative
    motor_arm_m: Positive
    motor_lag_s: Positive
    thrust_curve: tuple[tuple[float, float], ...]  # rows of (command in [-1, 1], thrust in N of one motor)
    wind_surge_n_per_mps2: NonNegative
    wind_sway_n_per_mps2: NonNegative
    wind_yaw_nm_per_mps2: NonNegative

    @model_validator(mode="after")
    def _check_curve(self) -> VesselConfig:
        commands = [row[0] for row in self.thrust_curve]
        thrusts = [row[1] for row in self.thrust_curve]
        if len(commands) < 2 or any(b <= a for a, b in pairwise(commands)):
            raise ValueError("thrust_curve needs at least 2 rows with rising commands")
        if any(b < a for a, b in pairwise(thrusts)):
            raise ValueError("thrust_curve: thrust must not fall while the command rises")
        if commands[0] < -1.0 or commands[-1] > 1.0 or thrusts[0] >= 0.0 or thrusts[-1] <= 0.0:
            raise ValueError("thrust_curve must lie in commands -1..1 and reach both astern and ahead thrust")
        return self


class PwmConfig(Section):
    """How a motor command becomes a pulse width, and the limits enforced last before the wire."""

    port_channel: Annotated[int, Field(ge=1, le=8)] = 1
    starboard_channel: Annotated[int, Field(ge=1, le=8)] = 3
    astern_us: ServoUs = 1100
    neutral_us: ServoUs = 1500
    ahead_us: ServoUs = 1900
    slew_us_per_s: Positive = 8000.0

    @model_validator(mode="after")
    def _check_order(self) -> PwmConfig:
        if not self.astern_us < self.neutral_us < self.ahead_us:
            raise ValueError("astern_us < neutral_us < ahead_us must hold")
        if self.port_channel == self.starboard_channel:
            raise ValueError("port_channel and starboard_channel must differ")
        return self


class VehicleConfig(Section):
    """One boat: its name, its hull and motors, and its motor outputs."""

    name: str
    vessel: VesselConfig
    pwm: PwmConfig = PwmConfig()


# --- links -----------------------------------------------------------------------------------------------


class AutopilotLinkConfig(Section):
    """The MAVLink link to the frontseat: who we are on it, and what we ask of it."""

    endpoint: LinkSpecText
    profile: Literal["ardurover"] = "ardurover"
    system_id: MavlinkId = 1
    component_id: MavlinkId = 191
    override_system_id: MavlinkId = 1  # ArduPilot obeys overrides only from SYSID_MYGCS
    autopilot_system_id: MavlinkId = 1
    position_source: Literal["GLOBAL_POSITION_INT", "GPS_RAW_INT"] = "GLOBAL_POSITION_INT"
    streams_hz: dict[str, Positive] = Field(
        default_factory=lambda: {
            "HEARTBEAT": 5.0,
            "ATTITUDE": 20.0,
            "GLOBAL_POSITION_INT": 10.0,
            "SERVO_OUTPUT_RAW": 10.0,
            "RC_CHANNELS": 10.0,
            "EKF_STATUS_REPORT": 2.0,
            "GPS_RAW_INT": 1.0,
            "SYSTEM_TIME": 1.0,
        }
    )


class AnemometerLinkConfig(Section):
    """NMEA 0183 wind sentences."""

    endpoint: LinkSpecText


class OperatorLinkConfig(Section):
    """Where `asvhil hold` and ground stations send their commands, as MAVLink."""

    endpoint: LinkSpecText = "udpin:127.0.0.1:14660"


class LinksConfig(Section):
    """What the daemon connects to."""

    autopilot: AutopilotLinkConfig
    anemometer: AnemometerLinkConfig | None = None
    operator: OperatorLinkConfig = OperatorLinkConfig()
    reconnect_first_s: Positive = 0.2
    reconnect_max_s: Positive = 5.0


# --- estimation and control ------------------------------------------------------------------------------


class EkfConfig(Section):
    """Noise of the extended Kalman filter: random walks per sqrt(s), measurement standard deviations, gates."""

    velocity_walk_mps: Positive = 0.10
    yaw_rate_walk_radps: Positive = 0.05
    position_walk_m: Positive = 0.02
    heading_walk_rad: Positive = 0.002
    disturbance_walk_mps2: Positive = 0.006
    disturbance_yaw_walk_radps2: Positive = 0.003
    disturbance_max_mps2: Positive = 0.3
    disturbance_yaw_max_radps2: Positive = 0.15
    position_std_m: Positive = 0.15
    velocity_std_mps: Positive = 0.06
    heading_std_deg: Positive = 0.4
    yaw_rate_std_radps: Positive = 0.01
    gate_sigma: Positive = 5.0
    reset_after_s: Positive = 3.0
    stale_after_s: Positive = 1.0


class WindFilterConfig(Section):
    """Low-pass of the true wind and when it is too old to use."""

    time_constant_s: Positive = 4.0
    stale_after_s: Positive = 3.0


class MonitorConfig(Section):
    """When the boat no longer behaves as the model says: limits of the RMS error after a horizon, over a window."""

    horizon_s: Positive = 4.0
    window_s: Positive = 20.0
    max_u_mps: Positive = 0.35
    max_v_mps: Positive = 0.25
    max_r_radps: Positive = 0.12


class EstimatorConfig(Section):
    ekf: EkfConfig = EkfConfig()
    wind: WindFilterConfig = WindFilterConfig()
    monitor: MonitorConfig = MonitorConfig()


class MpcWeights(Section):
    """Weights of the quadratic stage cost, per second of horizon; terminal position in seconds.

    `sideways` is the part of both position weights that offsets across the station's heading get.
    """

    position: NonNegative = 1.0
    sideways: Fraction = 1.0
    heading: NonNegative = 200.0
    velocity: NonNegative = 0.1
    slew: NonNegative = 0.05
    terminal_position_s: NonNegative = 60.0


class MpcConfig(Section):
    """The optimal control problem and how hard it is worked on. Caps are iterations, never time."""

    stages: Annotated[int, Field(ge=2, le=200)] = 20
    first_step_s: Positive = 0.2
    last_step_s: Positive = 0.8
    near: MpcWeights = MpcWeights()
    far: MpcWeights = MpcWeights(heading=10.0, terminal_position_s=1.0)
    position_only: MpcWeights = MpcWeights(heading=0.0)  # outside of the procedure's r_h, with its rule
    near_radius_m: Positive = 4.0
    far_radius_m: Positive = 10.0
    trim_time_s: Positive = 40.0
    trim_max_rad: NonNegative = 0.1
    iterations: Annotated[int, Field(ge=1, le=100)] = 3
    alternate_iterations: Annotated[int, Field(ge=0, le=200)] = 8
    alternate_beyond_m: NonNegative = 3.0
    second_order: bool = (
        True  # curvature of the dynamics in the later steps: nearer the optimum, dearer to build and run
    )
    wind_feedforward: bool = True
    disturbance_feedforward: bool = True


class ManoeuvresConfig(Section):
    """The programme of data collection around the station, and its fence."""

    duration_s: Positive = 600.0  # returns from the fence included
    seed: Annotated[int, Field(ge=0)] = 1
    geofence_radius_m: Positive = 60.0
    return_fraction: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.4  # of the radius: the return ends within it
    return_timeout_s: Positive = 120.0
    reaction_s: NonNegative = 0.4  # of the human-like hand
    max_command: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    note: str = ""  # weather and place in the operator's words, for the log


class ProcedureConfig(Section):
    """The paper's way to a station and back to it: Dubins path and ILOS beyond the radii, the keeper within them.

    `r_s_m`: the keeper takes over inside; `r_d_m`: start over outside; `r_h_m`: with `r_h_rule`, inside it heading and
    forward distance are kept, outside it position alone.
    """

    enabled: bool = False
    r_s_m: Positive = 15.0
    r_d_m: Positive = 20.0
    r_h_m: Positive = 5.0
    r_h_rule: bool = False
    r_h_back: Fraction = 0.7  # of r_h_m: back inside it the heading counts again
    dwell_s: NonNegative = 10.0  # least time in a stage
    turn_radius_m: Positive = 8.0
    speed_mps: Positive = 1.5
    handover_speed_mps: Positive = 0.8
    slow_down_mps2: Positive = 0.05
    lookahead_m: Positive = 8.0
    integral_gain: NonNegative = 0.5  # sigma of the ILOS law (m/s)
    integral_max_m: NonNegative = 6.0  # of the cross-track error that the integral may stand for
    replan_beyond_m: Positive = 6.0
    surge_time_s: Positive = 2.0  # time constants of the closed loops: speed, heading, yaw rate
    heading_time_s: Positive = 2.5
    yaw_rate_time_s: Positive = 0.8
    yaw_rate_max_radps: Positive = 0.3

    @model_validator(mode="after")
    def _check_radii(self) -> ProcedureConfig:
        if not self.r_h_m < self.r_s_m < self.r_d_m:
            raise ValueError("r_h_m < r_s_m < r_d_m must hold")
        return self


class SteeringConfig(Section):
    """How a classical law without side force steers: see `controller/classical.py`."""

    error_max_m: Positive = 4.0
    radius_m: Positive = 5.0
    lean_max_deg: Annotated[float, Field(ge=0.0, le=60.0)] = 10.0
    lean_from_m: Positive = 0.5
    lean_fade_n: Positive = 15.0


Gains3 = tuple[NonNegative, NonNegative, NonNegative]  # along, across, heading
Widths3 = tuple[Positive, Positive, Positive]


class BacksteppingConfig(Section):
    """Diagonals of the paper's gain matrices."""

    lambda_per_s: Gains3 = (0.3805, 0.3805, 0.6096)
    kd: Gains3 = (433.2, 433.2, 647.6)  # N s/m, N s/m, N m s/rad
    kp: Gains3 = (26.63, 26.63, 419.2)  # N/m, N/m, N m/rad
    wind_feedforward: bool = True
    steering: SteeringConfig = SteeringConfig(
        error_max_m=3.388,
        radius_m=21.42,
        lean_max_deg=33.87,
        lean_from_m=1.26,
        lean_fade_n=3.258,
    )


class SlidingModeConfig(Section):
    """Diagonals of the paper's gain matrices: Lambda, U (bound) and E (thickness of the boundary layer)."""

    lambda_per_s: Gains3 = (0.3, 0.3, 1.2)
    bound: Gains3 = (300.0, 300.0, 300.0)  # N, N, N m
    layer: Widths3 = (1.2, 1.2, 1.5)  # m/s, m/s, rad/s
    integral_max: Gains3 = (10.0, 10.0, 1.0)  # m s, m s, rad s
    wind_feedforward: bool = True
    steering: SteeringConfig = SteeringConfig(
        error_max_m=2.0,
        radius_m=15.0,
        lean_max_deg=12.0,
        lean_from_m=0.4,
        lean_fade_n=8.0,
    )


class LoiterConfig(Section):
    """The autopilot's LOITER: the names of its own parameters stand beside."""

    radius_m: Positive = 1.059  # LOIT_RADIUS
    speed_gain_per_s: Positive = 1.254  # LOIT_SPEED_GAIN
    speed_max_mps: Positive = 1.5  # WP_SPEED
    throttle_ff_per_mps: NonNegative = 0.7338  # CRUISE_THROTTLE over CRUISE_SPEED
    throttle_p_per_mps: NonNegative = 0.1447  # ATC_SPEED_P
    throttle_i_per_m: NonNegative = 0.04107  # ATC_SPEED_I
    throttle_min: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1149  # MOT_THR_MIN
    angle_p_per_s: NonNegative = 2.319  # ATC_STR_ANG_P
    rate_max_degps: Positive = 30.0  # ATC_STR_RAT_MAX
    rate_ff_s: NonNegative = 1.265  # ATC_STR_RAT_FF
    rate_p_s: NonNegative = 1.111  # ATC_STR_RAT_P


# Controllers that predict with a learned model, and the kind of model file each needs.
LEARNED = {
    "nnsem-mpc": "nnsem",
    "lagnet-mpc": "lagnet",
    "fitted-sd-mpc": "sd",
    "node-mpc": "node",
    "knode-mpc": "knode",
}


class SolverCaps(Section):
    """Iterations of a solver other than the default: from the shifted last plan, and from an alternate start (0: none).

    The default solver's are those of the MPC section.
    """

    iterations: Annotated[int, Field(ge=1, le=1000)]
    alternate_iterations: Annotated[int, Field(ge=0, le=1000)] = 0


class ControllerConfig(Section):
    """Which controller, and what it predicts with.

    `model` is the file of a learned model: a path, or the name of a shipped one; where absent, the one shipped for
    this vehicle. `vessel` is the physics that sd-mpc believes in; vehicle.vessel where absent.
    """

    name: Literal[
        "nnsem-mpc",
        "lagnet-mpc",
        "fitted-sd-mpc",
        "node-mpc",
        "knode-mpc",
        "sd-mpc",
        "manoeuvres",
        "backstepping",
        "sliding-mode",
        "loiter",
    ] = "sd-mpc"
    model: str | None = None
    vessel: VesselConfig | None = None
    mpc: MpcConfig = MpcConfig()
    solver: Literal["sqp", "ipopt", "fatrop", "torch-lqr"] = "sqp"  # of every *-mpc
    ipopt: SolverCaps = SolverCaps(iterations=100)
    fatrop: SolverCaps = SolverCaps(iterations=100)
    torch_lqr: SolverCaps = SolverCaps(iterations=2)  # LQR iterations, as in the paper
    manoeuvres: ManoeuvresConfig = ManoeuvresConfig()
    procedure: ProcedureConfig = ProcedureConfig()
    backstepping: BacksteppingConfig = BacksteppingConfig()
    sliding_mode: SlidingModeConfig = SlidingModeConfig()
    loiter: LoiterConfig = LoiterConfig()


class StationConfig(Section):
    lat_deg: Latitude
    lon_deg: Longitude
    heading_deg: Degrees


class SupervisorConfig(Section):
    """When the motors are taken and when they are given back."""

    engage: Literal["command", "auto"] = "command"
    station: StationConfig | None = None
    control_mode: str = "MANUAL"
    stick_channels: tuple[Annotated[int, Field(ge=1, le=18)], ...] = (2, 4)
    stick_threshold_us: Annotated[int, Field(ge=10, le=500)] = 60
    heartbeat_timeout_s: Positive = 2.5
    override_echo_s: Positive = 1.0
    failsafe_neutral_s: Positive = 2.0


class DaemonConfig(Section):
    """`control_hz` solves; `tick_hz` cuts inputs, resends the override and sees the pilot."""

    control_hz: Annotated[float, Field(ge=1.0, le=20.0)] = 5.0
    tick_hz: Annotated[float, Field(ge=10.0, le=100.0)] = 20.0

    @model_validator(mode="after")
    def _check_rates(self) -> DaemonConfig:
        ratio = self.tick_hz / self.control_hz
        if abs(ratio - round(ratio)) > 1e-9:
            raise ValueError("tick_hz must be a whole multiple of control_hz")
        return self

    @property
    def ticks_per_control(self) -> int:
        return round(self.tick_hz / self.control_hz)


class RecorderConfig(Section):
    directory: str = "runs"
    chunk_kib: Annotated[int, Field(ge=16, le=4096)] = 128
    sync_period_s: Positive = 0.5


# --- the simulated plant ---------------------------------------------------------------------------------


class WindConfig(Section):
    """Mean true wind and its gusts: two-component Ornstein-Uhlenbeck, fractions of the mean speed."""

    speed_mps: NonNegative = 3.0
    toward_deg: Degrees = 0.0
    gust_along: NonNegative = 0.15
    gust_across: NonNegative = 0.075
    gust_time_s: Positive = 15.0


class CurrentConfig(Section):
    speed_mps: NonNegative = 0.0
    toward_deg: Degrees = 0.0


class WeatherConfig(Section):
    wind: WindConfig = WindConfig()
    current: CurrentConfig = CurrentConfig()


class GnssSensorConfig(Section):
    rate_hz: Positive = 5.0
    slow_bias_m: NonNegative = 1.0
    slow_bias_time_s: Positive = 90.0
    white_m: NonNegative = 0.07
    velocity_white_mps: NonNegative = 0.05


class HeadingSensorConfig(Section):
    white_deg: NonNegative = 0.25
    bias_deg: float = 0.0


class ImuSensorConfig(Section):
    gyro_white_radps: NonNegative = 0.009
    accel_white_mps2: NonNegative = 0.021
    accel_bias_mps2: NonNegative = 0.05


class AnemometerSensorConfig(Section):
    rate_hz: Positive = 5.0
    speed_white_mps: NonNegative = 0.1
    directions: Annotated[int, Field(ge=4, le=360)] = 16
    misalignment_deg: Degrees = 0.0


class SensorsConfig(Section):
    gnss: GnssSensorConfig = GnssSensorConfig()
    heading: HeadingSensorConfig = HeadingSensorConfig()
    imu: ImuSensorConfig = ImuSensorConfig()
    anemometer: AnemometerSensorConfig = AnemometerSensorConfig()


class FrontseatConfig(Section):
    """The simulated autopilot; defaults follow a real ArduRover with its dead zones taken out."""

    system_id: MavlinkId = 1
    mygcs_system_id: MavlinkId = 1
    boot_s: NonNegative = 1.0
    ready_after_s: NonNegative = 3.0
    rc_receiver: bool = True
    override_timeout_s: Positive = 2.9
    neutral_timeout_s: Positive = 0.5
    failsafe_timeout_s: Positive = 1.9
    loop_hz: Positive = 50.0
    rc1_dz_us: Annotated[int, Field(ge=0, le=200)] = 0
    rc3_dz_us: Annotated[int, Field(ge=0, le=200)] = 0


class PlantLinksConfig(Section):
    autopilot: LinkSpecText = "udpout:127.0.0.1:14560"
    anemometer: LinkSpecText | None = None


class PlantConfig(Section):
    """The boat, weather and sensors that stand in for the real ones."""

    seed: Annotated[int, Field(ge=0)] = 1
    origin_lat_deg: Latitude = 40.4237
    origin_lon_deg: Longitude = -86.9212
    start_n_m: float = -14.0
    start_e_m: float = -3.0
    start_heading_deg: Degrees = 0.0
    step_s: Annotated[float, Field(gt=0.0, le=0.05)] = 0.01
    vessel: VesselConfig | None = None  # vehicle.vessel where absent
    weather: WeatherConfig = WeatherConfig()
    sensors: SensorsConfig = SensorsConfig()
    frontseat: FrontseatConfig = FrontseatConfig()
    links: PlantLinksConfig = PlantLinksConfig()


class Config(Section):
    """The whole of it: what every mode is built from."""

    vehicle: VehicleConfig
    links: LinksConfig
    estimator: EstimatorConfig = EstimatorConfig()
    controller: ControllerConfig = ControllerConfig()
    supervisor: SupervisorConfig = SupervisorConfig()
    daemon: DaemonConfig = DaemonConfig()
    recorder: RecorderConfig = RecorderConfig()
    plant: PlantConfig = PlantConfig()

    @model_validator(mode="after")
    def _check_across(self) -> Config:
        if self.supervisor.engage == "auto" and self.supervisor.station is None:
            raise ValueError("supervisor.station is needed where supervisor.engage is auto")
        pwm = self.vehicle.pwm
        for channel in (pwm.port_channel, pwm.starboard_channel):
            if channel in self.supervisor.stick_channels:
                raise ValueError(f"supervisor.stick_channels must not hold the motor channel {channel}")
        return self

    def content_hash(self) -> str:
        """First 16 hex digits of the SHA-256 of the config in canonical JSON."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()[:16]

    def canonical_json(self) -> str:
        """The whole config as JSON with sorted keys; `from_json` reads it back to an equal config."""
        return json.dumps(self.model_dump(mode="json"), sort_keys=True)


def find_config(name: str) -> Path:
    """The path of a config file: as given, else one of the shipped ones by its file name."""
    return find_shipped(name, "", (".yaml",), "config file (give a path, or the name of a shipped one such as sitl)")


def find_shipped(name: str, folder: str, endings: tuple[str, ...], what: str) -> Path:
    """A file as given, else one shipped under config/`folder` by its name, with or without one of the endings.

    Raises ConfigError saying that there is no such `what`.
    """
    given = Path(name)
    if given.is_file():
        return given
    package = Path(__file__).resolve().parent
    for root in (package / "shipped_config", package.parent / "config"):
        for ending in ("", *endings):
            candidate = root / folder / f"{name}{ending}"
            if given.name == name and candidate.is_file():
                return candidate
    raise ConfigError(f"{name}: no such {what}")


def load_config(path: str | Path, overrides: tuple[str, ...] = ()) -> Config:
    """Read a YAML config, merge it over the file its `base:` key names, apply `KEY=VALUE` overrides, validate.

    Raises ConfigError with one line that names the file and the key.
    """
    found = find_config(str(path))
    tree = _read_tree(found, ())
    for override in overrides:
        _apply_override(tree, override)
    return _validate(tree, str(found))


def config_from_json(text: str, source: str) -> Config:
    """The config stored in a log. Raises ConfigError naming the source."""
    try:
        tree = json.loads(text)
    except ValueError as error:
        raise ConfigError(f"{source}: the stored config is not JSON ({error})") from None
    return _validate(tree, source)


def _read_tree(path: Path, seen: tuple[Path, ...]) -> dict[str, Any]:
    if path.resolve() in seen:
        raise ConfigError(f"{path}: key base: the chain of base files runs in a circle")
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ConfigError(f"{path}: cannot be read ({reason})") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigError(
            f"{path}: not valid YAML{where} ({getattr(error, 'problem', None) or 'cannot be parsed'})"
        ) from None
    if tree is None:
        tree = {}
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: a mapping of keys is expected at the top level, not {type(tree).__name__}")
    base = tree.pop("base", None)
    if base is None:
        return tree
    if not isinstance(base, str):
        raise ConfigError(f"{path}: key base: the name of a config file is expected, not {base!r}")
    base_path = path.parent / base
    if not base_path.is_file():
        raise ConfigError(f"{path}: key base: no such file {base} beside it")
    return _merge(_read_tree(base_path, (*seen, path.resolve())), tree)


def _merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        if isinstance(value, dict) and isinstance(merged.get(key), dict):
            merged[key] = _merge(merged[key], value)
        else:
            merged[key] = value
    return merged


def _apply_override(tree: dict[str, Any], override: str) -> None:
    key, sign, text = override.partition("=")
    if not sign or not key:
        raise ConfigError(f"--set {override}: KEY=VALUE is expected, such as plant.seed=2")
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise ConfigError(f"--set {override}: the value is not valid YAML") from None
    *parents, leaf = key.split(".")
    node = tree
    for name in parents:
        child = node.get(name)
        if child is None:
            child = node[name] = {}
        if not isinstance(child, dict):
            raise ConfigError(f"--set {override}: {name} is a value, not a section")
        node = child
    node[leaf] = value


def _validate(tree: Any, source: str) -> Config:
    try:
        return Config.model_validate(_sorted(tree))
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        if first["type"] == "extra_forbidden":
            message = f"unknown key{_suggest(first['loc'])}"
        elif first["type"] == "missing":
            message = "this key is required"
        elif not isinstance(first["input"], dict | list):
            message = f"{message} (got {first['input']!r})"
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise ConfigError(f"{source}: {f'key {key}: ' if key else ''}{message}{more}") from None


def _sorted(tree: Any) -> Any:
    """Mappings in the order of their keys, so that a config read back from a log behaves alike to the last bit."""
    if isinstance(tree, dict):
        return {key: _sorted(tree[key]) for key in sorted(tree, key=str)}
    return tree


def _suggest(loc: tuple[int | str, ...]) -> str:
    """The nearest key that exists beside an unknown one, or nothing."""
    import difflib

    section: Any = Config
    for part in loc[:-1]:
        field = getattr(section, "model_fields", {}).get(str(part))
        section = field.annotation if field else None
        options = getattr(section, "__args__", ())
        section = next((option for option in options if hasattr(option, "model_fields")), section)
    near = difflib.get_close_matches(str(loc[-1]), list(getattr(section, "model_fields", {})), n=1)
    return f", did you mean {near[0]}?" if near else ""
