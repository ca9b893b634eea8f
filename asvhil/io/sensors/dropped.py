"""What the codecs of the sensor links have dropped, by cause: out of the counters of a tick."""

from __future__ import annotations

from asvhil.config.ports import AUTOPILOT
from asvhil.io.sensors.nmea_framing import DropCause

# The counters of what a sensor's codec has dropped; what was whole and of no use is none of it.
DROPPED = {*DropCause, "bad_crc", "garbage_bytes", "invalid", "errors"} - {DropCause.UNKNOWN, DropCause.UNUSED}
TOTAL = "bad"  # of all causes; the only one of a codec that does not tell causes apart


def dropped_of(counters: tuple[tuple[str, int], ...]) -> dict[str, dict[str, int]]:
    """What the sensor links have dropped so far: port, then cause, in words, and how often. Empty where nothing was.

    The total of a port is there only where the counters of its causes do not tell the same.
    """
    found: dict[str, dict[str, int]] = {}
    totals: dict[str, int] = {}
    for name, count in counters:
        port, _, cause = name.rpartition(".")
        if not count or port == AUTOPILOT:
            continue
        if cause in DROPPED:
            found.setdefault(port, {})[cause.replace("_", " ")] = count
        elif cause == TOTAL:
            totals[port] = count
    return found | {port: {TOTAL: count} for port, count in totals.items() if port not in found}
