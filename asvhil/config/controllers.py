"""The controllers and solvers of this package, one row for each, and the section that chooses among them."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from asvhil.config.chosen import Choosing, NamedIn
from asvhil.config.controller import (
    EFFORT_PARAMETER,
    EFFORTS,
    BacksteppingConfig,
    LoiterConfig,
    ManoeuvresConfig,
    MpcConfig,
    ProcedureConfig,
    SlidingModeConfig,
    SolverCaps,
)
from asvhil.config.registry import CONTROLLERS, SOLVERS, ControllerKind, OperatorParameter, SearchRange, SolverKind
from asvhil.config.vehicle import VesselConfig

DEGREE = math.pi / 180.0
_SETS = (("NEAR", "near"), ("ALONG", "along"), ("WTHR", "weather"), ("FAR", "far"), ("POSN", "position_only"))
# What may be set in a hold, from and to. Without any weight of the position, or of the heading, nothing keeps the boat
# there: in 4 m/s from abeam the WAM-V was held with a tenth of the shipped position weight, and not with a hundredth.
_WEIGHTS = (
    ("POS", "position", 0.1, 1e4),
    ("SIDE", "sideways", 0.05, 1.0),
    ("HDG", "heading", 1.0, 1e5),
    ("VEL", "velocity", 0.0, 1e4),
    ("SLEW", "slew", 0.0, 1e4),
    ("TERM", "terminal_position_s", 0.0, 1e4),
)
_ANY_HEADING = frozenset({("FAR", "HDG"), ("POSN", "HDG")})  # sets that need not point anywhere
_MPC_PARAMETERS = (
    *(
        OperatorParameter(
            name=f"W_{short}_{what}",
            path=(section, field),
            least=0.0 if (short, what) in _ANY_HEADING else least,
            most=most,
        )
        for short, section in _SETS
        for what, field, least, most in _WEIGHTS
    ),
    OperatorParameter(
        name=EFFORT_PARAMETER, path=("effort",), least=0.0, most=len(EFFORTS) - 1.0, choices=tuple(EFFORTS)
    ),
    OperatorParameter(name="MPC_NEAR_R", path=("near_radius_m",), least=0.5, most=100.0),
    OperatorParameter(name="MPC_FAR_R", path=("far_radius_m",), least=1.0, most=200.0),
    OperatorParameter(name="MPC_TRIM_T", path=("trim_time_s",), least=1.0, most=1e4),
    OperatorParameter(name="MPC_TRIM_MAX", path=("trim_max_rad",), least=0.0, most=30.0, scale=DEGREE),
)


def _mpc(name: str, label: str, model: str = "") -> ControllerKind:
    """Receding horizon control by a vessel model: a learned one of some kind, or the physics."""
    return ControllerKind(
        name=name,
        label=label,
        build="asvhil.controller.station_mpc:build",
        section=MpcConfig,
        key="mpc",
        model=model,
        solves=True,
        parameters=_MPC_PARAMETERS,
    )


def _gains(key: str, position: float, heading: float) -> tuple[SearchRange, ...]:
    """One gain along and across, so that the pull is towards the station from anywhere, and one for the heading."""
    return SearchRange(key=f"{key}[0,1]", start=position), SearchRange(key=f"{key}[2]", start=heading)


# The searches' starts: the best of a pilot search of 40 candidates for each, rounded. Only the steering's were set by
# hand, as the pilot had stuck at a small radius: from runs that included two of the test winds (3 and 6 m/s toward 90
# degrees).
_STEERING = (
    SearchRange(key="steering.error_max_m", start=2.0),
    SearchRange(key="steering.radius_m", start=15.0),
    SearchRange(key="steering.lean_max_deg", start=12.0),
    SearchRange(key="steering.lean_from_m", start=0.4),
    SearchRange(key="steering.lean_fade_n", start=8.0),
)

CONTROLLERS.fill(
    (
        _mpc("nnsem-mpc", "NNSEM-MPC", "nnsem"),
        _mpc("lagnet-mpc", "LagNet-MPC", "lagnet"),
        _mpc("fitted-sd-mpc", "SD-MPC (fitted)", "sd"),
        _mpc("node-mpc", "NODE-MPC", "node"),
        _mpc("knode-mpc", "KNODE-MPC", "knode"),
        ControllerKind(
            name="backstepping",
            build="asvhil.controller.backstepping:build",
            section=BacksteppingConfig,
            search=(
                *_gains("lambda_per_s", 0.1, 1.5),
                *_gains("kd", 600.0, 350.0),
                *_gains("kp", 40.0, 350.0),
                *_STEERING,
            ),
        ),
        ControllerKind(
            name="sliding-mode",
            label="sliding mode",
            build="asvhil.controller.sliding_mode:build",
            section=SlidingModeConfig,
            search=(
                *_gains("lambda_per_s", 0.3, 1.2),
                *_gains("bound", 300.0, 300.0),
                *_gains("layer", 1.2, 1.5),
                *_STEERING,
            ),
        ),
        ControllerKind(
            name="loiter",
            label="LOITER",
            build="asvhil.controller.loiter:build",
            section=LoiterConfig,
            parameters=(
                OperatorParameter(name="LOIT_RADIUS", path=("radius_m",), least=0.1, most=100.0),
                OperatorParameter(name="LOIT_SPEED_MAX", path=("speed_max_mps",), least=0.1, most=10.0),
            ),
            search=(
                SearchRange(key="radius_m", start=1.0),
                SearchRange(key="speed_gain_per_s", start=1.2),
                SearchRange(key="throttle_ff_per_mps", start=0.7),
                SearchRange(key="throttle_p_per_mps", start=0.15),
                SearchRange(key="throttle_i_per_m", start=0.04),
                SearchRange(key="throttle_min", start=0.12),
                SearchRange(key="angle_p_per_s", start=2.3),
                SearchRange(key="rate_ff_s", start=1.2),
                SearchRange(key="rate_p_s", start=1.1),
            ),
        ),
        _mpc("sd-mpc", "SD-MPC (true physics)"),
        ControllerKind(
            name="manoeuvres",
            build="asvhil.controller.manoeuvres:build",
            section=ManoeuvresConfig,
            keeps_station=False,
        ),
    )
)

SOLVERS.fill(
    (
        SolverKind(name="sqp", build="asvhil.controller.solvers.sqp:build"),
        SolverKind(name="ipopt", build="asvhil.controller.solvers.ipopt:Ipopt", section=SolverCaps),
        SolverKind(name="fatrop", build="asvhil.controller.solvers.fatrop:Fatrop", section=SolverCaps),
        SolverKind(
            name="torch-lqr",
            build="asvhil.controller.solvers.torch_lqr:build",
            section=SolverCaps,
            missing="needs torch: install asvhil[train]",
        ),
    )
)


class ControllerConfig(Choosing):
    """Which controller keeps the station, and what it predicts with.

    A controller of a plug-in has its settings here too, under its own name with `_` for `-`.
    """

    registry = CONTROLLERS
    chooser = "name"

    name: Annotated[str, NamedIn(CONTROLLERS)] = Field(
        default="sd-mpc", description="The controller; docs/controllers.md compares them."
    )
    model: str | None = Field(
        default=None,
        description=(
            "File of a learned model: a path, also from the folder of the config, or the name of a shipped one; where "
            "absent, the one shipped for this vehicle (VEHICLE-KIND.npz)."
        ),
    )
    on_other_hull: Literal["refuse", "physics", "use"] = Field(
        default="refuse",
        description=(
            "Where the model file was trained on a boat whose mass, yaw inertia, motor arm or thrust differs from "
            "vehicle.vessel by more than a factor of 1.5. `refuse`: the program does not start. `physics`: "
            "vehicle.vessel predicts in its place, as in sd-mpc, which is told. `use`: the model is used all the same."
        ),
    )
    vessel: VesselConfig | None = Field(
        default=None,
        description="Physics that estimator and controller assume, where it differs from vehicle.vessel.",
    )
    mpc: MpcConfig = Field(default=MpcConfig(), description="The MPC problem.")
    solver: Annotated[str, NamedIn(SOLVERS)] = Field(
        default="sqp", description="Solver of every `*-mpc`; torch-lqr needs the extra asvhil[train]."
    )
    ipopt: SolverCaps = Field(default=SolverCaps(iterations=100), description="Iterations of IPOPT.")
    fatrop: SolverCaps = Field(default=SolverCaps(iterations=100), description="Iterations of fatrop.")
    torch_lqr: SolverCaps = Field(
        default=SolverCaps(iterations=2), description="Iterations of iLQR on torch; 2 as in the paper."
    )
    manoeuvres: ManoeuvresConfig = Field(default=ManoeuvresConfig(), description="Data collection.")
    procedure: ProcedureConfig = Field(default=ProcedureConfig(), description="The approach to the station.")
    backstepping: BacksteppingConfig = Field(default=BacksteppingConfig(), description="Gains of `backstepping`.")
    sliding_mode: SlidingModeConfig = Field(default=SlidingModeConfig(), description="Gains of `sliding-mode`.")
    loiter: LoiterConfig = Field(default=LoiterConfig(), description="Gains of `loiter`.")
