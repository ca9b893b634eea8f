"""MAVLink messages in the frames of a tick."""

from collections.abc import Iterable
from typing import Any

from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.types import Frame


def messages(frames: Iterable[Frame], port: str = "", peer: str | None = None) -> list[Any]:
    """The messages of all frames, or of those of a port (and a peer), decoded frame by frame.

    AssertionError where a frame holds a message that the dialect does not have.
    """
    found = []
    for frame in frames:
        if (port and frame.port != port) or (peer is not None and frame.peer != peer):
            continue
        for data in FrameSplitter().receive(frame.data):
            message = decode(data)
            assert message is not None, data.hex()
            found.append(message)
    return found


def of_type(found: Iterable[Any], *names: str) -> list[Any]:
    """The messages of some types."""
    return [message for message in found if message.get_type() in names]


def overrides_us(frames: Iterable[Frame]) -> list[tuple[int, int]]:
    """(port, starboard) of each RC_CHANNELS_OVERRIDE, on channels 1 and 3."""
    return [(m.chan1_raw, m.chan3_raw) for m in of_type(messages(frames, "autopilot"), "RC_CHANNELS_OVERRIDE")]
