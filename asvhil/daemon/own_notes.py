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
        self._states: dict[str, tuple[str, bool]] = {}
        self._states_told: dict[str, tuple[str, bool]] = {}

    def note(self, subject: str, text: str) -> None:
        """What has happened, and stands until it is noted anew."""
        self._events[subject] = text

    def state(self, subject: str, text: str, *, ok: bool) -> None:
        """How something is, whether well or not, until it is told anew."""
        self._states[subject] = text, ok

    def take_frames(self, t_ns: int) -> list[Frame]:
        """The frames that tell what has changed since the last call."""
        now = self._events | {subject: tell() for subject, tell in self._watches.items()}
        news = []
        for subject, text in now.items():
            if text != self._told.get(subject, ""):
                news.append(Note(subject=subject, text=text, ok=False))
        for subject, (text, ok) in self._states.items():
            if self._states_told.get(subject) != (text, ok):
                news.append(Note(subject=subject, text=text, ok=ok))
        self._told, self._states_told = now, dict(self._states)
        return [Frame(t_ns=t_ns, port=OPERATOR, data=self._sender.encode(note)) for note in news]
