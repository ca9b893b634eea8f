"""Settings of the controllers: weights, gains, solvers, and the approach to the station."""

from __future__ import annotations

from typing import Literal, NamedTuple

from pydantic import Field, model_validator

from asvhil.config.base import Fraction, NonNegative, Positive, Section

EFFORT_PARAMETER = "MPC_EFFORT"


class Effort(NamedTuple):
    """What an effort asks of the MPC; chosen from the front in docs/results/effort.md."""

    slew_per_load: float = 0.0  # least slew weight of the near set per m/s^2 of side load
    slew_most: float = 40.0  # beyond, the boat swings farther and its motors work hardly less
    growth: float = 1.0  # of the stages: a longer look ahead has less of the same swing at full thrust


EFFORTS: dict[str, Effort] = {"precise": Effort(), "normal": Effort(150.0), "gentle": Effort(1000.0)}
# The same of a model whose input is thrust, of which a change is less than that of the command that gives it.
EFFORTS_OF_THRUST: dict[str, Effort] = {
    "precise": Effort(),
    "normal": Effort(150.0, 80.0),
    "gentle": Effort(6500.0, 112.0, 1.7),
}
NORMAL, GENTLE, GENTLE_OF_THRUST = EFFORTS["normal"], EFFORTS["gentle"], EFFORTS_OF_THRUST["gentle"]


class SoftLimits(Section):
    """Bounds of the state that the MPC leaves only at a price, `soft` of the weights in use; by default those of a
    docking window.
    """

    heading_deg: Positive = Field(default=17.0, description="Heading error within which an excess costs nothing.")
    speed_mps: Positive = Field(default=0.3, description="The same of the surge and sway velocities.")
    yaw_rate_degps: Positive = Field(default=3.0, description="The same of the yaw rate.")


class MpcWeights(Section):
    """One set of weights of the MPC's quadratic cost, in the station's axes.

    Stage weights count per second of horizon; errors are in m, rad, m/s and rad/s. Raise the heading weight for a boat
    that must point well, the position weight for one that must not drift. The shipped sets were chosen by the penalty
    score of the simulated WAM-V (`asvhil study six-tests`).
    """

    position: NonNegative = Field(default=1.0, description="Weight of the squared distance to the station (1/m^2).")
    sideways: Fraction = Field(
        default=1.0,
        description=(
            "Share of both position weights that offsets across the station's heading get; 1: all directions alike."
        ),
    )
    heading: NonNegative = Field(default=200.0, description="Weight of the squared heading error (1/rad^2).")
    velocity: NonNegative = Field(
        default=0.1, description="Weight of the squared velocities u, v (1/(m/s)^2) and r (1/(rad/s)^2)."
    )
    yaw_rate: NonNegative | None = Field(
        default=None,
        description=(
            "Weight of the squared r alone, for a boat that must turn slowly: 10000 counts 5 deg/s as much as 9 m of "
            "distance. null: as `velocity`."
        ),
    )
    slew: NonNegative = Field(
        default=0.05, description="Weight of the squared change of each input from one stage to the next."
    )
    soft: NonNegative = Field(
        default=0.0,
        description=(
            "Weight of the squared excess over each of `controller.mpc.soft_limits`, as a share of the limit: 100 "
            "counts twice the limit as much as 10 m of distance."
        ),
    )
    terminal_position_s: NonNegative = Field(
        default=60.0,
        description="Weight of the squared distance at the end of the horizon, as seconds of a stage weight of 1.",
    )


