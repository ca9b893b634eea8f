"""How many values a key of a config takes, in words, where an error of its validation is about that."""

from __future__ import annotations

from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

_COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}
_NOUNS = {(float,): "number", (int,): "whole number", (str,): "text"}


def count_wanted(root: Any, error: Any) -> str:
    """ "two numbers are expected, not 3"; empty where an error is not about the length of a list.

    `root`: the model that was validated. `error`: one of `ValidationError.errors()`; of a list of a fixed length that
    is too short, it tells the number of a value that is missing.
    """
    kind, loc = error["type"], error["loc"]
    if kind == "missing" and loc and isinstance(loc[-1], int):
        return _exactly(_annotation(root, loc[:-1]), error["input"])
    if kind == "too_long":
        most = error["ctx"]["max_length"]
        return _exactly(_annotation(root, loc), error["input"]) or _several(f"{most} or fewer", error)
    if kind == "too_short":
        return _several(f"{error['ctx']['min_length']} or more", error)
    return ""


def _several(count: str, error: Any) -> str:
    return f"a list of {count} is expected, not of {error['ctx']['actual_length']}"


def _exactly(annotation: Any, value: Any) -> str:
    """What is expected of a tuple of a fixed length; empty of anything else."""
    parts = _options(annotation, tuple)
    if not parts or Ellipsis in parts:
        return ""
    noun = _NOUNS.get(tuple({_bare(part) for part in parts}), "value")
    verb = "s are" if len(parts) > 1 else " is"
    return f"{_COUNTS.get(len(parts), len(parts))} {noun}{verb} expected, not {len(value)}"


def _annotation(root: Any, loc: tuple[int | str, ...]) -> Any:
    """What a model expects at a path; None where that is not known."""
    here = root
    for part in loc:
        here = _below(_bare(here), part)
    return here


def _below(here: Any, part: int | str) -> Any:
    field = getattr(here, "model_fields", {}).get(str(part))
    if field is not None:
        return field.annotation
    if hasattr(here, "registry"):
        kind = here.registry.at_key(str(part))
        return kind.section if kind else None
    if isinstance(part, int):
        parts = _options(here, tuple) or _options(here, list)
        return parts[part] if part < len(parts) and Ellipsis not in parts else next(iter(parts), None)
    return next(iter(_options(here, dict)[1:]), None)


def _options(annotation: Any, kind: type) -> tuple[Any, ...]:
    """The arguments of a generic type, such as `tuple[float, float]`; none of others."""
    bare = _bare(annotation)
    return get_args(bare) if get_origin(bare) is kind else ()


def _bare(annotation: Any) -> Any:
    """A type without what is noted about it, and without None."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return _bare(get_args(annotation)[0])
    if origin in (Union, UnionType):
        return _bare(next(part for part in get_args(annotation) if part is not type(None)))
    return annotation
