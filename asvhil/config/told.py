"""What a validation found in a YAML file, as one line: the file, the key, what would be right, and where it stands."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from typing import Any, get_origin

from pydantic import ValidationError

from asvhil.config.wanted import count_wanted
from asvhil.config.yaml_text import Path_, scalar
from asvhil.errors import ConfigError

Lines = dict[Path_, str]  # where a key stands, in words, by its path

_MEANT = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}
_SECTION = ("model_type", "model_attributes_type", "dict_type")
# The kinds of pydantic's errors, and what would be right.
_WANTED = {
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    "finite_number": "a finite number",
    "string_type": "text",
    **dict.fromkeys(("tuple_type", "list_type", "set_type", "frozen_set_type"), "a list"),
    "int_parsing_size": "a whole number of fewer digits",
    "string_too_short": "text that is not empty",
    **dict.fromkeys(_SECTION, "a section, with keys below it,"),
}
_BOUNDS = {
    "greater_than": "a number above {gt:.10g}",
    "greater_than_equal": "a number of {ge:.10g} or more",
    "less_than": "a number below {lt:.10g}",
    "less_than_equal": "a number of {le:.10g} or less",
    "literal_error": "{expected}",
}
# What texts may be, by the pattern that the config has for them.
PATTERNS = {
    "^[a-z0-9_-]+$": "a name of small letters, digits, _ and -",
    "^[A-Z][A-Z0-9_]*$": "a name of capitals, digits and _",
    "^[0-9a-f]{64}$": "a SHA-256 sum, 64 of 0 to 9 and a to f,",
}
_TAG = re.compile(
    r"[a-z_-]+\[.*\]|\[key\]"
)  # names what an error is of within a key: a kind of value, a key of a section
_LONGEST = 60  # of a value that is shown


def told(
    error: ValidationError,
    source: str,
    lines: Mapping[Path_, str],
    root: Any = None,
    alone: ValidationError | None = None,
) -> ConfigError:
    """The first of what a validation found, as one line. `root`: the model, for the keys that may have been meant.

    `alone`: what it finds without the options of the command line; None where nothing is wrong then.
    """
    first = _first(error)
    loc = _plain(first["loc"], lines)
    key = ".".join(str(part) for part in loc)
    counted = count_wanted(root, first)
    message, value = first["msg"].removeprefix("Value error, "), first["input"]
    if first["type"] == "extra_forbidden":
        message = f"unknown key{_suggest(root, first['loc'])}"
    elif counted:
        key, message = key if first["type"] != "missing" else ".".join(str(part) for part in loc[:-1]), counted
    elif first["type"] == "missing":
        message = "this key is required"
    elif first["type"] in _WANTED:
        wanted = _WANTED[first["type"]] if loc == first["loc"] else _any_of(error, loc, lines)
        message = f"{wanted} is expected, not {_shown(value)}{_meant(first['type'], value)}"
    elif first["type"] == "string_pattern_mismatch":
        pattern = first["ctx"]["pattern"]
        message = f"{PATTERNS.get(pattern, f'text of the pattern {pattern}')} is expected, not {_shown(value)}"
    elif first["type"] in _BOUNDS:
        message = f"{_BOUNDS[first['type']].format(**first['ctx'])} is expected, not {_shown(value)}"
    elif not isinstance(value, dict | list):
        message = f"{message} (got {value!r})"
    where = place_of(loc, lines)
    if _is_option(where):
        source, where = where, ""
    elif not _is_among(first, alone):
        options = _options_near(loc, lines, message)
        where = "; ".join(part for part in (where, f"with {', '.join(options)}" if options else "") if part)
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return ConfigError(f"{source}: {f'key {key}: ' if key else ''}{message}{f' ({where})' if where else ''}{more}")


def blamed(loc: Path_, source: str, lines: Mapping[Path_, str]) -> str:
    """What a wrong value came by: the option of the command line that set it, else the file."""
    where = place_of(loc, lines)
    return where if _is_option(where) else source


def _is_option(where: str) -> bool:
    """Whether a key stands on the command line."""
    return where.startswith("--")


def _is_among(one: Any, error: ValidationError | None) -> bool:
    """Whether a validation has found the same."""
    found = [] if error is None else error.errors()
    return any((other["loc"], other["msg"]) == (one["loc"], one["msg"]) for other in found)


def _options_near(loc: Path_, lines: Mapping[Path_, str], message: str) -> list[str]:
    """The options of keys that the message names, else of the section at `loc`, or the nearest one above it."""
    options = {path: where for path, where in lines.items() if _is_option(where)}
    named = [where for path, where in options.items() if ".".join(map(str, path)) in message]
    if named:
        return named
    for depth in range(len(loc), -1, -1):
        near = [where for path, where in options.items() if path[:depth] == loc[:depth]]
        if near:
            return near
    return []


def option_wanted(error: ValidationError, given: str) -> str:
    """What would be right of an option on the command line, which is one value; empty where that has no words here."""
    first = error.errors()[0]
    if first["type"] in _BOUNDS:
        return f"{_BOUNDS[first['type']].format(**first['ctx'])} is expected, not {given}"
    wanted = _WANTED.get(first["type"])
    return f"{wanted} is expected, not {given}{_meant(first['type'], given)}" if wanted else ""


def _plain(loc: Path_, lines: Mapping[Path_, str]) -> Path_:
    """The path of an error without what is no key of the file."""
    path: Path_ = ()
    for part in loc:
        if not (isinstance(part, str) and _TAG.fullmatch(part)) or (*path, part) in lines:
            path = (*path, part)
    return path


def _any_of(error: ValidationError, loc: Path_, lines: Mapping[Path_, str]) -> str:
    """What would be right of a key that may be of several kinds."""
    kinds = [one["type"] for one in error.errors() if _plain(one["loc"], lines) == loc]
    return " or ".join(dict.fromkeys(_WANTED[kind] for kind in kinds if kind in _WANTED))


def _first(error: ValidationError) -> Any:
    """The first that was found; of a key that is missing and an unknown one beside it the second, its misspelling."""
    found = error.errors()
    first = found[0]
    if first["type"] == "missing":
        beside = first["loc"][:-1]
        unknown = (one for one in found if one["type"] == "extra_forbidden" and one["loc"][:-1] == beside)
        return next(unknown, first)
    return first


def place_of(loc: Path_, lines: Mapping[Path_, str]) -> str:
    """Where a key stands, or the section that lacks it; empty where nothing is known of it.

    The path of an error may also name the variant of a union, which is no key.
    """
    if loc in lines:  # also where the sections above it stand nowhere, as of --set
        return lines[loc]
    below = [where for path, where in lines.items() if path[: len(loc)] == loc and _is_option(where)] if loc else []
    if below:  # --set of keys in a section that stands in no file
        return ", ".join(below)
    path: Path_ = ()
    for part in loc:
        if (*path, part) in lines:
            path = (*path, part)
    return lines.get(path, "")


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return f"the text {value[:_LONGEST]!r}{'...' if len(value) > _LONGEST else ''}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict | list):
        return "a section" if isinstance(value, dict) else "a list"
    return f"{value!r}"


def _meant(kind: str, value: Any) -> str:
    """ ", did you mean VALUE?" where a person would see what was meant."""
    wants_number = kind.startswith(("int", "float"))
    if kind == "string_type" and isinstance(value, bool | int | float):
        return "; quotes make it text"
    if not isinstance(value, str):
        return ""
    if kind.startswith("bool"):
        near = _MEANT.get(value.strip().lower(), value.strip().lower())
        return f", did you mean {near}?" if near in ("true", "false") else ""
    near = value.strip().replace("_", "")
    if "," in near and "." not in near:
        near = near.replace(",", ".")
    number = scalar(near) if wants_number else None
    if not isinstance(number, int | float) or isinstance(number, bool) or (kind.startswith("int") and number % 1):
        return ""
    return f", did you mean {near}?"


def _suggest(section: Any, loc: tuple[int | str, ...]) -> str:
    """ ", did you mean KEY?" with the nearest key of the same section; empty where none is near."""
    named = False  # whether the next part is a name in a mapping, and no key of a section
    for part in loc[:-1]:
        if named:
            named = False
            continue
        field = getattr(section, "model_fields", {}).get(str(part))
        kind = section.registry.at_key(str(part)) if field is None and hasattr(section, "registry") else None
        section = field.annotation if field else kind.section if kind else None
        named = get_origin(section) is dict
        options = getattr(section, "__args__", ())
        section = next((option for option in options if hasattr(option, "model_fields")), section)
    kinds = getattr(section, "registry", ())
    keys = [*getattr(section, "model_fields", {}), *(kind.settings_key for kind in kinds if kind.section)]
    near = difflib.get_close_matches(str(loc[-1]), keys, n=1)
    return f", did you mean {near[0]}?" if near else ""
