"""YAML 1.2 by its core schema, with the surprises of YAML refused in one line that names file, line and key."""

import math
import random
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import load_config, override_value
from asvhil.config.yaml_text import DEEPEST, parse_yaml, read_yaml
from asvhil.errors import ConfigError
from asvhil.study.rows import refuse_own
from asvhil.train.columns import load_columns
from tests.support.paths import ROOT


def tree(text: str) -> object:
    return parse_yaml(text, "boat.yaml").tree


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "boat.yaml")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("boat.yaml: ")
    return str(caught.value).removeprefix("boat.yaml: ")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("10", 10),
        ("010", 10),  # 8 in YAML 1.1
        ("-007", -7),
        ("0o10", 8),
        ("0x1F", 31),
        ("0b11", "0b11"),
        ("1_000", "1_000"),  # 1000
        ("1:30", "1:30"),  # 90
        ("190:20:30.5", "190:20:30.5"),
        ("2026-11-27", "2026-11-27"),  # a date
        ("5.", 5.0),
        (".5", 0.5),
        ("1e3", 1000.0),  # text in YAML 1.1
        ("+1.5E-2", 0.015),
        ("-.inf", -math.inf),
        ("inf", "inf"),
        ("nan", "nan"),
        ("1,5", "1,5"),
        ("٣", "٣"),
        ("true", True),
        ("FALSE", False),
        ("yes", "yes"),
        ("off", "off"),
        ("NO", "NO"),  # Norway
        ("y", "y"),
        ("~", None),
        ("", None),
        ("null", None),
        ("'10'", "10"),
        ('"true"', "true"),
        ("!!str 10", "10"),
        ("!!float 10", 10.0),
        ("!!int 010", 10),
        ("=", "="),
        ("9" * 500, "9" * 500),
    ],
)
def test_scalars(text: str, value: object) -> None:
    (found,) = tree(f"- {text}")  # type: ignore[misc]
    assert type(found) is type(value) and found == value


def test_not_a_number() -> None:
    assert math.isnan(tree(".nan"))  # type: ignore[arg-type]


def test_the_lines_of_all_keys_and_items() -> None:
    found = parse_yaml("# boat\na:\n  b: [1,\n      2]\nc: {d: 3}\n", "boat.yaml")
    assert found.tree == {"a": {"b": [1, 2]}, "c": {"d": 3}}
    assert found.lines == {
        ("a",): 2, ("a", "b"): 3, ("a", "b", 0): 3, ("a", "b", 1): 4, ("c",): 5, ("c", "d"): 5,
    }  # fmt: skip


