"""`asvhil init`: a config of one's own boat by options or by questions, and its simulated twin."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from tests.support.command_line import call, refused

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
            "cat.yaml: key links: autopilot and anemometer are both on /dev/ttyAMA0",
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
