"""`asvhil init`: a config of one's own boat by options or by questions, and its simulated twin."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from tests.support.command_line import Said, call, refused

HULL = ("--length", "1.6", "--beam", "1", "--mass", "38", "--top-speed", "2", "--motors-apart", "0.84")
CAT = ("--port", "serial:/dev/ttyAMA0:921600", *HULL)


def test_options_alone_write_a_config_and_its_twin(tmp_path: Path) -> None:
    said = call("init", "mycat.yaml", *CAT, "--anemometer", "/dev/ttyUSB0:4800", "--json", "f.json", cwd=tmp_path)
    assert (said.status, said.err) == (0, "")
    own, twin = load_config(tmp_path / "mycat.yaml"), load_config(tmp_path / "mycat-sim.yaml")
    assert own.vehicle.name == twin.vehicle.name == "mycat"
    assert own.vehicle.vessel == twin.vehicle.vessel and own.vehicle.vessel.mass_kg == 38.0
    assert own.controller.name == "sd-mpc" and own.supervisor.engage == "command"
    assert own.links.anemometer is not None and own.links.anemometer.endpoint == "serial:/dev/ttyUSB0:4800"
    assert own.links.anemometer.firmware is None
    assert twin.supervisor.engage == "auto" and twin.plant.links.anemometer == "pty:anemometer"
    assert json.loads((tmp_path / "f.json").read_text())["files"] == ["mycat.yaml", "mycat-sim.yaml"]
    assert "asvhil learn mycat-sim.yaml" in said.out


@pytest.mark.parametrize("autopilot", ["ardurover", "px4"])
def test_a_boat_does_without_the_accelerometer_of_its_autopilot(tmp_path: Path, autopilot: str) -> None:
    """docs/results/estimator.md: a quarter of a degree of error in what it tells of roll and pitch is too much."""
    assert call("init", "mycat.yaml", *CAT, "--anemometer", "none", "--autopilot", autopilot, cwd=tmp_path).status == 0
    assert not load_config(tmp_path / "mycat.yaml").estimator.ekf.accelerometer


def test_every_key_of_the_hull_says_what_it_is(tmp_path: Path) -> None:
    assert call("init", "mycat.yaml", *CAT, cwd=tmp_path).status == 0
    text = (tmp_path / "mycat.yaml").read_text()
    section = text.partition("  vessel:\n")[2].partition("    thrust_curve:")[0]
    keys = [line for line in section.splitlines() if not line.lstrip().startswith("#")]
    assert len(keys) == 16 and all(" # " in line for line in keys)
    assert all(len(line) <= 120 for line in text.splitlines())
    assert "254" not in text and "240.5" not in text  # nothing of the WAM-V's


def test_units_and_other_boats(tmp_path: Path) -> None:
    order = ("--length", "160 cm", "--beam", "1 m", "--mass", "84 lb", "--top-speed", "4 kn", "--motors-apart", "840mm")
    more = ("--thrust", "3kgf", "--turn-rate", "45", "--autopilot", "px4", "--port", "udpin:0.0.0.0:14540")
    pulses = ("--pwm", "1000,1500,2000", "--anemometer", "serial:/dev/ttyACM0:115200", "--anemometer-kind", "arduino")
    assert call("init", "--name", "other", *order, *more, *pulses, cwd=tmp_path).status == 0
    own, twin = load_config(tmp_path / "other.yaml"), load_config(tmp_path / "other-sim.yaml")
    assert own.vehicle.vessel.mass_kg == pytest.approx(38.1, abs=0.01)
    assert own.vehicle.vessel.thrust_curve[-1] == (1.0, 29.42)
    assert own.links.autopilot.profile == "px4" and twin.plant.autopilot == "px4"
    assert own.links.anemometer is not None and own.links.anemometer.firmware == "arduino_anemometer"
    assert (own.vehicle.pwm.astern_us, own.vehicle.pwm.ahead_us) == (1000, 2000)


def test_a_lively_boat_gets_calmer_weights(tmp_path: Path) -> None:
    assert call("init", "cat.yaml", *CAT, cwd=tmp_path).status == 0
    assert call("init", "racer.yaml", *CAT, "--thrust", "80", cwd=tmp_path).status == 0
    slow, quick = (load_config(tmp_path / f"{name}.yaml").controller.mpc.near for name in ("cat", "racer"))
    assert slow.heading == quick.heading == 120.0 and slow.slew < quick.slew == 20.0


def test_a_person_is_asked_until_the_answer_is_good(tmp_path: Path) -> None:
    answers = ["My Boat", "mycat", "", "ttyAMA0", "/dev/ttyAMA0:921600", "", "1,6", "1.6", "1", "38", "2", "0.84"]
    typed = "\n".join([*answers, "?", "", ""]) + "\n"
    said = call("init", cwd=tmp_path, typed=typed)
    assert said.status == 0, said
    assert "name My Boat: lower case letters" in said.out
    assert "link 'ttyAMA0': unknown kind" in said.out
    assert "--length 1,6: a number in m is expected, with a point for decimals" in said.out
    assert load_config(tmp_path / "mycat.yaml").links.autopilot.endpoint == "serial:/dev/ttyAMA0:921600"


def questions(tmp_path: Path, *order: str, answers: list[str]) -> Said:
    said = call("init", "mycat.yaml", *order, cwd=tmp_path, typed="\n".join(answers) + "\n")
    assert said.status == 0, said
    return said


def test_a_figure_out_of_range_is_asked_for_again_at_once(tmp_path: Path) -> None:
    ports = ["", "/dev/ttyAMA0:921600", "/dev/ttyAMA0:4800", ""]
    hull = ["16", "1.6", "0", "1", "38000", "38", "40", "2", "20", "0.84", "1000", "?", "0.1", "?", ""]
    said = questions(tmp_path, answers=ports + hull)
    assert "--anemometer /dev/ttyAMA0:4800: the autopilot is on /dev/ttyAMA0 already" in said.out
    for words in (
        "length 16 m: 0.3 to 12 m is expected",
        "beam 0 m: 0.1 to 8 m is expected",
        "mass 38000 kg: 1 to 5000 kg is expected",
        "top speed 40 m/s: 0.2 to 15 m/s is expected",
        "distance of the motors 20 m: 0.05 to 8 m is expected",
        "turning rate 1000 deg/s: 2 to 360 deg/s is expected",
        "thrust 0.1 N: 1 to 5000 N is expected",
    ):
        assert said.out.count(words) == 1, words
    assert "Once more" not in said.out
    assert load_config(tmp_path / "mycat.yaml").vehicle.vessel.mass_kg == 38.0


def test_figures_that_do_not_go_together_are_asked_for_again_and_keep_the_rest(tmp_path: Path) -> None:
    first = ["", "1", "1.6", "38", "2", "0.84", "45", "", "1000,1500,2000"]
    mended = ["", "", "1.6", "1", "", "", "", "", "", ""]
    said = questions(tmp_path, "--port", "udpin:0.0.0.0:14540", answers=[*["px4"], *first, *mended])
    assert "beam 1.6 m is more than the length of 1 m: exchanged?" in said.out and said.out.count("Once more") == 1
    own = load_config(tmp_path / "mycat.yaml")
    assert own.links.autopilot.profile == "px4" and own.vehicle.pwm.ahead_us == 2000
    assert own.vehicle.vessel.mass_kg == 38.0 and own.vehicle.vessel.motor_arm_m == 0.42


def test_what_the_whole_config_refuses_is_asked_for_again_too(tmp_path: Path) -> None:
    operator = load_config("field").links.operator
    assert operator is not None
    said = questions(
        tmp_path, *HULL, answers=["", operator.endpoint, "", "", "", "", "", "udpin:0.0.0.0:14599", "", "", "", ""]
    )
    assert "both on" in said.out and said.out.count("Once more") == 1
    assert load_config(tmp_path / "mycat.yaml").links.autopilot.endpoint == "udpin:0.0.0.0:14599"


def test_options_that_are_wrong_are_refused_before_any_question(tmp_path: Path) -> None:
    for order, words in (
        (("--thrust", "0.1"), "thrust 0.1 N: 1 to 5000 N is expected"),
        (("--length", "1", "--beam", "1.6"), "beam 1.6 m is more than the length of 1 m"),
        (("--port", "udpin:0.0.0.0:1", "--anemometer", "udpin:0.0.0.0:1"), "the autopilot is on udp port 1 already"),
    ):
        refused(call("init", "mycat.yaml", *order, cwd=tmp_path, typed=""), words)


def test_nothing_is_asked_where_all_is_given_and_nothing_is_overwritten(tmp_path: Path) -> None:
    assert call("init", "mycat.yaml", *CAT, cwd=tmp_path, typed="").status == 0
    before = (tmp_path / "mycat.yaml").read_bytes()
    heavier = [*CAT, "--mass", "50"]
    for order in (("init", "mycat.yaml", *heavier), ("init", "mycat.yaml")):
        refused(call(*order, cwd=tmp_path, typed=""), "mycat.yaml is there already: another name, or --force")
    (tmp_path / "mycat.yaml").unlink()
    refused(call("init", "mycat.yaml", *CAT, cwd=tmp_path), "mycat-sim.yaml is there already")
    assert not (tmp_path / "mycat.yaml").exists()
    assert call("init", "mycat.yaml", *heavier, "--force", cwd=tmp_path).status == 0
    assert (tmp_path / "mycat.yaml").read_bytes() != before


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (
            ("mycat.yaml",),
            "without a terminal to ask at, --port, --length, --beam, --mass, --top-speed, --motors-apart",
        ),
        ((*CAT,), "without a terminal to ask at, FILE.yaml must be given"),
        (("mycat.txt", *CAT), "mycat.txt: a config file ends in .yaml"),
        (("wamv16.yaml", *CAT), "name wamv16: a config of this name is shipped"),
        (("My.yaml", *CAT), "name My: lower case letters"),
        (("nowhere/cat.yaml", *CAT), "nowhere/cat.yaml: cannot be written (No such file or directory)"),
        (("cat.yaml", *CAT, "--autopilot", "pixhawk"), "--autopilot pixhawk: ardurover or px4 is expected"),
        (("cat.yaml", *CAT, "--port", "com3"), "link 'com3': unknown kind 'com3'"),
        (("cat.yaml", *CAT, "--mass", "heavy"), "--mass heavy: a number in kg is expected"),
        (("cat.yaml", *CAT, "--mass", "38 N"), "--mass 38 N: the unit N is none of kg, g, t, lb"),
        (("cat.yaml", *CAT, "--mass", "nan"), "--mass nan: a number in kg is expected"),
        (("cat.yaml", *CAT, "--length", "16"), "length 16 m: 0.3 to 12 m is expected"),
        (("cat.yaml", *CAT, "--beam", "3"), "beam 3 m is more than the length of 1.6 m: exchanged?"),
        (("cat.yaml", *CAT, "--pwm", "1900,1500,1100"), "--pwm 1900,1500,1100: rising within 500 to 2500 us"),
        (("cat.yaml", *CAT, "--pwm", "1100"), "--pwm 1100: three pulse widths in us are expected"),
        (
            ("cat.yaml", *CAT, "--anemometer", "/dev/ttyAMA0:4800"),
            "--anemometer /dev/ttyAMA0:4800: the autopilot is on /dev/ttyAMA0 already",
        ),
        (("cat.yaml", *CAT, "--anemometer-kind", "vane"), "--anemometer-kind vane: nmea or arduino is expected"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(tmp_path: Path, order: tuple[str, ...], words: str) -> None:
    refused(call("init", *order, cwd=tmp_path), words)
    assert not list(tmp_path.iterdir())


def test_an_odd_thrust_is_told_and_taken(tmp_path: Path) -> None:
    said = call("init", "cat.yaml", *CAT, "--thrust", "3", cwd=tmp_path)
    assert said.status == 0 and "thrust 3 N of a motor is unusual for 38 kg at 2 m/s" in said.err


def test_the_twin_keeps_its_station_by_the_guess(tmp_path: Path) -> None:
    assert call("init", "mycat.yaml", *CAT, cwd=tmp_path).status == 0
    order = ("sitl", "mycat-sim.yaml", "--lockstep", "--duration", "40", "--no-picture", "--log", "a.mcap")
    assert call(*order, "--json", "f.json", cwd=tmp_path).status == 0
    figures = json.loads((tmp_path / "f.json").read_text())
    assert figures["phases"]["hold"] > 35.0 and figures["measured"]["distance_m"]["mean"] < 1.0
