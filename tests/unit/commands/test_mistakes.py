"""Mistakes at the command line and in configs: one clear line, a status other than 0, and nothing left behind."""

from pathlib import Path

import pytest

from tests.support.command_line import call, refused

SITL = ("sitl", "mine.yaml", "--lockstep", "--duration", "1", "--no-picture", "--log", "never.mcap")
OTHER = "links.operator.endpoint=udpin:127.0.0.1:9"

WORDS = [
    (("sail",), "no such command 'sail'. Did you mean 'sitl'?"),
    (("hld",), "no such command 'hld'. Did you mean 'hold'?"),
    (("config", "shw"), "no such command 'shw'. Did you mean 'show'?"),
    (("sitl", "--windd", "3@0"), "no such option: --windd (Possible options: --wind)"),
    (("run",), "missing argument 'config'; `asvhil run -h` tells what it takes"),
    (("hold", "40.4,-86.9"), "got unexpected extra argument(s) (40.4,-86.9)"),
    (("sitl", "--duration"), "option '--duration' requires an argument"),
    (("sitl", "--duration", "long"), "invalid value for '--duration'"),
    (("sitl", "--duration", "0"), "invalid value for '--duration'"),
    (("sitl", "--duration", "nan"), "invalid value for '--duration'"),
    (("sitl", "--seed", "1.5"), "invalid value for '--seed'"),
    (("sitl", "--seed", "-1"), "invalid value for '--seed'"),
    (("run", "nowhere.yaml"), "nowhere.yaml: no such config file"),
    (("run", "feild"), "feild: no such config file; did you mean field?"),
    (("run", "mine"), "mine: no such config file; did you mean mine.yaml?"),
    (("run", "qx"), "qx: no such config file; shipped ones are"),
    (("campaign", "windz"), "windz: no such campaign file; did you mean winds?"),
    (("campaign", "qx"), "qx: no such campaign file; shipped ones are controllers, controllers-bream, effort, winds"),
    (("train", "sd", "a.csv", "-o", "m.npz", "--vehicle", "b", "--columns", "bluboat"), "did you mean blueboat?"),
    (
        (*SITL[:1], "sitl", *SITL[2:], "--set", "controller={name: lagnet-mpc, model: wamv16-lagnt}"),
        "wamv16-lagnt: no such model file (controller.model; lagnet-mpc needs one); did you mean wamv16-lagnet?",
    ),
    (("calibrate", "x.mcap", "--base", "feild", "-o", "b.yaml"), "and none shipped; did you mean field.yaml?"),
    (("hold", "--policy", "fre"), "--policy fre: unknown, did you mean free? (known: "),
    (("tune", "loitr", "-o", "t"), "NAME loitr: unknown, did you mean loiter? (known: "),
    (("study", "six-tests", "--solver", "iopt"), "--solver iopt: unknown, did you mean ipopt? (known: "),
    (("train", "nnsm", "empty.mcap", "-o", "m.npz"), "unknown model kind 'nnsm', did you mean nnsem? (known: "),
    (("run", "sitl", "--set", "plant.sead=1"), "did you mean seed?"),
    (("run", "sitl", "--set", "plant.seed"), "KEY=VALUE is expected"),
    (("run", "sitl", "--set", "plant.seed=one"), "plant.seed"),
    (("run", "sitl", "--set", "foo=1"), "foo"),
    (("run", "sitl", "--set", "controller.name=sd-mcp"), "controller.name"),
    (("run", "sitl", "--set", "links.operator.endpoint=udp:1"), "links.operator.endpoint"),
    (("run", "sitl", "--set", "plant.seed.more=1"), "plant.seed.more"),
    (("run", "sitl", "--log", "no/such/folder/log.mcap", "--duration", "1"), "log.mcap"),
    (("sitl", "--wind", "fast"), "SPEED@DEG is expected"),
    (("sitl", "--wind", "3 m/s"), "SPEED@DEG is expected"),
    (("sitl", "--wind", "nan@0"), "SPEED@DEG is expected"),
    (("sitl", "--controller", "pid"), "key controller.name"),
    (("sitl", "--fault", "gnss-jmp@60"), "gnss-j"),
    (("sitl", "--fault", "gnss-jump"), "gnss-jump"),
    (("sitl", "--anemometer", "cups"), "simulated or firmware is expected"),
    (("sitl", "--arduino", "there"), "goes with --anemometer firmware only"),
    (("sitl", "--json", "no/f.json"), "--json no/f.json: cannot be written"),
    (("sitl", "field", "--lockstep"), "field: key supervisor.engage: a simulated boat needs auto"),
    (("sitl", "boat.yaml", "--lockstep"), "the simulated twin of this boat is boat-sim.yaml"),
    (("collect", "boat.yaml"), "the simulated twin of this boat is boat-sim.yaml; for the real boat: --vehicle"),
    (("hold", "--at", "here"), "LAT,LON in degrees is expected"),
    (("hold", "--at", "91,0"), "--at 91,0: a latitude of -90 to 90 degrees is expected, not 91"),
    (("hold", "--at", "40.4,-286"), "--at 40.4,-286: a longitude of -180 to 180 degrees is expected, not -286"),
    (("hold", "--drift", "-1@0"), "--drift -1@0: a speed of 0 m/s or more is expected, not -1"),
    (("hold", "--drift", "0.5"), "--drift 0.5: SPEED@DEG is expected"),
    (("sitl", "--wind", "-3@0"), "--wind -3@0: a speed of 0 to 100 m/s is expected, not -3"),
    (("sitl", "--wind", "500@0"), "--wind 500@0: a speed of 0 to 100 m/s is expected, not 500"),
    (("sitl", "--fault", "gnss-jump@-5"), "--fault gnss-jump@-5: a begin of 0 s or more is expected, not -5"),
    (("sitl", "--duration", "8", "--fault", "gnss-jump@500:5s:20m"), "begins at 500 s, and the run ends at 8 s"),
    (("plant", "--duration", "8", "--fault", "gnss-jump@500:5s:20m"), "begins at 500 s, and the run ends at 8 s"),
    (("sitl", "--fault", "gnss-jump@5:20deg"), "--fault gnss-jump@5:20deg: the size of gnss-jump is in m, not 20deg"),
    (("sitl", "--fault", "gnss-jump@5:0s"), "--fault gnss-jump@5:0s: a duration above 0 s is expected, not 0"),
    (("hold", "--at", "40,4237,-86,9212"), "with points for decimals"),
    (("hold", "--at", "40.4S,86.9N"), "LAT,LON in degrees is expected"),
    (("hold", "--heading", "inf"), "--heading inf: a finite number is expected"),
    (("hold", "--within", "-5"), "invalid value for '--within'"),
    (("hold", "--set", OTHER), "no answer; is `asvhil run` up"),
    (("release", "--set", "links.operator.endpoint=udpout:127.0.0.1:9"), "the daemon does not listen there"),
    (("status", "--set", OTHER), "no answer; is `asvhil run` up"),
    (
        ("dashboard", "--config", "sitl", "--host", "no-such-host.invalid"),
        "cannot listen there (the name does not resolve)",
    ),
    (("dashboard", "--config", "sitl", "--host", "a" * 70), "cannot listen there (the name does not resolve)"),
    (("check", "sitl", "--fix"), "--fix needs a terminal to confirm; use --yes"),
    (("check", "sitl", "--yes"), "--yes goes with --fix"),
    (("collect", "--realtime", "--vehicle"), "--realtime is the simulated boat, --vehicle the real one"),
    (("collect", "field"), "supervisor.engage"),
    (("collect", "sitl", "--vehicle", "--wind", "3@0"), "nobody makes the wind for a real vehicle"),
    (("replay",), "give either an MCAP log or --tlog FILE"),
    (("replay", "x.mcap", "--config", "mine.yaml"), "--config goes with --tlog only; an MCAP log is replayed with the"),
    (
        ("replay", "--tlog", "x.tlog", "--picture", "x.png"),
        "--picture goes with an MCAP log of asvhil, not with --tlog",
    ),
    (("replay", "--tlog", "x.tlog", "--plugin", "x.py"), "--plugin goes with an MCAP log of asvhil, not with --tlog"),
    (("replay", "--tlog", "x.tlog", "--json", "no/x.json"), "--json no/x.json: cannot be written"),
    (
        ("report", "x.mcap", "--picture", "q.png", "--json", "q.png"),
        "--json q.png: is the file of --picture too; give another name",
    ),
    (("report", "x.mcap", "--html", "x.html", "--json", "./x.html"), "x.html: is the file of --html too"),
    (("report", "x.mcap", "--html", "x.html", "--picture", "x-track.png"), "x-track.png: is a name of the page's own"),
    (
        ("train", "sd", "x.mcap", "-o", "m.npz", "--json", "m.curve.png"),
        "is the picture of --output; give another",
    ),
    (("replay", "nowhere.mcap"), "nowhere.mcap: cannot be read"),
    (("report", "nowhere.mcap"), "nowhere.mcap: cannot be read"),
    (("report", "mine.yaml"), "mine.yaml: not a log"),
    (("report", "empty.mcap"), "empty.mcap"),
    (("log", "info", "nowhere.mcap"), "nowhere.mcap: cannot be read"),
    (("calibrate", "nowhere.mcap"), "nowhere.mcap: cannot be read"),
    (("plant", "--ardupilot-json", "--px4-hil"), "give --ardupilot-json or --px4-hil, not both"),
    (("plant", "--endpoint", "udpin:0.0.0.0:1"), "--endpoint goes with"),
    (("evaluate", "none.npz", "--data", "empty.mcap"), "none.npz: cannot be read"),
    (("evaluate", "mine.yaml", "--data", "empty.mcap"), "mine.yaml: not a model file"),
    (("train", "sd", "nowhere.mcap", "-o", "m.npz"), "nowhere.mcap: cannot be read"),
    (("train", "sd", "nofile", "-o", "m.npz"), "MCAP logs or CSV files are expected"),
    (("config", "show", "mine.yaml", "plant.sede"), "did you mean seed?"),
]

