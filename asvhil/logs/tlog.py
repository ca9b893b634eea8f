"""The telemetry log of ground stations (.tlog): each record is 8 bytes of Unix time, then one MAVLink frame."""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import BinaryIO

from asvhil.errors import LogError

_TIME = struct.Struct(">Q")
_V1, _V2 = 0xFE, 0xFD
_HEADER = 3  # magic, payload length, and in version 2 the flags that tell of a signature
_SIGNED = 0x01
_LATEST_US = 7_258_118_400_000_000  # the year 2200: any time beyond is damage


def read_tlog(path: Path, on_cut: Callable[[str], None] | None = None) -> Iterator[tuple[int, bytes]]:
    """(Unix time in us, MAVLink frame of version 1 or 2) in file order; checksums are left to the decoder.

    LogError names the byte offset of the first record that is damaged or cut off, after those before it were yielded.
    With `on_cut` a last record that is cut off, as where a ground station lost its power, goes there in words.
    """
    try:
        with path.open("rb") as file:
            cut = yield from _records(file, path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    if cut and on_cut is None:
        raise LogError(f"{path}: {cut}")
    if cut and on_cut is not None:
        on_cut(cut)


def _records(file: BinaryIO, path: Path) -> Generator[tuple[int, bytes], None, str]:
    """Yield the records; returns where the last one is cut off, in words, or an empty text."""
    offset = 0
    while head := file.read(_TIME.size + _HEADER):
        if len(head) < _TIME.size + _HEADER:
            return f"the record at byte {offset} is cut off after {len(head)} bytes"
        (t_us,) = _TIME.unpack_from(head)
        if t_us >= _LATEST_US:
            raise LogError(f"{path}: the record at byte {offset} has a time that cannot be, {t_us} us since 1970")
        start = head[_TIME.size :]
        size = _frame_size(start)
        if size is None:
            at = offset + _TIME.size
            raise LogError(f"{path}: byte {at} is 0x{start[0]:02x}, where a MAVLink frame (0xfe or 0xfd) should start")
        rest = file.read(size - _HEADER)
        if len(rest) < size - _HEADER:
            whole = _TIME.size + size
            return f"the record at byte {offset} is cut off: {len(head) + len(rest)} of {whole} bytes"
        yield t_us, start + rest
        offset += _TIME.size + size
    return ""


def _frame_size(start: bytes) -> int | None:
    """Length of the frame that begins with these 3 bytes: header, payload, checksum, signature; None if it is none."""
    magic, payload, flags = start
    if magic == _V1:
        return 6 + payload + 2
    if magic == _V2:
        return 10 + payload + 2 + (13 if flags & _SIGNED else 0)
    return None
