"""The paper's station keeping procedure: approach on a Dubins path, then station keeping, and again when far off.

    approach, recover --- inside r_s ---> keep_heading | keep_position --- beyond r_d ---> recover
    keep_heading --- beyond r_h ---> keep_position --- inside r_h_back r_h ---> keep_heading      (with r_h_rule)

A stage lasts at least `dwell_s` in any case. Releasing the motors in an emergency is done by the supervisor.
"""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Callable

from asvhil.config import ControllerConfig, ProcedureConfig, VesselConfig
from asvhil.controller.dubins import Dubins, shortest
from asvhil.controller.ilos import Guidance, Helm, Ilos, approach_speed
from asvhil.controller.protocol import Controller
from asvhil.geo import ned_to_body, wrap_rad
from asvhil.types import Control, Estimate, Station, Wind

PLAN_ROWS = 24  # rows of the path ahead, for the log and the viewers
PLAN_STEP_M = 1.0  # least distance between rows
PLAN_SPEED_MPS = 0.3  # least speed for the times of the plan
LATE_S = 1.0  # a longer time between two steps is a pause: the integral does not run on
REPLAN_LEAST_S = 5.0  # between two plans in one stage
REPLAN_MOVED_M = 1.0  # a station that has moved this far from the path's end needs another path
HEADING_OFF_RAD = 2.0  # at this heading error a new path from the present heading is better


class Stage(enum.StrEnum):
    """Stages of the procedure, logged as `Control.stage`."""

    APPROACH = "approach"  # on the first path to the station
    KEEP_HEADING = "keep_heading"  # the keeper holds position and heading
    KEEP_POSITION = "keep_position"  # the keeper holds position, at any heading
    RECOVER = "recover"  # on a path again, having been beyond r_d


APPROACHING = (Stage.APPROACH, Stage.RECOVER)