YAML = [
    ("vehicel: {name: cat}", "unknown key, did you mean vehicle?"),
    ("base: sitl.yaml\nlinks: {autopilot: {enpoint: x}}", "did you mean endpoint?"),
    ("links: {}", "vehicle"),
    ("base: sitl.yaml\nlinks: {}\nlinks: {}", "key links: given twice, in line 2 and again in line 3"),
    ("base: stil.yaml", "key base: no such file stil.yaml beside it, and none shipped; did you mean sitl.yaml?"),
    ("base: bota.yaml", "key base: no such file bota.yaml beside it, and none shipped; did you mean boat.yaml?"),
    ("base: mine.yaml", "runs in a circle"),
    ("base: [sitl.yaml]", "the name of a config file is expected"),
    ("base: sitl.yaml\nplant:\n\tseed: 1", "a tab, where YAML takes spaces alone"),
    ("base: sitl.yaml\nplant: {seed: 1", "not valid YAML"),
    ("base: sitl.yaml\nplant: {seed: 1,5}", "plant"),
    ("base: sitl.yaml\nplant: {origin_lat_deg: '40.4'}", "plant.origin_lat_deg"),
    ("base: sitl.yaml\nplant: {origin_lat_deg: 140.4}", "plant.origin_lat_deg"),
    ("base: sitl.yaml\nvehicle: {vessel: {mass_kg: -38}}", "vehicle.vessel.mass_kg"),
    ("base: sitl.yaml\nvehicle: {vessel: {mass_kg: .nan}}", "vehicle.vessel.mass_kg"),
    ("base: sitl.yaml\nvehicle: {vessel: {mass_kg: 38 kg}}", "a number is expected, not the text '38 kg'"),
    ("base: sitl.yaml\nvehicle: {vessel: {thrust_curve: [[0, 0]]}}", "thrust_curve"),
    ("base: sitl.yaml\nvehicle: {pwm: {astern_us: 1900, ahead_us: 1100}}", "astern_us < neutral_us < ahead_us"),
    ("base: sitl.yaml\nsupervisor: {engage: yes}", "supervisor.engage"),
    ("base: sitl.yaml\nsupervisor: {station: null}", "supervisor.station is needed"),
    ("base: sitl.yaml\nsupervisor: {geofence: [[40, -86]]}", "a geofence needs 3 corners"),
    ("base: sitl.yaml\nlinks: {autopilot: {endpoint: 'serial:/dev/ttyAMA0'}}", "a part is missing"),
    ("base: sitl.yaml\nlinks: {autopilot: {endpoint: 'com3'}}", "unknown kind 'com3'"),
    (
        "base: field.yaml\nlinks: {autopilot: {endpoint: 'serial:/dev/ttyACM0:57600'}}",
        "key links: autopilot and anemometer are both on /dev/ttyACM0",
    ),
    (
        "base: field.yaml\nlinks: {ground_stations: {tablet: {endpoint: 'udpin:0.0.0.0:14660'}}}",
        "operator and ground_stations.tablet are both on udp port 14660",
    ),
    ("base: sitl.yaml\nlinks: {autopilot: {profile: pixhawk}}", "links.autopilot.profile"),
    ("base: sitl.yaml\nlinks: {autopilot: {profile: px4, output: rc_override}}", "does not go with profile px4"),
    ("base: sitl.yaml\nsources: {wind: [mast]}", "a source is LINK.MESSAGE"),
    ("base: sitl.yaml\nsources: {position: [gnss.RMC]}", "sources.position"),
    ("base: sitl.yaml\ncontroller: {name: nnsem-mpc, model: none.npz}", "none.npz: no such model file"),
    (
        "base: sitl.yaml\nvehicle: {name: mycat}",
        "mycat-lagnet: no such model file (controller.model; lagnet-mpc needs one)\n",
    ),
    ("base: sitl.yaml\nvehicle: {vessel: {mass_kg: 38}}", "was trained on another boat than vehicle.vessel"),
    ("base: sitl.yaml\nplugins: [nowhere.py]", "nowhere.py"),
    ("- just\n- a list", "a mapping of keys is expected at the top level"),
    ("", "vehicle"),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine.yaml").write_text("base: sitl.yaml\n")
    (tmp_path / "boat.yaml").write_text("base: field.yaml\n")
    (tmp_path / "boat-sim.yaml").write_text("base: sitl.yaml\n")
    (tmp_path / "empty.mcap").write_bytes(b"")
    (tmp_path / "a.csv").write_bytes(b"")
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() if path.is_file() else b"" for path in folder.iterdir()}


