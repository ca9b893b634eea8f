"""The paper's six tests, their mirrors and diagonals: all controllers, several seeds, resumable, on all cores."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.build import model_file
from asvhil.config import Config, load_config
from asvhil.errors import AsvhilError
from asvhil.study.trial import NO_NOISE, run_trial

FROM_S, TO_S = 60.0, 360.0
ROWS: dict[str, tuple[float, float]] = {  # m/s, blowing toward degrees from the station's heading
    "1": (3.0, 0.0),
    "2": (6.0, 0.0),
    "3": (3.0, 180.0),
    "4": (6.0, 180.0),
    "5": (3.0, 90.0),
    "5 mirrored": (3.0, -90.0),
    "6": (6.0, 90.0),
    "6 mirrored": (6.0, -90.0),
    "diagonal": (6.0, 45.0),
    "diagonal mirrored": (6.0, -45.0),
}
CONTROLLERS: dict[str, tuple[str, ...]] = {  # label in the table: overrides
    "NNSEM-MPC": ("controller.name=nnsem-mpc",),
    "LagNet-MPC": ("controller.name=lagnet-mpc",),
    "SD-MPC (fitted)": ("controller.name=fitted-sd-mpc",),
    "NODE-MPC": ("controller.name=node-mpc",),
    "KNODE-MPC": ("controller.name=knode-mpc",),
    "SD-MPC (true physics)": ("controller.name=sd-mpc",),
    "backstepping": ("controller.name=backstepping",),
    "sliding mode": ("controller.name=sliding-mode",),
    "LOITER": ("controller.name=loiter",),
}
# The slow GNSS bias is a floor under every controller alike; it is left out here and shown by `asvhil sitl`.
COMMON = ("plant.sensors.gnss.slow_bias_m=0",)
# Two-sided 95 % quantiles of Student's t by degrees of freedom.
T_95 = (math.nan, 12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)

Job = tuple[str, str, int, bool]  # row, controller, seed, noise


def job_config(job: Job, base: str, overrides: Sequence[str] = ()) -> Config:
    """The config of one run."""
    row, controller, seed, noise = job
    speed_mps, toward_deg = ROWS[row]
    return load_config(
        base,
        (
            *COMMON,
            *CONTROLLERS[controller],
            f"plant.seed={seed}",
            f"plant.weather.wind.speed_mps={speed_mps}",
            f"plant.weather.wind.toward_deg={toward_deg}",
            *(() if noise else NO_NOISE),
            *overrides,
        ),
    )


def run_job(job: Job, base: str, overrides: tuple[str, ...], window_s: tuple[float, float]) -> dict[str, Any]:
    """One run, with what names it."""
    row, controller, seed, noise = job
    result = run_trial(job_config(job, base, overrides), *window_s)
    return {"row": row, "controller": controller, "seed": seed, "noise": noise, **result}


def job_key(job: Job, base: str, overrides: tuple[str, ...], window_s: tuple[float, float]) -> str:
    """What must be equal for a stored result to stand: the whole config, the model file, and the window."""
    import hashlib

    config = job_config(job, base, overrides)
    file = model_file(config)
    weights = hashlib.sha256(file.read_bytes()).hexdigest()[:16] if file is not None else ""
    return f"{config.content_hash()}-{weights}-{window_s[0]:g}-{window_s[1]:g}"


def study_six_tests(
    store: Path,
    *,
    controllers: Iterable[str] = tuple(CONTROLLERS),
    rows: Iterable[str] = tuple(ROWS),
    seeds: Iterable[int] = (1, 2, 3, 4, 5),
    noise: bool = True,
    window_s: tuple[float, float] = (FROM_S, TO_S),
    workers: int | None = None,
    base: str = "sitl",
    overrides: tuple[str, ...] = (),
    on_progress: Callable[[int, int], None] = lambda done, of: None,
) -> dict[str, Any]:
    """All runs that `store` (JSON lines) does not hold yet, and the table of all of them.

    Interrupted and called again it goes on where it was. Raises AsvhilError where the store cannot be read or written.
    """
    jobs: list[Job] = [(row, name, seed, noise) for row in rows for name in controllers for seed in seeds]
    keys = {job: job_key(job, base, overrides, window_s) for job in jobs}
    results = _stored(store)
    missing = [job for job in jobs if keys[job] not in results]
    on_progress(len(jobs) - len(missing), len(jobs))
    if missing:
        context = multiprocessing.get_context("spawn")
        count = workers or os.cpu_count() or 1
        with ProcessPoolExecutor(count, context) as pool, _appending(store) as file:
            running = {pool.submit(run_job, job, base, overrides, window_s): job for job in missing}
            while running:
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    job = running.pop(future)
                    results[keys[job]] = future.result()
                    file.write(json.dumps({"key": keys[job], **results[keys[job]]}) + "\n")
                    file.flush()
                    on_progress(len(jobs) - len(running), len(jobs))
    return tabulate([results[keys[job]] for job in jobs])


def tabulate(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """{row: {controller: figures}} with means over seeds, the 95 % interval of ps, and the best controller a row."""
    cells: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for result in results:
        cells.setdefault((result["row"], result["controller"]), []).append(result)
    table: dict[str, dict[str, Any]] = {}
    for (row, controller), runs in cells.items():
        table.setdefault(row, {})[controller] = _cell(runs)
    best = {row: min(line, key=lambda name: line[name]["penalty_score"]["mean"]) for row, line in table.items()}
    return {"rows": table, "best": best}


def markdown(table: Mapping[str, Any]) -> str:
    """ps with its 95 % interval, e_d and |e_h| of each controller in each row; the best of a row in bold."""
    rows: Mapping[str, Mapping[str, Any]] = table["rows"]
    names = list(dict.fromkeys(name for line in rows.values() for name in line))
    lines = ["| test | " + " | ".join(names) + " |", "| --- |" + " --- |" * len(names)]
    for row, line in rows.items():
        cells = []
        for name in names:
            cell = line.get(name)
            if cell is None:
                cells.append("")
                continue
            ps, interval = cell["penalty_score"]["mean"], cell["penalty_score"]["ci95"]
            text = f"{ps:.2f}" + (f" ± {interval:.2f}" if interval is not None else "")
            text = f"**{text}**" if table["best"][row] == name else text
            cells.append(f"{text} ({cell['e_d_m']:.2f} m, {abs(cell['e_h_deg']):.2f}°)")
        speed_mps, toward_deg = ROWS[row]
        lines.append(f"| {row} ({speed_mps:g} m/s toward {toward_deg:g}°) | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cell(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    truth = [run["truth"] for run in runs]
    scores = np.array([part["penalty_score"] for part in truth])
    figures = {
        "e_d_m": [part["distance_m"]["mean"] for part in truth],
        "s_d_m": [part["distance_m"]["std"] for part in truth],
        "e_h_deg": [part["heading_deg"]["mean"] for part in truth],
        "s_h_deg": [part["heading_deg"]["std"] for part in truth],
        "max_distance_m": [part["distance_m"]["max_settled"] for part in truth],
        "energy_n2": [run["energy_n2"] for run in runs],
        "held": [run["held"] for run in runs],
        "measured_ps": [run["measured"]["penalty_score"] for run in runs],
    }
    return {
        "seeds": len(runs),
        "penalty_score": {"mean": float(scores.mean()), "ci95": _interval(scores)},
        **{name: float(np.mean(values)) for name, values in figures.items()},
        "worst_max_distance_m": float(max(figures["max_distance_m"])),
    }


def _interval(values: np.ndarray[Any, np.dtype[np.float64]]) -> float | None:
    """Half width of the 95 % interval of a mean; None for a single value."""
    n = len(values)
    if n < 2:
        return None
    quantile = T_95[n - 1] if n - 1 < len(T_95) else 1.96
    return float(quantile * values.std(ddof=1) / math.sqrt(n))


def _stored(store: Path) -> dict[str, dict[str, Any]]:
    if not store.exists():
        return {}
    results = {}
    for number, line in enumerate(store.read_text(encoding="utf-8").splitlines(), 1):
        try:
            row = json.loads(line)
            results[row.pop("key")] = row
        except (ValueError, KeyError, AttributeError):
            # A line that was cut off by an interrupt is run again; anything else before the last line is damage.
            if number < len(store.read_text(encoding="utf-8").splitlines()):
                raise AsvhilError(f"{store}: line {number} is not a stored result; delete it or the file") from None
    return results


def _appending(store: Path) -> Any:
    try:
        store.parent.mkdir(parents=True, exist_ok=True)
        text = store.read_text(encoding="utf-8") if store.exists() else ""
        if text and not text.endswith("\n"):
            store.write_text(text[: text.rfind("\n") + 1], encoding="utf-8")
        return store.open("a", encoding="utf-8")
    except OSError as error:
        raise AsvhilError(f"{store}: cannot be written ({error.strerror})") from None
