"""Tells two vehicles with one system id from one vehicle that is heard by several ways. Sans-IO.

Two boats on one port would both be armed and driven by one controller. One boat may well be heard twice: by two radios,
or through a router that passes frames on by two links. What differs is the vehicle itself. It has one clock since its
boot, one mode, one place, and one state at each time of that clock; the ways differ by their delays alone.
"""

from __future__ import annotations

import math
from collections import OrderedDict, deque
from typing import Any

from asvhil.io.mavlink.frames import dialect

SAME_NS = 2_000_000_000  # clocks that differ by less are one clock, by ways of different delay
ALIVE_NS = 1_900_000_000  # less than that: a link that stalled for longer makes its clock jump and come back
WINDOW_NS = 5_000_000_000
TIMES = 3  # pieces of evidence within the window
LATCH_NS = 10_000_000_000  # as long as the links send to a peer that has fallen silent
WAYS = 16
CLOCKS = 4  # of a kind
MOMENTS = 512
APART_M, APART_S = 15.0, 3.0  # positions by two ways: this far, and as far as the boat goes in this time
LASTING_NS = 3_000_000_000
MODES_LASTING_NS = 2_500_000_000  # longer than a way of the same vehicle is late
METRES_PER_DEGREE = 111_200.0
ASK_NS, ASK_TIMES = 2_000_000_000, 5


SYSTEM_TIME = dialect.MAVLINK_MSG_ID_SYSTEM_TIME
STATES = (dialect.MAVLINK_MSG_ID_ATTITUDE, dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, SYSTEM_TIME)


class _Clock:
    def __init__(self, offset_ns: int, t_ns: int, peer: str) -> None:
        self.offset_ns = offset_ns
        self.t_ns = t_ns
        self.peer = peer


class _Way:
    """What came by one peer last."""

    def __init__(self) -> None:
        self.t_ns = 0
        self.beat: tuple[int, ...] = ()
        self.beat_ns = 0
        self.place: tuple[int, float, float, float] | None = None  # t_ns, latitude, longitude (deg), speed (m/s)
        self.uid = b""


