"""Routes MAVLink frames between links by the rules of the protocol, as mavlink-router applies them. Sans-IO.

A system is reached by the links on which its frames were received. A broadcast goes to all other links, a frame for a
system and component to those where it was heard, and none back to the link it came from. Frames are never changed.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Collection, Mapping
from typing import NamedTuple

from asvhil.io.mavlink.frames import message_id, source, target
from asvhil.types import record

MAX_SENDERS = 1024  # forged senders take places too; beyond it the one not heard for longest is forgotten
MAX_RECENT = 4096


@record
class LinkRules:
    """Message ids that may be routed from a link (in) and to it (out); an empty set is no rule."""

    allow_in: frozenset[int] = frozenset()
    block_in: frozenset[int] = frozenset()
    allow_out: frozenset[int] = frozenset()
    block_out: frozenset[int] = frozenset()

    def lets_in(self, msg_id: int) -> bool:
        return msg_id not in self.block_in and (not self.allow_in or msg_id in self.allow_in)

    def lets_out(self, msg_id: int) -> bool:
        return msg_id not in self.block_out and (not self.allow_out or msg_id in self.allow_out)


class Hops(NamedTuple):
    """Where a frame goes: links in the order of the config, and whether to this program."""

    links: tuple[str, ...]
    local: bool


NOWHERE = Hops((), False)


class RoutingTable:
    """Learns on which links each component is heard, and finds the links that a frame goes to.

    `local` are this program's own (system, component) pairs. Frames that come again on another link within
    `duplicates_ns` are dropped.
    """

    def __init__(
        self, links: Mapping[str, LinkRules], local: Collection[tuple[int, int]], *, duplicates_ns: int = 200_000_000
    ) -> None:
        self._links = dict(links)
        self._local = frozenset(local)
        self._local_systems = frozenset(system_id for system_id, _ in local)
        self._duplicates_ns = duplicates_ns
        self._heard: OrderedDict[tuple[int, int], set[str]] = OrderedDict()
        self._recent: OrderedDict[bytes, tuple[int, str]] = OrderedDict()
        self.counts: Counter[str] = Counter()

    def route(self, link: str, frame: bytes, t_ns: int) -> Hops:
        """The hops of a complete frame received on a link at t_ns."""
        sender = source(frame)
        if sender in self._local:
            # Our own frame, come back through a loop of links; or another sender that uses our ids.
            self.counts["own"] += 1
            return NOWHERE
        if self._is_duplicate(link, frame, t_ns):
            self.counts["duplicate"] += 1
            return NOWHERE
        self._learn(link, sender)
        to = target(frame)
        msg_id = message_id(frame)
        links: tuple[str, ...] = ()
        if self._links[link].lets_in(msg_id):
            reached = self._where(to)
            links = tuple(
                name
                for name, rules in self._links.items()
                if name != link and (reached is None or name in reached) and rules.lets_out(msg_id)
            )
        local = self._is_local(to)
        if not links and not local:
            self.counts["unroutable"] += 1
        self.counts["routed"] += len(links)
        return Hops(links, local)

    def originate(self, frame: bytes, besides: Collection[str] = ()) -> tuple[str, ...]:
        """The links that a frame of our own goes to, without those in `besides`."""
        reached = self._where(target(frame))
        msg_id = message_id(frame)
        return tuple(
            name
            for name, rules in self._links.items()
            if name not in besides and (reached is None or name in reached) and rules.lets_out(msg_id)
        )

    def _learn(self, link: str, sender: tuple[int, int]) -> None:
        if sender[0] == 0:  # not a sender by the protocol
            return
        links = self._heard.get(sender)
        if links is None:
            if len(self._heard) >= MAX_SENDERS:
                self._heard.popitem(last=False)
            links = self._heard[sender] = set()
        links.add(link)
        self._heard.move_to_end(sender)

    def _where(self, to: tuple[int, int]) -> set[str] | None:
        """The links where a target was heard; None where everybody is meant."""
        system_id, component_id = to
        if system_id == 0:
            return None
        if component_id != 0:
            return self._heard.get(to, set())
        return {link for (system, _), links in self._heard.items() if system == system_id for link in links}

    def _is_local(self, to: tuple[int, int]) -> bool:
        system_id, component_id = to
        if system_id == 0:
            return True
        return system_id in self._local_systems if component_id == 0 else to in self._local

    def _is_duplicate(self, link: str, frame: bytes, t_ns: int) -> bool:
        """Whether the same bytes came a moment ago on another link.

        On the same link they are a repetition that its sender meant: not every sender counts its frames.
        """
        if not self._duplicates_ns:
            return False
        recent = self._recent
        while recent:
            first_ns, _ = next(iter(recent.values()))
            if t_ns - first_ns <= self._duplicates_ns and len(recent) < MAX_RECENT:
                break
            recent.popitem(last=False)
        seen = recent.get(frame)
        if seen is not None and seen[1] != link:
            return True
        recent[frame] = (t_ns, link)
        recent.move_to_end(frame)
        return False
