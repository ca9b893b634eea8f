"""What a validation found, in plain words: none of pydantic's own come through."""

import json

import pytest

from asvhil.config import Config, load_config
from asvhil.config.told import PATTERNS
from asvhil.errors import ConfigError

MISTAKES = [
    ("supervisor: {geofence: [[1, 2, 3]]}", "key supervisor.geofence.0: two numbers are expected, not 3 (line 2)"),
    ("supervisor: {geofence: [[1]]}", "key supervisor.geofence.0: two numbers are expected, not 1 (line 2)"),
    ("vehicle: {vessel: {thrust_curve: [[1, 2, 3]]}}", "thrust_curve.0: two numbers are expected, not 3 (line 2)"),
    ("learning: {start: [1, 1]}", "key learning.start: five numbers are expected, not 2 (line 2)"),
    ("controller: {mpc: {near: {heading: [1]}}}", "key controller.mpc.near.heading: a number is expected, not a list"),
    ("vehicle: {power: {power_curve: [[1, 2, 3]]}}", "power_curve.0: two numbers are expected, not 3 (line 2)"),
    ("plant: {glitches: {kinds: []}}", "key plant.glitches.kinds: a list of 1 or more is expected, not of 0 (line 2)"),
    (
        "links: {sensors: {Foo: {endpoint: 'udpin:0.0.0.0:1'}}}",
        "key links.sensors.Foo: a name of small letters, digits, _ and - is expected, not the text 'Foo' (line 2)",
    ),
    (
        "links: {operator: {allow_in: [attitude]}}",
        "key links.operator.allow_in.0: a name of capitals, digits and _ is expected, not the text 'attitude' (line 2)",
    ),
    ("plugins: [{file: a.py, sha256: x}]", "a SHA-256 sum, 64 of 0 to 9 and a to f, is expected, not the text 'x'"),
    (f"plant: {{seed: 1{'0' * 5000}}}", "000'... (line 2)"),
]


@pytest.mark.parametrize(("text", "words"), MISTAKES, ids=[words[:50] for _, words in MISTAKES])
def test_a_mistake_is_told_in_plain_words(tmp_path, text, words):
    path = tmp_path / "boat.yaml"
    path.write_text(f"base: sitl.yaml\n{text}\n")
    with pytest.raises(ConfigError) as raised:
        load_config(str(path))
    said = str(raised.value)
    assert words in said and "should" not in said and "[key]" not in said and len(said) < 400, said


def test_every_pattern_of_the_config_has_words():
    def patterns(tree):
        if isinstance(tree, dict):
            yield from [tree["pattern"]] if isinstance(tree.get("pattern"), str) else []
            tree = list(tree.values())
        for part in tree if isinstance(tree, list) else ():
            yield from patterns(part)

    schema = json.loads(json.dumps(Config.model_json_schema()))
    found = set(patterns(schema)) | {key for part in schema["$defs"].values() for key in _of_keys(part)}
    assert found and found <= set(PATTERNS)


def _of_keys(part):
    for field in part.get("properties", {}).values():
        yield from field.get("patternProperties", {})
