"""`asvhil train` and `asvhil evaluate` at the command line: what they leave, how they resume, what they refuse."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asvhil.commands import cli
from asvhil.dynamics.weights import read_model, save_model
from tests.support.csv_columns import COLUMNS
from tests.support.model_data import drive
from tests.support.model_samples import sample
from tests.support.paths import ROOT

pytest.importorskip("torch")

PNG = b"\x89PNG"
SHIPPED = ROOT / "config" / "models" / "wamv16-nnsem.npz"


def write_csv(path: Path, rows: np.ndarray, header: str = "t,u,v,r,left,right") -> Path:
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(header.split(","))
        table.writerows([f"{value:.6f}" for value in row] for row in rows)
    return path


def rows_of(seed: int, seconds: float) -> np.ndarray:
    segment, _ = drive(seed, seconds, 0.0)
    return np.column_stack([segment.t_s, segment.nu, segment.command])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run to train on, one to score on, and their column map."""
    place = tmp_path_factory.mktemp("csv")
    (place / "map.yaml").write_text(COLUMNS)
    write_csv(place / "run.csv", rows_of(11, 90.0))
    write_csv(place / "test.csv", rows_of(12, 70.0))
    return place


OF_CSV = ("--columns", "map.yaml", "--vehicle", "boat")


Done = tuple[int, str, str]  # exit code, stdout, stderr
Run = Callable[..., Done]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], folder: Path) -> Run:
    """The command line in the folder."""

    def start(*arguments: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["asvhil", *arguments])
        capfd.readouterr()
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = int(end.code or 0)
        return code, *capfd.readouterr()

    monkeypatch.chdir(folder)
    return start


def refused(result: Done, words: str) -> None:
    """One line on stderr that says so, and exit status 2."""
    code, _, err = result
    assert code == 2, err
    assert err.startswith("asvhil: ") and err.count("\n") == 1 and words in err, err


