"""What the codecs of the sensor links have dropped, by cause: out of the counters of a tick."""

from __future__ import annotations

from asvhil.config.ports import AUTOPILOT
from asvhil.io.sensors.nmea_framing import DropCause

# The counters of what a sensor's codec has dropped; what was whole and of no use is none of it.
DROPPED = {*DropCause, "bad_crc", "garbage_bytes", "invalid", "errors"} - {DropCause.UNKNOWN, DropCause.UNUSED}


def dropped_of(counters: tuple[tuple[str, int], ...]) -> dict[str, dict[str, int]]:
    """What the sensor links have dropped so far: port, then cause, in words, and how often. Empty where nothing was."""
    found: dict[str, dict[str, int]] = {}
    for name, count in counters:
        port, _, cause = name.rpartition(".")
        if count and port != AUTOPILOT and cause in DROPPED:
            found.setdefault(port, {})[cause.replace("_", " ")] = count
    return found
