"""Problems solved by the PyPI package `mpc` (mpc.torch, Amos et al. 2018), to hold torch_lqr against.

The package asks for an old NumPy, and does not need it (constraints-peer.txt):

    python mpc_torch_peer.py problems.npz

The file holds `config` (JSON), `model_file` (empty: the physics model), `parameters` (K, n), `starts` (K, stages, 2)
and `lqr_iterations`. Printed is JSON: for each problem the time (ms), the inputs, and their cost by `StationProblem`.
The grid must be uniform: the package's dynamics do not know the time.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import torch
from mpc import mpc

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from asvhil.config import config_from_json
from asvhil.controller.solvers.problem import StationProblem
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import load_model


class Step(torch.nn.Module):
    """One stage of the problem as the package wants it: x (1, n), u (1, 2) to the next x."""

    def __init__(self, problem: StationProblem, parameters: np.ndarray) -> None:
        super().__init__()
        n = problem.n_state
        self.problem = problem
        self.wind, self.push = (torch.tensor(parameters[i:j]) for i, j in ((n, n + 2), (n + 2, n + 5)))
        self.step_s, self.count = float(problem.steps_s[0]), problem.substep_counts[0]

    def forward(self, x: torch.Tensor, u: torch.Tensor) -> torch.Tensor:
        return advance(self.problem.model, x, u, self.wind, self.push, self.step_s, self.count)


def solve(problem: StationProblem, parameters: np.ndarray, start: np.ndarray, lqr_iterations: int) -> np.ndarray:
    """The package's inputs (stages, 2). Its horizon has one input more, which moves nothing."""
    n, stages = problem.n_state, problem.stages
    weights, reference, previous, slew = problem.unpack_cost(parameters)
    quadratic, linear = torch.zeros(stages + 1, 1, n + 2, n + 2), torch.zeros(stages + 1, 1, n + 2)
    for k in range(stages):
        quadratic[k + 1, 0, :6, :6] = 2.0 * torch.diag(torch.tensor(weights[k]))
        linear[k + 1, 0, 2] = -2.0 * weights[k, 2] * reference
    u_init = torch.tensor(np.concatenate([start, start[-1:]]))[:, None]
    solver = mpc.MPC(
        n,
        2,
        stages + 1,
        u_lower=problem.lower,
        u_upper=problem.upper,
        u_init=u_init.clamp(problem.lower, problem.upper),
        lqr_iter=lqr_iterations,
        grad_method=mpc.GradMethods.AUTO_DIFF,
        exit_unconverged=False,
        detach_unconverged=False,
        backprop=False,
        n_batch=1,
        verbose=-1,
        slew_rate_penalty=2.0 * slew,
        prev_ctrl=torch.tensor(previous),
    )
    initial = torch.tensor(parameters[:n])[None]
    _, inputs, _ = solver(initial, mpc.QuadCost(quadratic, linear), Step(problem, parameters))
    return inputs[:stages, 0].detach().numpy().clip(problem.lower, problem.upper)


def main() -> None:
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    data = np.load(sys.argv[1])
    config = config_from_json(str(data["config"]), sys.argv[1])
    file = str(data["model_file"])
    model = load_model(file) if file else SimplifiedDynamics(config.controller.vessel or config.vehicle.vessel)
    problem = StationProblem(model, config.controller.mpc)
    assert np.ptp(problem.steps_s) < 1e-12, "the grid must be uniform"
    out: dict[str, list] = {"ms": [], "inputs": [], "cost": []}
    for parameters, start in zip(data["parameters"], data["starts"], strict=True):
        begin = time.perf_counter()
        inputs = solve(problem, parameters, start, int(data["lqr_iterations"]))
        out["ms"].append(1e3 * (time.perf_counter() - begin))
        out["inputs"].append(inputs.tolist())
        out["cost"].append(float(problem.rollout(parameters, inputs.ravel())[1]))
    print(json.dumps(out))


if __name__ == "__main__":
    main()