def test_train_and_evaluate_leave_figures_and_pictures(run: Run, folder: Path) -> None:
    code, words, err = run(
        "train", "nnsem", "run.csv", *OF_CSV, "-o", "models/net.npz", "--iterations", "100", "--json", "t.json"
    )
    assert (code, err) == (0, "")
    assert "models/net.npz: nnsem for boat, 90 s of data" in words
    assert "at rest: still air " in words
    figures = json.loads((folder / "t.json").read_text())
    assert {name: figures[name] for name in ("kind", "vehicle", "model", "picture", "data", "seed")} == {
        "kind": "nnsem", "vehicle": "boat", "model": "models/net.npz", "picture": "models/net.curve.png",
        "data": ["run.csv"], "seed": 1,
    }  # fmt: skip
    assert {"data_s", "data_hash", "outliers", "missing_rows", "smoothed", "wall_s"} < figures.keys()
    assert (figures["iterations_run"], figures["options"]["window"], figures["missing_rows"]) == (100, 20, 0)
    assert (folder / "models" / "net.curve.png").read_bytes()[:4] == PNG
    assert read_model(folder / "models" / "net.npz").data_hash == figures["data_hash"]

    assert run("train", "sd", "run.csv", *OF_CSV, "-o", "models/sd.npz")[0] == 0
    code, words, err = run(
        "evaluate", "models/net.npz", "models/sd.npz", "--data", "test.csv", "--columns", "map.yaml",
        "--every", "5", "--picture", "sheet.png", "--json", "e.json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert (folder / "sheet.png").read_bytes()[:4] == PNG
    scores = json.loads((folder / "e.json").read_text())
    assert (scores["horizon_s"], scores["every_s"], scores["reference"]) == (50.0, 5.0, "measured")
    assert scores["models"] == ["models/net.npz", "models/sd.npz"] and scores["data"] == ["test.csv"]
    assert list(scores["rows"]) == ["nnsem", "sd", "hold the initial value"]
    for row in scores["rows"].values():
        assert list(row) == ["all", "moving", "idle"]
        assert row["all"]["windows"] == row["moving"]["windows"] + row["idle"]["windows"] == 4
        assert {f"{kind}_{axis}" for kind in ("mae", "std") for axis in "uvr"} < row["all"].keys()
    assert scores["rows"]["sd"]["all"]["mae_u"] < scores["rows"]["hold the initial value"]["all"]["mae_u"]
    assert f"{scores['rows']['sd']['all']['mae_u']:.4f}" in words
    assert list(scores["at_rest"]) == ["nnsem", "sd"]
    assert {row["reference"] for row in scores["at_rest"]["sd"]["winds"]} == {None}  # nobody knows a real boat's rates
    assert words.count("at rest: still air ") == 2


@pytest.mark.thorough
def test_an_interrupted_training_resumes_to_the_same_bits(run: Run, folder: Path) -> None:
    order = ["train", "nnsem", "run.csv", *OF_CSV, "--iterations", "600", "--seed", "4"]  # validated and kept after 500
    checkpoint = folder / "cut.npz.checkpoint"
    process = subprocess.Popen(
        [sys.executable, "-m", "asvhil", *order, "-o", "cut.npz"],
        cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        for _ in range(6000):
            if checkpoint.exists() or process.poll() is not None:
                break
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, words = process.communicate(timeout=100)
    finally:
        process.kill()
    assert process.returncode == 130
    assert words.splitlines()[-1].endswith("with --resume goes on from cut.npz.checkpoint") and "Traceback" not in words
    assert checkpoint.exists() and not (folder / "cut.npz").exists()
    assert run(*order, "-o", "cut.npz", "--resume")[0] == 0
    assert run(*order, "-o", "whole.npz")[0] == 0
    assert not checkpoint.exists()
    cut, whole = read_model(folder / "cut.npz"), read_model(folder / "whole.npz")
    assert all((cut.weights[name] == whole.weights[name]).all() for name in whole.weights)
    assert (folder / "cut.npz").read_bytes() == (folder / "whole.npz").read_bytes()


@pytest.mark.parametrize(
    ("kind", "package", "code", "words"),
    [
        ("nnsem", "torch", "raise OSError('libcudart.so.12: cannot open')", "does not load (libcudart.so.12: cannot o"),
        (
            "nnsem",
            "torch",
            "import libtorch_of_another_python",
            "is installed and does not load (No module named",
        ),
        ("node", "torchdiffeq", "raise ModuleNotFoundError(name='torchdiffeq')", "needs torchdiffeq: pip install"),
    ],
)
def test_a_package_that_does_not_load_is_one_line(
    folder: Path, tmp_path: Path, kind: str, package: str, code: str, words: str
) -> None:
    (tmp_path / f"{package}.py").write_text(code)
    done = subprocess.run(
        [sys.executable, "-m", "asvhil", "train", kind, "run.csv", *OF_CSV, "-o", "never.npz"],
        cwd=folder, text=True, capture_output=True, timeout=100,
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
    )  # fmt: skip
    refused((done.returncode, done.stdout, done.stderr), words)


def test_options_reach_the_training(run: Run, folder: Path) -> None:
    code, _, err = run(
        "train", "lagnet", "run.csv", *OF_CSV, "-o", "opt.npz", "--iterations", "30", "--members", "2", "--width", "5",
        "--horizon", "2", "--moving-share", "0.5", "--validation-share", "0", "--no-mirror", "--batch", "8", "--force",
        "--json", "opt.json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    figures = json.loads((folder / "opt.json").read_text())
    options = figures["options"]
    assert (options["window"], options["moving_share"], options["validation_fraction"]) == (10, 0.5, 0.0)
    assert (figures["best_iteration"], figures["iterations_run"]) == (30, 30)
    assert (options["mirror"], options["members"], options["hidden"], options["batch"]) == (False, 2, 5, 8)
    assert read_model(folder / "opt.npz").weights["w1"].shape == (10, 7)


def test_options_of_rates_and_shapes_reach_the_training(run: Run, folder: Path) -> None:
    order = ("--iterations", "20", "--rate", "0.004", "--weight-decay", "1e-5", "--json", "opt.json")
    assert run("train", "nnsem", "run.csv", *OF_CSV, "-o", "opt.npz", "--force", "--paired", *order)[0] == 0
    options = json.loads((folder / "opt.json").read_text())["options"]
    assert (options["paired"], options["symmetric"], options["mirror"]) == (True, True, False)
    assert (options["rate"], options["last_rate"], options["weight_decay"]) == (0.004, 0.004, 1e-5)
    assert (
        run(
            "train",
            "lagnet",
            "run.csv",
            *OF_CSV,
            "-o",
            "opt.npz",
            "--force",
            "--from-sd",
            "--last-rate",
            "0",
            "--robust",
            "0.05",
            *order,
        )[0]
        == 0
    )
    options = json.loads((folder / "opt.json").read_text())["options"]
    assert options["robust"] == 0.05 == read_model(folder / "opt.npz").figures["options"]["robust"]
    assert (options["from_sd"], options["symmetric"], options["rate"], options["last_rate"]) == (True, True, 0.004, 0.0)


def test_a_model_is_not_overwritten_and_a_record_counts_once(run: Run, folder: Path) -> None:
    (folder / "kept.npz").write_bytes(b"hours of work")
    order = ("train", "sd", "run.csv", *OF_CSV, "-o", "kept.npz")
    refused(run(*order), "kept.npz is there already: another name, or --force to overwrite it")
    assert (folder / "kept.npz").read_bytes() == b"hours of work"
    assert run(*order, "--force")[0] == 0 and read_model(folder / "kept.npz").kind == "sd"
    (folder / "copy.csv").write_bytes((folder / "run.csv").read_bytes())
    for twice in ("run.csv", "copy.csv"):
        words = f"run.csv and {twice} are the same record: give it once"
        refused(run("train", "sd", "run.csv", twice, *OF_CSV, "-o", "twice.npz"), words)
        refused(run("evaluate", str(SHIPPED), "--data", "run.csv", "--data", twice, "--columns", "map.yaml"), words)
    assert not (folder / "twice.npz").exists()


def test_nothing_is_lost_and_all_is_checked_before_the_training(run: Run, folder: Path) -> None:
    order = ("train", "sd", "run.csv", *OF_CSV)
    (folder / "late.npz.checkpoint").write_bytes(b"hours of work")
    refused(run(*order, "-o", "late.npz"), "late.npz.checkpoint is of a training that was interrupted: --resume")
    assert (folder / "late.npz.checkpoint").read_bytes() == b"hours of work"
    (folder / "mine.curve.png").write_bytes(b"mine")
    refused(run(*order, "-o", "mine.npz"), "mine.curve.png is there already")
    (folder / "d.npz").mkdir()
    refused(run(*order, "-o", "d.npz", "--force"), "d.npz: cannot be written (Is a directory)")
    refused(run(*order, "-o", "same.npz", "--json", "same.npz"), "--json same.npz: is the file of --output too")
    refused(run(*order, "-o", "new.npz", "--json", "none/x.json"), "--json none/x.json: cannot be written")
    assert not list(folder.glob("new.npz*")) and not list(folder.glob("same.npz*"))


def test_of_several_tries_the_best_on_validation_is_kept(run: Run, folder: Path) -> None:
    order = ("train", "nnsem", "run.csv", *OF_CSV, "--iterations", "60")
    code, _, err = run(*order, "--seed", "3", "--tries", "4", "-o", "best.npz", "--json", "tries.json")
    assert (code, err) == (0, "")
    figures = json.loads((folder / "tries.json").read_text())
    errors = figures["validation_of_seeds"]
    assert list(errors) == ["3", "4", "5", "6"]
    assert figures["best_validation"] == errors[str(figures["seed"])] == min(errors.values()) < max(errors.values())
    assert run(*order, "--seed", str(figures["seed"]), "-o", "alone.npz")[0] == 0
    best, alone = read_model(folder / "best.npz"), read_model(folder / "alone.npz")
    assert best.seed == alone.seed == figures["seed"]
    np.testing.assert_allclose(best.weights["w1"], alone.weights["w1"], atol=1e-9)


def test_nothing_held_back_means_all_of_the_data_and_all_of_the_iterations(run: Run, folder: Path) -> None:
    # The ranges for the scaling are those of the training part: all rows, or all but the last tenth.
    for share in ("0", "0.5"):
        order = ("train", "nnsem", "run.csv", *OF_CSV, "-o", f"share{share}.npz", "--iterations", "5")
        assert run(*order, "--validation-share", share)[0] == 0
    half, whole = (read_model(folder / f"share{share}.npz").scaling.half for share in ("0.5", "0"))
    assert (whole >= half).all() and (whole > half).any()


def test_training_data_are_smoothed_unless_not_wanted(run: Run, folder: Path) -> None:
    costs = []
    for flag in ("--smoothing", "--no-smoothing"):
        assert run("train", "sd", "run.csv", *OF_CSV, "-o", f"sd{flag}.npz", "--json", "sd.json", flag)[0] == 0
        assert json.loads((folder / "sd.json").read_text())["smoothed"] == (flag == "--smoothing")
        costs.append(read_model(folder / f"sd{flag}.npz").figures["curve"][-1][1])
    assert costs[0] < 0.8 * costs[1]  # the noise of the sensors is much of what no model fits


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (("oracle",), "unknown model kind 'oracle' (known: sd, nnsem"),
        (("nnsem", "--members", "3"), "--members does not apply to model nnsem, only to lagnet"),
        (("sd", "--width", "4"), "--width does not apply to model sd"),
        (("sd", "--tries", "2"), "--tries does not apply to model sd"),
        (("sd", "--rate", "0.1"), "--rate does not apply to model sd"),
        (("sd", "--robust", "0.1"), "--robust does not apply to model sd"),
        (("node", "--paired"), "--paired does not apply to model node, only to nnsem"),
        (("lagnet", "--monotone", "1"), "--monotone does not apply to model lagnet, only to nnsem"),
        (("nnsem", "--paired", "--width", "5"), "--paired needs an even --width, not 5"),
        (("nnsem", "--from-sd"), "--from-sd does not apply to model nnsem, only to lagnet"),
        (("nnsem", "--horizon", "0.2"), "--horizon 0.2 is less than two steps of 0.2 s"),
        (("nnsem", "-o", "net.onnx"), "net.onnx: a model file ends in .npz"),
        (("nnsem", "-o", "run.csv/net.npz"), "run.csv/net.npz: cannot be written"),
        (("nnsem", "--resume"), "out.npz.checkpoint: no interrupted training to go on with"),
    ],
)
def test_orders_that_make_no_sense(run: Run, order: tuple[str, ...], words: str) -> None:
    refused(run("train", order[0], "run.csv", *OF_CSV, "-o", "out.npz", *order[1:]), words)


def changed(**arrays: object) -> Callable[[Path], None]:
    """A shipped model with some arrays replaced."""

    def write(path: Path) -> None:
        with np.load(SHIPPED) as archive:
            np.savez(path, **({part: archive[part] for part in archive.files} | arrays))

    return write


def flipped(path: Path) -> None:
    content = bytearray(SHIPPED.read_bytes())
    content[content.index(b"weights.w1.npy") + 200] ^= 4
    path.write_bytes(content)


def bomb(path: Path, size: int, shape: tuple[int, ...] | None = None) -> None:
    """A small file whose only array has so many bytes, and says to have that shape."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": shape or (size // 8,)})
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed, packed.open("weights.w1.npy", "w") as file:
        file.write(head.getvalue())
        for _ in range(size // 1_000_000):
            file.write(bytes(1_000_000))


DAMAGED = {
    "truncated": (lambda path: path.write_bytes(SHIPPED.read_bytes()[:3000]), "damaged (File is not a zip file)"),
    "flipped": (flipped, "damaged: the checksum of weights.w1.npy is wrong"),
    "huge": (lambda path: bomb(path, 300_000_000), "holds more than 200 MB: no model of asvhil"),
    "claims": (lambda path: bomb(path, 100, shape=(10**11,)), "damaged: an array claims to be larger than the memory"),
    "text": (lambda path: path.write_text("no weights"), "not a model file (npz)"),
    "empty": (lambda path: path.write_bytes(b""), "not a model file (npz)"),
    "pickled": (changed(**{"weights.w1": np.array([{}], dtype=object)}), "a pickled object, which is never"),
    "not-finite": (changed(**{"weights.b1": np.full(24, np.nan)}), "weights.b1 holds 24 values that are not f"),
    "other-boat": (changed(vehicle=np.array("bream")), "was trained for vehicle 'bream'"),
    "other-step": (changed(dt_s=np.array(0.1)), "steps of 0.1 s"),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_models_that_will_not_do_are_refused_in_the_loop_and_in_the_score(run: Run, folder: Path, damage: str) -> None:
    write, words = DAMAGED[damage]
    path = folder / f"{damage}.npz"
    write(path)
    sitl = ("sitl", "--lockstep", "--duration", "2", "--no-picture", "--log", "never.mcap")
    result = run(*sitl, "--controller", "nnsem-mpc", "--set", f"controller.model={path}")
    refused(result, f"asvhil: {path}: ")
    refused(result, words)
    assert not (folder / "never.mcap").exists()
    if damage != "other-boat":  # a CSV file does not say of which boat it is
        refused(run("evaluate", str(SHIPPED), path.name, "--data", "test.csv", "--columns", "map.yaml"), words)
    else:
        refused(run("evaluate", path.name, "--data", short_log(run, folder)), "the logs are of 'wamv16'")


def test_a_model_of_another_kind_than_the_controller_needs(run: Run, folder: Path) -> None:
    save_model(folder / "lag.npz", sample("lagnet"))
    order = ("sitl", "--lockstep", "--duration", "2", "--controller", "nnsem-mpc", "--set")
    refused(run(*order, "controller.model=lag.npz"), "lag.npz: holds a model of kind lagnet, but nnsem-mpc needs nnsem")
    refused(run(*order, "controller.model=none.npz"), "none.npz: no such model file")


def short_log(run: Run, folder: Path) -> str:
    """The name of a log of 10 s, which is made once."""
    if not (folder / "short.mcap").exists():
        assert run("sitl", "--lockstep", "--duration", "10", "--no-picture", "--log", "short.mcap")[0] == 0
    return "short.mcap"


def broken(name: str, folder: Path) -> str:
    """A file of training data with something wrong."""
    rows = rows_of(11, 70.0)
    path = folder / f"{name}.csv"
    if name == "short":
        write_csv(path, rows[:50])
    elif name == "still":
        write_csv(path, np.column_stack([rows[:, 0], np.zeros((len(rows), 5))]))
    elif name == "many-nan":
        rows[5::10, 2] = np.nan
        write_csv(path, rows)
    elif name == "no-column":
        write_csv(path, rows[:, :5], "t,u,v,r,left")
    elif name == "empty":
        path.write_text("")
    elif name == "header-only":
        path.write_text("t,u,v,r,left,right\n")
    elif name == "word":
        write_csv(path, rows)
        path.write_text(path.read_text().replace("\n0.400000,", "\nsoon,", 1))
    elif name == "backwards":
        rows[33, 0] = 1.0
        write_csv(path, rows)
    elif name == "degrees":
        rows[:, 3] *= 57.3 * np.where(np.arange(len(rows)) % 4, 1.0, -3.0)
        write_csv(path, rows)
    elif name == "percent":
        rows[:, 4:] *= 100.0
        write_csv(path, rows)
    return path.name


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("short", "short.csv: 9.8 s of usable data, at least 30 s are needed"),
        ("many-nan", "many-nan.csv: column 'v': 35 of 350 values are NaN or empty, the first in row 7; up to 5%"),
        ("no-column", "no-column.csv: row 1: no column 'right' (for starboard); the header has 't', 'u',"),
        ("empty", "empty.csv: row 1: empty, where the names of the columns should be"),
        ("header-only", "header-only.csv: holds no row of data"),
        ("word", "word.csv: row 4, column 't': a number is expected, not 'soon'"),
        ("backwards", "backwards.csv: row 35, column 't': time does not rise (1 after 6.4)"),
        ("percent", "is beyond -1..1"),
        ("degrees", "rows have jumps of r: is their unit right?"),
        ("nowhere", "nowhere.csv: cannot be read (No such file or directory)"),
    ],
)
def test_broken_csv_files_are_refused_by_training_and_scoring_alike(
    run: Run, folder: Path, name: str, words: str
) -> None:
    data = broken(name, folder)
    refused(run("train", "nnsem", data, *OF_CSV, "-o", "never.npz"), words)
    refused(run("evaluate", str(SHIPPED), "--data", data, "--columns", "map.yaml"), words)
    assert not list(folder.glob("never.npz*"))


def test_a_boat_at_rest_teaches_nothing(run: Run, folder: Path) -> None:
    refused(run("train", "nnsem", broken("still", folder), *OF_CSV, "-o", "never.npz"), "hold no motion: u spans 0.000")


def test_a_few_missing_values_are_gaps_and_are_told(run: Run, folder: Path) -> None:
    rows = rows_of(11, 70.0)
    rows[[20, 21, 150], 2] = np.nan
    write_csv(folder / "gaps.csv", rows)
    order = ("train", "sd", "gaps.csv", *OF_CSV, "-o", "gaps.npz", "--json", "gaps.json")
    code, words, err = run(*order)
    assert (code, err) == (0, "") and "left out: 3 rows with a missing value, 0 jumps" in words
    assert json.loads((folder / "gaps.json").read_text())["missing_rows"] == 3


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ("short.mcap", " s of usable data, at least 30 s are needed"),
        ("empty.mcap", "empty.mcap: is empty; a log is expected"),
        ("nowhere.mcap", "nowhere.mcap: cannot be read (No such file or directory)"),
        ("notes.txt", "MCAP logs or CSV files are expected, all of one kind, not notes.txt"),
    ],
)
def test_logs_that_will_not_do(run: Run, folder: Path, data: str, words: str) -> None:
    short_log(run, folder)
    (folder / "empty.mcap").write_bytes(b"")
    refused(run("train", "nnsem", data, "-o", "never.npz"), words)
    refused(run("evaluate", str(SHIPPED), "--data", data), words)


def test_a_step_that_is_not_the_one_of_the_loop(run: Run, folder: Path) -> None:
    order = ("train", "sd", "run.csv", "--columns", "map.yaml", "--vehicle", "wamv16", "--dt", "0.5", "-o", "slow.npz")
    assert run(*order)[0] == 0
    sitl = ("sitl", "--lockstep", "--duration", "2", "--controller", "fitted-sd-mpc")
    refused(run(*sitl, "--set", "controller.model=slow.npz"), "steps of 0.5 s, but 0.2 s are asked for")
