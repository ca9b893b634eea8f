"""The station keeping problem's cost, prediction and sensitivities over the horizon, as CasADi functions.

What they compute is written in `problem`; here is how.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import casadi as ca

from asvhil.config import SoftLimits
from asvhil.dynamics.buffers import fastest
from asvhil.dynamics.integrate import advance, motion_derivative
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model

HEAD = 12  # parameters between the state and the weights
POSE_AND_VELOCITY = 6  # x, y, psi, u, v, r: the states that carry a cost
LIMITED = slice(2, POSE_AND_VELOCITY)  # psi, u, v, r: those that may have a soft limit
REMEMBERED = 4  # sets of functions


def limits_of(limits: SoftLimits) -> tuple[float, float, float, float]:
    """Soft limits of psi (rad), u, v (m/s) and r (rad/s)."""
    return math.radians(limits.heading_deg), limits.speed_mps, limits.speed_mps, math.radians(limits.yaw_rate_degps)


def excess_of(error: Any, limits: tuple[float, ...]) -> Any:
    """The excess of each of psi, u, v and r over its limit, signed, as a share of it."""
    part, most = error[LIMITED], ca.DM(limits)
    return (part - ca.fmin(ca.fmax(part, -most), most)) / most


def parameter_count(n_state: int, stages: int) -> int:
    """How many there are: state, wind, disturbance, previous input, reference, slew weight, the station's velocity and
    the weight of the soft limits; of each stage the weights of its state and the length of its substeps.
    """
    return n_state + HEAD + (POSE_AND_VELOCITY + 1) * stages


def target_of(pose: Any, moves: Any, psi: Any) -> Any:
    """What the first six states are to be where the station has a pose and a velocity, and the boat a heading."""
    u, v = ca.cos(psi) * moves[0] + ca.sin(psi) * moves[1], ca.cos(psi) * moves[1] - ca.sin(psi) * moves[0]
    return ca.vertcat(pose, u, v, 0)


@by_model
def of_model(model: Dynamics) -> tuple[ca.Function, str, ca.Function]:
    """A model's substep (state, input, wind, disturbance, length) -> state; the same as text; and (wind, disturbance,
    motion) -> its sideways acceleration with the motors neutral. Remembered by the model.
    """
    n = POSE_AND_VELOCITY + model.n_motor
    s, a, h = ca.SX.sym("s", n), ca.SX.sym("a", 2), ca.SX.sym("h")
    w, d = ca.SX.sym("w", 2), ca.SX.sym("d", 3)
    substep = ca.Function("substep", [s, a, w, d, h], [advance(model, s, a, w, d, h, 1)], {"cse": True})
    moves, neutral = ca.SX.sym("c", 2), ca.SX(ca.DM(model.input_of_command((0.0, 0.0))))
    along = ca.vertcat(ca.SX.zeros(3), moves, ca.SX.zeros(n - 5))
    side = ca.Function("side_acceleration", [w, d, moves], [motion_derivative(model, along, neutral, w, d)[4]])
    return substep, substep.serialize(), side


@functools.lru_cache(maxsize=REMEMBERED)
def over_the_horizon(
    serialized: str, counts: tuple[int, ...], limits: tuple[float, ...] | None
) -> tuple[ca.Function, ca.Function]:
    """`rollout` and `linearised` of a substep, for stages of so many substeps, with soft limits or none.

    Remembered by what they are made of, since backseats of one model are built again and again: in a replay, in each
    run of a study. They call the functions of a substep and of a stage, so that machine code stays small.
    """
    substep = ca.Function.deserialize(serialized)
    first, further = _tangents(substep)
    stage_cost, stage_adjoint = _stage(substep.size1_out(0), limits)
    n, stages = substep.size1_out(0), len(counts)
    p, inputs = ca.MX.sym("p", parameter_count(n, stages)), ca.MX.sym("U", 2 * stages)
    wind, disturbance = p[n : n + 2], p[n + 2 : n + 5]
    previous, reference, slew = p[n + 5 : n + 7], p[n + 7], p[n + 8]
    moves, soft, q, lengths = p[n + 9 : n + 11], p[n + 11], p[n + HEAD : -stages], p[-stages:]
    weights = [q[POSE_AND_VELOCITY * k : POSE_AND_VELOCITY * (k + 1)] for k in range(stages)]
    a = [previous, *(inputs[2 * k : 2 * k + 2] for k in range(stages))]

    state = tangent_state = p[:n]
    states, tangent_states, blocks = [state], [state], []
    for k, count in enumerate(counts):
        held = a[k + 1], wind, disturbance, lengths[k]
        for _ in range(count):
            state = substep(state, *held)
        tangent_state, block = first(tangent_state, *held)
        for _ in range(count - 1):
            tangent_state, block = further(tangent_state, block, *held)
        states.append(state)
        tangent_states.append(tangent_state)
        blocks.append(block)

    elapsed_s, targets, softs = ca.MX(0.0), [], []
    for k, count in enumerate(counts):
        elapsed_s += count * lengths[k]
        targets.append((ca.vertcat(moves * elapsed_s, reference), moves))
        softs.append(soft * count * lengths[k])

    def cost_of(trajectory: list[ca.MX]) -> ca.MX:
        cost = ca.MX(0.0)
        for k in range(stages):
            cost = stage_cost(cost, trajectory[k + 1], weights[k], *targets[k], a[k], a[k + 1], slew, softs[k])
        return cost

    adjoint, change, slopes = ca.MX.zeros(n), ca.MX.zeros(2), []
    for k in range(stages - 1, -1, -1):
        of_stage = tangent_states[k + 1], blocks[k], weights[k], *targets[k], a[k], a[k + 1], slew, softs[k]
        slope, adjoint, change = stage_adjoint(adjoint, change, *of_stage)
        slopes.append(slope)
    gradient = ca.vertcat(*reversed(slopes))

    rollout = ca.Function("rollout", [p, inputs], [ca.vertcat(*states), cost_of(states)])
    rows = ca.vertcat(*(ca.vec(block.T) for block in blocks))
    linearised = [ca.vertcat(*tangent_states), rows, cost_of(tangent_states), gradient]
    return fastest(rollout), fastest(ca.Function("linearised", [p, inputs], linearised))


def _tangents(substep: ca.Function) -> tuple[ca.Function, ca.Function]:
    """The state after a substep and the block [d/ds | d/da] of it: of a stage's first substep, and of one after others.

    The second takes the block of those before it. Differentiating all substeps at once would take a hundred times as
    long.
    """
    state, *held = substep.sx_in()
    n = state.size1()
    after = substep(state, *held)
    jacobian = ca.jacobian(after, ca.vertcat(state, held[0]))
    block = ca.SX.sym("block", n, n + 2)
    chained = jacobian[:, :n] @ block + ca.horzcat(ca.SX(n, n), jacobian[:, n:])
    first = ca.Function("first_tangent", [state, *held], [after, ca.densify(jacobian)], {"cse": True})
    further = ca.Function("further_tangent", [state, block, *held], [after, ca.densify(chained)], {"cse": True})
    return first, further


def _stage(n: int, limits: tuple[float, ...] | None) -> tuple[ca.Function, ca.Function]:
    """The cost up to a stage, and half of its gradient by the stage's input: by the adjoint, from the last stage back.

    The second gives the adjoint of the stage before, and the price of the change of input into this one, too.
    """
    s, q, slew = ca.SX.sym("s", n), ca.SX.sym("q", POSE_AND_VELOCITY), ca.SX.sym("slew")
    pose, moves = ca.SX.sym("pose", 3), ca.SX.sym("c", 2)
    a_before, a, cost_before, soft = ca.SX.sym("a0", 2), ca.SX.sym("a", 2), ca.SX.sym("cost"), ca.SX.sym("soft")
    error = s[:POSE_AND_VELOCITY] - target_of(pose, moves, s[2])
    of_state, pull = ca.dot(q, error**2), q * error
    if limits is not None:
        excess = excess_of(error, limits)
        of_state += soft * ca.sumsqr(excess)
        pull[LIMITED] += soft * excess / ca.DM(limits)
    cost = cost_before + (of_state + slew * ca.sumsqr(a - a_before))
    arguments = [s, q, pose, moves, a_before, a, slew, soft]
    cost_of = ca.Function("stage_cost", [cost_before, *arguments], [cost])

    adjoint_after, change_after = ca.SX.sym("adjoint", n), ca.SX.sym("change", 2)
    block = ca.SX.sym("block", n, n + 2)
    turn = pull[4] * (ca.cos(s[2]) * moves[0] + ca.sin(s[2]) * moves[1]) - pull[3] * (
        ca.cos(s[2]) * moves[1] - ca.sin(s[2]) * moves[0]
    )
    pull[2] += turn  # of the velocity that the station has in body axes, by the heading
    adjoint = adjoint_after + ca.vertcat(pull, ca.SX(n - POSE_AND_VELOCITY, 1))
    change = slew * (a - a_before)
    slope = block[:, n:].T @ adjoint + change - change_after
    adjoint_of = ca.Function(
        "stage_adjoint",
        [adjoint_after, change_after, s, block, *arguments[1:]],
        [slope, ca.densify(block[:, :n].T @ adjoint), change],
        {"cse": True},
    )
    return cost_of, adjoint_of