class MpcConfig(Section):
    """The optimal control problem of every `*-mpc` controller, and the iterations that its default solver may take.

    Solvers are capped by iterations and never by time, so that two runs agree. The weight set in use depends on where
    the boat is (`near`, `along`, `far`, `position_only`), and on whether its heading is the weather's (`weather`).
    """

    before_it_came = (
        ("effort", "precise"),
        ("least_thrust", 0.0),
        ("thrust_slew", 0.0),
        ("weather", None),
        ("sideways_heading", None),
    )

    stages: int = Field(default=20, ge=2, le=200, description="Number of stages of the horizon, one input pair each.")
    first_step_s: Positive = Field(
        default=0.2,
        le=10.0,
        description="Length of the first stage; a learned model must have been trained with this step.",
    )
    last_step_s: Positive = Field(
        default=0.9,
        le=60.0,
        description="Length of the last stage; stages in between grow linearly (horizon by default: 11 s).",
    )
    near: MpcWeights = Field(
        default=MpcWeights(heading=350.0, velocity=0.0, terminal_position_s=140.0),
        description="Weights near the station, with a side load to carry or an offset to remove.",
    )
    sideways_heading: NonNegative | None = Field(
        default=120.0,
        description=(
            "Most heading weight of `near` while the station moves across its heading: no motor pushes that way, so "
            "the boat follows by turns to either side. null: that of `near`."
        ),
    )
    effort: Literal["precise", "normal", "gentle"] = Field(
        default="normal",
        description=(
            "How much the motors may work near the station against a load across its heading: the least slew weight "
            "of `near`, in proportion to the side load. `precise` keeps the configured one; with `normal` and `gentle` "
            f"it is at least {NORMAL.slew_per_load:g} and {GENTLE.slew_per_load:g} per m/s^2, {GENTLE.slew_most:g} at "
            f"most (models whose input is thrust: `gentle` {GENTLE_OF_THRUST.slew_per_load:g}, "
            f"{GENTLE_OF_THRUST.slew_most:g} at most, and to look further ahead stages that grow "
            f"{GENTLE_OF_THRUST.growth:g} times as fast): fewer reversals, less time at full thrust, a wider swing."
        ),
    )
    # Near too, but with no load across the heading to carry.
    along: MpcWeights = Field(
        default=MpcWeights(heading=5000.0, slew=4.0),
        description="Weights near the station where wind and disturbance act along the boat.",
    )
    weather: MpcWeights | None = Field(
        default=MpcWeights(heading=30.0, velocity=20.0, slew=90.0, terminal_position_s=100.0),
        description=(
            "Weights near the station while its heading follows the weather (`supervisor.heading.policy`), without "
            "heading trim: a light heading weight lets a small turn and the weather itself bring the boat back, in the "
            "place of the motors. null: `near` and `along`, as with a fixed heading."
        ),
    )
    far: MpcWeights = Field(
        default=MpcWeights(heading=10.0, terminal_position_s=1.0),
        description="Weights while the boat is not near (near_radius_m): the way back counts, the heading hardly.",
    )
    position_only: MpcWeights = Field(
        default=MpcWeights(heading=0.0),
        description="Weights of the procedure's stage keep_position, outside its r_h_m (with r_h_rule).",
    )
    side_load_mps2: tuple[NonNegative, Positive] = Field(
        default=(0.004, 0.010),
        description=(
            "Side load, the sway acceleration at rest at the station's heading, up to which `along` holds, and from "
            "which `near` does; between them a mean of both."
        ),
    )
    side_load_time_s: Positive = Field(default=10.0, description="Time constant of the side load's low-pass.")
    offset_m: tuple[NonNegative, Positive] = Field(
        default=(0.2, 0.6),
        description=(
            "Distances from which `near` begins to replace `along`, and has replaced it, whatever the side load."
        ),
    )
    lasting_offset_m: tuple[NonNegative, Positive] | None = Field(
        default=None,
        description=(
            "The same for the offset across the station's heading, low-passed, so that these limits can be below "
            "offset_m without following noise and gusts; null: only the distance counts."
        ),
    )
    lasting_offset_time_s: Positive = Field(default=8.0, description="Time constant of that offset's low-pass.")
    soft_limits: SoftLimits | None = Field(
        default=None,
        description=(
            "Heading error, speed and yaw rate beyond which the weights' `soft` counts, for a boat whose docking "
            "window is to stay open. null: no such limits."
        ),
    )
    near_radius_m: Positive = Field(default=4.0, description="Distance within which the boat counts as near.")
    far_radius_m: Positive = Field(
        default=10.0, description="Distance beyond which a boat that was near no longer is; above near_radius_m."
    )
    delay_s: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="Time from the estimate to the motors' answer: solving and links. The plan starts that much later.",
    )
    unmodelled_lag_s: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description=(
            "Added to delay_s for a model without motor states (nnsem, node, knode, sd fitted): the motors' lag as a "
            "dead time, about two thirds of the lag."
        ),
    )
    trim_time_s: Positive = Field(
        default=40.0,
        description="Integration time of the heading trim, which removes the mean heading error once the boat is near.",
    )
    trim_max_rad: NonNegative = Field(default=0.1, description="Largest heading trim; 0: none.")
    iterations: int = Field(default=10, ge=1, le=100, description="QPs per solution from the shifted last plan (sqp).")
    alternate_iterations: int = Field(
        default=8, ge=0, le=200, description="QPs from the alternate start, see alternate_beyond_m; 0: none (sqp)."
    )
    alternate_beyond_m: NonNegative = Field(
        default=3.0,
        description=(
            "Beyond this distance each solution also tries one other start (both motors off, ahead and astern in "
            "turn), since a single start can stay in a local minimum."
        ),
    )
    least_thrust: Fraction = Field(
        default=0.05,
        description=(
            "Of a model whose input is thrust (lagnet, sd): the share of full thrust ahead below which a motor that is "
            "off stays off, and one that turns stops where it should turn the other way. Such a model does not see "
            "that a small thrust to either side is a jump across the motor's dead band."
        ),
    )
    thrust_slew: NonNegative = Field(
        default=60.0,
        description=(
            "Least slew weight of `along` with a model whose input is thrust: a change of a small thrust is less than "
            "the change of motor command that it takes."
        ),
    )
    wind_feedforward: bool = Field(default=True, description="Whether the prediction includes the measured wind.")
    disturbance_feedforward: bool = Field(
        default=True, description="Whether the prediction includes the estimated disturbance."
    )

    @model_validator(mode="after")
    def _check_ramps(self) -> MpcConfig:
        for name in ("side_load_mps2", "offset_m", "lasting_offset_m"):
            limits = getattr(self, name)
            if limits is not None and not limits[0] < limits[1]:
                raise ValueError(f"{name} needs two rising values")
        if not self.near_radius_m < self.far_radius_m:
            raise ValueError("near_radius_m < far_radius_m must hold")
        return self

    @model_validator(mode="after")
    def _check_soft_limits(self) -> MpcConfig:
        sets = ("near", "along", "weather", "far", "position_only")
        soft = [name for name in sets if (weights := getattr(self, name)) is not None and weights.soft > 0.0]
        if soft and self.soft_limits is None:
            raise ValueError(f"{soft[0]}.soft has no effect without soft_limits: give these, as soft_limits: {{}}")
        if self.soft_limits is not None and not soft:
            raise ValueError("soft_limits have no effect where soft is 0 in all weights: give near.soft, as 5000")
        return self


