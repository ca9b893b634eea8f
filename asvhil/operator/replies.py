"""What the daemon answers to operators, as frames of its own component or of the one that was asked. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.config.ports import OPERATOR
from asvhil.io.mavlink.frames import dialect, pack
from asvhil.io.mavlink.texts import Texts
from asvhil.supervisor.reasons import Explanation, describe
from asvhil.types import Address, Frame

REPEAT_NS = 5_000_000_000  # the same refusal of a stream is sent no more often


class Replies:
    """Collects frames until they are taken; each sender numbers its own."""

    def __init__(self, us: tuple[int, int]) -> None:
        self._us = us
        self._senders = {us: dialect.MAVLink(None, srcSystem=us[0], srcComponent=us[1])}
        self._texts = Texts()
        self._refused_ns: dict[str, int] = {}
        self._to_send: list[Frame] = []

    def take(self) -> list[Frame]:
        """What has come together since the last call."""
        frames, self._to_send = self._to_send, []
        return frames

    def send(self, t_ns: int, message: Any, address: Address, answer_as: tuple[int, int] | None = None) -> None:
        """A message of ours, or of the (system, component) that it answers as."""
        sender = answer_as or self._us
        mav = self._senders.get(sender)
        if mav is None:
            mav = self._senders[sender] = dialect.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])
        data = pack(message, mav)
        mav.seq = (mav.seq + 1) % 256
        self._to_send.append(Frame(t_ns=t_ns, port=OPERATOR, data=data, peer=address.peer, via=address.via))

    def send_text(self, t_ns: int, severity: int, text: str, address: Address) -> None:
        """STATUSTEXT, in as many messages as the text needs."""
        for message in self._texts.messages(severity, text):
            self.send(t_ns, message, address)

    def send_refusal(self, t_ns: int, why: Explanation, address: Address, *, seldom: bool = False) -> None:
        """Why something is not done, as STATUSTEXT; `seldom`: not where the same was sent a moment ago."""
        text = describe(why)
        if seldom:
            self._refused_ns = {said: at for said, at in self._refused_ns.items() if t_ns - at < REPEAT_NS}
            if text in self._refused_ns:
                return
            self._refused_ns[text] = t_ns
        self.send_text(t_ns, dialect.MAV_SEVERITY_WARNING, text, address)
