"""MPC for station keeping: problem, solver, warm start, weight sets and heading trim behind `Controller`."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from asvhil.config import Config, ControllerConfig, MpcConfig, MpcWeights
from asvhil.config.controller import EFFORTS, EFFORTS_OF_THRUST
from asvhil.controller.plan_shift import shift_matrix
from asvhil.controller.solvers.choice import choose_solver
from asvhil.controller.solvers.motor_limits import UNLIMITED, MotorLimits
from asvhil.controller.solvers.problem import Solution, Solver, StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.corrected import has_lag
from asvhil.dynamics.ordered import product
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import ned_to_body, wrap_rad
from asvhil.types import Control, Estimate, Station, Wind

ALTERNATE_STARTS = (0.0, 0.7, -0.7)  # of full ahead (positive) or astern, both motors, in turn
TRIM_WAITS = 0.5  # of the trim time that the boat must be near first, or errors of the approach stay in it for minutes
TRIM_WITHIN_RAD = 0.5  # larger heading errors are transients and would wind up the trim
TUNED = (
    *("effort", "near", "along", "weather", "far", "position_only"),
    *("near_radius_m", "far_radius_m", "trim_time_s", "trim_max_rad"),
)
# How fast a station moves across its heading where `sideways_heading` begins to hold, and holds: below the first the
# weather is the greater load.
SIDEWAYS_MPS = (0.05, 0.15)
TURN_HYSTERESIS_RAD = 0.3  # the turning direction is kept up to this far past half a turn


class StationMpc:
    """Keeps a station by receding horizon control. Its state: plan, last input, what chooses the weights, heading trim.

    The caller runs `step` every `period_s` while the motors obey it, and calls `reset` when they did not.
    """

    def __init__(
        self,
        model: Dynamics,
        config: MpcConfig,
        period_s: float,
        make_solver: Callable[[StationProblem], Solver] = Sqp,
        limits: MotorLimits = UNLIMITED,
    ) -> None:
        self._model, self.config, self._period_s = model, config, period_s
        self._delay_s = config.delay_s + (0.0 if has_lag(model) else config.unmodelled_lag_s)
        self._make_solver, self._limits = make_solver, limits
        of_thrust = model.input_of_command((0.5, 0.5)) != (0.5, 0.5)  # a model of the command has the dead band in it
        self._least_thrust, self._thrust_slew = (config.least_thrust, config.thrust_slew) if of_thrust else (0.0, 0.0)
        self._efforts = EFFORTS_OF_THRUST if of_thrust else EFFORTS
        self._solvers: dict[float, tuple[StationProblem, Solver]] = {}  # by growth of the stages
        self._look_ahead()
        self.reset()

    def _look_ahead(self) -> None:
        """Plan over the horizon of the effort from now on."""
        growth = self._efforts[self.config.effort].growth
        if growth not in self._solvers:
            problem = StationProblem(self._model, self.config, self._limits, growth)
            self._solvers[growth] = problem, self._make_solver(problem)
        self._problem, self._solver = self._solvers[growth]
        self._times_s: list[float] = self._problem.times_s.tolist()
        self._shift = shift_matrix(self._problem.times_s, self._period_s)

    def reset(self) -> None:
        """Forget the plan, the trim and the last input, as after a time without control."""
        self._plan: Array | None = None
        self._wanted = self._input = self._neutral()
        self._position_only = False
        self._weather: MpcWeights | None = None
        self._side_load_mps2: float | None = None
        self._ticks = 0
        self.new_station()

    def new_station(self) -> None:
        """Forget what belongs to the last station (trim, offset, turning direction); the plan is kept as a start."""
        self._near = False
        self._offset_m = 0.0
        self.trim_rad = self._near_s = 0.0
        self._psi_rad: float | None = None

    def favour_position(self, on: bool) -> None:
        """Keep position at any heading (True), or heading too (False), from the next step on and until `reset`."""
        self._position_only = on

    def retune(self, config: ControllerConfig) -> None:
        """Other weights, radii and trim from the next step on, and with another effort its horizon.

        What a solver was built for stays as it was built.
        """
        self.config = self.config.model_copy(update={name: getattr(config.mpc, name) for name in TUNED})
        planned_s = self._problem.times_s
        self._look_ahead()
        if self._plan is not None and planned_s is not self._problem.times_s:  # it goes on over the other horizon
            self._plan = product(shift_matrix(planned_s, 0.0, self._problem.times_s), self._plan)

    def follow(self, control: Control) -> None:
        """Go on from another solution of the last step, as a replay does that cannot be exact."""
        if not control.ok:
            self._give_up(0)
        elif control.inputs:
            self._plan = np.array(control.inputs)
            self._apply(control.inputs[0])

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """One control tick. Neutral and not ok where an input is not finite or the solver fails.

        Raises ValueError where the estimate has not the model's number of motor states.
        """
        if len(estimate.motor) != self._model.n_motor:
            raise ValueError(f"{len(estimate.motor)} motor states, model {self._model.name} has {self._model.n_motor}")
        # Without a wind the model assumes still air; the disturbance includes the mean wind load.
        use_wind = self.config.wind_feedforward and wind is not None and wind.valid
        air = (wind.vn_mps, wind.ve_mps) if wind is not None and use_wind else (0.0, 0.0)
        push = estimate.disturbance if self.config.disturbance_feedforward else (0.0, 0.0, 0.0)
        pose = (estimate.n_m, estimate.e_m, estimate.psi_rad, station.n_m, station.e_m, station.psi_rad)
        drift = (station.vn_mps, station.ve_mps)
        nu = (estimate.u_mps, estimate.v_mps, estimate.r_radps)
        if not all(map(math.isfinite, (*pose, *nu, *estimate.motor, *air, *push, *drift))):
            return self._give_up(0)

        # The problem is written in the station's frame, so it does not depend on the station.
        x, y = ned_to_body(station.psi_rad, estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        psi_rad = self._heading_error_rad(estimate.psi_rad - station.psi_rad)
        distance_m = math.hypot(x, y)
        self._near = distance_m < (self.config.far_radius_m if self._near else self.config.near_radius_m)
        self._weather = self.config.weather if station.of_weather else None
        self._update_trim(psi_rad)
        state = (x, y, psi_rad, *nu, *estimate.motor)
        wind_here = ned_to_body(station.psi_rad, *air)
        push_here = (*ned_to_body(station.psi_rad, push[0], push[1]), push[2])
        moves = ned_to_body(station.psi_rad, *drift) if station.moves else (0.0, 0.0)
        if self._delay_s > 0.0:
            state = self._problem.ahead(state, self._input, wind_here, push_here, self._delay_s)
            if station.moves:  # meanwhile the station has gone on too
                state = (state[0] - moves[0] * self._delay_s, state[1] - moves[1] * self._delay_s, *state[2:])
        self._update_side_load(wind_here, push_here, moves)
        self._update_offset(state[1])
        parameters = self._parameters(state, wind_here, push_here, moves)
        solution, iterations = self._solve(parameters, distance_m)
        return self._control(solution, iterations, station) if solution.ok else self._give_up(iterations)

    def _update_trim(self, psi_rad: float) -> None:
        """Integrate the heading error into the trim, once the boat has been near for some time."""
        config = self.config
        if self._weather is not None:  # where the boat lies in the weather tells more than where its station points
            self.trim_rad = self._near_s = 0.0
            return
        self._near_s = self._near_s + self._period_s if self._near else 0.0
        settled = self._near_s > TRIM_WAITS * config.trim_time_s
        if settled and not self._position_only and abs(psi_rad) < TRIM_WITHIN_RAD:
            trim_rad = self.trim_rad - psi_rad * self._period_s / config.trim_time_s
            self.trim_rad = min(max(trim_rad, -config.trim_max_rad), config.trim_max_rad)

    def _parameters(
        self,
        state: tuple[float, ...],
        wind: tuple[float, float],
        disturbance: tuple[float, float, float],
        moves: tuple[float, float],
    ) -> Array:
        """The problem's parameters, all in the station's frame, with the weights that hold now."""

        def packed(weights: MpcWeights, least_slew: float = 0.0) -> Array:
            wanted = self._wanted
            return self._problem.pack(state, wind, disturbance, self.trim_rad, wanted, weights, least_slew, moves)

        config = self.config
        # An offset justifies heading oscillations too: a high heading weight would leave the boat off the station.
        share = max(self._side_load_share, _ramp(math.hypot(state[0], state[1]), config.offset_m), self._offset_share)
        if self._position_only:
            return packed(config.position_only)
        if not self._near:
            return packed(config.far)
        if self._weather is not None:
            return packed(self._weather)
        # Slower swings keep the boat nearly as near as motors at their limits do, the more so the greater the load.
        effort = self._efforts[config.effort]
        least_slew = min(effort.slew_per_load * (self._side_load_mps2 or 0.0), effort.slew_most)
        # The cost is linear in its weights, so a mean of two is a problem of the same kind.
        near = packed(config.near, least_slew)
        sideways = _ramp(abs(moves[1]), SIDEWAYS_MPS)
        if sideways and config.sideways_heading is not None and config.sideways_heading < config.near.heading:
            freer = packed(_with_heading(config.near, config.sideways_heading), least_slew)
            near = sideways * freer + (1.0 - sideways) * near
        return share * near + (1.0 - share) * packed(config.along, self._thrust_slew)

    def _update_side_load(
        self, wind: tuple[float, float], disturbance: tuple[float, float, float], moves: tuple[float, float]
    ) -> None:
        """The low-passed sideways acceleration (m/s^2) of the boat at the station's heading and velocity."""
        mps2 = abs(self._problem.side_acceleration(wind, disturbance, moves))
        if self._side_load_mps2 is None:
            self._side_load_mps2 = mps2
        gain = min(self._period_s / self.config.side_load_time_s, 1.0)
        self._side_load_mps2 += gain * (mps2 - self._side_load_mps2)

    def _update_offset(self, y_m: float) -> None:
        """The low-passed offset (m) across the station's heading, from zero where the boat gets near."""
        gain = min(self._period_s / self.config.lasting_offset_time_s, 1.0)
        self._offset_m = self._offset_m + gain * (y_m - self._offset_m) if self._near else 0.0

    @property
    def _offset_share(self) -> float:
        """0 without a lasting offset across the station's heading, 1 with one.

        No motor pushes sideways: within its horizon a plan with a high heading weight finds no turn worth the last few
        decimetres, and the boat lies still beside its station for minutes.
        """
        limits = self.config.lasting_offset_m
        return 0.0 if limits is None else _ramp(abs(self._offset_m), limits)

    @property
    def _side_load_share(self) -> float:
        """0 without a side load at the station's heading, 1 with one.

        Two fixed motors compensate a side load only by oscillations of the heading, which a high heading weight would
        prevent. Without a side load a low weight would only follow noise.
        """
        return _ramp(self._side_load_mps2 or 0.0, self.config.side_load_mps2)

    def _solve(self, parameters: Array, distance_m: float) -> tuple[Solution, int]:
        """The plan of lowest cost, from the shifted last plan and, if far off or failed, an alternate start in turn.

        A single start can stay in a local minimum that leaves a sideways offset. Also gives the number of QPs solved.
        """
        lost = self._plan is None
        start = np.zeros((self._problem.stages, 2)) if self._plan is None else product(self._shift, self._plan)
        best = self._solver.solve(parameters, start, self.config.iterations)
        iterations = best.iterations
        self._ticks += 1
        if self.config.alternate_iterations and (lost or not best.ok or distance_m > self.config.alternate_beyond_m):
            share = ALTERNATE_STARTS[self._ticks % len(ALTERNATE_STARTS)]
            level = share * (self._problem.upper if share > 0.0 else -self._problem.lower)
            start = np.full((self._problem.stages, 2), level)
            other = self._solver.solve(parameters, start, self.config.alternate_iterations)
            iterations += other.iterations
            if other.ok and (not best.ok or other.cost < best.cost):
                best = other
        return best, iterations

    def _control(self, solution: Solution, iterations: int, station: Station) -> Control:
        self._plan = solution.inputs
        port, starboard = solution.inputs[0].tolist()
        self._apply((port, starboard))
        n_m, e_m, heading_rad = station.n_m, station.e_m, station.psi_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)  # once for `body_to_ned` of all rows
        plan = [
            (t_s, n_m + (cos * x - sin * y), e_m + (sin * x + cos * y), wrap_rad(heading_rad + psi_rad))
            for t_s, (x, y, psi_rad) in zip(self._times_s, solution.states[:, :3].tolist(), strict=True)
        ]
        return Control(
            command=self._model.command_of_input(self._input),
            ok=True,
            iterations=iterations,
            cost=solution.cost,
            plan=tuple(plan),
            inputs=tuple([(port, starboard) for port, starboard in solution.inputs.tolist()]),
        )

    def _apply(self, wanted: tuple[float, float]) -> None:
        """Keep what a plan begins with, and give the motors that without thrusts too small to start or turn one.

        The next plan's price of a change is from what was wanted: from what was given a small thrust would never grow.
        """
        port, starboard = (
            0.0 if abs(thrust) < self._least_thrust and thrust * given <= 0.0 else thrust
            for thrust, given in zip(wanted, self._input, strict=True)
        )
        self._wanted, self._input = wanted, (port, starboard)

    def _give_up(self, iterations: int) -> Control:
        self._plan = None
        self._wanted = self._input = self._neutral()
        return Control(command=(0.0, 0.0), ok=False, iterations=iterations, cost=0.0)

    def _neutral(self) -> tuple[float, float]:
        return self._model.input_of_command((0.0, 0.0))

    def _heading_error_rad(self, error_rad: float) -> float:
        """The wrapped heading error (rad), with hysteresis in the turning direction, against noise at half a turn."""
        if self._psi_rad is None:
            self._psi_rad = wrap_rad(error_rad)
        else:
            self._psi_rad += wrap_rad(error_rad - self._psi_rad)
            if abs(self._psi_rad) > math.pi + TURN_HYSTERESIS_RAD:
                self._psi_rad = wrap_rad(self._psi_rad)
        return self._psi_rad


@functools.lru_cache(maxsize=8)
def _with_heading(weights: MpcWeights, heading: float) -> MpcWeights:
    """The same object each time: a problem remembers what it has made of its last sets of weights."""
    return weights.model_copy(update={"heading": heading})


def _ramp(value: float, limits: tuple[float, float]) -> float:
    """0 up to the first limit, 1 from the second, linear between."""
    low, high = limits
    return min(max((value - low) / (high - low), 0.0), 1.0)


def build(settings: MpcConfig, config: Config, model: Dynamics) -> StationMpc:
    """The MPC of a config with its solver. ConfigError if that is not installed."""
    capped, make_solver = choose_solver(config.controller)
    limits = MotorLimits.of_pwm(config.vehicle.pwm)
    return StationMpc(model, capped, 1.0 / config.daemon.control_hz, make_solver, limits)