class ManoeuvresConfig(Section):
    """The manoeuvres of `asvhil collect`, which make training data around the station, and their geofence."""

    duration_s: Positive = Field(default=600.0, description="Length of the programme, returns from the fence included.")
    seed: int = Field(default=1, ge=0, description="Seed of the programme's order and levels.")
    geofence_radius_m: Positive = Field(
        default=60.0,
        description="Distance to the station at which the boat is brought back; at twice that it gives up.",
    )
    return_fraction: float = Field(
        default=0.4, gt=0.0, lt=1.0, description="Share of the geofence's radius within which a return is complete."
    )
    return_timeout_s: Positive = Field(default=120.0, description="A return that takes longer ends the programme.")
    reaction_s: NonNegative = Field(default=0.4, description="Reaction time of the simulated human operator.")
    max_command: float = Field(
        default=1.0, gt=0.0, le=1.0, description="Bound on every motor command of the programme."
    )
    note: str = Field(default="", description="Weather and place in the operator's words, for the log.")


class ProcedureConfig(Section):
    """The paper's station keeping procedure: a Dubins path followed by ILOS to the station, then the controller.

    Radii are distances to the station. The controller (`controller.name`) takes over within r_s_m; beyond r_d_m the
    boat starts over.
    """

    enabled: bool = Field(
        default=False, description="Whether the procedure is used; an MPC alone drives straight to its station."
    )
    r_s_m: Positive = Field(default=15.0, description="Within it the controller takes over from the approach.")
    r_d_m: Positive = Field(default=20.0, description="Beyond it the approach starts over; above r_s_m.")
    r_h_m: Positive = Field(
        default=5.0, description="With r_h_rule: within it position and heading are kept, outside it position alone."
    )
    r_h_rule: bool = Field(default=False, description="Whether the controller ignores the heading beyond r_h_m.")
    r_h_back: Fraction = Field(
        default=0.7, description="Share of r_h_m within which the heading counts again after it was ignored."
    )
    dwell_s: NonNegative = Field(default=10.0, description="Least time in a stage.")
    turn_radius_m: Positive = Field(
        default=8.0, description="Radius of the path's turns; what the boat can do at speed_mps."
    )
    speed_mps: Positive = Field(default=1.5, description="Surge speed of the approach.")
    handover_speed_mps: Positive = Field(default=0.8, description="Surge speed at which the boat reaches r_s_m.")
    slow_down_mps2: Positive = Field(default=0.05, description="Deceleration from speed_mps toward handover_speed_mps.")
    lookahead_m: Positive = Field(
        default=8.0,
        description="Look-ahead distance Delta of the ILOS law, about two boat lengths; smaller turns sharper.",
    )
    integral_gain: NonNegative = Field(default=0.5, description="Integral gain sigma of the ILOS law (m/s).")
    integral_max_m: NonNegative = Field(
        default=6.0, description="Largest cross-track error that the ILOS integral may compensate."
    )
    replan_beyond_m: Positive = Field(default=6.0, description="Cross-track error at which a new path is planned.")
    surge_time_s: Positive = Field(default=2.0, description="Time constant of the closed speed loop.")
    heading_time_s: Positive = Field(default=2.5, description="Time constant of the closed heading loop.")
    yaw_rate_time_s: Positive = Field(default=0.8, description="Time constant of the closed yaw rate loop.")
    yaw_rate_max_radps: Positive = Field(default=0.3, description="Largest yaw rate that the approach asks for.")

    @model_validator(mode="after")
    def _check_radii(self) -> ProcedureConfig:
        if not self.r_h_m < self.r_s_m < self.r_d_m:
            raise ValueError("r_h_m < r_s_m < r_d_m must hold")
        return self