def test_there_are_sixty_and_more() -> None:
    assert len(WORDS) + len(YAML) >= 60


@pytest.mark.parametrize(
    ("order", "words"), WORDS, ids=lambda value: " ".join(value) if isinstance(value, tuple) else ""
)
def test_of_words(folder: Path, order: tuple[str, ...], words: str) -> None:
    before = contents(folder)
    refused(call(*order, cwd=folder), words)
    assert contents(folder) == before


@pytest.mark.parametrize(("text", "words"), YAML)
def test_in_a_config(folder: Path, text: str, words: str) -> None:
    (folder / "mine.yaml").write_text(text)
    before = contents(folder)
    refused(call(*SITL, cwd=folder), words)
    assert contents(folder) == before


@pytest.mark.parametrize("data", ["base: sitl\xe4".encode("latin-1"), b"\x00\x01\x02", "base: sitl".encode("utf-16")])
def test_in_what_is_no_text(folder: Path, data: bytes) -> None:
    (folder / "mine.yaml").write_bytes(data)
    refused(call(*SITL, cwd=folder), "mine.yaml: ")


@pytest.mark.parametrize(("name", "told"), [("boat.yaml", True), ("boat-sim.yaml", False)])
def test_to_simulate_the_boat_in_place_of_its_twin_is_told(folder: Path, name: str, told: bool) -> None:
    said = call("plant", name, "--duration", "0.1", "--quiet", cwd=folder)
    assert said.status == 0
    assert ("warning: boat.yaml: " in said.err and "twin of this boat is boat-sim.yaml" in said.err) == told, said
    assert told or said.err == ""


