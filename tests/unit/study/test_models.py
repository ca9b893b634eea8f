"""`asvhil study models`: rows in waves, and a study that is interrupted, resumed, or given a folder of another one."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from asvhil.collect import collect  # noqa: E402
from asvhil.config import Config, load_config  # noqa: E402
from asvhil.config.mean_wind import parse_wind  # noqa: E402
from asvhil.dynamics.weights import read_model, save_model  # noqa: E402
from asvhil.errors import ConfigError, LogError, ModelError  # noqa: E402
from asvhil.study.model_jobs import TrainingJob, chosen_jobs, jobs  # noqa: E402
from asvhil.study.model_logs import WAVES, Logs, Programme, collect_logs, wave_figures  # noqa: E402
from asvhil.study.models import study_models  # noqa: E402

SEA = tuple(f"plant.weather.waves.{key}={value}" for key, value in WAVES.items())
FLEETING = {"cpu_s": 0, "mpc_ms": 0}  # what a clock decides


def drive(config: Config, duration_s: float, winds: list[str], path: Path) -> list[Path]:
    return [run.log for run in collect(config, "lockstep", duration_s, [parse_wind(wind) for wind in winds], path)]


SEEDS = ("plant.seed=7", "controller.manoeuvres.seed=7")


@pytest.fixture(scope="module")
def flat(run_logs: Callable[[str], Path]) -> Path:
    """A programme on a flat sea."""
    return run_logs("programme")


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same programme in the same wind, in waves."""
    config = load_config("sitl", (*SEEDS, *SEA))
    return drive(config, 70.0, ["6@90"], tmp_path_factory.mktemp("logs") / "rough.mcap")[0]


def quick_jobs(ode_iterations: int) -> tuple[TrainingJob, ...]:
    """The jobs of the study with trainings of a few iterations."""
    changes = {"nnsem": {"iterations": 8, "block": 2}, "lagnet": {"iterations": 4, "block": 1}, "node": {"block": 1}}
    return tuple(
        dataclasses.replace(job, options=dataclasses.replace(job.options, **changes.get(job.kind, {})))
        for job in jobs(ode_iterations)
    )


def study(log: Path, out: Path, *only: str, ode_iterations: int = 4, **options: Any) -> dict[str, dict[str, Any]]:
    """A quick study without an MPC, whose time has a test of its own."""
    result = study_models(
        [[log]], [log], out, known=quick_jobs(ode_iterations), only=only, tick_ms=lambda model: 0.0, **options
    )
    return {row["model"]: {**row, **FLEETING} for row in result["rows"]}


# --- jobs --------------------------------------------------------------------------------------------------------


def test_rows_in_waves_are_trained_like_their_calm_twins() -> None:
    rough = [job for job in jobs(100) if job.waves]
    assert [job.name for job in rough] == ["nnsem (waves)", "lagnet: map, lag, mirror, skip (single) (waves)"]
    calm = {job.name: job for job in jobs(100) if not job.waves}
    for job in rough:
        assert dataclasses.replace(calm[job.name.removesuffix(" (waves)")], name=job.name, waves=True) == job
        assert job.seeds == 3


def test_only_chooses_by_name_and_refuses_what_is_not_there() -> None:
    assert [job.name for job in chosen_jobs(jobs(10), ["node", "sd"])] == ["sd", "node"]
    assert len(chosen_jobs(jobs(10), [])) == len(jobs(10))
    with pytest.raises(ConfigError, match=r"--only nnsemm: unknown, did you mean nnsem\? \(known: sd; nnsem; "):
        chosen_jobs(jobs(10), ["nnsemm"])


# --- logs --------------------------------------------------------------------------------------------------------


SHORT = Programme(train_seeds=(100,), train_s=2.0, test_s=2.0, test_winds=("6@90",))


