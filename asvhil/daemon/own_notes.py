"""What the daemon finds wrong with itself: looked at in each tick, and told to the backseat when it changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from asvhil.config import AutopilotLinkConfig
from asvhil.config.ports import OPERATOR
from asvhil.operator.shell_notes import NoteSender
from asvhil.types import Frame, Note


class OwnNotes:
    """Notes by their subject. Each of `watches` tells what is wrong with its subject, with no text where nothing is."""

    def __init__(self, config: AutopilotLinkConfig, watches: Mapping[str, Callable[[], str]]) -> None:
        self._sender = NoteSender(config)
        self._watches = dict(watches)
        self._told: dict[str, str] = {}
        self._events: dict[str, str] = {}

    def note(self, subject: str, text: str) -> None:
        """What has happened, and stands until it is noted anew."""
        self._events[subject] = text

    def take_frames(self, t_ns: int) -> list[Frame]:
        """The frames that tell what has changed since the last call."""
        now = self._events | {subject: tell() for subject, tell in self._watches.items()}
        frames = []
        for subject, text in now.items():
            if text != self._told.get(subject, ""):
                data = self._sender.encode(Note(subject=subject, text=text, ok=False))
                frames.append(Frame(t_ns=t_ns, port=OPERATOR, data=data))
        self._told = now
        return frames
