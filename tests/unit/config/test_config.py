"""Configs: the shipped ones load, mistakes are one line that names the file and the key."""

import json
from pathlib import Path

import pytest

from asvhil.config import Config, config_from_json, find_config, load_config
from asvhil.errors import ConfigError


@pytest.mark.parametrize("name", ["sitl", "field", "sitl.yaml"])
def test_shipped_configs_load(name: str) -> None:
    assert load_config(name).vehicle.name == "wamv16"


@pytest.mark.parametrize(
    ("name", "horizon_s", "solver", "radii_m", "heading_rule"),
    [
        ("sitl-paper", 4.0, "torch-lqr", (15.0, 20.0), False),
        ("sitl-bream-paper", 1.6, "torch-lqr", (15.0, 20.0), True),
        ("sitl-vn300-paper", 4.0, "ipopt", (10.0, 20.0), False),
    ],
)
def test_the_paper_s_settings_are_shipped(
    name: str, horizon_s: float, solver: str, radii_m: tuple[float, float], heading_rule: bool
) -> None:
    paper, own = load_config(name).controller, load_config(name.removesuffix("-paper")).controller
    mpc, procedure = paper.mpc, paper.procedure
    assert mpc.first_step_s == mpc.last_step_s and mpc.stages * mpc.last_step_s == pytest.approx(horizon_s)
    for weights in ("near", "along", "far", "position_only"):  # but for the slew weight they are this project's
        assert getattr(mpc, weights) == getattr(own.mpc, weights).model_copy(update={"slew": 0.001})
    assert (paper.name, paper.solver, paper.torch_lqr.iterations) == ("nnsem-mpc", solver, 2)
    assert not mpc.disturbance_feedforward and mpc.trim_max_rad == 0.0 and mpc.wind_feedforward
    assert procedure.enabled and (procedure.r_s_m, procedure.r_d_m) == radii_m
    assert procedure.r_h_rule == heading_rule and (not heading_rule or procedure.r_h_m == 10.0)


