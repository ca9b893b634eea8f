"""The records at the start of a log: their digests, which of them are damaged, and the search for intact ones.

MCAP has no checksum of a metadata record. So the record that closes them holds a SHA-256 of each, and of itself. Of
logs from before that, the config and the model are checked by the digests that they hold themselves.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import re
from base64 import b64decode
from collections.abc import Callable, Mapping
from pathlib import PurePath
from struct import Struct
from struct import error as StructError

from mcap.opcode import Opcode

from asvhil.logs.resync import RECORD_HEAD
from asvhil.types import record

Values = Mapping[str, str]

PROFILE = "asvhil"
LAYOUT = "1"
LAYOUT_RECORD = "asvhil"  # the name of the metadata record that closes the others
SEGMENT_RECORD = "segment"  # of those of a segment, and the one at its end
CONTINUED_RECORD = "continued"

DAMAGED_PREFIX = "damaged."  # of a record that `recover` keeps without trusting it
_DIGEST_PREFIX, _OWN_DIGEST = "sha256.", "sha256"
_LENGTH = Struct("<I")
# A metadata record below 4 GiB, with a name below 64 KiB.
_LOOKS_LIKE_ONE = re.compile(rb"\x0c(?=.{4}\x00{4}.{2}\x00{2})", re.DOTALL)


def closing_record(records: Mapping[str, Values]) -> dict[str, str]:
    """The values of the record that closes the others."""
    values = {"layout": LAYOUT, "records": str(len(records))}
    values |= {f"{_DIGEST_PREFIX}{name}": digest(record) for name, record in records.items()}
    return values | {_OWN_DIGEST: digest(values)}


def closing_is_damaged(closing: Values) -> bool:
    """Whether the closing record is not what was written; False for one that has no digest."""
    own = closing.get(_OWN_DIGEST)
    if own is None:
        return any(key.startswith(_DIGEST_PREFIX) for key in closing)
    return own != digest({key: value for key, value in closing.items() if key != _OWN_DIGEST})


def is_closing(values: Values) -> bool:
    """Whether a record is an intact closing one, whatever its name is."""
    return _OWN_DIGEST in values and "layout" in values and not closing_is_damaged(values)


def digests_of(closing: Values) -> dict[str, str]:
    """The digests in a closing record, by the names of the others."""
    prefix = _DIGEST_PREFIX
    return {key.removeprefix(prefix): value for key, value in closing.items() if key.startswith(prefix)}


def damaged_names(records: Mapping[str, Values], closing: Values | None) -> list[str]:
    """The records that are not what was written, or are missing; `closing` None: not there, or damaged itself."""
    digests = digests_of(closing or {})
    if digests:
        found = [name for name, values in records.items() if digests.get(name) != digest(values)]
        return [*found, *(name for name in digests if name not in records)]
    checks: dict[str, Callable[[Values], bool]] = {
        "config": _config_is_intact,
        "model": lambda values: model_bytes(values) is not None,
    }
    return [name for name, intact in checks.items() if name in records and not intact(records[name])]


def parse_record(opcode: int, content: bytes) -> tuple[str, dict[str, str]] | None:
    """Name and values of a metadata record; of the header its profile, and no values. None where it is not intact."""
    try:
        name, at = _text(content, 0)
        if opcode == Opcode.HEADER:
            return (name, {}) if _text(content, at)[1] == len(content) else None
        (size,) = _LENGTH.unpack_from(content, at)
        at += _LENGTH.size
        if opcode != Opcode.METADATA or at + size != len(content):
            return None
        values = {}
        while at < len(content):
            key, at = _text(content, at)
            values[key], at = _text(content, at)
    except (StructError, UnicodeDecodeError):
        return None
    return (name, values) if at == len(content) else None


@record
class Found:
    """A record before the data of a log: its name (the profile, of the header) and values, None where it is not intact.

    `mended`: its opcode or its length is damaged, but not what they stand before.
    """

    offset: int
    name: str | None
    values: dict[str, str]
    mended: bool = False


def found_record(offset: int, opcode: int, content: bytes, *, mended: bool = False) -> Found:
    """The record at an offset, of its content."""
    name, values = parse_record(opcode, content) or (None, {})
    return Found(offset=offset, name=name, values=values, mended=mended)


def search_records(begin: bytes | mmap.mmap, start: int) -> list[Found]:
    """All records from `start` on in the bytes before a log's first chunk.

    One whose opcode or length alone is damaged is read up to the next.
    """
    found: list[Found] = []
    at = start
    while at + RECORD_HEAD.size <= len(begin):
        opcode, length = RECORD_HEAD.unpack_from(begin, at)
        content_at, end = at + RECORD_HEAD.size, at + RECORD_HEAD.size + length
        one = found_record(at, opcode, begin[content_at:end])
        if one.name is None or end > len(begin):
            end = _next_record(begin, at + 1)
            expected = Opcode.HEADER if at == start else Opcode.METADATA
            one = found_record(at, expected, begin[content_at:end], mended=True)
        found.append(one)
        at = end
    return found


def _next_record(begin: bytes | mmap.mmap, at: int) -> int:
    """The offset of the next intact metadata record, or the end of the bytes."""
    for match in _LOOKS_LIKE_ONE.finditer(begin, at):
        _, length = RECORD_HEAD.unpack_from(begin, match.start())
        content_at = match.start() + RECORD_HEAD.size
        content = begin[content_at : content_at + length]
        if len(content) == length and parse_record(Opcode.METADATA, content) is not None:
            return match.start()
    return len(begin)


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A text with its length before it, and the place behind it. struct.error where the bytes end before."""
    (size,) = _LENGTH.unpack_from(content, at)
    end = at + _LENGTH.size + size
    if end > len(content):
        raise StructError
    return content[at + _LENGTH.size : end].decode(), end


def digest(values: Values) -> str:
    """The SHA-256 of a record's values."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _config_is_intact(values: Values) -> bool:
    """By the hash beside the text, which is of the text itself but for the folders of plug-in files."""
    text, stored = values.get("json"), values.get("hash")
    if text is None or stored is None:
        return False
    if _short_hash(text) == stored:
        return True
    try:
        tree = json.loads(text)
        for one in tree["plugins"]:
            one["file"] = PurePath(one["file"]).name
    except (ValueError, RecursionError, KeyError, TypeError):
        return False
    return _short_hash(json.dumps(tree, sort_keys=True)) == stored


def _short_hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def model_bytes(values: Values) -> bytes | None:
    """The file of a model record; None where it is not what its SHA-256 says."""
    try:
        data = b64decode(values["base64"], validate=True)
        return data if hashlib.sha256(data).hexdigest() == values["sha256"] else None
    except (KeyError, ValueError):
        return None
