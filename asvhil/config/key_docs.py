"""What a key of the config does, for the terminal: from the definitions that docs/configuration.md is made from."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Any

from asvhil.config.reference import Schema, default_text, references, unit_of, values_text
from asvhil.config.root import Config
from asvhil.errors import ConfigError

SECTION = "a section"

Line = tuple[str, str]  # a key, and its values, default and meaning in words


def key_lines(key: str = "") -> list[Line]:
    """What a key does; of a section, what it is under the empty key, then its keys. Without a key all sections.

    ConfigError names the nearest key where there is none of this name.
    """
    schema = Config.model_json_schema()
    definitions: dict[str, Schema] = schema["$defs"]
    node: Schema = schema
    field: Schema = {}
    done: list[str] = []
    required = False
    for part in key.split(".") if key else ():
        known = node.get("properties", {})
        field = known.get(part) or _inner(node)
        if not field:
            raise ConfigError(f"{key}: no such key{_nearest(part, done, known)}")
        required = part in node.get("required", ())
        node = _section(field, definitions)
        done.append(part)
    if "properties" not in node:
        return [(key, _words(done[-1], field, required, definitions))]
    lines = [("", str(node["description"]).replace("\n", " "))] if key else []
    needed = node.get("required", ())
    return lines + [
        (name, _words(name, part, name in needed, definitions)) for name, part in node["properties"].items()
    ]


def keys_about(word: str) -> list[Line]:
    """All keys whose name or meaning holds a word, by their whole path."""
    schema = Config.model_json_schema()
    return [line for line in _all(schema, "", schema["$defs"]) if word.lower() in " ".join(line).lower()]


def _all(section: Schema, path: str, definitions: dict[str, Schema]) -> Iterator[Line]:
    for key, field in section["properties"].items():
        yield f"{path}{key}", field["description"]
        for name, step in references(field):
            if "properties" in definitions[name]:
                yield from _all(definitions[name], f"{path}{key}{step}.", definitions)


def _inner(node: Schema) -> Schema:
    """What a list or a mapping with names of one's own holds; empty for anything else."""
    inner: Any = (
        node.get("items")
        or node.get("additionalProperties")
        or next(iter(node.get("patternProperties", {}).values()), {})
    )
    return inner if isinstance(inner, dict) else {}


def _section(field: Schema, definitions: dict[str, Schema]) -> Schema:
    """The section that stands at a field; the field itself where it has none."""
    named = [definitions[name] for name, step in references(field) if not step]
    return next((section for section in named if "properties" in section), field)


def _nearest(part: str, done: list[str], known: Schema) -> str:
    near = difflib.get_close_matches(part, known, n=1)
    if near:
        return f", did you mean {'.'.join([*done, near[0]])}?"
    where = f"{'.'.join(done)} has " if done else ""
    return f"; {where}{', '.join(known)}" if known else f"; {'.'.join(done)} is a value"


def _words(name: str, field: Schema, required: bool, definitions: dict[str, Schema]) -> str:
    sections = {inner: SECTION for inner, definition in definitions.items() if "properties" in definition}
    values, unit = values_text(field, definitions, sections).replace("`", ""), unit_of(name)
    default = "" if values == SECTION else default_text(field, definitions).strip("`")
    parts = [
        f"{values}; {unit}" if unit else values,
        "required" if required else "",
        f"default {default}" if default else "",
    ]
    return f"{', '.join(part for part in parts if part)}. {field.get('description', '')}"