def test_anchors_aliases_and_merges() -> None:
    text = "a: &one {x: 1, y: 2}\nb: &two {y: 3, z: 4}\nc: {<<: *one, y: 9}\nd: {<<: [*one, *two]}\ne: *one\n"
    found = tree(text)
    assert found == yaml.safe_load(text)
    assert found["c"] == {"x": 1, "y": 9} and found["d"] == {"y": 2, "z": 4, "x": 1}  # type: ignore[index]
    assert tree("a: &a\n  <<: {p: 1}\n  <<q: 2\nb: {<<: *a}\n")["b"] == {"p": 1, "<<q": 2}  # type: ignore[index]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\nb: 2\na: 3", "key a: given twice, in line 1 and again in line 3"),
        ("plant:\n  seed: 1\n  rain: {x: 1, x: 1}", "key plant.rain.x: given twice, in line 3 and again in line 3"),
        ("a: 1\n'a': 1", "key a: given twice"),
        ("a: &x {b: 1}\nc:\n  <<: *x\n  d: 1\n  <<: *x", "key c.<<: given twice, in line 3 and again in line 5"),
        ("a: &x {b: 1}\nc: {<<: *x, b: 2, b: 3}", "key c.b: given twice"),
        ("- {a: 1}\n- {a: 1, a: 2}", "key 1.a: given twice"),
        ("a:\n\tb: 1", "line 2, column 1 (a tab"),
        ("a: [1\t,\n\t2]\n\tb: 1", "a tab"),
        ("a: 1\n---\na: 2", "holds several documents, the second at line 2"),
        ("---\na: 1\n...\nrest", "not valid YAML at line 4"),
        ("1: x", "a key must be text, and '1' is a number; in quotes it would be text (line 1)"),
        ("a: {true: x}", "key a: a key must be text, and 'true' is true or false"),
        ("a:\n  ~: x", "key a: a key must be text, and '~' is empty; in quotes it would be text (line 2)"),
        ("? [a]\n: b", "a key must be text, and this is a mapping or a list"),
        ("? {a: b}\n: c", "a key must be text"),
        ("a: &x [*x]", "key a.0: an alias inside of what it stands for"),
        ("a: &x {b: *x}", "an alias inside"),
        ("a: &x {<<: *x}", "an alias inside"),
        ("a: *nowhere", "undefined alias"),
        ("a: {<<: 5}", "<< takes a mapping"),
        ("a: {<<: [1]}", "<< takes a mapping"),
        ("a: !!python/object:os.system x", "the tag !!python/object:os.system means nothing here"),
        ("a: !boat {b: 1}", "key a: the tag !boat means nothing here"),
        ("a: !!set {b}", "the tag !!set means nothing here"),
        ("a: !!binary aGk=", "the tag !!binary means nothing here"),
        ("a: !!int yes", "'yes' is not of its tag !!int"),
        ("a: !!bool 1", "'1' is not of its tag !!bool"),
        ("a: 1\nb: [1", "not valid YAML at line 2"),
        ("a: b: c", "not valid YAML at line 1"),
        ("a: 'x\nb: 1", "not valid YAML"),
        ("a: \"\\q\"", "not valid YAML at line 1"),
        ("a: \"\\UFFFFFFFF\"", "not valid YAML"),
        ("a: 1\nb: \x07", "not valid YAML at line 2 (a character that is no text"),
        ("%YAML 3.0\n---\na: 1", "not valid YAML"),
        ("a: " + "[" * 80 + "]" * 80, f"nested too deeply; at most {DEEPEST} levels"),
        ("a: " + "[" * 5000, f"nested too deeply; at most {DEEPEST} levels"),
        ("- " * 5000, f"nested too deeply; at most {DEEPEST} levels"),
    ],
)  # fmt: skip
def test_surprises_are_one_line(text: str, words: str) -> None:
    assert words in refusal(text)


def test_a_bomb_of_aliases_goes_off_early() -> None:
    lines = ["a0: &a0 [x, x]"] + [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 40)]
    assert "more than 100000 values" in refusal("\n".join(lines))
    merges = ["m0: &m0 {x: 1}"] + [f"m{n}: &m{n} {{<<: [*m{n - 1}, *m{n - 1}]}}" for n in range(1, 40)]
    assert "more than 100000 values" in refusal("\n".join(merges))


def test_encodings(tmp_path: Path) -> None:
    path = tmp_path / "boat.yaml"
    for ends in ("\n", "\r\n", "\r"):
        path.write_bytes(b"\xef\xbb\xbf" + f"a: 1{ends}b: ü{ends}".encode())
        assert read_yaml(path).tree == {"a": 1, "b": "ü"} and read_yaml(path).lines[("b",)] == 2
    for data in ("a: 1".encode("utf-16"), "a: ü".encode("latin-1"), b"\xff" * 9):
        path.write_bytes(data)
        with pytest.raises(ConfigError, match=rf"^{path}: cannot be read \(.*not UTF-8 text: save it as UTF-8\)$"):
            read_yaml(path)
    with pytest.raises(ConfigError, match=rf"^{tmp_path}: cannot be read \(Is a directory\)$"):
        read_yaml(tmp_path)