class OneVehicle:
    """Takes in what the autopilot's component sends, by peer; `is_two` says whether it is more than one vehicle."""

    def __init__(self) -> None:
        self._clocks: dict[int, list[_Clock]] = {}  # by message, the one heard last at the end
        self._last_clock: dict[tuple[int, str], int] = {}
        self._ways: dict[str, _Way] = {}
        self._moments: OrderedDict[tuple[int, int], tuple[str, Any]] = OrderedDict()  # peer and message
        self._copies: dict[frozenset[str], int] = {}
        self._evidence: deque[int] = deque(maxlen=TIMES)
        self._apart_ns: int | None = None  # since when positions by two ways have differed
        self._differ_ns: int | None = None  # and modes
        self._two_ns: int | None = None
        self._asked_ns = 0
        self._asked = 0

    def is_two(self, t_ns: int) -> bool:
        """Whether two vehicles were heard within the last 10 s."""
        return self._two_ns is not None and t_ns - self._two_ns < LATCH_NS

    def wants_uid(self, t_ns: int) -> bool:
        """Whether to ask for AUTOPILOT_VERSION now: by several ways, and their hardware is not known."""
        if len(self._ways) < 2:  # as nearly always
            return False
        ways = self._alive(t_ns)
        if len(ways) < 2 or all(way.uid for way in ways.values()) or t_ns - self._asked_ns < ASK_NS:
            return False
        self._asked += 1
        self._asked_ns = t_ns
        return self._asked <= ASK_TIMES

    def take(self, t_ns: int, peer: str, m: Any) -> bool:
        """A message of the autopilot's component. Whether its clock since boot is one that was not heard before."""
        way = self._ways.get(peer)
        if way is None or len(self._ways) > 1:  # as seldom
            way = self._put_last(peer, way)
        way.t_ns = t_ns
        number = m.get_msgId()
        if number == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            self._on_heartbeat(t_ns, way, m)
        elif number == dialect.MAVLINK_MSG_ID_TIMESYNC:
            return m.tc1 != 0 and self._on_clock(t_ns, peer, number, m.tc1)
        elif number == dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            self._on_version(t_ns, way, m)
        elif (boot_ms := getattr(m, "time_boot_ms", None)) is not None:
            if number in STATES and boot_ms and (number != SYSTEM_TIME or m.time_unix_usec):
                self._on_state(t_ns, peer, number, m)
            if number == dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
                self._on_place(t_ns, way, m)
            return self._on_clock(t_ns, peer, number, boot_ms * 1_000_000)
        return False

    def _put_last(self, peer: str, way: _Way | None) -> _Way:
        """Let the one heard last stand last, anew where it was not heard before."""
        if way is None:
            way = _Way()
            self._asked = 0
            if len(self._ways) >= WAYS:
                self._ways.pop(next(iter(self._ways)))
        else:
            del self._ways[peer]
        self._ways[peer] = way
        return way

    # --- evidence ------------------------------------------------------------------------------------------

    def _on_clock(self, t_ns: int, peer: str, number: int, clock_ns: int) -> bool:
        """Two clocks that are heard in turn are two vehicles; one that is heard no more was before a reboot."""
        if clock_ns == 0 or self._last_clock.get((number, peer)) == clock_ns:
            return False  # no clock
        if len(self._last_clock) >= 8 * WAYS:
            self._last_clock.clear()
        self._last_clock[number, peer] = clock_ns
        offset_ns = clock_ns - t_ns
        clocks = self._clocks.setdefault(number, [])
        if len(clocks) == 1 and abs(clocks[0].offset_ns - offset_ns) <= SAME_NS:  # as nearly always
            only = clocks[0]
            only.offset_ns, only.t_ns, only.peer = offset_ns, t_ns, peer
            return False
        known = min(clocks, key=lambda clock: abs(clock.offset_ns - offset_ns), default=None)
        if known is None or abs(known.offset_ns - offset_ns) > SAME_NS:
            late = bool(clocks) and self._are_copies(t_ns, peer, clocks[-1].peer)
            clocks.append(_Clock(offset_ns, t_ns, peer))
            del clocks[:-CLOCKS]
            return not late
        last, came_back = clocks[-1], t_ns - known.t_ns < ALIVE_NS
        if known is not last and came_back and not self._are_copies(t_ns, peer, last.peer):
            self._note(t_ns)
        known.offset_ns, known.t_ns, known.peer = offset_ns, t_ns, peer
        # A way that has stalled catches up: its clock comes near until it is the one that it was.
        clocks[:] = [clock for clock in clocks if abs(clock.offset_ns - offset_ns) > SAME_NS] + [known]
        return False

    def _on_state(self, t_ns: int, peer: str, number: int, m: Any) -> None:
        """At one time of its clock a vehicle has one state."""
        key = number, m.time_boot_ms
        before = self._moments.get(key)
        if before is None:
            self._moments[key] = peer, m
            if len(self._moments) > MOMENTS:
                self._moments.popitem(last=False)
        elif before[0] != peer and before[1].get_payload().rstrip(b"\0") != m.get_payload().rstrip(b"\0"):
            if number != SYSTEM_TIME:  # which has the microseconds of its sending
                self._note(t_ns)
        elif before[0] != peer:
            self._copies[frozenset((before[0], peer))] = t_ns
            if len(self._copies) > WAYS:
                self._copies.pop(next(iter(self._copies)))

    def _are_copies(self, t_ns: int, a: str, b: str) -> bool:
        """Whether one of two ways passes on the same frames as the other, however late."""
        return t_ns - self._copies.get(frozenset((a, b)), -LATCH_NS) < LATCH_NS

    def _on_heartbeat(self, t_ns: int, way: _Way, m: Any) -> None:
        """A change of mode comes by each way, sooner or later."""
        beat = (m.type, m.autopilot, m.custom_mode, m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        way.beat, way.beat_ns = beat, t_ns
        others = [w for w in self._ways.values() if w.beat != beat and w.beat and t_ns - w.beat_ns < LASTING_NS]
        if not others:
            self._differ_ns = None
        elif self._differ_ns is None:
            self._differ_ns = t_ns
        elif any(other.beat_ns - self._differ_ns >= MODES_LASTING_NS for other in others):
            self._two_ns = t_ns

    def _on_place(self, t_ns: int, way: _Way, m: Any) -> None:
        lat_deg, lon_deg = m.lat * 1e-7, m.lon * 1e-7
        way.place = (t_ns, lat_deg, lon_deg, math.hypot(m.vx, m.vy) * 0.01)
        places = [w.place for w in self._ways.values() if w.place is not None and t_ns - w.place[0] < ALIVE_NS]
        if len(places) < 2 or (lat_deg == 0.0 and lon_deg == 0.0):
            self._apart_ns = None
            return
        farthest_m = max(
            math.hypot(lat - lat_deg, (lon - lon_deg) * math.cos(math.radians(lat_deg))) * METRES_PER_DEGREE
            for _, lat, lon, _ in places
        )
        if farthest_m <= APART_M + APART_S * max(speed_mps for *_, speed_mps in places):
            self._apart_ns = None
        elif self._apart_ns is None:
            self._apart_ns = t_ns
        elif t_ns - self._apart_ns >= LASTING_NS:
            self._two_ns = t_ns

    def _on_version(self, t_ns: int, way: _Way, m: Any) -> None:
        """Hardware has a number of its own, where the firmware tells it; equal ones prove nothing."""
        uid = bytes(m.uid2) if any(m.uid2) else m.uid.to_bytes(8, "little") if m.uid else b""
        way.uid = uid
        if uid and any(other.uid and other.uid != uid for other in self._alive(t_ns).values()):
            self._two_ns = t_ns

    def _note(self, t_ns: int) -> None:
        self._evidence.append(t_ns)
        if len(self._evidence) == TIMES and t_ns - self._evidence[0] <= WINDOW_NS:
            self._two_ns = t_ns

    def _alive(self, t_ns: int) -> dict[str, _Way]:
        return {peer: way for peer, way in self._ways.items() if t_ns - way.t_ns < LATCH_NS}
