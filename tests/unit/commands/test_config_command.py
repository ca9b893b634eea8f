"""`asvhil config show|check|docs|schema`."""

import json
from pathlib import Path

import pytest

from asvhil.config import Config
from asvhil.config.key_docs import key_lines, keys_about
from asvhil.config.reference import reference
from asvhil.config.yaml_text import parse_yaml
from asvhil.errors import ConfigError
from tests.support.command_line import call, refused

LAZY = 'base: field.yaml\nlinks:\n  autopilot: {endpoint: "udpin:0.0.0.0:14550"}\n'


def test_show_tells_where_each_key_is_set(tmp_path: Path) -> None:
    (tmp_path / "lazy.yaml").write_text(LAZY)
    said = call("config", "show", "lazy.yaml", "--set", "vehicle.pwm.ahead_us=1950", "--json", "all.json", cwd=tmp_path)
    assert said.status == 0
    lines = said.out.splitlines()
    assert '    endpoint: "udpin:0.0.0.0:14550"   # line 3' in lines
    assert '  name: "wamv16"   # line 3 of wamv16.yaml' in lines
    assert "    ahead_us: 1950   # --set vehicle.pwm.ahead_us=1950" in lines
    assert "    slew_us_per_s: 8000.0" in lines  # a default
    tree = json.loads((tmp_path / "all.json").read_text())
    assert parse_yaml(said.out, "").tree == tree and tree["vehicle"]["pwm"]["ahead_us"] == 1950


def test_show_of_a_part_and_of_what_is_set(tmp_path: Path) -> None:
    assert call("config", "show", "sitl", "plant.weather.wind.speed_mps", cwd=tmp_path).out == "3.0   # line 36\n"
    set_ = call("config", "show", "sitl", "--set-only", cwd=tmp_path).out
    tree = parse_yaml(set_, "").tree
    assert tree["plant"]["seed"] == 1 and "daemon" not in tree and "monitor" not in tree["estimator"]
    refused(
        call("config", "show", "sitl", "plant.wether", cwd=tmp_path), "plant.wether: no such key, did you mean weather?"
    )


def test_check_says_whose_hull_and_model_are_in_use(tmp_path: Path) -> None:
    (tmp_path / "lazy.yaml").write_text(LAZY)
    said = call("config", "check", "lazy.yaml", "--json", "f.json", cwd=tmp_path)
    assert said.status == 0
    assert "hull: warn: wamv16: 254.5 kg, arm 1.027 m" in said.out and "that of the shipped wamv16.yaml" in said.out
    assert "model: pass: wamv16-lagnet.npz" in said.out and "mind the warning" in said.out
    assert json.loads((tmp_path / "f.json").read_text())["result"] == "warn"
    right = call("config", "check", "blueboat", cwd=tmp_path)
    assert right.status == 0 and "blueboat: right" in right.out and "hull: pass: blueboat: 20 kg" in right.out
    wrong = call("config", "check", "field", "--set", "controller.model=none.npz", cwd=tmp_path)
    assert wrong.status == 1 and "none.npz: no such model file" in wrong.out and "cannot be run" in wrong.out


def test_a_borrowed_hull_is_told_by_run_before_anything_else(tmp_path: Path) -> None:
    (tmp_path / "lazy.yaml").write_text(LAZY.replace("14550", "0"))
    order = ("run", "lazy.yaml", "--duration", "0.2", "--log", "l.mcap", "--no-guardian")
    said = call(
        *order, "--set", "links.anemometer=null", "--set", "links.operator.endpoint=udpin:127.0.0.1:0", cwd=tmp_path
    )
    assert "asvhil: warning: lazy.yaml: the hull is that of the shipped wamv16.yaml (254.5 kg" in said.err


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("supervisor.max_distance_m", "number > 0, ≤ 2000; m, default 100. A station farther"),
        ("sources.wind.0.timeout_s", "number > 0; s, default 1."),
        ("links.ground_stations.tablet.endpoint", "text, required"),
        ("controller.name", "nnsem-mpc, lagnet-mpc"),
        ("vehicle.vessel.mass_kg", "number > 0; kg"),
    ],
)
def test_docs_of_a_key(key: str, words: str) -> None:
    ((name, text),) = key_lines(key)
    assert name == key and words in text


def test_docs_of_a_section_begin_with_what_it_is(tmp_path: Path) -> None:
    lines = key_lines("vehicle.pwm")
    assert lines[0] == ("", lines[0][1]) and "motor command" in lines[0][1]
    assert [name for name, _ in lines[1:]][:2] == ["port", "starboard"]
    assert call("config", "docs", "vehicle.pwm", cwd=tmp_path).out.splitlines()[0] == lines[0][1]
    assert len(key_lines()) == len(Config.model_fields)


def test_every_key_of_the_reference_has_docs() -> None:
    rows = [line for line in reference().splitlines() if line.startswith("| `")]
    assert len(keys_about("")) >= len(rows) > 300


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("supervisor.geofnce", "did you mean supervisor.geofence?"),
        ("vehicle.mass", "vehicle has name, vessel, pwm"),
        ("plant.seed.more", "plant.seed is a value"),
    ],
)
def test_docs_of_a_key_that_is_none(key: str, words: str) -> None:
    with pytest.raises(ConfigError) as error:
        key_lines(key)
    assert words in str(error.value)


def test_keys_are_found_by_a_word(tmp_path: Path) -> None:
    said = call("config", "docs", "--about", "geofence", cwd=tmp_path)
    assert "supervisor.geofence: " in said.out and "controller.manoeuvres.geofence_radius_m: " in said.out
    refused(call("config", "docs", "--about", "zeppelin", cwd=tmp_path), "--about zeppelin: no key has this word")
    refused(call("config", "docs", "plant", "--about", "wind", cwd=tmp_path), "give a key or --about, not both")


def test_the_schema_goes_to_a_file_or_out(tmp_path: Path) -> None:
    said = call("config", "schema", "-o", "asvhil.json", cwd=tmp_path)
    assert said.status == 0 and "yaml-language-server: $schema=asvhil.json" in said.out
    assert json.loads(call("config", "schema", cwd=tmp_path).out) == json.loads((tmp_path / "asvhil.json").read_text())
    refused(call("config", "schema", "-o", "no/where.json", cwd=tmp_path), "no/where.json: cannot be written")