# --- where a config asks for a type ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("supervisor.station=1:30", "key supervisor.station: "),
        ("vehicle.vessel.mass_kg=1:30", "a number is expected, not the text '1:30'"),
        ("vehicle.vessel.mass_kg=1_000", "a number is expected, not the text '1_000', did you mean 1000?"),
        ("vehicle.vessel.mass_kg='180'", "a number is expected, not the text '180', did you mean 180?"),
        ("vehicle.vessel.mass_kg=180,5", "a number is expected, not the text '180,5', did you mean 180.5?"),
        ("vehicle.vessel.mass_kg=true", "a number is expected, not true"),
        ("vehicle.vessel.mass_kg=", "a number is expected, not nothing"),
        ("vehicle.vessel.mass_kg=.inf", "key vehicle.vessel.mass_kg: a finite number is expected, not inf"),
        ("vehicle.vessel.mass_kg=1e999", "key vehicle.vessel.mass_kg: a finite number is expected, not inf"),
        ("plant.seed=2_0", "a whole number is expected, not the text '2_0', did you mean 20?"),
        ("plant.seed=1.5", "a whole number is expected, not 1.5"),
        ("plant.seed=true", "a whole number is expected, not true"),
        ("controller.procedure.enabled=on", "true or false is expected, not the text 'on', did you mean true?"),
        ("controller.procedure.enabled=No", "true or false is expected, not the text 'No', did you mean false?"),
        ("controller.procedure.enabled=1", "true or false is expected, not 1"),
        ("vehicle.name=5", "text is expected, not 5; quotes make it text"),
        ("vehicle.vessel=", "a section, with keys below it, is expected, not nothing"),
        ("vehicle.vessel=3", "a section, with keys below it, is expected, not 3"),
        ("plant.seed=1\nplant.seed", "plant.seed"),
        ("a..b=1", "KEY=VALUE is expected"),
        (".=1", "KEY=VALUE is expected"),
        ("plant.seed={a: 1, a: 2}", "key a: given twice"),
    ],
)  # fmt: skip
def test_wrong_types_in_overrides(override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", (override,))
    assert words in str(caught.value)


def test_a_wrong_value_is_told_with_its_line_and_file(tmp_path: Path) -> None:
    (tmp_path / "low.yaml").write_text("base: sitl.yaml\nplant:\n  seed: 0x10\n  weather: {wind: {speed_mps: 010}}\n")
    path = tmp_path / "boat.yaml"
    path.write_text("base: low.yaml\ncontroller:\n  procedure:\n    enabled: yes\n")
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(caught.value) == (
        f"{path}: key controller.procedure.enabled: true or false is expected, not the text 'yes', did you mean true? "
        "(line 4)"
    )
    path.write_text("base: low.yaml\n")
    settings = load_config(path)
    assert settings.plant.seed == 16 and settings.plant.weather.wind.speed_mps == 10.0
    (tmp_path / "low.yaml").write_text("base: sitl.yaml\nplant:\n\n  seed: -1\n")
    with pytest.raises(ConfigError, match=r"boat.yaml: key plant.seed: .*, not -1 \(line 4 of low.yaml\)$"):
        load_config(path)
    with pytest.raises(ConfigError, match=r"^--set plant.seed=-2: key plant.seed: .*, not -2$"):
        load_config(path, ("plant.seed=-2",))
    with pytest.raises(ConfigError, match=r"^--set plant={seed: -3}: key plant.seed: .*, not -3$"):
        load_config(path, ("plant={seed: -3}",))


def test_a_column_map_and_a_study_read_yaml_alike(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    path.write_text("time: {column: t, unit: s}\ntime: {column: u, unit: s}\n")
    with pytest.raises(ConfigError, match=r"map.yaml: key time: given twice, in line 1 and again in line 2"):
        load_columns(path)
    path.write_text("time:\n  column: t\n  units: s\n")
    with pytest.raises(ConfigError, match=r"map.yaml: key time.units: unknown key, did you mean unit\? \(line 3\)"):
        load_columns(path)
    with pytest.raises(ConfigError, match=r"^--set plant.seed=\[: not valid YAML"):
        refuse_own(["plant.seed=["], ["plant.seed=1"])
    assert override_value(" plant.seed = 1:30 ") == ("plant.seed", "1:30")


@pytest.mark.parametrize("path", sorted((ROOT / "config").rglob("*.yaml")), ids=lambda path: path.name)
def test_shipped_files_mean_the_same_to_both_versions(path: Path) -> None:
    assert read_yaml(path).tree == yaml.safe_load(path.read_text())


@given(st.text(alphabet="ab:-{}[],&*!|>'\"%@`#~<?=0.1_\n\t \\\x85\ufeff\u2028é", max_size=60))
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        parse_yaml(text, "boat.yaml")
    except ConfigError as error:
        assert str(error).startswith("boat.yaml: ") and "\n" not in str(error)


def test_a_mutated_config_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    noise, path = random.Random(1), tmp_path / "boat.yaml"
    whole = (ROOT / "config" / "wamv16.yaml").read_bytes() + (ROOT / "config" / "sitl.yaml").read_bytes()
    whole = whole.replace(b"base:", b"#")
    for _ in range(150):
        data = bytearray(whole)
        for _ in range(noise.randrange(1, 4)):
            at = noise.randrange(len(data))
            data[at : at + noise.randrange(3)] = noise.choice(
                (b"\t", b":", b"\n", b"{", b"'", b"\xff", b"0", b"- ", b"")
            )
        path.write_bytes(bytes(data))
        try:
            load_config(path)
        except ConfigError as error:
            assert str(path) in str(error) and "\n" not in str(error)


def test_a_file_that_would_take_minutes_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "big.yaml"
    path.write_text("base: sitl\nplant:\n" + "".join(f"  k{n}: [1, 2, 3, 4]\n" for n in range(40_000)))
    with pytest.raises(ConfigError, match=r"big.yaml: cannot be read \(0.9 MB, a config has 0.5 MB at most\)"):
        load_config(path)


def test_a_value_of_set_is_told_with_its_option_also_where_its_section_stands_nowhere() -> None:
    with pytest.raises(
        ConfigError, match=r"^--set su.*=any: key .*'either' or 'free' is expected, not the text 'any'$"
    ):
        load_config("sitl", ("supervisor.heading.policy=any",))


ONE_KEY = [
    (("controler.name=sd-mpc",), "--set controler.name=sd-mpc: key controler: unknown key, did you mean controller?"),
    (("controller.mcp.near=1",), "--set controller.mcp.near=1: key controller.mcp: unknown key, did you mean mpc?"),
    (("controller.name=sd-mcp",), "--set controller.name=sd-mcp: key controller.name: "),
    (("plant.seed=3", "plant.seed=x"), "--set plant.seed=x: key plant.seed: a whole number is expected"),
    (("plugins=[nowhere.py]",), "--set plugins=[nowhere.py]: key plugins: "),
]


@pytest.mark.parametrize(("overrides", "words"), ONE_KEY)
def test_a_mistake_in_set_is_blamed_on_set_and_not_on_the_file(overrides: tuple[str, ...], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", overrides)
    assert str(caught.value).startswith(words) and "sitl.yaml" not in str(caught.value)


def test_a_mistake_in_the_file_is_blamed_on_the_file_beside_a_set_too(tmp_path: Path) -> None:
    path = tmp_path / "boat.yaml"
    path.write_text("base: sitl.yaml\nplant:\n  sead: 1\n")
    for overrides in ((), ("plant.seed=3",), ("controller.name=loiter", "plant.origin_lat_deg=1")):
        with pytest.raises(ConfigError) as caught:
            load_config(path, overrides)
        assert str(caught.value) == f"{path}: key plant.sead: unknown key, did you mean seed? (line 3)"


def test_keys_that_do_not_go_together_are_told_with_the_set_that_parted_them(tmp_path: Path) -> None:
    path = tmp_path / "boat.yaml"
    path.write_text("base: sitl.yaml\n")
    with pytest.raises(ConfigError) as caught:
        load_config(path, ("plant.seed=3", "vehicle.pwm.ahead_us=1100"))
    assert str(caught.value).startswith(f"{path}: key vehicle.pwm: ")
    assert str(caught.value).endswith("; with --set vehicle.pwm.ahead_us=1100)")
    with pytest.raises(ConfigError) as caught:
        load_config(path, ("plant.seed=3", "supervisor.station=null"))
    assert str(caught.value).startswith(f"{path}: supervisor.station is needed")
    assert str(caught.value).endswith(" (with --set supervisor.station=null)")
    path.write_text("base: sitl.yaml\nsupervisor:\n  station: null\n")
    with pytest.raises(ConfigError, match=r"engage is auto$"):
        load_config(path, ("plant.seed=3",))