def test_logs_are_driven_once_and_a_log_that_was_interrupted_is_driven_anew(tmp_path: Path) -> None:
    driven: list[str] = []

    def counted(config: Config, duration_s: float, winds: list[str], path: Path) -> list[Path]:
        driven.append(path.name)
        if len(driven) == 2:
            path.write_bytes(b"begun")
            raise KeyboardInterrupt
        return drive(config, duration_s, winds, path)

    with pytest.raises(KeyboardInterrupt):
        collect_logs(tmp_path, counted, programme=SHORT)
    found = collect_logs(tmp_path, counted, programme=SHORT)
    assert driven == ["train100-0.part.mcap", "train100-1.part.mcap", "train100-1.part.mcap", "test0.part.mcap"]
    assert found == collect_logs(tmp_path, counted, programme=SHORT) and len(driven) == 4
    assert [path.name for path in (*found.train[0], *found.test)] == [
        "train100-0.mcap",
        "train100-1.mcap",
        "test0.mcap",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["test0.mcap", "train100-0.mcap", "train100-1.mcap"]


def test_logs_of_another_study_are_refused_by_the_setting_that_differs(tmp_path: Path) -> None:
    found = collect_logs(tmp_path, drive, programme=SHORT)
    shutil.copy(found.test[0], tmp_path / "waves-test0.mcap")
    shutil.copy(found.train[0][0], tmp_path / "waves-train100-0.mcap")
    with pytest.raises(
        LogError, match=r"waves-train100-0\.mcap: driven with plant\.weather\.waves\.orbital_std_mps 0\.0"
    ):
        collect_logs(tmp_path, drive, programme=SHORT, waves=True)
    with pytest.raises(LogError, match=r"manoeuvres\.duration_s 2\.0, this study asks for 3\.0; remove the log"):
        collect_logs(tmp_path, drive, programme=dataclasses.replace(SHORT, train_s=3.0))
    with pytest.raises(LogError, match=r"train100-1\.mcap: driven with plant\.weather\.wind\.toward_deg 180\.0"):
        collect_logs(tmp_path, drive, programme=dataclasses.replace(SHORT, train_winds=("3@0", "6@170")))


# --- models ------------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_an_interrupted_study_ends_in_the_same_figures(flat: Path, tmp_path: Path) -> None:
    whole = study(flat, tmp_path / "whole", "nnsem", "node")
    assert list(whole) == ["nnsem", "node", "node, NNSEM's time", "hold the initial value"]

    def interrupt(what: str, share: float) -> None:
        if what == "node, data set 1":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(flat, tmp_path / "parts", "nnsem", "node", tell=interrupt)
    (tmp_path / "parts" / "models" / "nnsem-1-2.npz").unlink()  # as if it had come between two files
    told: list[str] = []
    parts = study(flat, tmp_path / "parts", "nnsem", "node", tell=lambda what, share: told.append(what))
    assert {"nnsem, data set 1", "node, data set 1"} <= set(told)
    for name in ("nnsem", "node", "hold the initial value"):
        assert parts[name] == whole[name]
    for number in (1, 2, 3):
        a, b = (read_model(tmp_path / run / "models" / f"nnsem-1-{number}.npz") for run in ("whole", "parts"))
        assert all(np.array_equal(a.weights[name], b.weights[name]) for name in a.weights)


@pytest.mark.thorough
def test_the_row_at_nnsems_time_needs_nnsem_whichever_run_trained_it(flat: Path, tmp_path: Path) -> None:
    assert list(study(flat, tmp_path, "node")) == ["node", "hold the initial value"]
    study(flat, tmp_path, "nnsem")
    nnsem = read_model(tmp_path / "models" / "nnsem-1-1.npz")
    for number in (1, 2, 3):  # as if NNSEM had taken no time: the early network is that of the first block
        save_model(
            tmp_path / "models" / f"nnsem-1-{number}.npz",
            dataclasses.replace(nnsem, seed=number, figures={**nnsem.figures, "cpu_s": 0.0}),
        )
    rows = study(flat, tmp_path, "node")
    assert list(rows) == ["node", "node, NNSEM's time", "hold the initial value"]
    assert (rows["node"]["iterations"], rows["node, NNSEM's time"]["iterations"]) == (4, 1)


@pytest.mark.thorough
def test_models_of_another_study_are_refused(flat: Path, rough: Path, tmp_path: Path) -> None:
    study(flat, tmp_path, "nnsem", "node")
    with pytest.raises(ModelError, match=r"node-1-1\.npz: trained with iterations 4, this study asks for 5; remove it"):
        study(flat, tmp_path, "node", ode_iterations=5)
    with pytest.raises(ModelError, match=r"nnsem-1-1\.npz: trained on other logs than those of data set 1"):
        study(rough, tmp_path, "nnsem")
    first, second = (tmp_path / "models" / f"nnsem-1-{number}.npz" for number in (1, 2))
    shutil.copy(first, second)
    with pytest.raises(ModelError, match=r"nnsem-1-2\.npz: trained with seed 1, not 2"):
        study(flat, tmp_path, "nnsem")
    shutil.copy(tmp_path / "models" / "node-1-1.npz", first)
    with pytest.raises(ModelError, match=r"nnsem-1-1\.npz: a node of 'wamv16', not a nnsem"):
        study(flat, tmp_path, "nnsem")
    second.unlink()  # a file is missing, so the data set is trained again: not over a file that is not its own
    with pytest.raises(ModelError, match=r"nnsem-1-1\.npz: a node"):
        study(flat, tmp_path, "nnsem")


@pytest.mark.thorough
def test_rows_in_waves_are_trained_and_scored_on_logs_in_waves(flat: Path, rough: Path, tmp_path: Path) -> None:
    waves = Logs(train=((rough,),), test=(rough,))
    lagnet = "lagnet: map, lag, mirror, skip (single) (waves)"
    rows = study(flat, tmp_path, "nnsem", "nnsem (waves)", lagnet, waves=waves)
    assert list(rows) == [
        "nnsem",
        "nnsem (waves)",
        lagnet,
        "hold the initial value",
        "hold the initial value (waves)",
    ]
    hashes = {
        name: read_model(tmp_path / "models" / f"{name}-1-1.npz").data_hash
        for name in ("nnsem", "nnsem--waves", "lagnet--map--lag--mirror--skip--single---waves")
    }
    assert hashes["nnsem--waves"] == hashes["lagnet--map--lag--mirror--skip--single---waves"] != hashes["nnsem"]
    assert rows["hold the initial value"]["mae_u"] != rows["hold the initial value (waves)"]["mae_u"]
    written = json.loads((tmp_path / "models.json").read_text())
    assert [row["model"] for row in written["rows"]] == list(rows)
    assert written["waves"]["data_sets"] == 1 and written["waves"]["floor"] == wave_figures()["floor"]
    assert "| nnsem (waves) |" in (tmp_path / "models.md").read_text()


def test_without_logs_in_waves_their_rows_are_left_out(flat: Path, tmp_path: Path) -> None:
    assert list(study(flat, tmp_path, "sd", "nnsem (waves)")) == ["sd", "hold the initial value"]


def test_the_floor_is_the_mean_absolute_value_of_the_waves() -> None:
    seen = np.abs(np.random.default_rng(1).normal(0.0, [0.07, 0.07, 0.02], (100_000, 3))).mean(axis=0)
    assert list(wave_figures()["floor"].values()) == pytest.approx(seen, rel=0.02)
    assert wave_figures()["floor"]["mae_u"] == pytest.approx(0.07 * math.sqrt(2.0 / math.pi), abs=1e-4)
