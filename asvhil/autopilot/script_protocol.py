"""What the daemon and the script on the autopilot tell each other: orders by TUNNEL, an alive sign by named floats.

An order is 16 bytes, little-endian: version, order, start (u16), count (u32), the pulses of port and starboard (u16,
us), and a CRC-32 over sender, target and all before. The script is `firmware/ardupilot_script/asvhil.lua`. Sans-IO.
"""

from __future__ import annotations

import enum
import math
import struct
import zlib
from typing import Any

from asvhil.io.mavlink.frames import dialect
from asvhil.types import record

VERSION = 1
PAYLOAD_TYPE = 42353  # from 32768 on MAVLink leaves the numbers to private use
SENDERS = range(191, 195)  # component ids of onboard computers: the script listens to no others
SHORTEST_US, LONGEST_US = 800, 2200  # the script drops orders with pulses beyond these
TIMEOUT_S = 0.3  # after which the autopilot drops the pulses of an order
ALIVE_S = 0.5  # between two alive signs, at most
MOST = 1 << 24  # the alive sign's counts start again there

ORDER = struct.Struct("<BBHIHH")
CHECK = struct.Struct("<I")
LENGTH = ORDER.size + CHECK.size
SPACE = 128  # of a TUNNEL's payload

WHY, START, USED, DROPPED = "ASV_WHY", "ASV_START", "ASV_USED", "ASV_DROP"
NAMES = (WHY, START, USED, DROPPED)


class Order(enum.IntEnum):
    """What the script is to do."""

    RELEASE = 0
    DRIVE = 1


class ScriptReason(enum.IntEnum):
    """Why the script drives the motors or does not. The script's own numbers: none is ever changed."""

    READY = 0
    DRIVING = 1
    SILENT = 2
    RELEASED = 3
    DISARMED = 4
    MODE = 5
    EMERGENCY_STOP = 6
    STICK = 7
    OUTPUTS = 8


TEXTS = {
    ScriptReason.READY: "ready for a start",
    ScriptReason.DRIVING: "drives the motors",
    ScriptReason.SILENT: "no orders came for 0.3 s: the motors are neutral",
    ScriptReason.RELEASED: "the motors were released",
    ScriptReason.DISARMED: "the vehicle is, or was, disarmed",
    ScriptReason.MODE: "the mode is, or was, not HOLD",
    ScriptReason.EMERGENCY_STOP: "the emergency stop is, or was, on",
    ScriptReason.STICK: "the pilot has, or had, a stick off its centre",
    ScriptReason.OUTPUTS: "SERVOn_FUNCTION 73 and 74 are not on one output each",
}


@record
class ScriptState:
    """The alive sign. `reason` is None for a number that only another version knows.

    `start`: what the next session must begin with; `used` and `dropped`: orders, counted modulo 2^24.
    """

    version: int
    reason: ScriptReason | None
    start: int
    used: int
    dropped: int

    @property
    def driving(self) -> bool:
        """Whether a session has the motors."""
        return self.reason in (ScriptReason.DRIVING, ScriptReason.SILENT)


def encode_order(
    order: Order,
    *,
    start: int,
    count: int,
    pulses_us: tuple[int, int],
    sender: tuple[int, int],
    target: tuple[int, int],
) -> Any:
    """The TUNNEL with an order; `sender` and `target` are (system id, component id), as in its header.

    `start` is what the alive sign tells for a new session, and stays in it; `count` rises with each order, below 2^31.
    Raises ValueError where the script would drop it.
    """
    if sender[1] not in SENDERS:
        raise ValueError(f"component id {sender[1]}: the script listens to {SENDERS[0]} to {SENDERS[-1]} only")
    if not 0 < count < 2**31:
        raise ValueError(f"count {count} is not from 1 to 2^31 - 1")
    if not all(SHORTEST_US <= pulse_us <= LONGEST_US for pulse_us in pulses_us):
        raise ValueError(f"pulses {pulses_us} us are not from {SHORTEST_US} to {LONGEST_US} us")
    body = ORDER.pack(VERSION, order, start % 2**16, count, *pulses_us)
    head = struct.pack("<BBHBBB", *sender, PAYLOAD_TYPE, *target, LENGTH)
    payload = (body + CHECK.pack(zlib.crc32(head + body))).ljust(SPACE, b"\0")
    return dialect.MAVLink_tunnel_message(*target, PAYLOAD_TYPE, LENGTH, payload)


class AliveSign:
    """Puts the values of the alive sign together: each comes as a message of its own, and any may be lost."""

    def __init__(self) -> None:
        self._values: dict[str, int] = {}
        self.heard_ns: int | None = None  # the last of its messages
        self.state: ScriptState | None = None  # known once all four have come

    def receive(self, t_ns: int, message: Any) -> bool:
        """Take in a NAMED_VALUE_FLOAT of the autopilot; whether it is of the alive sign."""
        name, value = message.name, message.value
        if name not in NAMES or not math.isfinite(value) or not 0 <= value <= MOST:
            return False
        self._values[name] = int(value)
        self.heard_ns = t_ns
        if len(self._values) == len(NAMES):
            version, number = divmod(self._values[WHY], 100)
            self.state = ScriptState(
                version=version,
                reason=ScriptReason(number) if number in TEXTS else None,
                start=self._values[START],
                used=self._values[USED],
                dropped=self._values[DROPPED],
            )
        return True

    def forget(self) -> None:
        """The autopilot has restarted, or the script: what was told holds no more."""
        self.__init__()  # type: ignore[misc]
