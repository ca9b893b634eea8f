"""`asvhil train`, `asvhil evaluate` and `asvhil study models` below the command line, on a short collected log."""

import csv
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.csv_columns import COLUMNS
from tests.support.model_data import drive
from tests.support.model_samples import sample

torch = pytest.importorskip("torch")

from asvhil.dynamics.nnsem import Scaling  # noqa: E402
from asvhil.dynamics.weights import TrainedModel, load_model, read_model, save_model  # noqa: E402
from asvhil.errors import ConfigError, LogError, ModelError  # noqa: E402
from asvhil.study.model_jobs import jobs  # noqa: E402
from asvhil.study.models import markdown, mpc_tick_ms, study_models  # noqa: E402
from asvhil.study.page import MARKER  # noqa: E402
from asvhil.train.at_rest import thrust_dip  # noqa: E402
from asvhil.train.choice import TOLERANCE_MPS2, best_of, check_at_rest  # noqa: E402
from asvhil.train.jobs import check_test, evaluate_command, is_csv, train_command, trained_before  # noqa: E402
from asvhil.train.options import FitOptions, chosen_options  # noqa: E402
from asvhil.train.progress import TrainingProgress  # noqa: E402
from tests.support.paths import ROOT  # noqa: E402

MODELS = ROOT / "config" / "models"


@pytest.fixture(scope="module")
def log(run_logs: Callable[[str], Path]) -> Path:
    return run_logs("programme")


@pytest.fixture(scope="module")
def trained(log: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("models") / "wamv16-nnsem.npz"
    seen: list[TrainingProgress] = []
    figures = train_command(
        "nnsem", [log], output, seed=3, options=chosen_options("nnsem", 0.2, iterations=600), progress=seen.append
    )
    assert figures["vehicle"] == "wamv16" and figures["iterations_run"] == 600
    assert [state.iteration for state in seen] == [500, 600]
    assert Path(figures["picture"]).stat().st_size > 1000
    assert {row["from"] for row in figures["at_rest"]["winds"]} >= {"bow", "stern", "port", "starboard"}
    assert figures["at_rest"]["verdict"].startswith("at rest: still air ")
    json.dumps(figures)
    return output


def written_csv(path: Path, seconds: float) -> Path:
    segment, _ = drive(11, seconds, 0.0)
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["t", "u", "v", "r", "left", "right"])
        for row in np.column_stack([segment.t_s, segment.nu, segment.command]):
            table.writerow([f"{value:.6f}" for value in row])
    return path


def test_a_trained_model_knows_where_it_comes_from(log: Path, trained: Path) -> None:
    model = read_model(trained)
    assert (model.vehicle, model.dt_s, model.seed) == ("wamv16", 0.2, 3)
    assert len(model.data_hash) == 64 and len(model.config_hash) == 16
    assert load_model(trained, vehicle="wamv16", dt_s=0.2).name == "nnsem"
    assert not trained.with_name("wamv16-nnsem.npz.checkpoint").exists()


def test_a_model_that_cannot_be_saved_leaves_its_checkpoint_and_a_picture_is_not_missed(
    log: Path, tmp_path: Path
) -> None:
    output = tmp_path / "m.npz"
    output.mkdir()
    options = chosen_options("nnsem", 0.2, iterations=20)
    with pytest.raises(ModelError, match=r"m\.npz: cannot be written"):
        train_command("nnsem", [log], output, options=options)
    checkpoint = tmp_path / "m.npz.checkpoint"
    assert checkpoint.exists()
    output.rmdir()
    (tmp_path / "m.curve.png").mkdir()
    figures = train_command("nnsem", [log], output, options=options, resume=True)
    assert read_model(output).kind == "nnsem" and not checkpoint.exists()
    assert figures["picture"] is None and "m.curve.png: cannot be written" in figures["picture_fault"]


def test_a_model_is_of_the_same_training_by_all_that_decides_it(log: Path, tmp_path: Path) -> None:
    output = tmp_path / "m.npz"
    options = chosen_options("nnsem", 0.2, iterations=20)

    def same(*seeds: int, chosen: FitOptions = options) -> bool:
        return trained_before(output, "nnsem", [log], seeds, chosen) is not None

    train_command("nnsem", [log], output, options=options)
    assert same(1) and not same(1, 2) and not same(2)
    assert not same(1, chosen=dataclasses.replace(options, iterations=21))
    train_command("nnsem", [log], output, options=options, tries=2)
    assert same(1, 2) and not same(1) and not same(2) and not same(0, 1) and not same(2, 3)
    train_command("nnsem", [log], output, options=options, smoothed=False)
    assert not same(1)
    train_command("nnsem", [log], output, options=chosen_options("nnsem", 0.1, iterations=20), dt_s=0.1)
    assert not same(1, chosen=chosen_options("nnsem", 0.1, iterations=20))


