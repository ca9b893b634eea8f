"""The schema that editors check configs by takes all that is right, and no misspelt key or value out of range."""

from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from asvhil.config.editor_schema import editor_schema
from asvhil.config.yaml_text import parse_yaml, read_yaml
from tests.support.paths import ROOT

CONFIGS = sorted((ROOT / "config").glob("*.yaml"))


@pytest.fixture(scope="module")
def validator() -> Any:
    schema = editor_schema()
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_shipped_configs_are_right(validator: Any, path: Path) -> None:
    assert [error.message for error in validator.iter_errors(read_yaml(path).tree)] == []


@pytest.mark.parametrize(
    "text",
    [
        "sources: {wind: [autopilot.WIND]}",
        "sources: {wind: [{link: gnss, message: MWV, delay_s: 0.1}]}",
        "plugins: [mine.py]",
        "controller: {my_own: {gain: 1}}",
        "links: {sensors: {mast: {kind: nmea, endpoint: serial:/dev/ttyUSB0:4800, relative_to: bow}}}",
        "base: field.yaml",
    ],
)
def test_what_may_stand_in_a_config_is_taken(validator: Any, text: str) -> None:
    assert list(validator.iter_errors(parse_yaml(text, "").tree)) == []


@pytest.mark.parametrize(
    "text",
    [
        "vehicel: {name: cat}",
        "vehicle: {vessel: {mass: 38}}",
        "vehicle: {vessel: {mass_kg: -38}}",
        "controller: {nam: sd-mpc}",
        "controller: {name: sd-mcp}",
        "supervisor: {engage: automatic}",
        "plant: {seed: one}",
        "base: 1",
    ],
)
def test_mistakes_are_found_while_they_are_typed(validator: Any, text: str) -> None:
    assert list(validator.iter_errors(parse_yaml(text, "").tree))
