"""Outputs to the bytes that a log keeps and replay compares, and back.

The record is JSON with the fields in the order of `asvhil.types`; bytes are base64, floats are the shortest text that
reads back to the same double. JSON has no NaN: a non-finite float is written as the string "NaN", "Infinity" or
"-Infinity", because the cost of a failed solution must be readable in a log.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from asvhil.errors import LogError
from asvhil.types import Outputs

T = TypeVar("T")

NOT_VALID = (msgspec.DecodeError, UnicodeDecodeError)  # the second for a text that is no UTF-8


def _plain(value: Any) -> Any:
    """A NumPy scalar as a Python number of the same value: msgspec does not know NumPy's."""
    item = getattr(value, "item", None)
    if item is None:
        raise TypeError(f"a {type(value).__name__} cannot be recorded")
    return item()


def _optional_fields(record: type) -> list[str]:
    """The fields of a record that may be None."""
    return [name for name, kind in get_type_hints(record).items() if NoneType in get_args(kind)]


def _count_absent(outputs: Outputs) -> int:
    """The fields of the outputs and of the records in them that are None, each of which is a null in JSON."""
    absent = [getattr(outputs, name) for name in _OPTIONAL].count(None)
    for name, fields in _OPTIONAL_WITHIN.items():
        part = getattr(outputs, name)
        if part is not None:
            absent += [getattr(part, field) for field in fields].count(None)
    return absent


_OPTIONAL = _optional_fields(Outputs)
_OPTIONAL_WITHIN = {
    name: fields
    for name, kind in get_type_hints(Outputs).items()
    for record in (kind, *get_args(kind))
    if isinstance(record, type) and dataclasses.is_dataclass(record) and (fields := _optional_fields(record))
}


_encoder = msgspec.json.Encoder(enc_hook=_plain)
_strict = msgspec.json.Decoder(Outputs)
_lax = msgspec.json.Decoder(Outputs, strict=False)  # reads the three strings above as floats


def encode_outputs(outputs: Outputs) -> bytes:
    """The record of one tick's outputs: equal outputs give equal bytes. TypeError on what JSON cannot hold."""
    data = _encoder.encode(outputs)
    # msgspec writes null for a non-finite float. More nulls than None fields (or that word in a text) take the slow
    # path, which is right in every case.
    if data.count(b"null") > _count_absent(outputs):
        data = _encoder.encode(_spell_non_finite(msgspec.to_builtins(outputs, enc_hook=_plain)))
    return data


def decode_outputs(data: bytes, log: Path | None = None) -> Outputs:
    """The outputs of a record. LogError names the wrong field, and the log that it is in."""
    try:
        return _strict.decode(data)
    except NOT_VALID:
        return decode_record(_lax, data, "outputs record" if log is None else f"{log}: outputs record")


def decode_record(decoder: msgspec.json.Decoder[T], data: bytes, what: str) -> T:
    """The record in the bytes of a message. LogError names what it is of and the wrong field."""
    try:
        return decoder.decode(data)
    except NOT_VALID as error:
        raise LogError(f"{what}: {error}") from None


def _spell_non_finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0.0 else "-Infinity"
    if isinstance(value, dict):
        return {key: _spell_non_finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_spell_non_finite(part) for part in value]
    return value


def first_difference(a: bytes, b: bytes) -> str | None:
    """The first field in which record b (replayed) differs from record a (recorded), with both values; else None."""
    if a == b:
        return None
    try:
        recorded = msgspec.json.decode(a)
    except NOT_VALID:
        return "the recorded bytes are not JSON"
    try:
        replayed = msgspec.json.decode(b)
    except NOT_VALID:
        return "the replayed bytes are not JSON"
    return _difference("", recorded, replayed) or "the same values in other bytes (order of keys, or spaces)"


def _difference(path: str, a: Any, b: Any) -> str | None:
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(key for key in b if key not in a)]:
            below = f"{path}.{key}" if path else key
            if key not in b:
                return f"{below}: {_show(a[key])} recorded, absent in the replay"
            if key not in a:
                return f"{below}: absent in the record, {_show(b[key])} replayed"
            found = _difference(below, a[key], b[key])
            if found:
                return found
        return None
    if isinstance(a, list) and isinstance(b, list):
        for i, (left, right) in enumerate(zip(a, b, strict=False)):
            found = _difference(f"{path}[{i}]", left, right)
            if found:
                return found
        return None if len(a) == len(b) else f"{path}: {len(a)} items recorded, {len(b)} replayed"
    # Compared as JSON, since == does not tell -0.0 from 0.0 nor 1 from 1.0.
    if msgspec.json.encode(a) == msgspec.json.encode(b):
        return None
    return f"{path or 'record'}: {_show(a)} recorded, {_show(b)} replayed"


def _show(value: Any) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= 80 else f"{text[:77]}..."