def test_one_key_of_a_section_leaves_the_section_s_other_defaults() -> None:
    """`along` and `near` are sections of one kind with defaults of their own."""
    before, after = (
        load_config("sitl").controller.mpc,
        load_config("sitl", ("controller.mpc.along.slew=2",)).controller.mpc,
    )
    assert after.along.slew == 2.0
    assert after.along == before.along.model_copy(update={"slew": 2.0})
    assert after.near == before.near


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("plant.sead=1", "key plant.sead: unknown key, did you mean seed?"),
        ("plant.seed=-1", "key plant.seed: a number of 0 or more is expected, not -1"),
        ("vehicle.vessel.mass_kg=-2", "key vehicle.vessel.mass_kg"),
        ("vehicle.vessel.mass_kg=.nan", "key vehicle.vessel.mass_kg"),
        ("daemon.tick_hz=12", "key daemon: tick_hz must be a whole multiple of control_hz"),
        ("vehicle.pwm={port: {output: 2}, starboard: {output: 2}}", "port.output and starboard.output must differ"),
        ("vehicle.pwm.port.astern_us=1900", "astern_us and ahead_us are set together, or neither"),
        ("vehicle.pwm.starboard.neutral_us=1900", "starboard: neutral_us must lie between astern_us and ahead_us"),
        ("supervisor.station=null", "supervisor.station is needed"),
        ("vehicle.vessel.thrust_curve=[[0, 1], [0, 2]]", "rising commands"),
        ("vehicle.name=[1]", "key vehicle.name"),
        ("plant.seed.deeper=1", "seed is a value, not a section"),
        ("links.autopilot.endpoint=udpim:127.0.0.1:1", "udpin:HOST:PORT"),
        ("plant.seed", "KEY=VALUE is expected"),
        ("plant.seed=[", "not valid YAML"),
    ],
)
def test_wrong_overrides_name_the_key(override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", (override,))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: [1", "not valid YAML at line"),
        ("- 1", "mapping of keys is expected at the top level, not list"),
        ("base: nowhere.yaml", "key base: no such file nowhere.yaml"),
        ("base: [1]", "key base: the name of a config file"),
        ("base: self.yaml", "runs in a circle"),
        ("", "this key is required"),
        ("\x00", "not valid YAML"),
    ],
)
def test_wrong_files_name_the_file(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "self.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(path) in str(caught.value) and words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_binary_and_missing_files(tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(ConfigError, match="not UTF-8 text"):
        load_config(path)
    with pytest.raises(ConfigError, match="no such config file"):
        load_config("nowhere")


def test_a_file_is_merged_over_its_base(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(find_config("wamv16").read_text())
    (tmp_path / "top.yaml").write_text(
        "base: base.yaml\nlinks: {autopilot: {endpoint: 'udpin:127.0.0.1:1'}}\nvehicle: {vessel: {mass_kg: 300.0}}\n"
    )
    config = load_config(tmp_path / "top.yaml")
    assert config.vehicle.vessel.mass_kg == 300.0
    assert config.vehicle.vessel.motor_arm_m == 1.027


def test_a_copy_of_a_shipped_file_finds_what_it_stands_on(tmp_path: Path) -> None:
    copy = tmp_path / "my-boat.yaml"
    copy.write_text(find_config("field-px4").read_text())
    assert load_config(copy) == load_config("field-px4")
    copy.write_text("base: nowhere.yaml")
    with pytest.raises(ConfigError, match=r"key base: no such file nowhere.yaml beside it, and none shipped"):
        load_config(copy)


def test_hash_follows_content_and_json_round_trips() -> None:
    config = load_config("sitl")
    again = config_from_json(config.canonical_json(), "memory")
    assert again == config and again.content_hash() == config.content_hash()
    # The order of keys is what makes a config read back from a log behave alike.
    assert list(again.links.autopilot.streams_hz) == list(config.links.autopilot.streams_hz)
    assert load_config("sitl", ("plant.seed=2",)).content_hash() != config.content_hash()
    with pytest.raises(ConfigError, match=r"memory: the stored config is not JSON"):
        config_from_json("{", "memory")


def test_a_log_of_before_a_key_came_is_taken_as_it_was_recorded() -> None:
    tree = json.loads(load_config("sitl").canonical_json())
    del tree["controller"]["mpc"]["effort"]
    for known_only in (False, True):
        config = config_from_json(json.dumps(tree), "memory", known_only=known_only)
        assert config.controller.mpc.effort == "precise"
    assert load_config("sitl").controller.mpc.effort == "normal"


def test_keys_of_another_version_are_left_out_where_only_what_was_measured_counts() -> None:
    config = load_config("sitl")
    tree = json.loads(config.canonical_json())
    tree["controller"]["mpc"]["gone"] = True
    tree["links"]["autopilot"]["gone"] = {"since": 1}
    tree["gone"] = 1
    text = json.dumps(tree)
    assert config_from_json(text, "memory", known_only=True) == config
    with pytest.raises(ConfigError, match=r"memory: key .*gone: unknown key.* \(and 2 more\)"):
        config_from_json(text, "memory")
    tree["daemon"]["tick_hz"] = -1
    with pytest.raises(ConfigError, match=r"memory: key daemon\.tick_hz"):
        config_from_json(json.dumps(tree), "memory", known_only=True)


def test_nothing_changes_after_loading() -> None:
    config: Config = load_config("sitl")
    with pytest.raises(ValueError):
        config.plant.seed = 3  # type: ignore[misc]


def test_every_vehicle_parameter_has_a_source() -> None:
    lines = find_config("wamv16").read_text().splitlines()
    start = lines.index("  vessel:")
    parameters = []
    for line in lines[start + 1 :]:
        if line.startswith("  pwm:"):
            break
        if line.strip() and not line.strip().startswith(("-", "#", "thrust_curve")):
            parameters.append(line)
    assert len(parameters) == 16
    for line in parameters:
        assert "#" in line, f"no source: {line}"
