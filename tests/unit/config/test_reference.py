"""The page of all keys is made from their definitions, and every key has one."""

import re

import pytest

from asvhil.config import Config, Section
from asvhil.config.reference import reference
from tests.support.paths import ROOT

PAGE = ROOT / "docs" / "configuration.md"


def all_sections(kind: type[Section] = Section) -> list[type[Section]]:
    """Every section of the config; other files of the same form, such as column maps, have pages of their own."""
    found = [found for child in kind.__subclasses__() for found in (child, *all_sections(child))]
    return [section for section in found if section.__module__.startswith("asvhil.config.")]


def test_the_page_is_that_of_the_present_definitions() -> None:
    assert PAGE.read_text() == reference(), "python -m asvhil.config.reference > docs/configuration.md"


@pytest.mark.parametrize("section", all_sections(), ids=lambda section: section.__name__)
def test_every_section_and_every_key_is_described(section: type[Section]) -> None:
    assert section.__doc__ and section.__doc__ != Section.__doc__
    for name, field in section.model_fields.items():
        assert field.description, name
        assert field.description[0] in "`(" or field.description[0].upper() == field.description[0], name
        assert field.description.endswith("."), name


def test_links_of_the_page_lead_to_its_headings() -> None:
    page = reference()
    headings = {re.sub(r"[^a-z0-9_-]", "", line.lower()) for line in re.findall(r"^## (.*)$", page, re.MULTILINE)}
    targets = set(re.findall(r"\]\(#([^)]*)\)", page))
    assert targets <= headings and len(targets) > 40


@pytest.mark.parametrize(
    "row",
    [
        "| `mass_kg` | number > 0; kg | required | Mass of the boat, payload included. |",
        "| `ahead_us` | integer 500 to 2500; µs | `1900` | Pulse width of the command 1, full ahead. |",
        "| `return_fraction` | number > 0, < 1 | `0.4` |",
        "| `stuck_after_s` | number > 0 or null; s | `2` |",
        "| `compass` | [`estimator.ekf.compass`](#estimatorekfcompass) |  |",
        "| `far` | [`controller.mpc.near`](#controllermpcnear) | `{heading: 10, terminal_position_s: 1}` |",
        "| `torch_lqr` | [`controller.ipopt`](#controlleripopt) | `{iterations: 2}` |",
        "| `station` | [`supervisor.station`](#supervisorstation) or null | `null` |",
        "| `frontseat` | [`plant.frontseat`](#plantfrontseat) |  |",
        "| `heading` | list of: [`sources.position.N`](#sourcespositionn) | `[]` |",
        "| `ground_stations` | mapping: name to [`links.ground_stations.NAME`](#linksground_stationsname) |  |",
        "| `cut_on` | `timer`, `arrival` | `timer` |",
        "| `tolerate` | list of: `ignored`, `mixed`,",
        r"Quadratic drag in surge, -X_u\|u\|. |",
    ],
)
def test_rows_of_each_kind(row: str) -> None:
    assert row in reference()


def test_every_place_of_a_section_is_named() -> None:
    page = reference()
    for path in ("controller.mpc.along", "plant.vessel", "links.ground_stations.NAME.signing", "sources.wind.N"):
        assert f"`{path}`" in page


def test_every_top_section_has_a_table() -> None:
    for name in Config.model_fields:
        assert re.search(rf"\n## `{name}(\.N)?`\n", reference())
