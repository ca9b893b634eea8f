"""Other messages of a real PX4, which this program does not read: PING, and messages outside of the dialect."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.io.mavlink.frames import MAGIC_V2, checksum

PING_NS = 1_000_000_000
# Message id, CRC_EXTRA, bytes of payload and interval of those that PX4 1.15 and 1.16 send on an onboard link and the
# ardupilotmega dialect does not have, as recorded.
UNKNOWN = (
    (8, 117, 27, 1_000_000_000),
    (290, 251, 46, 100_000_000),
    (291, 10, 56, 100_000_000),
    (380, 232, 20, 2_000_000_000),
    (410, 160, 18, 2_000_000_000),
    (411, 106, 2, 3_000_000_000),
    (436, 193, 8, 2_000_000_000),
)


class UnknownMessage:
    """A message that the dialect does not have. It has `pack`, as an outbox requires."""

    def __init__(self, msg_id: int, seed: int, payload: bytes) -> None:
        self._msg_id, self._seed, self._payload = msg_id, seed, payload

    def pack(self, mav: Any) -> bytes:
        """The whole frame, MAVLink 2, with the sequence number that `mav` is at."""
        header = bytes([MAGIC_V2, len(self._payload), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent])
        body = header + self._msg_id.to_bytes(3, "little") + self._payload
        return body + checksum(body, bytes([self._seed]))


class RawFrame:
    """A frame of another sender, forwarded unchanged."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def pack(self, mav: Any) -> bytes:
        """The frame."""
        return self._data


class OtherTraffic:
    """The other messages of one vehicle; call `take_due` at each loop."""

    def __init__(self, t_ns: int) -> None:
        self._start_ns = t_ns
        self._pings = 0
        self._ping_ns = t_ns
        self._due_ns = {row[0]: t_ns + row[3] for row in UNKNOWN}

    def take_due(self, t_ns: int, us: int) -> list[Any]:
        """The messages to send now; `us` is the time of the vehicle."""
        sent: list[Any] = []
        if t_ns >= self._ping_ns:
            self._ping_ns += PING_NS
            sent.append(dialect.MAVLink_ping_message(us, self._pings, 0, 0))
            self._pings += 1
        for msg_id, seed, size, interval_ns in UNKNOWN:
            if t_ns >= self._due_ns[msg_id]:
                self._due_ns[msg_id] += interval_ns
                payload = us.to_bytes(8, "little") + bytes(range(1, size + 1))
                sent.append(UnknownMessage(msg_id, seed, payload[:size]))
        return sent
