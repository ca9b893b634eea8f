"""A copy of a shipped config with ports alone is told from a boat of one's own."""

from pathlib import Path

import pytest

from asvhil.config.borrowed import borrowed_from, chain_of, hull_home
from asvhil.errors import ConfigError
from tests.support.paths import ROOT

PORTS = 'links:\n  autopilot: {endpoint: "udpin:0.0.0.0:14550"}\n'


def written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def test_field_with_ports_only_has_the_hull_of_the_wamv(tmp_path: Path) -> None:
    lazy = written(tmp_path / "lazy.yaml", f"base: field.yaml\n{PORTS}")
    assert borrowed_from(lazy) == "wamv16.yaml"
    assert [path.name for path in chain_of(lazy)] == ["lazy.yaml", "field.yaml", "wamv16.yaml"]
    copied = (ROOT / "config" / "field.yaml").read_text()  # as README once said
    assert borrowed_from(written(tmp_path / "copy.yaml", copied)) == "wamv16.yaml"


def test_a_hull_of_ones_own_is_not_borrowed(tmp_path: Path) -> None:
    own = written(tmp_path / "own.yaml", f"base: field.yaml\nvehicle: {{vessel: {{mass_kg: 260}}}}\n{PORTS}")
    over = written(tmp_path / "over.yaml", "base: own.yaml\n")
    assert borrowed_from(own) == borrowed_from(over) == ""
    home = hull_home(over)
    assert home is not None and home.name == "own.yaml"
    lazy = written(tmp_path / "lazy.yaml", f"base: field.yaml\n{PORTS}")
    assert borrowed_from(lazy, ("vehicle.vessel.mass_kg=260",)) == ""
    assert borrowed_from("field") == borrowed_from("sitl") == ""


def test_a_circle_of_bases_ends(tmp_path: Path) -> None:
    one = written(tmp_path / "one.yaml", "base: two.yaml\n")
    written(tmp_path / "two.yaml", "base: one.yaml\n")
    with pytest.raises(ConfigError, match="runs in a circle"):
        chain_of(one)
