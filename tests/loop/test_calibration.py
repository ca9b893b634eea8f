"""`asvhil calibrate` on turns of the simulated BREAM: what was put in comes out, and a straight run is refused."""

import json
import shutil
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from asvhil.backseat.build import model_file
from asvhil.collect import collect
from asvhil.commands.cli import app, main
from asvhil.config import load_config
from asvhil.config.mean_wind import parse_wind
from asvhil.errors import AsvhilError
from asvhil.logs.opening import open_recorder
from asvhil.preflight.calibration import VaneFit, calibrate, vane_of
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep
from tests.support.command_line import call

# Bias of the simulated compass (A) and its B to E: as config/bream.yaml has them.
DEVIATION_DEG = (3.0, 4.0, 3.5, 1.0, 0.5)
TURNED_DEG = -15.0


@pytest.fixture(scope="module")
def turns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("turns") / "turns.mcap"
    config = load_config("sitl-bream", (f"plant.sensors.anemometer.misalignment_deg={TURNED_DEG}",))
    (run,) = collect(config, "lockstep", 300.0, [parse_wind("3@90")], path, "")
    assert run.complete
    return path


@pytest.mark.thorough
def test_the_deviation_of_the_compass_and_the_turn_of_the_vane_are_found(turns: Path, tmp_path: Path) -> None:
    written, figures = tmp_path / "boat.yaml", tmp_path / "figures.json"
    (tmp_path / "base.yaml").write_text(json.dumps(load_config("sitl-bream").model_dump(mode="json")))
    arguments = ["calibrate", str(turns), "-o", str(written), "--base", "base.yaml", "--json", str(figures)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads(figures.read_text())
    compass, vane = found["compass"], found["vane"]
    assert compass["sectors"] == 12 and not found["missing"]
    errors = [abs(a - b) for a, b in zip(compass["deviation_deg"], DEVIATION_DEG, strict=True)]
    assert errors[0] < 1.5 and max(errors[1:]) < 0.8
    assert all(error < 4.0 * std for error, std in zip(errors, compass["std_deg"], strict=True))
    assert vane["offset_deg"] == pytest.approx(TURNED_DEG, abs=5.0)
    # The keys that it writes make a config.
    config, keys = load_config(written), yaml.safe_load(written.read_text())["estimator"]
    assert list(config.estimator.ekf.compass.deviation_deg) == keys["ekf"]["compass"]["deviation_deg"]
    assert keys["ekf"]["compass"]["deviation_deg"] == pytest.approx(compass["deviation_deg"], abs=0.006)
    assert config.estimator.wind.vane_offset_deg == keys["wind"]["vane_offset_deg"]
    assert keys["wind"]["vane_offset_deg"] == pytest.approx(vane["offset_deg"], abs=0.06)


@pytest.mark.parametrize(
    ("output", "base", "words"),
    [
        ("boat.yaml", "boat.yaml", "boat.yaml: is the file of --base too; give another name"),
        ("new.yaml", "nosuch.yaml", "--base nosuch.yaml: no such config file"),
    ],
)
def test_the_config_of_the_boat_is_not_overwritten_and_its_base_must_be_there(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    output: str,
    base: str,
    words: str,
) -> None:
    """Told before the log is read."""
    boat = tmp_path / "boat.yaml"
    boat.write_text("base: field.yaml\n")
    arguments = ["asvhil", "calibrate", str(tmp_path / "no.mcap"), "-o", str(tmp_path / output), "--base", base]
    monkeypatch.setattr("sys.argv", arguments)
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and words in lines[0]
    assert boat.read_text() == "base: field.yaml\n" and not (tmp_path / "new.yaml").exists()


def turned_on_the_spot(path: Path, *overrides: str) -> None:
    """A log in which the pilot turns the boat on the spot, more than once around, in a calm."""
    calm = ("supervisor.engage=command", "plant.weather.wind.speed_mps=0", *overrides)
    config = load_config("sitl-bream", calm)
    recorder = open_recorder(config, path, "lockstep", threaded=False)
    loop = Lockstep(config, recorder)
    loop.run(10.0)
    assert loop.plant.frontseat.arm(True)
    loop.plant.frontseat.set_sticks({1: 1700, 3: 1300})
    loop.run(60.0)
    recorder.close()


def test_a_compass_that_the_log_does_not_show_is_not_told_as_known(tmp_path: Path) -> None:
    turned_on_the_spot(tmp_path / "own.mcap")
    compass = calibrate(tmp_path / "own.mcap").compass
    assert compass is not None and max(compass.std_deg) < 3.0
    errors = [abs(a - b) for a, b in zip(compass.deviation_deg, DEVIATION_DEG, strict=True)]
    assert all(error < 3.0 * std for error, std in zip(errors, compass.std_deg, strict=True))
    # A velocity that rests on the compass itself teaches nothing of it.
    turned_on_the_spot(tmp_path / "fused.mcap", "sources.velocity=[autopilot.GLOBAL_POSITION_INT]")
    with pytest.raises(AsvhilError, match=r"compass: [A-E], .* known to \d+ degrees only; drive circles under way"):
        calibrate(tmp_path / "fused.mcap")


@pytest.mark.parametrize(
    ("offset_deg", "std_deg", "configured_deg", "words"),
    [
        (4.5, 3.3, 0.0, "vane: turned by 4.5 deg, standard deviation 3.3: not written, above 3; drive circles"),
        (40.0, 3.1, 0.0, "not written, above 3"),
        (2.8, 3.8, 0.0, "not written, above 3"),
        (-3.9, 2.0, 0.0, "vane: turned by -3.9 deg, standard deviation 2.0: not written, as it may be straight"),
        (0.4, 1.5, 12.0, "as it may be straight; remove estimator.wind.vane_offset_deg, which is 12"),
        (-4.1, 2.0, 0.0, ""),
        (12.9, 1.8, 12.0, ""),
    ],
)
def test_an_offset_of_the_vane_that_is_noise_is_not_written(
    offset_deg: float, std_deg: float, configured_deg: float, words: str
) -> None:
    found = VaneFit(offset_deg=offset_deg, std_deg=std_deg)
    fit, why = vane_of(found, configured_deg)
    assert (fit, why) == (found, "") if not words else fit is None and words in why and "\n" not in why
    assert configured_deg or "remove" not in why


@pytest.mark.parametrize("output", [("-o", "new.yaml"), ()], ids=["file", "terminal"])
def test_a_base_of_another_boat_is_refused(output: tuple[str, ...], tmp_path: Path) -> None:
    run_lockstep(load_config("sitl-bream"), tmp_path / "log.mcap", 2.0)
    (tmp_path / "mine.yaml").write_text("base: sitl.yaml\n")
    said = call("calibrate", "log.mcap", *output, "--base", "mine.yaml", cwd=tmp_path)
    assert said.status == 2 and said.err.count("\n") == 1
    assert "--base mine.yaml: of the boat wamv16, and log.mcap of the boat bream" in said.err
    own = call("calibrate", "log.mcap", *output, "--base", "sitl-bream", cwd=tmp_path)
    assert "headings seen" in own.err  # of the right boat, and the log has no turn


def test_a_log_without_a_turn_gives_no_calibration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # With a model whose file is gone by then: the log holds it.
    shipped = model_file(load_config("sitl-bream"))
    assert shipped is not None
    model = Path(shutil.copy(shipped, tmp_path / "model.npz"))
    config = load_config("sitl-bream", ("supervisor.engage=command", f"controller.model={model}"))
    run_lockstep(config, tmp_path / "log.mcap", 10.0)
    model.unlink()
    monkeypatch.setattr("sys.argv", ["asvhil", "calibrate", str(tmp_path / "log.mcap")])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and "headings seen; drive full circles, both ways" in lines[0]
