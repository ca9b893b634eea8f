"""The JSON Schema of a config *file*, for editors: the keys of `Config`, without those that a base may give instead."""

from __future__ import annotations

from typing import Any

from asvhil.config.root import Config

IN_ONE_WORD = ("SourceConfig", "PluginFile")  # sections that may stand as text
OPEN = ("SensorLinkConfig",)  # whose kinds have keys of their own

Schema = dict[str, Any]


def editor_schema() -> Schema:
    """The schema: unknown keys, kinds of values and ranges are checked; that nothing is missing is not.

    What spans keys is left to `asvhil config check`.
    """
    schema = Config.model_json_schema()
    schema["properties"]["base"] = {
        "type": "string",
        "description": "A config whose keys this one starts from: a file beside it, or a shipped one.",
    }
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "asvhil"
    for name, section in schema["$defs"].items():
        if name in OPEN:
            section["additionalProperties"] = True
        elif section.get("additionalProperties") is True:  # sections of kinds, by their keys
            section["additionalProperties"] = {"type": "object"}
    changed: Schema = _changed(schema)
    return changed


def _changed(node: Any) -> Any:
    """Without `required`, and with text allowed where a section may stand as one word."""
    if isinstance(node, list):
        return [_changed(part) for part in node]
    if not isinstance(node, dict):
        return node
    part = {key: _changed(value) for key, value in node.items() if key != "required" or not isinstance(value, list)}
    if str(node.get("$ref", "")).rsplit("/", 1)[-1] in IN_ONE_WORD:
        return {"anyOf": [part, {"type": "string"}]}
    return part
