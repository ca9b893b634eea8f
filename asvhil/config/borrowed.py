"""Which file a config takes its hull from: a copy of a shipped config with ports alone still has the shipped hull."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from asvhil.config.loading import base_of, find_config, is_shipped
from asvhil.config.yaml_text import read_yaml
from asvhil.errors import ConfigError


def chain_of(name: str) -> list[Path]:
    """The files of a config: itself, its base, the base's base, and so on. ConfigError as `load_config` raises it."""
    chain = [find_config(name)]
    while True:
        tree = read_yaml(chain[-1]).tree
        base = base_of(chain[-1], tree) if isinstance(tree, dict) else None
        if base is None:
            return chain
        if base.resolve() in {path.resolve() for path in chain}:
            raise ConfigError(f"{chain[-1]}: key base: the chain of base files runs in a circle")
        chain.append(base)


def hull_home(name: str) -> Path | None:
    """The file whose `vehicle.vessel.mass_kg` holds, without overrides; None where none has it."""
    for path in chain_of(name):
        node = read_yaml(path).tree
        for key in ("vehicle", "vessel", "mass_kg"):
            node = node.get(key) if isinstance(node, dict) else None
        if node is not None:
            return path
    return None


def borrowed_from(name: str, overrides: Sequence[str] = ()) -> str:
    """The shipped file that a config of one's own has its hull from.

    Empty for a hull of its own, also by overrides (KEY=VALUE), and for a shipped config.
    """
    home = hull_home(name)
    own = any(override.strip().startswith("vehicle.vessel") for override in overrides)
    return "" if own or home is None or not is_shipped(home) or is_shipped(find_config(name)) else home.name
