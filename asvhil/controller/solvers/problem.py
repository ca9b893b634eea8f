"""The station keeping optimal control problem, written once for every solver: dynamics, cost, grid and bounds.

In the station's frame (station at the origin, heading 0), with s = (x, y, psi, u, v, r, motors ...):

    min  sum_k h_k l(s_k+1) + l_N(s_N) + w_slew sum_k |a_k - a_k-1|^2,   a_-1 the input applied last
    l   = w_pos (x_e^2 + w_y y_e^2) + w_psi (psi - psi_t)^2 + w_vel (u_e^2 + v_e^2 + r^2) + w_soft l_s
    l_N = t_N (x_e^2 + w_y y_e^2)   + w_psi (psi - psi_t)^2 + w_vel (u_e^2 + v_e^2 + r^2)
    s_k+1 = F(s_k, a_k, h_k),  input_lower <= a_k <= input_upper, and no further from a_-1 than the slew limit of the
    motor outputs lets a_k be by the end of its stage, nor of another sign within the pause of a reversal

    l_s = sum_e (max(|e| - e_max, 0) / e_max)^2 of e = psi - psi_t, u_e, v_e, r where soft limits e_max are set, or 0

A station that moves has the velocity c in the frame of its present pose. It has moved by c t_k when stage k ends, and
the boat's velocity is relative to it: (x_e, y_e) = (x, y) - c t_k, (u_e, v_e) = (u, v) - R(psi)^T c. Where it does not,
c is zero and the errors are the states. It is a sum of squares, so Gauss-Newton applies. Weights are parameters: a
change of them rebuilds nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from asvhil.config import MpcConfig, MpcWeights
from asvhil.controller.solvers.graphs import (
    HEAD,
    LIMITED,
    POSE_AND_VELOCITY,
    limits_of,
    of_model,
    over_the_horizon,
    parameter_count,
)
from asvhil.controller.solvers.motor_limits import UNLIMITED, MotorLimits
from asvhil.dynamics.arrays import Array
from asvhil.dynamics.buffers import bind
from asvhil.dynamics.integrate import substeps
from asvhil.dynamics.protocol import Dynamics
from asvhil.geo import ned_to_body
from asvhil.types import record

FULL_TURN = 2.0  # of a motor command, from astern to ahead: a slew limit that allows it within a stage has no effect
REMEMBERED = 4  # sets of weights


@record
class Solution:
    """What a solver returns: inputs (stages, 2), states (stages + 1, n_state), both finite where ok, and the reason."""

    inputs: Array
    states: Array
    cost: float
    iterations: int
    ok: bool
    status: str


class Solver(Protocol):
    """Improves a start; capped by iterations, never by time, and without memory, so that equal calls agree."""

    def solve(self, parameters: Array, start: Array, iterations: int) -> Solution:
        """The best plan found from `start` (stages, 2) under `StationProblem.pack`ed parameters. Raises nothing."""


class StationProblem:
    """The problem above as CasADi functions of parameters p and inputs U = (a_0, a_1, ...).

    `rollout(p, U)` gives (states, cost); `linearised(p, U)` gives (states, sensitivities, cost, half of the cost's
    gradient), where the states are s_0 .. s_N in a row and the sensitivities are the row-major blocks [dF/ds | dF/da]
    of each stage.
    """

    def __init__(
        self, model: Dynamics, config: MpcConfig, limits: MotorLimits = UNLIMITED, growth: float = 1.0
    ) -> None:
        """`growth`: how much faster than the config says the stages grow, in substeps that are as many, and longer."""
        self.model = model
        self.stages = config.stages
        self.n_state = POSE_AND_VELOCITY + model.n_motor
        self.n_motor = model.n_motor
        # Steps grow linearly: fine where the input is about to be applied, coarse where only the trend counts.
        configured_s = np.linspace(config.first_step_s, config.last_step_s, config.stages)
        grown_s = config.first_step_s + growth * (configured_s - config.first_step_s)
        self.steps_s: Array = configured_s if growth == 1.0 else grown_s  # not another last bit
        self.times_s: Array = np.concatenate([[0.0], np.cumsum(self.steps_s)])
        self.substep_counts = [substeps(float(step_s), model.max_step_s) for step_s in configured_s]
        self._substeps_s = self.steps_s / self.substep_counts
        self.lower, self.upper = float(model.input_lower), float(model.input_upper)
        if (most := limits.command_max) < 1.0:
            self.lower = max(self.lower, model.input_of_command((-most, -most))[0])
            self.upper = min(self.upper, model.input_of_command((most, most))[0])
        shape = (config.stages, 2)
        self._limits = np.full(shape, self.lower), np.full(shape, self.upper)
        # A motor that turns now cannot turn the other way in stages that begin before the pause is over.
        self._paused = int(np.count_nonzero(self.times_s[:-1] < limits.reversal_pause_s))
        reach = limits.rate_per_s * self.times_s[1:]  # of the motor command, by the end of each stage
        self._reach: Array | None = None if reach[0] >= FULL_TURN else reach
        self.n_parameters = parameter_count(self.n_state, self.stages)
        self.soft_limits = None if config.soft_limits is None else limits_of(config.soft_limits)
        self._weights_of: list[tuple[MpcWeights, Array]] = []
        self._build(model)

    def pack(
        self,
        state: Sequence[float],
        wind: tuple[float, float],
        disturbance: tuple[float, float, float],
        heading_reference_rad: float,
        previous_input: tuple[float, float],
        weights: MpcWeights,
        least_slew: float = 0.0,
        moves_mps: tuple[float, float] = (0.0, 0.0),
    ) -> Array:
        """The parameter vector; state (n_state), wind (m/s) and disturbance (m/s^2, rad/s^2) in the station's frame.

        `moves_mps` is the station's velocity, in that frame too. `least_slew` is the slew weight where that of the
        weights is lower. Raises ValueError where the state has the wrong length.
        """
        if len(state) != self.n_state:
            raise ValueError(f"the state has {len(state)} entries, the model needs {self.n_state}")
        slew = max(weights.slew, least_slew)
        reference = heading_reference_rad
        head = np.array([*state, *wind, *disturbance, *previous_input, reference, slew, *moves_mps, weights.soft])
        return np.concatenate([head, self._state_weights(weights), self._substeps_s])

    def ahead(
        self,
        state: Sequence[float],
        applied: tuple[float, float],
        wind: tuple[float, float],
        disturbance: tuple[float, float, float],
        delay_s: float,
    ) -> tuple[float, ...]:
        """The state (n_state) after delay_s under the input applied now: the initial state of the plan."""
        count = substeps(delay_s, self.model.max_step_s)
        self._after[:] = state
        self._applied[:], self._wind[:], self._disturbance[:] = applied, wind, disturbance
        self._step_s[0] = delay_s / count
        for _ in range(count):
            self._state[:] = self._after
            self._advance()
        return tuple(self._after.tolist())

    def side_acceleration(
        self,
        wind: tuple[float, float],
        disturbance: tuple[float, float, float],
        moves_mps: tuple[float, float] = (0.0, 0.0),
    ) -> float:
        """v_dot (m/s^2) of the boat that is and moves as the station, its motors neutral; arguments as in `pack`."""
        self._wind[:], self._disturbance[:], self._moves[:] = wind, disturbance, moves_mps
        self._evaluate_side()
        return float(self._side[0])

    def bounds(self, parameters: Array) -> tuple[Array, Array]:
        """Lower and upper bounds of the inputs, (stages, 2) each, from the input applied last.

        As in the output limiter: towards neutral at once, away from it no faster than the slew rate, and to the other
        side not before the pause. The bounds of a stage do not depend on those before it; they are exact for the first,
        which is applied, but for a motor that stopped less than a pause ago.
        """
        if self._reach is None and not self._paused:
            return self._limits
        model, previous = self.model, self.unpack_cost(parameters)[2]
        last = model.command_of_input((float(previous[0]), float(previous[1])))
        lower, upper = self._limits if self._reach is None else self._within_reach(last, self._reach)
        if self._paused:
            lower, upper = lower.copy(), upper.copy()
            neutral = model.input_of_command((0.0, 0.0))
            for motor, command in enumerate(last):
                if command > 0.0:
                    lower[: self._paused, motor] = np.maximum(lower[: self._paused, motor], neutral[motor])
                elif command < 0.0:
                    upper[: self._paused, motor] = np.minimum(upper[: self._paused, motor], neutral[motor])
        return lower, upper

    def _within_reach(self, last: tuple[float, float], per_stage: Array) -> tuple[Array, Array]:
        """Bounds (stages, 2) of the inputs that the slew limit allows, from the command given last."""
        model = self.model
        least, most = [min(c, 0.0) for c in last], [max(c, 0.0) for c in last]
        reach = per_stage.tolist()
        lower = [model.input_of_command((max(least[0] - r, -1.0), max(least[1] - r, -1.0))) for r in reach]
        upper = [model.input_of_command((min(most[0] + r, 1.0), min(most[1] + r, 1.0))) for r in reach]
        return np.maximum(lower, self.lower), np.minimum(upper, self.upper)

    def unpack_cost(self, parameters: Array) -> tuple[Array, float, Array, float]:
        """State weights (stages, 6), heading reference (rad), previous input (2) and slew weight of the parameters."""
        i = self.n_state + 5
        weights = parameters[self.n_state + HEAD : -self.stages].reshape(self.stages, POSE_AND_VELOCITY)
        return weights, float(parameters[i + 2]), parameters[i : i + 2], float(parameters[i + 3])

    def moves(self, parameters: Array) -> bool:
        """Whether the station has a velocity."""
        return bool(parameters[self.n_state + 9 : self.n_state + 11].any())

    def soft_weights(self, parameters: Array) -> Array | None:
        """Weight of each squared excess over a soft limit after each stage (stages, 4); None where there are none."""
        weight = float(parameters[self.n_state + HEAD - 1])
        if self.soft_limits is None or weight == 0.0:
            return None
        return np.outer(self.steps_s, weight / np.square(self.soft_limits))

    def excess(self, errors: Array) -> Array:
        """By how much psi, u, v and r of errors after each stage (stages, 6) are beyond their soft limits, signed."""
        part = errors[:, LIMITED]
        return part - np.clip(part, -np.array(self.soft_limits), self.soft_limits)

    def targets(self, parameters: Array, states: Array) -> Array:
        """What the states after each stage (stages, n) are to be, (stages, 6), where the boat has their headings."""
        i = self.n_state + 7
        reference, (moves_x, moves_y) = parameters[i], parameters[i + 2 : i + 4].tolist()
        found = np.zeros((self.stages, POSE_AND_VELOCITY))
        found[:, 2] = reference
        if moves_x or moves_y:
            found[:, 0], found[:, 1] = moves_x * self.times_s[1:], moves_y * self.times_s[1:]
            for row, psi_rad in zip(found, states[:, 2].tolist(), strict=True):
                row[3:5] = ned_to_body(psi_rad, moves_x, moves_y)
        return found

    def _state_weights(self, weights: MpcWeights) -> Array:
        """Weight of each squared state after each stage (stages * 6): the stage's, times its step, and the terminal.

        Those of the last few sets of weights are remembered, since a controller changes between the same few.
        """
        for known, q in self._weights_of:
            if known is weights:
                return q
        yaw_rate = weights.velocity if weights.yaw_rate is None else weights.yaw_rate
        heading_and_velocity = [weights.heading, weights.velocity, weights.velocity, yaw_rate]
        axes = np.array([1.0, weights.sideways])
        q = np.outer(self.steps_s, [*(weights.position * axes), *heading_and_velocity])
        q[-1] += [*(weights.terminal_position_s * axes), *heading_and_velocity]
        self._weights_of = [(weights, q.ravel()), *self._weights_of[: REMEMBERED - 1]]
        return self._weights_of[0][1]

    def _build(self, model: Dynamics) -> None:
        n = self.n_state
        self.substep, serialized, side = of_model(model)
        built = over_the_horizon(serialized, tuple(self.substep_counts), self.soft_limits)
        self.rollout, self.linearised = built

        self._state, self._after, self._applied = np.zeros(n), np.zeros(n), np.zeros(2)
        self._wind, self._disturbance, self._step_s, self._side = np.zeros(2), np.zeros(3), np.zeros(1), np.zeros(1)
        arguments = [self._state, self._applied, self._wind, self._disturbance, self._step_s]
        self._advance = bind(self.substep, arguments, [self._after])
        self._moves = np.zeros(2)
        self._evaluate_side = bind(side, [self._wind, self._disturbance, self._moves], [self._side])