def test_a_test_that_tells_nothing_is_refused(log: Path) -> None:
    check_test([log], horizon_s=10.0, every_s=2.0, least=10)
    with pytest.raises(ConfigError, match=r"stretches of 10 s in motion, and 1000 or more are needed: drive it"):
        check_test([log], horizon_s=10.0, every_s=2.0, least=1000)
    with pytest.raises(LogError, match="no stretch for a rollout of 300 s"):
        check_test([log], horizon_s=300.0, every_s=2.0, least=10)


def test_evaluate_gives_a_row_for_each_model_and_for_holding(log: Path, trained: Path, tmp_path: Path) -> None:
    sd = tmp_path / "sd.npz"
    train_command("sd", [log], sd)
    figure = tmp_path / "sheet.png"
    result = evaluate_command([trained, sd], [log], horizon_s=20.0, every_s=5.0, truth=True, figure=figure)
    rows = result["rows"]
    assert list(rows) == ["nnsem", "sd", "hold the initial value"]
    assert rows["sd"]["all"]["windows"] == 10
    assert rows["sd"]["all"]["mae_u"] < rows["hold the initial value"]["all"]["mae_u"]
    assert figure.read_bytes()[:4] == b"\x89PNG"
    first = result["at_rest"]["sd"]["winds"][0]
    assert first["reference"] == pytest.approx([-0.001786, 0.0, 0.0], abs=1e-6)  # 1 m/s of wind on the bow
    assert result["at_rest"]["sd"]["still_air"] == [0.0, 0.0, 0.0]
    json.dumps(result)
    measured = evaluate_command([sd], [log], horizon_s=20.0, every_s=5.0)["rows"]["sd"]["all"]
    assert measured["mae_v"] > rows["sd"]["all"]["mae_v"]  # the noise of the measurement comes on top


