"""Set-points that come as a stream, of which only the first takes a station and none counts after a later one."""

from __future__ import annotations

from asvhil.io.mavlink.frames import Parser, sequence, source
from asvhil.operator.repeats import BEHIND
from asvhil.types import Address, Frame

STREAM_NS = 3_000_000_000  # set-points closer than this are one stream


class SetpointStreams:
    """The last set-point of each sender, by time and by number."""

    def __init__(self) -> None:
        self._last: dict[tuple[Address, tuple[int, int]], tuple[int, int]] = {}

    def take(self, frame: Frame, data: bytes) -> tuple[bool, bool]:
        """A complete frame: whether it goes on with a stream, and whether a later set-point of it has come already."""
        key, number = (frame.address, source(data)), sequence(data)
        last = self._last.pop(key, None)
        streaming = last is not None and frame.t_ns - last[0] < STREAM_NS
        overtaken = streaming and last is not None and 0 < (last[1] - number) % 256 <= BEHIND
        if len(self._last) >= Parser.MAX_PEERS:
            self._last.pop(next(iter(self._last)))
        self._last[key] = frame.t_ns, last[1] if overtaken and last is not None else number
        return streaming, overtaken