class SteeringConfig(Section):
    """Heading reference of a classical controller, for a boat whose fixed motors make no side force.

    Far off, bow or stern points at the station; near, the heading turns off the station's by an angle (the lean) at
    which surge force removes an offset abeam. Shipped values: `asvhil tune`.
    """

    error_max_m: Positive = Field(
        default=4.0, description="Position errors are shortened to this length before the feedback law."
    )
    radius_m: Positive = Field(
        default=5.0, description="Beyond it bow or stern points at the station, until within half of it."
    )
    lean_max_deg: float = Field(default=10.0, ge=0.0, le=60.0, description="Largest lean off the station's heading.")
    lean_from_m: Positive = Field(
        default=0.5, description="Offset abeam at which the lean begins; at twice that it may reach lean_max_deg."
    )
    lean_fade_n: Positive = Field(default=15.0, description="Surge force below which the lean fades out.")


Gains3 = tuple[NonNegative, NonNegative, NonNegative]  # along, across, heading
Widths3 = tuple[Positive, Positive, Positive]


class BacksteppingConfig(Section):
    """P-D backstepping after Sarda et al. (2016): diagonals (along, across, heading) of its gain matrices.

    Shipped gains: `asvhil tune`.
    """

    lambda_per_s: Gains3 = Field(
        default=(0.1258, 0.1258, 0.9509), description="Lambda, the bandwidth of the reference velocity."
    )
    kd: Gains3 = Field(default=(300.0, 300.0, 344.6), description="K_d, in N s/m, N s/m, N m s/rad.")
    kp: Gains3 = Field(default=(970.8, 970.8, 16.89), description="K_p, in N/m, N/m, N m/rad.")
    wind_feedforward: bool = Field(default=True, description="Whether the measured wind's load is compensated.")
    steering: SteeringConfig = Field(
        default=SteeringConfig(
            error_max_m=45.28,
            radius_m=23.01,
            lean_max_deg=22.4,
            lean_from_m=1.591,
            lean_fade_n=2.519,
        ),
        description="Heading reference.",
    )


