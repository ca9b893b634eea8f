"""Faults as they are given at the command line."""

from __future__ import annotations

import pytest

from asvhil.config import FaultConfig, load_config
from asvhil.config.fault_text import parse_fault, with_faults
from asvhil.config.plant_faults import DEFAULT_SIZE, SIZE_UNITS
from asvhil.errors import ConfigError
from asvhil.links.clock import Clock
from asvhil.preflight.computer import simulation_checks
from asvhil.simplant.hil.plant import HilPlant
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.server import PlantServer
from asvhil.study.trials.trial import run_key


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("gnss-jump@60:5s:20m", FaultConfig(kind="gnss-jump", from_s=60.0, until_s=65.0, size=20.0)),
        ("gnss-jump@60:20m:5s", FaultConfig(kind="gnss-jump", from_s=60.0, until_s=65.0, size=20.0)),
        ("heading-jump@1.5s:-30deg", FaultConfig(kind="heading-jump", from_s=1.5, size=-30.0)),
        ("port-motor-weak@10:0.5", FaultConfig(kind="port-motor-weak", from_s=10.0, size=0.5)),
        ("heading-drift@3:2deg/s", FaultConfig(kind="heading-drift", from_s=3.0, size=2.0)),
        ("heading-drift@3:2deg", FaultConfig(kind="heading-drift", from_s=3.0, size=2.0)),
        ("battery@3:10.5V", FaultConfig(kind="battery", from_s=3.0, size=10.5)),
        ("battery@3:10.5", FaultConfig(kind="battery", from_s=3.0, size=10.5)),
        ("motors-swapped@0", FaultConfig(kind="motors-swapped")),
    ],
)
def test_what_is_understood(text: str, fault: FaultConfig) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gps-jump@60", r"unknown kind 'gps-jump' \(did you mean gnss-jump\?\)"),
        ("fire@60", r"unknown kind 'fire' \(known: port-motor, "),
        ("gnss-jump", r"KIND@FROM\[:DURATION\]\[:SIZE\], such as gnss-jump@60:5s:20m is expected"),
        ("gnss-jump@", "is expected"),
        ("gnss-jump@60m", "the begin is in seconds"),
        ("gnss-jump@60:5s:6s", "a duration ends in s"),
        ("gnss-jump@60:5s:6m:7", "is expected"),
        ("gnss-jump@60:0s", "a duration above 0 s is expected, not 0"),
        ("gnss-jump@-1", "a begin of 0 s or more is expected, not -1"),
        ("gnss-silent@60:5m", "have a size, gnss-silent has none"),
        ("port-motor-weak@60:7", "a share of the thrust, between 0 and 1"),
        ("battery@60:0V", "a voltage above 0 and below 65.5 V"),
        ("battery@60:-1", "a voltage above 0 and below 65.5 V"),
        ("battery@60:70V", "a voltage above 0 and below 65.5 V"),
        ("gnss-jump@5:20deg", "the size of gnss-jump is in m, not 20deg"),
        ("heading-jump@3:20m", "the size of heading-jump is in deg, not 20m"),
        ("compass-turned@3:20deg/s", "the size of compass-turned is in deg, not 20deg/s"),
        ("heading-drift@3:5s:20V", "the size of heading-drift is in deg/s or deg, not 20V"),
        ("battery@3:20deg", "the size of battery is in V, not 20deg"),
        ("port-motor-weak@3:0.5V", "the size of port-motor-weak is a share, which has no unit, not 0.5V"),
    ],
)
def test_what_is_not_is_told_in_one_line(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=f"^--fault {text.replace('[', '.')}: .*{words}") as caught:
        parse_fault(text)
    assert "\n" not in str(caught.value)


def test_each_kind_with_a_size_says_its_unit() -> None:
    assert SIZE_UNITS.keys() == DEFAULT_SIZE.keys()


@pytest.mark.parametrize("text", ["gnss-jump@500:5s:20m", "gnss-jump@8"])
def test_one_that_begins_when_the_run_has_ended_is_refused(text: str) -> None:
    config = load_config("sitl")
    with pytest.raises(ConfigError, match=rf"^--fault {text}: begins at \d+ s, and the run ends at 8 s; "):
        with_faults(config, ["cups@5", text], 8.0)
    assert len(with_faults(config, ["cups@5", "gnss-jump@7.9"], 8.0).plant.faults) == 2
    assert with_faults(config, [text]).plant.faults  # until it is interrupted


def test_they_are_added_to_those_of_the_config() -> None:
    config = load_config("sitl", ("plant.faults=[{kind: vane}]",))
    kinds = [fault.kind for fault in with_faults(config, ["cups@5", "gnss-silent@9:2s"]).plant.faults]
    assert kinds == ["vane", "cups", "gnss-silent"]
    assert with_faults(config, []) is config


@pytest.mark.parametrize("text", ["nmea@5:10s", "ins@5", "ins-gnss@5:10s"])
def test_a_fault_of_a_device_that_the_boat_has_not_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=rf"^--fault {text}: .* this boat has autopilot alone \(links\.(ins|gnss) "):
        with_faults(load_config("sitl"), [text])


def test_a_fault_of_a_device_that_the_boat_has_is_taken() -> None:
    assert with_faults(load_config("sitl-vn300"), ["ins@5", "ins-gnss@5:10s"]).plant.faults[1].kind == "ins-gnss"
    assert with_faults(load_config("sitl-bream"), ["nmea@5"]).plant.faults[0].kind == "nmea"


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("plant.faults=[{kind: ins}]", "plant.faults: ins is a fault of the device ins"),
        ("plant.faults=[{kind: gnss-jump, device: nmea}]", "plant.faults: gnss-jump is a fault of the device nmea"),
        ("plant.glitches={kinds: [{kind: ins-gnss}]}", "plant.glitches: ins-gnss is a fault of the device ins"),
        ("plant.glitches={device: nmea}", "plant.glitches: gnss-jump is a fault of the device nmea"),
    ],
)
def test_the_same_holds_for_the_faults_of_a_config_where_its_boat_is_built(keys: str, words: str) -> None:
    config = load_config("sitl", (keys,))  # of a real boat: its daemon has no use for them
    with pytest.raises(ConfigError, match=words):
        config.check_faults()
    with pytest.raises(ConfigError, match=words):
        Lockstep(config)
    with pytest.raises(ConfigError, match=words):
        PlantServer(config, Clock())
    with pytest.raises(ConfigError, match=words):
        HilPlant(config, 0.01, sample_each_step=True)
    with pytest.raises(ConfigError, match=words):
        run_key(config)
    (told,) = simulation_checks(config)
    assert words in told.found and told.result == "warn"
