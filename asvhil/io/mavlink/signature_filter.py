"""Filters what one MAVLink link receives: complete frames, of allowed senders, with valid signatures. Sans-IO."""

from __future__ import annotations

from collections import Counter

from asvhil.io.mavlink.frames import Parser, source
from asvhil.io.mavlink.signing import Verdict, Verifier
from asvhil.types import Frame

OTHER_SENDER = "of other senders"


class Senders:
    """The (system, component) pairs that are accepted, by patterns such as "1/1", "255/*", "*/190"; none: all."""

    def __init__(self, patterns: tuple[str, ...]) -> None:
        self._pairs = []
        for pattern in patterns:
            system, _, component = pattern.partition("/")
            self._pairs.append((_number(system), _number(component or "*")))

    def __contains__(self, sender: object) -> bool:
        if not self._pairs:
            return True
        if not isinstance(sender, tuple):
            return False
        return any(system in (None, sender[0]) and component in (None, sender[1]) for system, component in self._pairs)


def _number(text: str) -> int | None:
    return None if text == "*" else int(text)


class SignatureFilter:
    """Cuts what one link receives into frames, passes those that its rules accept, and counts the others by reason.

    `guards`: there are rules; without any, everything passes.
    """

    def __init__(self, senders: tuple[str, ...] = (), verifier: Verifier | None = None) -> None:
        self._parser = Parser()
        self._senders = Senders(senders)
        self.guards = bool(senders) or verifier is not None
        self.verifier = verifier
        self.rejected: Counter[str] = Counter()

    def receive(self, frame: Frame, unix_ns: int) -> list[bytes]:
        """The accepted MAVLink frames that the bytes of one received frame complete, in order."""
        found = self._parser.receive(frame.peer, frame.data)
        if not self.guards:
            return found
        return [data for data in found if self._accepts(data, frame.t_ns, unix_ns)]

    def _accepts(self, data: bytes, t_ns: int, unix_ns: int) -> bool:
        # Senders first: a frame of one that is not allowed must not change the state of the signature check.
        if source(data) not in self._senders:
            self.rejected[OTHER_SENDER] += 1
            return False
        if self.verifier is None:
            return True
        verdict = self.verifier.check(data, t_ns, unix_ns)
        if verdict is Verdict.ACCEPTED:
            return True
        self.rejected[verdict.value] += 1
        return False
