"""MAVLink 2 message signing, sans-IO: our own signatures, and the check of others' before anything parses them.

The signature is the first 48 bits of SHA-256(key, header, payload, CRC, link id, timestamp); timestamps count 10 us
since 2015 and rise strictly within each stream (system, component, link id). https://mavlink.io, message signing.

Nothing is remembered of a frame before its signature is verified, so a sender without the key changes no state here: it
can neither lock a rightful peer out nor move our time. Time comes in twice: `t_ns`, which never steps, and `unix_ns`,
the computer's clock as it is believed now, which a time server may set right while we run.
"""

from __future__ import annotations

import enum
import hashlib
import hmac
import re
from collections import Counter
from collections.abc import Collection, Mapping

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import MAGIC_V2, SIGNATURE_LENGTH, SIGNED, checksum, message_id, source
from asvhil.types import record

KEY_BYTES = 32
LIKE_A_KEY = 48  # hexadecimal digits; nobody makes a passphrase of so many
SIGNATURE_BYTES = 6
TIMESTAMP_BYTES = 6
EPOCH_2015_NS = 1_420_070_400_000_000_000
TICK_NS = 10_000
PER_SECOND = 100_000
# A clock that stands before this was never set: computers without a clock battery start in 1970.
CLOCK_UNSET_BEFORE = (1_767_225_600_000_000_000 - EPOCH_2015_NS) // TICK_NS  # 2026-01-01
MAX_STREAMS = 1024  # only owners of the key can make streams; this bounds a faulty one

_HEX = re.compile("[0-9A-Fa-f]+")

Stream = tuple[int, int, int]  # system id, component id, link id


def derive_key(text: str) -> bytes:
    """The 32-byte key of a key file's text: 64 hexadecimal digits as they are, else the passphrase's SHA-256.

    Ground stations make the key of a passphrase in the same way. Raises ConfigError, without the text, when empty, of
    several lines, or nearly a key: a digit too few makes a passphrase that nobody else has.
    """
    text = text.strip()
    if not text:
        raise ConfigError("is empty; 64 hexadecimal digits or a passphrase is expected")
    if not text.isprintable():
        raise ConfigError("is more than one line of text; 64 hexadecimal digits or a passphrase is expected")
    digits = "".join(character for character in text if character not in " :-").removeprefix("0x")
    if len(digits) >= LIKE_A_KEY and _HEX.fullmatch(digits) and len(text) != 2 * KEY_BYTES:
        raise ConfigError(f"has {len(digits)} hexadecimal digits; {2 * KEY_BYTES}, without blanks or signs, are a key")
    if len(text) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(text)
        except ValueError:
            pass
    return hashlib.sha256(text.encode()).digest()


