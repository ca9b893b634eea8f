"""The page docs/configuration.md, made from the keys' definitions: `python -m asvhil.config.reference` prints it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from asvhil.config.root import Config

INTRODUCTION = """\
# Configuration

Every key with its values, unit, default and meaning. This page is made from the definitions in `asvhil/config/`:
`python -m asvhil.config.reference > docs/configuration.md`.

A config is a YAML file. `base: FILE` names a file whose keys it starts from: one beside it, or a shipped one
(`config/`). A command takes the path of a config or the name of a shipped one, and `--set KEY=VALUE` changes any key,
such as `--set controller.mpc.near.heading=300` or `--set 'plant.faults=[{kind: vane, from_s: 60}]'`. Unknown keys and
values out of range are refused with the name of the key. The log of a run holds its whole config.

The unit is the suffix of the key's name: `_s`, `_m`, `_mps` (m/s), `_radps` (rad/s), `_us` (microseconds) and so on.
Angles are degrees where the name ends in `_deg` and radians elsewhere; directions count clockwise. A section
that may be null is off until it is given.
"""

UNITS = {
    "nm_per_radps2": "N m/(rad/s)²",
    "nm_per_radps": "N m/(rad/s)",
    "nm_per_mps2": "N m/(m/s)²",
    "n_per_mps2": "N/(m/s)²",
    "n_per_mps": "N/(m/s)",
    "us_per_s": "µs/s",
    "per_mps": "1/(m/s)",
    "per_m": "1/m",
    "per_s": "1/s",
    "radps2": "rad/s²",
    "radps": "rad/s",
    "degps": "degrees/s",
    "mps2": "m/s²",
    "mps": "m/s",
    "kgm2": "kg m²",
    "kg": "kg",
    "kib": "KiB",
    "gauss": "gauss",
    "rad": "rad",
    "deg": "degrees",
    "hz": "Hz",
    "us": "µs",
    "pa": "Pa",
    "n": "N",
    "m": "m",
    "s": "s",
    "v": "V",
    "wh": "Wh",
    "w": "W",
}
WORDS = {"number": "number", "integer": "integer", "boolean": "true or false", "string": "text", "null": "null"}

Schema = dict[str, Any]


def reference() -> str:
    """The page as Markdown: one table for each section, which names all places where the section stands."""
    schema = Config.model_json_schema()
    definitions: dict[str, Schema] = schema["$defs"]
    places: dict[str, list[str]] = {}
    for path, name in _sections(schema, "", definitions):
        places.setdefault(name, []).append(path)
    links = {name: f"[`{paths[0]}`](#{_anchor(paths[0])})" for name, paths in places.items()}
    parts = [INTRODUCTION, "## The sections\n", _table(schema, definitions, links)]
    for name, paths in places.items():
        parts.append(f"## `{paths[0]}`\n")
        if len(paths) > 1:
            parts.append(f"Also: {', '.join(f'`{path}`' for path in paths[1:])}.\n")
        section = definitions[name]
        parts += [f"{section['description']}\n", _table(section, definitions, links)]
    return "\n".join(parts)


def _sections(schema: Schema, path: str, definitions: dict[str, Schema]) -> Iterator[tuple[str, str]]:
    """Path of every section below `path` and name of its definition, depth first."""
    for key, field in schema["properties"].items():
        for name, step in references(field):
            if "properties" in definitions[name]:
                place = f"{path}{key}{step}"
                yield place, name
                yield from _sections(definitions[name], f"{place}.", definitions)


def references(field: Schema) -> Iterator[tuple[str, str]]:
    """Names of the definitions that a field refers to, and what their paths add to the key: .N in a list."""
    if "$ref" in field:
        yield field["$ref"].rsplit("/", 1)[1], ""
    for option in (*field.get("allOf", ()), *field.get("anyOf", ())):
        yield from references(option)
    for inner, step in ((field.get("items"), ".N"), (field.get("additionalProperties"), ".NAME")):
        if isinstance(inner, dict):
            yield from ((name, step) for name, _ in references(inner))
    for inner in field.get("patternProperties", {}).values():
        yield from ((name, ".NAME") for name, _ in references(inner))


def _table(section: Schema, definitions: dict[str, Schema], links: dict[str, str]) -> str:
    lines = ["| key | values | default | meaning |", "| --- | --- | --- | --- |"]
    for key, field in section["properties"].items():
        unit = unit_of(key)
        values = values_text(field, definitions, links) + (f"; {unit}" if unit else "")
        default = "required" if key in section.get("required", ()) else default_text(field, definitions)
        cells = (f"`{key}`", values, default, field["description"])
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def unit_of(key: str) -> str:
    """The unit that the suffix of a key's name stands for; empty without one."""
    return next((unit for suffix, unit in UNITS.items() if key.endswith(f"_{suffix}")), "")


def values_text(field: Schema, definitions: dict[str, Schema], links: dict[str, str]) -> str:
    """The values of a field in words: type and range, a choice, or a link to the section that describes them."""
    name = next((name for name, step in references(field) if not step), None)
    options = [values_text(option, definitions, links) for option in field.get("anyOf", ())]
    if options:
        return " or ".join(options)
    if name is not None:
        return links.get(name) or values_text(definitions[name], definitions, links)
    if "enum" in field or "const" in field:
        return ", ".join(f"`{value}`" for value in field.get("enum", (field.get("const"),)))
    if field["type"] == "object":
        inner = field.get("additionalProperties") or next(iter(field["patternProperties"].values()))
        return f"mapping: name to {values_text(inner, definitions, links)}"
    if field["type"] == "array":
        parts = [values_text(part, definitions, links) for part in field.get("prefixItems", ())]
        if parts:
            return f"list of {len(parts)}: {parts[0] if len(set(parts)) == 1 else ', '.join(parts)}"
        return f"list of: {values_text(field['items'], definitions, links)}"
    return f"{WORDS[field['type']]}{_range(field)}"


def _range(field: Schema) -> str:
    if "minimum" in field and "maximum" in field:
        return f" {_text(field['minimum'])} to {_text(field['maximum'])}"
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    limits = ", ".join(f"{sign} {_text(field[name])}" for name, sign in signs.items() if name in field)
    return f" {limits}" if limits else ""


def default_text(field: Schema, definitions: dict[str, Schema]) -> str:
    """The default value; of a section, the keys whose defaults differ here from those in its own table."""
    if "default" not in field:
        return ""
    name = next((name for name, _ in references(field)), "")
    own = definitions.get(name, {})
    value = field["default"]
    if isinstance(value, dict):
        value = _differing(value, own)
    elif isinstance(value, list):
        value = [_differing(part, own) if isinstance(part, dict) else part for part in value]
    return "" if value == {} else f"`{_text(value)}`"


def _differing(value: Schema, section: Schema) -> Schema:
    """The keys of a section's value that are required, or differ from the defaults in the section's own table."""
    defaults = {key: field["default"] for key, field in section["properties"].items() if "default" in field}
    known = defaults.keys() | section.get("required", ())
    return {key: part for key, part in value.items() if key in known and (key, part) not in defaults.items()}


def _text(value: Any) -> str:
    """A value as YAML on one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_text(part)}' for key, part in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_text(part) for part in value)}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:.10g}" if isinstance(value, float) else str(value) or '""'


def _anchor(path: str) -> str:
    """The fragment by which GitHub links to the heading of a path."""
    return re.sub(r"[^a-z0-9_-]", "", path.lower())


if __name__ == "__main__":
    print(reference(), end="")
