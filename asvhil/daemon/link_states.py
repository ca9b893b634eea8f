"""The state of each link in words, with what speaks against one that is open: silence, or bytes that mean nothing."""

from __future__ import annotations

from collections.abc import Mapping

from asvhil.config.ports import GROUND, OPERATOR
from asvhil.links.reconnecting import ReconnectingLink

PATIENCE_NS = 2_000_000_000
SOME_BYTES = 32
WHOLE = ("frames", "sentences", "packets")  # the counters of what was whole


class LinkStates:
    """The links of a daemon; ground stations and operators may be silent as long as they like."""

    def __init__(self, links: Mapping[str, ReconnectingLink]) -> None:
        self._links = links
        self._whole_before: dict[str, tuple[int, int]] = {}  # (opening, what was whole by then)

    def state(self, port: str, t_ns: int, counters: Mapping[str, int]) -> str:
        """Such as `up`, `up, nothing heard yet`; changes seldom. `counters` are those of the backseat's health."""
        link = self._links[port]
        if link.state != "up" or port == OPERATOR or port.startswith(GROUND) or t_ns - link.opened_ns < PATIENCE_NS:
            return link.state
        if not link.received_bytes:
            return "up, nothing heard yet"
        known = [counters[name] for kind in WHOLE if (name := f"{port}.{kind}") in counters]
        opening, before = self._whole_before.setdefault(port, (link.openings, 0))
        if opening != link.openings:
            before = sum(known)
            self._whole_before[port] = (link.openings, before)
        if known and sum(known) <= before and link.received_bytes >= SOME_BYTES:
            return f"up, nothing but bad bytes{', baud rate?' if link.is_serial else ''}"
        return "up"

    def bytes_text(self, port: str) -> str:
        """How much has come in on a link since it was opened."""
        return f"{self._links[port].received_bytes} bytes"
