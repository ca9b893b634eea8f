"""`asvhil learn`: the afternoon as one command, on a short rehearsal, and what it refuses."""

import dataclasses
import io
import json
import os
import shutil
import signal
import threading
from pathlib import Path

import pytest
from rich.console import Console

from asvhil.collect import collect, log_paths, recorded, with_manoeuvres
from asvhil.commands import learn as learn_module
from asvhil.commands.learn_drives import LearnFiles, put_aside
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.dynamics.weights import read_model
from asvhil.logs.opening import open_recorder
from asvhil.train.at_rest import AtRest, Load
from asvhil.train.checkpoint import Checkpoint, write_checkpoint
from asvhil.train.origin import origin_of
from asvhil.train.verdict import ModelVerdict
from tests.support.command_line import call, refused
from tests.support.ports import free_port
from tests.support.waiting import wait_until

pytest.importorskip("torch")
CAT = ("--port", "udpin:0.0.0.0:14550", "--length", "1.6", "--beam", "1", "--mass", "38", "--top-speed", "2")
SHORT = ("--duration", "80", "--wind", "3@90", "--iterations", "60")


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a boat, and what a rehearsal of a minute has left."""
    folder = tmp_path_factory.mktemp("learned")
    assert call("init", "cat.yaml", *CAT, "--motors-apart", "0.84", cwd=folder).status == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(learn_module, "HOLD_S", 10.0)
        said = call("learn", "cat-sim.yaml", *SHORT, "--json", "f.json", cwd=folder, typed="y\n" * 5)
    (folder / "said.txt").write_text(said.out)
    assert said.status in (0, 1) and said.err == "", said
    assert (said.status == 0) == json.loads((folder / "f.json").read_text())["good"]
    return folder


def test_all_steps_leave_their_files_and_a_verdict(learned: Path) -> None:
    made = {path.name for path in (learned / "cat-sim-learned").iterdir()}
    assert made >= {"drive.mcap", "test.mcap", "cat-nnsem.npz", "cat-sd.npz", "fit.png"}
    figures = json.loads((learned / "f.json").read_text())
    assert list(figures["rows"]) == ["nnsem", "sd", "physics as configured", "hold the initial value"]
    assert set(figures["hold"]) == {"sd-mpc", "nnsem-mpc"}
    said = (learned / "said.txt").read_text()
    assert [line[:2] for line in said.splitlines() if line[:2] in ("1.", "2.", "3.", "4.", "5.")] == [
        "1.", "2.", "3.", "4.", "5.",
    ]  # fmt: skip
    assert "at rest in still air the boat stays where it is" in said  # trained so
    assert ("Not good enough" in said) == (not figures["good"])


def test_the_lines_that_it_advises_are_taken(learned: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (learned / "own.yaml").write_text(
        "base: cat-sim.yaml\ncontroller:\n  name: nnsem-mpc\n  model: cat-sim-learned/cat-nnsem.npz\n"
    )
    monkeypatch.chdir(learned.parent)  # the path counts from the config
    config = load_config(learned / "own.yaml")
    assert config.controller.model is not None and read_model(config.controller.model).vehicle == "cat"
    said = call("config", "check", str(learned / "own.yaml"), cwd=learned.parent)
    assert said.status == 0 and "model: pass: cat-nnsem.npz, nnsem of cat" in said.out


def test_advice_names_the_lines_that_are_there_and_a_wind_load_that_is_off(learned: Path) -> None:
    files = LearnFiles.of(learned / "cat-sim-learned", "cat", "nnsem")
    load = Load(side="port", speed_mps=10.0, rates=(0.0, 0.0, 0.0), reference=(0.0, 0.1, 0.0), error=4.4)
    good = ModelVerdict(passed=("all",), faults=())
    said = []
    for name, error in (("cat.yaml", 4.4), ("cat-sim.yaml", 0.9)):
        loads = (dataclasses.replace(load, error=error),)
        check = AtRest(still=(0.0, 0.0, 0.0), loads=loads, fall_mps2=0.0, thrust_dip_mps2=0.0)
        out = io.StringIO()
        config = learned / name
        learn_module._advise(Console(file=out), load_config(config), "nnsem", files, config, good, check, {})
        said.append(out.getvalue())
    own, twin = said
    assert "cat.yaml, in place of the `name` under the `controller` that is there:\ncontroller:\n" in own
    assert "cat-sim.yaml:\ncontroller:\n" in twin
    assert "not learned well, least in 10 m/s of wind on the port" in own and "not learned well" not in twin


def test_nothing_is_overwritten_and_no_log_counts_twice(learned: Path) -> None:
    before = {path: path.read_bytes() for path in (learned / "cat-sim-learned").iterdir()}
    refused(
        call("learn", "cat-sim.yaml", "--yes", cwd=learned),
        "cat-sim-learned is not empty: another folder by -o, --resume to go on with its drives, or --force",
    )
    drive, test = "cat-sim-learned/drive.mcap", "cat-sim-learned/test.mcap"
    logs = ("--data", drive, "--data", test, "--test", test)
    refused(
        call("learn", "cat-sim.yaml", "--yes", "-o", "other", *logs, cwd=learned), "are the same record: give it once"
    )
    assert {path: path.read_bytes() for path in before} == before and not (learned / "other").exists()


def test_a_test_is_looked_at_before_the_training(learned: Path) -> None:
    short = learned / "short.mcap"
    collect(load_config(learned / "cat-sim.yaml"), "lockstep", 15.0, [parse_wind("3@90")], short)
    drive = "cat-sim-learned/drive.mcap"
    said = call("learn", "cat-sim.yaml", "--yes", "-o", "new", "--data", drive, "--test", short.name, cwd=learned)
    short.unlink()
    refused(said, "short.mcap: ")
    assert "s are needed" in said.err and not (learned / "new").exists() and "training" not in said.out


def test_a_model_that_is_there_is_not_trained_again(learned: Path) -> None:
    model = learned / "cat-sim-learned" / "cat-nnsem.npz"
    before = model.stat().st_mtime_ns
    said = call("learn", "cat-sim.yaml", "--resume", "--iterations", "60", cwd=learned, typed="y\nn\n")
    assert "cat-nnsem.npz: is there already, of the same data, options and seed" in said.out.replace("\n", " "), said
    assert model.stat().st_mtime_ns == before and "stopped" in said.err


def test_what_another_training_has_left_is_put_aside(learned: Path, tmp_path: Path) -> None:
    """A model that is finished, and then the state of one that was interrupted."""
    folder = Path(shutil.copytree(learned / "cat-sim-learned", tmp_path / "kept"))
    made = ("cat-nnsem.npz", "cat-nnsem.curve.png", "cat-sd.npz", "cat-sd.curve.png", "fit.png")
    before = {name: (folder / name).read_bytes() for name in made}
    order = ("learn", "cat-sim.yaml", "-o", str(folder), "--resume", "--iterations", "60")
    said = call(*order, "--seed", "2", cwd=learned, typed="y\nn\n")
    words = f"put into {folder / 'before-1'}: {', '.join(made)}, of another training"
    assert words in said.out.replace("\n", " ") and "stopped" in said.err, said
    assert {path.name: path.read_bytes() for path in (folder / "before-1").iterdir()} == before
    model = folder / made[0]
    assert read_model(model).seed in (2, 3)
    model.unlink()
    state = folder / "cat-nnsem.npz.checkpoint"
    write_checkpoint(state, Checkpoint(key="of another drive", iteration=50, curve=[], arrays={}))
    kept = state.read_bytes()
    said = call(*order, "--seed", "2", cwd=learned, typed="y\nn\n")
    assert "of a training of other data, options or seeds" in said.out.replace("\n", " "), said
    assert (folder / "before-3" / state.name).read_bytes() == kept and not state.exists() and model.exists()


def test_a_warning_of_the_data_comes_once_and_a_picture_that_cannot_be_written_is_told(
    learned: Path, tmp_path: Path
) -> None:
    silent = "sources.wind=[{link: autopilot, message: WIND}]"  # which it never sends
    settings = load_config(learned / "cat-sim.yaml", (silent,))
    for name, number in (("drive.mcap", 0), ("test.mcap", 1)):
        collect(settings, "lockstep", 80.0, [parse_wind(f"{3 + number}@90")], tmp_path / name)
    (tmp_path / "out" / "cat-nnsem.curve.png").mkdir(parents=True)
    logs = ("--data", str(tmp_path / "drive.mcap"), "--test", str(tmp_path / "test.mcap"))
    order = ("learn", "cat-sim.yaml", "--force", "-o", str(tmp_path / "out"), "--iterations", "50", *logs)
    said = call(*order, cwd=learned, typed="y\nn\n")
    assert said.err.count("no wind was measured") == 1, said
    assert said.err.count("cat-nnsem.curve.png: cannot be written") == 1, said


def test_another_boats_logs_are_refused_before_the_training(learned: Path) -> None:
    assert (
        call("init", "dog.yaml", *CAT[:-4], "--mass", "90", *CAT[-2:], "--motors-apart", "0.84", cwd=learned).status
        == 0
    )
    logs = ("--data", "cat-sim-learned/drive.mcap", "--test", "cat-sim-learned/test.mcap")
    said = call("learn", "dog-sim.yaml", "--yes", *logs, cwd=learned)
    refused(said, "drive.mcap: of the boat 'cat', of another hull (mass")
    assert not (learned / "dog-sim-learned").exists()
    for made in learned.glob("dog*"):
        made.unlink()


def test_a_rehearsal_teaches_nothing_of_the_real_boat(learned: Path) -> None:
    drive, test = "cat-sim-learned/drive.mcap", "cat-sim-learned/test.mcap"
    words = f"learn: {drive}: of the simulated boat, and cat.yaml is of the real boat"
    refused(call("learn", "cat.yaml", "--yes", "--data", drive, "--test", test, cwd=learned), words)
    refused(call("learn", "cat.yaml", "--yes", "--resume", "-o", "cat-sim-learned", cwd=learned), words)
    assert not (learned / "cat-learned").exists()


def test_logs_of_the_rehearsal_and_of_the_boat_train_no_model_together(learned: Path) -> None:
    own, drive = learned / "own.mcap", learned / "cat-sim-learned" / "drive.mcap"
    recorder = open_recorder(load_config(learned / "cat.yaml"), own, "live", threaded=False)
    recorder.close()
    assert origin_of([drive]).simulated and not origin_of([own]).simulated
    said = call("train", "sd", str(drive), str(own), "-o", "both.npz", cwd=learned)
    own.unlink()
    refused(said, f"{own} is of the real boat, and {drive} of the simulated boat")


def test_forced_drives_put_the_logs_that_are_there_aside(tmp_path: Path) -> None:
    made = {"drive.mcap": b"1", "drive-lake-monday.mcap": b"2", "test.mcap": b"3"}
    for turn in (1, 2):
        for name, content in made.items():
            (tmp_path / name).write_bytes(content)
        put_aside(tmp_path, sorted(tmp_path.glob("*.mcap")), Console(file=io.StringIO()))
        aside = tmp_path / f"before-{turn}"
        assert {path.name: path.read_bytes() for path in aside.iterdir()} == made
        assert not list(tmp_path.glob("*.mcap"))


def test_a_no_ends_it_and_says_how_to_go_on(learned: Path) -> None:
    said = call("learn", "cat-sim.yaml", "-o", "third", cwd=learned, typed="n\n")
    assert said.status == 2 and "the same command with --resume goes on" in said.err
    assert not (learned / "third").exists()


def test_resume_makes_the_drives_that_are_missing_or_broken_off(learned: Path, tmp_path: Path) -> None:
    """Stopped before the test, with one drive of two there and the other one cut off, as a power cut leaves it."""
    folder = tmp_path / "half"
    winds = ("--wind", "3@90", "--wind", "2@0")
    settings = load_config(learned / "cat-sim.yaml")
    sectors = [parse_wind(text) for text in winds[1::2]]
    logs = log_paths(folder / "drive.mcap", folder, sectors)
    folder.mkdir()
    collect(settings, "lockstep", 80.0, sectors, folder / "drive.mcap")
    whole = logs[0].read_bytes()
    second = logs[1].read_bytes()
    logs[1].write_bytes(second[: len(second) // 2])
    order = ("learn", "cat-sim.yaml", "-o", str(folder), "--resume", *winds)
    refused(call(*order, "--yes", "--duration", "90", cwd=learned), "is of 80 s, and not of the 90 s that are asked")
    other = ("learn", "cat-sim.yaml", "-o", str(folder), "--resume", "--yes")
    refused(call(*other, "--wind", "2@0", "--wind", "3@90", cwd=learned), "in their order")
    refused(call(*other, cwd=learned), "give its --wind options")
    said = call(*order, cwd=learned, typed="y\ny\nn\n")
    assert said.status == 2 and "stopped" in said.err, said
    assert "broken off after" in said.out.replace("\n", " ") and "1. a drive of 80 s of manoeuvres" in said.out
    assert "2. a drive of 60 s to test on" in said.out
    assert logs[0].read_bytes() == whole and len(logs[1].read_bytes()) > 0.9 * len(second)
    assert (folder / "before-1" / logs[1].name).read_bytes() == second[: len(second) // 2]
    assert recorded(logs[1]).complete and recorded(folder / "test.mcap").complete
    said = call(*other[:-1], cwd=learned, typed="n\n")  # all is there: the winds need not be told
    assert said.status == 2 and "1. training of nnsem on 2 logs" in said.out, said


def real_logs(learned: Path, folder: Path, **lengths_s: float) -> dict[str, Path]:
    """Logs of drives of the real boat by their names, each of so many seconds and broken off before it engaged."""
    folder.mkdir(parents=True)
    settings = load_config(learned / "cat.yaml")
    logs = {name: folder / f"{name.replace('_', '-')}.mcap" for name in lengths_s}
    for name, log in logs.items():
        open_recorder(with_manoeuvres(settings, lengths_s[name]), log, "live", threaded=False).close()
    return logs


def test_on_a_real_boat_drives_may_be_of_any_length(learned: Path, tmp_path: Path) -> None:
    real_logs(learned, tmp_path / "own", drive=600.0, drive_monday=300.0, test=240.0)
    order = ("learn", "cat.yaml", "-o", str(tmp_path / "own"), "--resume")
    for more in ((), ("--duration", "200")):
        said = call(*order, *more, cwd=learned, typed="n\nn\nn\nn\n")
        assert said.out.count("it is used as it is") == 3, said
        assert said.err.endswith("test.mcap: holds no tick\n"), "it has gone on, to the look at the test"


@pytest.mark.real_time
def test_on_a_real_boat_what_is_to_be_driven_again_is_driven_under_its_own_name(learned: Path, tmp_path: Path) -> None:
    """The serial line of the autopilot is not there, so the drive waits until it is interrupted."""
    logs = real_logs(learned, tmp_path / "own", drive=600.0, drive_monday=300.0, test=240.0)
    before = {log: log.read_bytes() for log in logs.values()}
    order = ("learn", "cat.yaml", "-o", str(tmp_path / "own"), "--resume")
    said = call(*order, cwd=learned, typed="n\ny\ny\nn\n")
    assert "1. a drive of 600 s of manoeuvres (the real boat" in said.out and "stopped" in said.err, said
    assert {log: log.read_bytes() for log in before} == before, "nothing is moved before somebody has confirmed"
    monday, aside = logs["drive_monday"], tmp_path / "own" / "before-1"

    def interrupt() -> None:
        wait_until(lambda: "asyncio" in signal.getsignal(signal.SIGINT).__module__, 20.0)  # type: ignore[union-attr]
        os.kill(os.getpid(), signal.SIGINT)

    hand = threading.Thread(target=interrupt)
    hand.start()
    operator = f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}"
    no_line = ("--set", "links.autopilot.endpoint=serial:/none:57600", "--set", operator)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        said = call(*order, *no_line, cwd=learned, typed="n\ny\ny\ny\n")
    finally:  # the daemon leaves them ignored, as the end of its process
        hand.join()
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert "drive-monday.mcap: not complete after 0 s: waiting for a hold command; the same command with" in said.err, (
        said
    )
    assert {path.name: path.read_bytes() for path in aside.iterdir()} == {
        log.name: before[log] for log in (monday, logs["test"])
    }
    assert monday.exists() and logs["drive"].read_bytes() == before[logs["drive"]] and not logs["test"].exists()


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (("cat-sim.yaml",), "it stops to ask, and there is no terminal: use --yes"),
        (("cat-sim.yaml", "--yes", "--kind", "node"), "--kind node: nnsem or lagnet is expected"),
        (("cat-sim.yaml", "--yes", "--data", "a.mcap"), "--data and --test go together"),
        (("cat-sim.yaml", "--yes", "-o", "new", "--data", "a.mcap", "--test", "b.mcap"), "a.mcap: cannot be read"),
        (("cat-sim.yaml", "--yes", "-o", "new", "--wind", "fast"), "SPEED@DEG is expected"),
        (("cat-sim.yaml", "--yes", "-o", "new", "--resume"), "new holds no drives to go on with"),
        (("cat-sim.yaml", "--yes", "-o", "new", "--resume", "--force"), "give one of them"),
        (
            ("cat-sim.yaml", "--yes", "--data", "a.mcap", "--test", "b.mcap", "--wind", "3@0"),
            "--wind is of drives, and with --data there are none",
        ),
        (("cat.yaml", "--yes", "-o", "new", "--wind", "3@0"), "nobody makes the wind for a real vehicle"),
        (("dog.yaml", "--yes"), "dog.yaml: no such config file"),
        (
            ("cat-sim.yaml", "--yes", "-o", "new", "--set", "supervisor.engage=command"),
            "has SIM_STATE, as of the simulated boat, and supervisor.engage is command, as of a real one: set engage",
        ),
    ],
)
def test_mistakes_are_one_line_before_anything_is_done(learned: Path, order: tuple[str, ...], words: str) -> None:
    refused(call("learn", *order, cwd=learned), words)
    assert not (learned / "new").exists()