class SlidingModeConfig(Section):
    """Sliding mode with an integral surface and a boundary layer: diagonals (along, across, heading) of its matrices.

    Shipped gains: `asvhil tune`.
    """

    lambda_per_s: Gains3 = Field(default=(0.4412, 0.4412, 0.5601), description="Lambda, the surface's bandwidth.")
    bound: Gains3 = Field(
        default=(1793.0, 1793.0, 374.7), description="U, the bound of the switching force, in N, N, N m."
    )
    layer: Widths3 = Field(
        default=(0.9177, 0.9177, 0.1682), description="E, the thickness of the boundary layer, in m/s, m/s, rad/s."
    )
    integral_max: Gains3 = Field(
        default=(10.0, 10.0, 1.0), description="Bound on the integrated error, in m s, m s, rad s."
    )
    wind_feedforward: bool = Field(default=True, description="Whether the measured wind's load is compensated.")
    steering: SteeringConfig = Field(
        default=SteeringConfig(
            error_max_m=0.8359,
            radius_m=10.21,
            lean_max_deg=3.509,
            lean_from_m=1.644,
            lean_fade_n=4.292,
        ),
        description="Heading reference.",
    )


class LoiterConfig(Section):
    """What ArduRover's LOITER mode does, as a baseline; each key corresponds to a parameter of the autopilot.

    Shipped gains: `asvhil tune`. Speeds are in m/s and throttle and steering in [-1, 1].
    """

    radius_m: Positive = Field(default=1.258, description="LOIT_RADIUS: within it the boat drifts.")
    speed_gain_per_s: Positive = Field(
        default=1.961, description="LOIT_SPEED_GAIN: speed for each metre outside the radius."
    )
    speed_max_mps: Positive = Field(default=1.5, description="WP_SPEED: highest speed toward the station.")
    throttle_ff_per_mps: NonNegative = Field(
        default=0.7262, description="CRUISE_THROTTLE over CRUISE_SPEED: throttle for each m/s of speed wanted."
    )
    throttle_p_per_mps: NonNegative = Field(default=0.1335, description="ATC_SPEED_P, on the speed error.")
    throttle_i_per_m: NonNegative = Field(default=0.06501, description="ATC_SPEED_I, on its integral.")
    throttle_min: float = Field(
        default=0.1013, ge=0.0, lt=1.0, description="MOT_THR_MIN: least command of a motor that runs."
    )
    angle_p_per_s: NonNegative = Field(
        default=1.406, description="ATC_STR_ANG_P: turn rate for each radian off course."
    )
    rate_max_degps: Positive = Field(default=30.0, description="ATC_STR_RAT_MAX: highest turn rate.")
    rate_ff_s: NonNegative = Field(default=1.094, description="ATC_STR_RAT_FF: steering for each rad/s of rate wanted.")
    rate_p_s: NonNegative = Field(default=0.8756, description="ATC_STR_RAT_P: steering for each rad/s of rate error.")


class SolverCaps(Section):
    """Iterations of a solver other than sqp; those of sqp are in `controller.mpc`."""

    iterations: int = Field(ge=1, le=1000, description="Iterations from the shifted last plan.")
    alternate_iterations: int = Field(
        default=0, ge=0, le=1000, description="Iterations from an alternate start; 0: none is tried."
    )
