"""What the shell finds wrong with itself, told to the core as frames, so that operators get it and a replay has it too.

A note travels as a STATUSTEXT of our own system and component, "SUBJECT: TEXT"; one without a text takes it back.
Sans-IO.
"""

from __future__ import annotations

from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.texts import TextReader, Texts
from asvhil.types import Note

MOST = 16


class NoteSender:
    """The shell's side: notes to frames."""

    def __init__(self, config: AutopilotLinkConfig) -> None:
        self._mav = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._texts = Texts()

    def encode(self, note: Note) -> bytes:
        """The frames of a note, one behind the other."""
        severity = dialect.MAV_SEVERITY_INFO if note.ok else dialect.MAV_SEVERITY_WARNING
        messages = self._texts.messages(severity, f"{note.subject}: {note.text}")
        return b"".join(bytes(message.pack(self._mav)) for message in messages)


class NoteReader:
    """The core's side: `notes` are those that stand."""

    def __init__(self) -> None:
        self._reader = TextReader()
        self._notes: dict[str, Note] = {}

    @property
    def notes(self) -> tuple[Note, ...]:
        """In the order in which their subjects were first told."""
        return tuple(self._notes.values())

    def receive(self, message: Any) -> None:
        """Take in a STATUSTEXT of our own."""
        whole = self._reader.receive(message)
        if whole is None:
            return
        subject, _, text = whole.partition(": ")
        if not text:
            self._notes.pop(subject.rstrip(": "), None)
        elif subject in self._notes or len(self._notes) < MOST:
            ok = message.severity >= dialect.MAV_SEVERITY_NOTICE
            self._notes[subject] = Note(subject=subject, text=text, ok=ok)