def test_evaluate_refuses_another_vehicle_another_step_and_short_data(log: Path, trained: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.npz"
    stranger = sample("nnsem")
    save_model(other, type(stranger)(**{**_fields(stranger), "vehicle": "bream"}))
    with pytest.raises(ModelError, match=r"other\.npz: .* trained for vehicle 'bream', the logs are of 'wamv16'"):
        evaluate_command([trained, other], [log])
    hull = {**(read_model(trained).hull or {}), "mass": 38.0}
    save_model(other, type(stranger)(**{**_fields(stranger), "hull": hull}))
    with pytest.raises(ModelError, match=r"other\.npz: .* another boat than that of the logs \(mass 38 kg for "):
        evaluate_command([trained, other], [log])
    save_model(other, type(stranger)(**{**_fields(stranger), "dt_s": 0.1}))
    with pytest.raises(ModelError, match=r"other\.npz: .* steps of 0\.1 s, the first one 0\.2 s"):
        evaluate_command([trained, other], [log])
    with pytest.raises(LogError, match=r"no stretch for a rollout of 300 s"):
        evaluate_command([trained], [log], horizon_s=300.0)
    with pytest.raises(ConfigError, match="no model is given"):
        evaluate_command([], [log])
    with pytest.raises(ConfigError, match=r"--horizon 0\.05: at least a step of the model, 0\.2 s, is expected"):
        evaluate_command([trained], [log], horizon_s=0.05)
    with pytest.raises(ConfigError, match="--columns goes with CSV files"):
        evaluate_command([trained], [log], columns="map.yaml")
    with pytest.raises(ConfigError, match="a CSV file has no truth"):
        evaluate_command([trained], [Path("run.csv")], truth=True)


def test_models_of_one_kind_are_named_by_their_files(log: Path, trained: Path, tmp_path: Path) -> None:
    twins = [tmp_path / name / "m.npz" for name in "ab"]
    for twin in twins:
        twin.parent.mkdir()
        twin.write_bytes(trained.read_bytes())
    found = evaluate_command([trained, *twins], [log], horizon_s=20.0, every_s=20.0)
    assert list(found["at_rest"]) == [f"nnsem {path}" for path in (trained, *twins)]
    assert list(found["rows"]) == [*found["at_rest"], "hold the initial value"]


def _fields(model: object) -> dict[str, object]:
    return {name: getattr(model, name) for name in model.__dataclass_fields__}  # type: ignore[attr-defined]


def test_csv_files_train_a_model_with_a_column_map(tmp_path: Path) -> None:
    columns = tmp_path / "columns.yaml"
    columns.write_text(COLUMNS)
    run = written_csv(tmp_path / "run.csv", 120.0)
    boat, map_ = r"--vehicle NAME \(which boat they come from\)", r"--columns MAP \(what each column is\)"
    with pytest.raises(ConfigError, match=f"give {boat}$"):
        train_command("sd", [run], tmp_path / "sd.npz", columns=str(columns))
    with pytest.raises(ConfigError, match=f"give {map_}$"):
        train_command("sd", [run], tmp_path / "sd.npz", vehicle="boat")
    with pytest.raises(ConfigError, match=f"give {boat} and {map_}$"):
        train_command("sd", [run], tmp_path / "sd.npz")
    figures = train_command("sd", [run], tmp_path / "sd.npz", columns=str(columns), vehicle="boat")
    assert figures["data_s"] > 100.0
    rows = evaluate_command([tmp_path / "sd.npz"], [run], columns=str(columns))["rows"]
    assert (
        rows["sd"]["moving"]["windows"] + rows["sd"].get("idle", {}).get("windows", 0) == rows["sd"]["all"]["windows"]
    )


def test_data_of_two_kinds_or_of_none(tmp_path: Path) -> None:
    for names in (["a.csv", "b.mcap"], ["a.txt"], []):
        with pytest.raises(ConfigError, match="all of one kind"):
            is_csv([tmp_path / name for name in names])


def test_too_short_a_csv_and_an_unknown_kind(tmp_path: Path, log: Path) -> None:
    columns = tmp_path / "columns.yaml"
    columns.write_text(COLUMNS)
    with pytest.raises((LogError, ModelError), match="s are needed"):
        train_command(
            "nnsem", [written_csv(tmp_path / "a.csv", 10.0)], tmp_path / "m.npz", columns=str(columns), vehicle="b"
        )
    with pytest.raises(ModelError, match="unknown model kind 'oracle'"):
        train_command("oracle", [log], tmp_path / "m.npz")


def test_the_study_writes_its_table_and_reuses_what_is_trained(log: Path, tmp_path: Path) -> None:
    told: list[str] = []
    result = study_models(
        [[log]],
        [log],
        tmp_path,
        known=jobs(),
        only=("sd",),
        tick_ms=lambda model: mpc_tick_ms(model, 2),
        tell=lambda name, share: told.append(name),
    )
    assert [row["model"] for row in result["rows"]] == ["sd", "hold the initial value"]
    assert "sd, data set 1" in told
    table = (tmp_path / "models.md").read_text()
    assert table == f"{MARKER}\n\n{markdown(result['rows'])}" and table.count("\n") == 6
    assert json.loads((tmp_path / "models.json").read_text()) == result
    told.clear()
    again = study_models(
        [[log]],
        [log],
        tmp_path,
        known=jobs(),
        only=("sd",),
        tick_ms=lambda model: mpc_tick_ms(model, 2),
        tell=lambda name, share: told.append(name),
    )
    assert not told
    for before, after in zip(result["rows"], again["rows"], strict=True):
        assert {**before, "mpc_ms": 0} == {**after, "mpc_ms": 0}


@pytest.mark.parametrize("kind", ["nnsem", "lagnet"])
def test_an_mpc_tick_is_timed(kind: str) -> None:
    assert 0.0 < mpc_tick_ms(sample(kind).dynamics(), ticks=2) < 5000.0


def net(seed: int, validation: float, surge: tuple[float, float]) -> TrainedModel:
    """A model whose surge rate is the sum of two tanh of the commands: rising ones, or one that falls in the middle."""
    model = sample("nnsem", seed)
    w1, w2 = np.zeros((12, 7)), np.zeros((3, 12))
    w1[0, 3:5], w1[1, 3:5] = 0.5, 5.0
    w2[0, :2] = surge
    weights = {"w1": w1, "b1": np.zeros(12), "w2": w2, "b2": np.zeros(3)}
    return dataclasses.replace(model, weights=weights, figures={"best_validation": validation})


def about_zero(model: TrainedModel) -> TrainedModel:
    return dataclasses.replace(model, scaling=Scaling(centre=np.zeros(7), half=model.scaling.half))


def dip(model: TrainedModel) -> float:
    return thrust_dip(model.dynamics(), model.scaling.half[5:])


def test_a_model_whose_thrust_falls_as_the_command_rises_comes_last() -> None:
    rising, better, dipped = net(1, 0.04, (1.0, 0.1)), net(2, 0.035, (1.0, 0.1)), net(3, 0.03, (1.0, -0.3))
    assert dip(rising) == 0.0 < 0.01 < dip(dipped)
    best = best_of([rising, better, dipped])
    assert best.seed == 2 and best.weights is better.weights
    assert best.figures["validation_of_seeds"] == {"1": 0.04, "2": 0.035, "3": 0.03}
    assert best_of([dipped, net(4, 0.05, (1.0, -0.3))]).seed == 3


def test_a_model_that_moves_a_boat_at_rest_comes_after_all_that_let_it_lie() -> None:
    still, better = (about_zero(net(seed, error, (1.0, 0.1))) for seed, error in ((1, 0.04), (2, 0.03)))
    moving = dataclasses.replace(better, weights={**better.weights, "b2": np.array([0.1, 0.0, 0.0])})
    assert best_of([still, better]).seed == 2
    assert check_at_rest(still).stays and not check_at_rest(moving).stays
    best = best_of([still, moving])
    assert best.seed == 1 and best.figures["right_at_rest"] == {"1": True, "2": False}
    assert best_of([moving, net(3, 0.02, (1.0, -0.3))]).seed == 2  # a dip is worse


@pytest.mark.parametrize("kind", ["nnsem", "lagnet"])
def test_the_thrust_of_a_shipped_network_rises_with_the_command(kind: str) -> None:
    assert dip(read_model(MODELS / f"wamv16-{kind}.npz")) <= TOLERANCE_MPS2
