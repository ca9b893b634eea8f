"""The controllers, their weights, gains and solvers, and the way to the station."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from asvhil.config.base import Fraction, NonNegative, Positive, Section
from asvhil.config.vehicle import VesselConfig


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
    last_step_s: Positive = 0.9
    near: MpcWeights = MpcWeights(heading=350.0, velocity=0.0, terminal_position_s=140.0)
    along: MpcWeights = MpcWeights(heading=5000.0, slew=4.0)  # near too, but with no load across the heading to carry
    far: MpcWeights = MpcWeights(heading=10.0, terminal_position_s=1.0)
    position_only: MpcWeights = MpcWeights(heading=0.0)  # outside of the procedure's r_h, with its rule
    side_load_mps2: tuple[NonNegative, Positive] = (0.004, 0.010)  # `along` up to the first, `near` from the second
    side_load_time_s: Positive = 10.0
    offset_m: tuple[NonNegative, Positive] = (0.2, 0.6)  # `near` weights from the second on, whatever the load
    near_radius_m: Positive = 4.0
    far_radius_m: Positive = 10.0
    delay_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0  # from the estimate to the motors' answer: solving and links
    unmodelled_lag_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0  # added to it for a model without motor states
    trim_time_s: Positive = 40.0
    trim_max_rad: NonNegative = 0.1
    iterations: Annotated[int, Field(ge=1, le=100)] = 10
    alternate_iterations: Annotated[int, Field(ge=0, le=200)] = 8
    alternate_beyond_m: NonNegative = 3.0
    wind_feedforward: bool = True
    disturbance_feedforward: bool = True

    @model_validator(mode="after")
    def _check_ramps(self) -> MpcConfig:
        for name, (low, high) in (("side_load_mps2", self.side_load_mps2), ("offset_m", self.offset_m)):
            if not low < high:
                raise ValueError(f"{name} needs two rising values")
        if not self.near_radius_m < self.far_radius_m:
            raise ValueError("near_radius_m < far_radius_m must hold")
        return self


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

    lambda_per_s: Gains3 = (0.4, 0.4, 0.8686)
    kd: Gains3 = (324.7, 324.7, 1400.0)  # N s/m, N s/m, N m s/rad
    kp: Gains3 = (35.94, 35.94, 1400.0)  # N/m, N/m, N m/rad
    wind_feedforward: bool = True
    steering: SteeringConfig = SteeringConfig(
        error_max_m=4.935,
        radius_m=21.42,
        lean_max_deg=35.89,
        lean_from_m=1.175,
        lean_fade_n=2.023,
    )


class SlidingModeConfig(Section):
    """Diagonals of the paper's gain matrices: Lambda, U (bound) and E (thickness of the boundary layer)."""

    lambda_per_s: Gains3 = (0.514, 0.514, 0.5171)
    bound: Gains3 = (1044.0, 1044.0, 530.4)  # N, N, N m
    layer: Widths3 = (1.487, 1.487, 0.4261)  # m/s, m/s, rad/s
    integral_max: Gains3 = (10.0, 10.0, 1.0)  # m s, m s, rad s
    wind_feedforward: bool = True
    steering: SteeringConfig = SteeringConfig(
        error_max_m=0.6366,
        radius_m=6.592,
        lean_max_deg=9.98,
        lean_from_m=1.13,
        lean_fade_n=3.271,
    )


class LoiterConfig(Section):
    """The autopilot's LOITER: the names of its own parameters stand beside."""

    radius_m: Positive = 1.258  # LOIT_RADIUS
    speed_gain_per_s: Positive = 1.961  # LOIT_SPEED_GAIN
    speed_max_mps: Positive = 1.5  # WP_SPEED
    throttle_ff_per_mps: NonNegative = 0.7262  # CRUISE_THROTTLE over CRUISE_SPEED
    throttle_p_per_mps: NonNegative = 0.1335  # ATC_SPEED_P
    throttle_i_per_m: NonNegative = 0.06501  # ATC_SPEED_I
    throttle_min: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.1013  # MOT_THR_MIN
    angle_p_per_s: NonNegative = 1.406  # ATC_STR_ANG_P
    rate_max_degps: Positive = 30.0  # ATC_STR_RAT_MAX
    rate_ff_s: NonNegative = 1.094  # ATC_STR_RAT_FF
    rate_p_s: NonNegative = 0.8756  # ATC_STR_RAT_P


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
