"""Message rates of an autopilot: asked for one command at a time, watched, and asked for again, sans-IO."""

from __future__ import annotations

import math

from asvhil.io.mavlink.frames import dialect

ACK_TIMEOUT_NS = 500_000_000
ATTEMPTS = 4
WATCH_NS = 5_000_000_000
RETRY_AFTER_NS = 15_000_000_000
LEAST_SHARE = 0.5  # of the asked rate: below it the stream is asked for again

# What ArduPilot streams together by REQUEST_DATA_STREAM.
LEGACY_STREAMS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT", "GPS2_RAW"),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    dialect.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    dialect.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE", "SIM_STATE"),
    dialect.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    dialect.MAV_DATA_STREAM_EXTRA3: ("SYSTEM_TIME", "EKF_STATUS_REPORT", "WIND"),
}


class StreamKeeper:
    """Keeps the wanted messages coming. ACKs carry no message id, so one request is in flight at a time.

    Never trusts an ACK: only what arrives counts. A reboot of the autopilot (`restart`) forgets all rates. `legacy`:
    a message that cannot be had so is asked for with its whole stream by REQUEST_DATA_STREAM, which has no ACK, at the
    highest rate wanted of that stream.
    """

    def __init__(self, rates_hz: dict[str, float], *, legacy: bool = False) -> None:
        self._rates_hz = dict(rates_hz)
        self._stream_of = {name: stream for stream, names in LEGACY_STREAMS.items() for name in names} if legacy else {}
        self._legacy: list[int] = []
        self._wanted = {getattr(dialect, f"MAVLINK_MSG_ID_{name}"): rate for name, rate in rates_hz.items()}
        self._names = {getattr(dialect, f"MAVLINK_MSG_ID_{name}"): name for name in rates_hz}
        self._queue: list[int] = []
        self._seen: dict[int, int] = dict.fromkeys(self._wanted, 0)
        self._in_flight: int | None = None
        self._asked_ns = 0
        self._attempts = 0
        self._watch_from_ns: int | None = None
        self._not_before_ns: dict[int, int] = {}
        self.denied: set[str] = set()
        self.requests = 0
        self.restart()

    def restart(self) -> None:
        """Ask for everything again."""
        self._queue = list(self._wanted)
        self._in_flight = None
        self._watch_from_ns = None
        self._not_before_ns.clear()
        self._legacy.clear()
        self.denied.clear()

    def seen(self, msg_id: int) -> None:
        """A message of this id arrived from the autopilot."""
        if msg_id in self._seen:
            self._seen[msg_id] += 1

    def acknowledged(self, result: int) -> None:
        """A COMMAND_ACK for SET_MESSAGE_INTERVAL arrived."""
        if self._in_flight is None or result == dialect.MAV_RESULT_IN_PROGRESS:
            return
        if result != dialect.MAV_RESULT_ACCEPTED:
            self.denied.add(self._names[self._in_flight])
            self._fall_back(self._in_flight)
        self._in_flight = None

    def legacy_requests(self) -> list[tuple[int, int]]:
        """(stream, rate in Hz) to ask for now by REQUEST_DATA_STREAM."""
        requests = []
        for stream in self._legacy:
            rates_hz = [self._rates_hz.get(name, 0.0) for name in LEGACY_STREAMS[stream]]
            requests.append((stream, math.ceil(max(rates_hz))))
        self.requests += len(requests)
        self._legacy = []
        return requests

    def _fall_back(self, msg_id: int) -> None:
        stream = self._stream_of.get(self._names[msg_id])
        if stream is not None and stream not in self._legacy:
            self._legacy.append(stream)

    def next_request(self, t_ns: int) -> tuple[int, float] | None:
        """(message id, interval in us) to ask for now, or None."""
        self._watch(t_ns)
        if self._in_flight is not None:
            if t_ns - self._asked_ns < ACK_TIMEOUT_NS:
                return None
            if self._attempts >= ATTEMPTS:
                self._fall_back(self._in_flight)
                self._in_flight = None
        if self._in_flight is None:
            if not self._queue:
                return None
            self._in_flight = self._queue.pop(0)
            self._attempts = 0
        self._attempts += 1
        self._asked_ns = t_ns
        self.requests += 1
        return self._in_flight, 1e6 / self._wanted[self._in_flight]

    def _watch(self, t_ns: int) -> None:
        """Every few seconds, put the streams that come too slowly back into the queue."""
        if self._queue or self._in_flight is not None:
            self._watch_from_ns = None
            return
        if self._watch_from_ns is None:
            self._watch_from_ns = t_ns
            self._seen = dict.fromkeys(self._wanted, 0)
            return
        elapsed_ns = t_ns - self._watch_from_ns
        if elapsed_ns < WATCH_NS:
            return
        for msg_id, rate_hz in self._wanted.items():
            slow = self._seen[msg_id] < LEAST_SHARE * rate_hz * elapsed_ns * 1e-9
            if slow and t_ns >= self._not_before_ns.get(msg_id, 0):
                self._not_before_ns[msg_id] = t_ns + RETRY_AFTER_NS
                self._queue.append(msg_id)
        self._watch_from_ns = None
