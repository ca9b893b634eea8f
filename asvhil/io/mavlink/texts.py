"""STATUSTEXT: texts to messages, and messages to texts. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.io.mavlink.frames import dialect

TEXT_BYTES = 50


class Texts:
    """STATUSTEXT: texts beyond 50 bytes go in pieces with a number in common, as MAVLink 2 has it."""

    def __init__(self) -> None:
        self._number = 0

    def messages(self, severity: int, text: str) -> list[Any]:
        """The pieces, in order. A short text is one message without a number."""
        data = text.encode("ascii", "replace")
        if len(data) <= TEXT_BYTES:
            return [dialect.MAVLink_statustext_message(severity, data)]
        self._number = self._number % 65535 + 1
        # The last piece is known by the zeros at its end, so a text that fills its pieces needs an empty one.
        return [
            dialect.MAVLink_statustext_message(severity, data[at : at + TEXT_BYTES], self._number, at // TEXT_BYTES)
            for at in range(0, len(data) + 1, TEXT_BYTES)
        ]


class TextReader:
    """Puts the pieces of a sender's texts together again; a piece that is lost takes its text with it."""

    def __init__(self) -> None:
        self._number = 0
        self._pieces: list[str] = []

    def receive(self, message: Any) -> str | None:
        """The text that a STATUSTEXT brings to an end, if it does, without the tab that PX4 ends some with."""
        if message.id == 0:
            return str(message.text).rstrip("\t")
        if message.chunk_seq == 0:
            self._number, self._pieces = message.id, []
        elif message.id != self._number or message.chunk_seq != len(self._pieces):
            return None
        self._pieces.append(message.text)
        return "".join(self._pieces).rstrip("\t") if len(message.text) < TEXT_BYTES else None