def test_help_is_short_and_long_and_no_error(folder: Path) -> None:
    for order in (("-h",), ("--help",), ("sitl", "-h"), ("config", "-h"), ("config", "show", "-h")):
        said = call(*order, cwd=folder)
        assert said.status == 0 and "Usage: asvhil" in said.out and "<bool>" not in said.out, order


def test_a_question_that_is_not_answered_does_nothing(folder: Path) -> None:
    said = call("init", "cat.yaml", cwd=folder, typed="")
    assert said.status == 130 and said.err.endswith("asvhil: interrupted at a question: nothing was done\n")
    assert not (folder / "cat.yaml").exists()


def test_a_shell_completes_configs_and_commands(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def completed(words: str) -> list[str]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("_ASVHIL_COMPLETE", "complete_bash")
            patch.setenv("COMP_WORDS", words)
            patch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))
            return call(cwd=folder).out.split()

    assert completed("asvhil rel") == ["release"]
    assert completed("asvhil run si") == [
        *("sitl", "sitl-blueboat", "sitl-bream", "sitl-bream-paper"),
        *("sitl-paper", "sitl-px4", "sitl-second", "sitl-vn300", "sitl-vn300-paper"),
    ]
    assert completed("asvhil run mi") == ["mine.yaml"]
    assert "--lockstep" in completed("asvhil sitl --lo")
