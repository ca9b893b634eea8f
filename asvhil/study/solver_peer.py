"""mpc.torch on the recorded problems of the solver study, run as a command in an environment of its own."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config
from asvhil.dynamics.arrays import Array
from asvhil.errors import AsvhilError
from asvhil.study.solver_figures import gap_figures, time_figures
from asvhil.study.solver_runs import Problems, Tell


def peer_row(config: Config, peer: Sequence[str], model_file: str, recorded: Problems, tell: Tell) -> Any:
    """mpc.torch on the problems and warm starts of the torch-lqr run. AsvhilError where the command fails."""
    tell("mpc.torch: recorded problems", 0, len(recorded.parameters))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problems.npz"
        np.savez(
            file,
            config=config.canonical_json(),
            model_file=model_file,
            parameters=np.array(recorded.parameters),
            starts=np.array(recorded.starts),
            lqr_iterations=config.controller.torch_lqr.iterations,
        )
        try:
            done = subprocess.run([*peer, str(file)], capture_output=True, text=True, errors="replace", check=False)
        except OSError as error:
            raise AsvhilError(f"{peer[0]}: cannot be run ({error.strerror})") from None
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        raise AsvhilError(f"{peer[0]}: failed ({(done.stderr.strip().splitlines() or ['no output'])[-1]})")
    ms, cost = _peer_output(peer[0], lines[-1], len(recorded.parameters))
    known = np.isfinite(recorded.optima)
    gaps = cost[known] / recorded.optima[known] - 1.0
    tell("mpc.torch: recorded problems", len(recorded.parameters), len(recorded.parameters))
    return {"step_ms": time_figures(ms), "gap": gap_figures(gaps) | {"problems": int(known.sum())}}


def _peer_output(name: str, line: str, count: int) -> tuple[Array, Array]:
    """Times (ms) and costs, one of each problem. AsvhilError where the peer's last line is something else."""
    try:
        found = json.loads(line)
        ms, cost = np.array(found["ms"], dtype=float), np.array(found["cost"], dtype=float)
    except (ValueError, KeyError, TypeError):
        ms = cost = np.empty(0)
    if not ms.shape == cost.shape == (count,) or not count:
        words = f'{{"ms": [...], "cost": [...]}} of {count} problems is expected in its last line'
        raise AsvhilError(f"{name}: {words}, not {line[:40]}")
    return ms, cost