class Procedure:
    """A `Controller` that brings the boat to the station, and runs another one, the keeper, to keep it.

    `favour_position` has the keeper ignore the heading (True) or not; without it there is no r_h rule. `config`
    has the settings in use, `retune`d ones included.
    """

    def __init__(
        self,
        config: ProcedureConfig,
        vessel: VesselConfig,
        keeper: Controller,
        favour_position: Callable[[bool], None] | None = None,
    ) -> None:
        self.config, self.keeper = config, keeper
        self._favour_position = favour_position if config.r_h_rule else None
        self._keeper_follow: Callable[[Control], None] | None = getattr(keeper, "follow", None)
        self._keeper_retune: Callable[[ControllerConfig], None] | None = getattr(keeper, "retune", None)
        self._ilos, self._helm = Ilos(config), Helm(config, vessel)
        self.reset()

    def retune(self, config: ControllerConfig) -> None:
        """Other radii and speeds from the next step on, and the keeper's own settings where it has any."""
        self.config = config.procedure
        self._ilos.retune(config.procedure)
        if self._keeper_retune is not None:
            self._keeper_retune(config)

    def follow(self, control: Control) -> None:
        """Go on from another solution of the last step, as a replay does that cannot be exact."""
        if self._keeper_follow is not None and self.stage not in APPROACHING:
            self._keeper_follow(control)

    def reset(self) -> None:
        """Forget stage and path, as after a time without control."""
        self.stage: Stage | None = None
        self._since_ns = self._last_ns = self._planned_ns = 0
        self._path: Dubins | None = None
        self._goal_m = (0.0, 0.0)  # of the path
        self.keeper.reset()
        self._keeper_idle = False  # others have had the motors since its last step

    def new_station(self) -> None:
        """Start with an approach, or within r_s with the keeper, which continues."""
        self.stage, self._path = None, None
        self.keeper.new_station()

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick. Neutral and not ok where the estimate or the wind is not finite or the keeper fails."""
        numbers = (estimate.n_m, estimate.e_m, estimate.psi_rad, estimate.u_mps, estimate.v_mps, estimate.r_radps)
        air = (wind.vn_mps, wind.ve_mps) if wind is not None else ()
        pose = (station.n_m, station.e_m, station.psi_rad)
        if not all(map(math.isfinite, (*numbers, *estimate.disturbance, *air, *pose))):
            return Control(command=(0.0, 0.0), ok=False, iterations=0, cost=0.0, stage=self.stage or "")
        distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        stage = self._next(estimate.t_ns, distance_m)
        if stage is not self.stage:
            self._enter(stage, estimate.t_ns)
        elapsed_s = min(max((estimate.t_ns - self._last_ns) * 1e-9, 0.0), LATE_S)
        self._last_ns = estimate.t_ns
        if stage in APPROACHING:
            return self._approach(stage, estimate, wind, station, distance_m, elapsed_s)
        return dataclasses.replace(self.keeper.step(estimate, wind, station), stage=stage)

    def _next(self, t_ns: int, distance_m: float) -> Stage:
        """The stage for a distance, once the present one has lasted long enough."""
        config, stage = self.config, self.stage
        if stage is None:
            return self._keep(distance_m) if distance_m < config.r_s_m else Stage.APPROACH
        if (t_ns - self._since_ns) * 1e-9 < config.dwell_s:
            return stage
        if stage in APPROACHING:
            return self._keep(distance_m) if distance_m < config.r_s_m else stage
        return self._keep(distance_m) if distance_m <= config.r_d_m else Stage.RECOVER

    def _keep(self, distance_m: float) -> Stage:
        if self._favour_position is None:
            return Stage.KEEP_HEADING
        radius_m = self.config.r_h_m * (1.0 if self.stage is Stage.KEEP_HEADING else self.config.r_h_back)
        return Stage.KEEP_HEADING if distance_m < radius_m else Stage.KEEP_POSITION

    def _enter(self, stage: Stage, t_ns: int) -> None:
        if stage in APPROACHING:
            self._path, self._keeper_idle = None, True
        else:
            if self._keeper_idle:
                self.keeper.reset()
                self._keeper_idle = False
            if self._favour_position is not None:
                self._favour_position(stage is Stage.KEEP_POSITION)
        self.stage, self._since_ns = stage, t_ns

    # --- the approach --------------------------------------------------------------------------------------

    def _approach(
        self,
        stage: Stage,
        estimate: Estimate,
        wind: Wind | None,
        station: Station,
        distance_m: float,
        elapsed_s: float,
    ) -> Control:
        path, guidance = self._follow(estimate, station, elapsed_s)
        heading_error_rad = wrap_rad(guidance.psi_rad - estimate.psi_rad)
        u_mps = approach_speed(self.config, distance_m, heading_error_rad)
        if station.moves:  # the speeds above are relative to the station
            u_mps = max(u_mps + ned_to_body(estimate.psi_rad, station.vn_mps, station.ve_mps)[0], 0.0)
        return Control(
            command=self._helm.command(estimate, wind, guidance, u_mps),
            ok=True,
            iterations=0,
            cost=0.0,
            plan=_plan(path, guidance.along_m, u_mps),
            stage=stage,
        )

    def _follow(self, estimate: Estimate, station: Station, elapsed_s: float) -> tuple[Dubins, Guidance]:
        """The path, replanned if there is none or the boat has left it or passed its end, and its guidance."""
        path = self._path
        if path is not None:
            guidance = self._ilos.step(path, estimate, elapsed_s)
            off = (
                abs(guidance.cross_m) > self.config.replan_beyond_m
                or abs(wrap_rad(guidance.psi_rad - estimate.psi_rad)) > HEADING_OFF_RAD
                or guidance.along_m >= path.length_m
                or math.hypot(station.n_m - self._goal_m[0], station.e_m - self._goal_m[1]) > REPLAN_MOVED_M
            )
            if not off or (estimate.t_ns - self._planned_ns) * 1e-9 < REPLAN_LEAST_S:
                return path, guidance
        begin = (estimate.n_m, estimate.e_m, estimate.psi_rad)
        goal = (station.n_m, station.e_m, station.psi_rad)
        self._path = path = shortest(begin, goal, self.config.turn_radius_m)
        self._planned_ns, self._goal_m = estimate.t_ns, (station.n_m, station.e_m)
        self._ilos.begin()
        return path, self._ilos.step(path, estimate, 0.0)


def _plan(path: Dubins, along_m: float, u_mps: float) -> tuple[tuple[float, float, float, float], ...]:
    step_m = max((path.length_m - along_m) / PLAN_ROWS, PLAN_STEP_M)
    speed_mps = max(u_mps, PLAN_SPEED_MPS)
    return tuple(((at_m - along_m) / speed_mps, *pose) for at_m, pose in path.sample(along_m, step_m))