def timestamp_of(unix_ns: int) -> int:
    """A time of day as a signing timestamp (10 us since 2015-01-01 UTC); 0 before that."""
    return max(0, (unix_ns - EPOCH_2015_NS) // TICK_NS)


def is_signed(frame: bytes) -> bool:
    """Whether a complete frame carries a signature."""
    return frame[0] == MAGIC_V2 and bool(frame[2] & SIGNED)


def sign(frame: bytes, key: bytes, link_id: int, timestamp: int) -> bytes:
    """A complete, unsigned MAVLink 2 frame with its signature; MAVLink 1, or signed already: unchanged."""
    if frame[0] != MAGIC_V2 or frame[2] & SIGNED:
        return frame
    body = frame[:2] + bytes([frame[2] | SIGNED]) + frame[3:-2]
    signed = body + checksum(body) + bytes([link_id]) + timestamp.to_bytes(TIMESTAMP_BYTES, "little")
    return signed + hashlib.sha256(key + signed).digest()[:SIGNATURE_BYTES]


class Verdict(enum.StrEnum):
    """What became of a frame; all but the first mean that it is dropped."""

    ACCEPTED = "accepted"
    UNSIGNED = "unsigned"
    BAD_SIGNATURE = "wrongly signed"
    REPLAYED = "replayed"
    TOO_OLD = "too old"
    FUTURE = "future-dated"
    TOO_MANY_STREAMS = "of too many streams"


@record
class SigningState:
    """What has to survive a restart: the highest timestamp sent or accepted, and the last of each stream."""

    last: int
    streams: Mapping[Stream, int]


FIRST_START = SigningState(last=0, streams={})


class SigningClock:
    """The source of outgoing timestamps, one for all links of a key, so that none is ever used twice."""

    def __init__(self, last: int = 0) -> None:
        self.last = last

    def next(self, unix_ns: int) -> int:
        """The timestamp of the next frame: the time of day, or one more than the last where that is higher."""
        self.last = max(timestamp_of(unix_ns), self.last + 1)
        return self.last

    def ahead(self, unix_ns: int, by: int) -> int:
        """A timestamp for a frame that may leave later, `by` ticks of 10 us ahead of all that left until now."""
        return max(timestamp_of(unix_ns), self.last) + by

    def learn(self, timestamp: int) -> None:
        """A peer is ahead: follow, or it would take our frames for old ones."""
        self.last = max(self.last, timestamp)


class Signer:
    """Signs what leaves on one link."""

    def __init__(self, key: bytes, link_id: int, clock: SigningClock) -> None:
        self._key = key
        self._link_id = link_id
        self._clock = clock

    def sign(self, frame: bytes, unix_ns: int) -> bytes:
        """The frame, signed now."""
        return sign(frame, self._key, self._link_id, self._clock.next(unix_ns))

    def sign_ahead(self, frame: bytes, unix_ns: int, by: int) -> bytes:
        """The frame, signed to leave later, if at all: `by` ticks of 10 us ahead of what left until now."""
        return sign(frame, self._key, self._link_id, self._clock.ahead(unix_ns, by))


class Verifier:
    """Tells which frames of one link come, freshly, from an owner of the key.

    `max_ahead_s` None: frames may be dated ahead as far as they like, as the standard has it. A clock that was never
    set cannot tell, so there is no limit with it either.
    """

    def __init__(
        self,
        key: bytes,
        clock: SigningClock,
        *,
        accept_unsigned: Collection[int] = (),
        max_behind_s: float = 60.0,
        max_ahead_s: float | None = 60.0,
        state: SigningState = FIRST_START,
        start_ns: int = 0,
    ) -> None:
        self._key = key
        self._clock = clock
        self._accept_unsigned = frozenset(accept_unsigned)
        self._behind = round(max_behind_s * PER_SECOND)
        self._ahead = None if max_ahead_s is None else round(max_ahead_s * PER_SECOND)
        self._start = (state.last, start_ns)
        self._streams: dict[Stream, tuple[int, int]] = {
            stream: (timestamp, start_ns) for stream, timestamp in state.streams.items()
        }
        self.counts: Counter[Verdict] = Counter()
        clock.learn(state.last)

    def check(self, frame: bytes, t_ns: int, unix_ns: int) -> Verdict:
        """The verdict on a complete frame whose checksum holds, received at t_ns."""
        verdict = self._check(frame, t_ns, unix_ns)
        self.counts[verdict] += 1
        return verdict

    def state(self) -> SigningState:
        """What to keep for the next start."""
        return SigningState(
            last=self._clock.last, streams={stream: timestamp for stream, (timestamp, _) in self._streams.items()}
        )

    def _check(self, frame: bytes, t_ns: int, unix_ns: int) -> Verdict:
        if not is_signed(frame):
            return Verdict.ACCEPTED if message_id(frame) in self._accept_unsigned else Verdict.UNSIGNED
        expected = hashlib.sha256(self._key + frame[:-SIGNATURE_BYTES]).digest()[:SIGNATURE_BYTES]
        if not hmac.compare_digest(expected, frame[-SIGNATURE_BYTES:]):
            return Verdict.BAD_SIGNATURE
        # From here on the frame was made by an owner of the key, though perhaps sent again by somebody else.
        timestamp = int.from_bytes(frame[-SIGNATURE_BYTES - TIMESTAMP_BYTES : -SIGNATURE_BYTES], "little")
        stream = (*source(frame), frame[-SIGNATURE_LENGTH])
        known = self._streams.get(stream)
        now = self._now(t_ns, unix_ns)
        if known is not None and timestamp <= known[0]:
            return Verdict.REPLAYED
        if known is None and timestamp < now - self._behind:
            return Verdict.TOO_OLD
        if self._is_ahead(timestamp, known, now, t_ns, unix_ns):
            return Verdict.FUTURE
        if known is None and len(self._streams) >= MAX_STREAMS:
            return Verdict.TOO_MANY_STREAMS
        self._streams[stream] = (timestamp, t_ns)
        self._clock.learn(timestamp)
        return Verdict.ACCEPTED

    def _now(self, t_ns: int, unix_ns: int) -> int:
        """The time that it must be at least: by the clock, and by what was known at the start and has passed since."""
        last, start_ns = self._start
        return max(timestamp_of(unix_ns), last + (t_ns - start_ns) // TICK_NS)

    def _is_ahead(self, timestamp: int, known: tuple[int, int] | None, now: int, t_ns: int, unix_ns: int) -> bool:
        if self._ahead is None or timestamp_of(unix_ns) < CLOCK_UNSET_BEFORE:
            return False
        if timestamp <= now + self._ahead:
            return False
        # When our own clock was set back, a stream that only went on as time does is not ahead of it.
        return known is None or timestamp > known[0] + (t_ns - known[1]) // TICK_NS + self._ahead
