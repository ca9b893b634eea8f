"""Message rates of an autopilot: requested one command at a time, measured, and requested again. Sans-IO."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from asvhil.io.mavlink.frames import decode, dialect, target

EVERYBODY = (0, 0)  # an acknowledgement of MAVLink 1 names nobody
ACK_TIMEOUT_NS = 500_000_000
ATTEMPTS = 4
MORE_ROUNDS = 3  # of ATTEMPTS each for a request that gets no answer where others did
WATCH_NS = 5_000_000_000
FIRST_WATCH_NS = 2_000_000_000  # or until ENOUGH messages are due: a stream that nobody has asked for is known by then
ENOUGH = 10  # of which some get lost by chance; of fewer nothing is said
LOOK_NS = 500_000_000
RETRY_AFTER_NS = 15_000_000_000
LEAST_SHARE = 0.5  # of the asked rate: below it the stream is asked for again
SLOW_SHARE = 0.3  # below it the stream is called slow: no loss that a boat can be used with makes it so
STALE_NS = 3_000_000_000  # for so long a second answer to a repeated request may be on its way
UNANSWERED = 3  # messages in a row without any acknowledgement, before it is thought that there are none

# What ArduPilot streams together by REQUEST_DATA_STREAM.
LEGACY_STREAMS = {
    dialect.MAV_DATA_STREAM_RAW_SENSORS: ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3"),
    dialect.MAV_DATA_STREAM_EXTENDED_STATUS: ("SYS_STATUS", "GPS_RAW_INT", "GPS2_RAW"),
    dialect.MAV_DATA_STREAM_RC_CHANNELS: ("SERVO_OUTPUT_RAW", "RC_CHANNELS"),
    dialect.MAV_DATA_STREAM_POSITION: ("GLOBAL_POSITION_INT", "LOCAL_POSITION_NED"),
    dialect.MAV_DATA_STREAM_EXTRA1: ("ATTITUDE", "SIM_STATE"),
    dialect.MAV_DATA_STREAM_EXTRA2: ("VFR_HUD",),
    dialect.MAV_DATA_STREAM_EXTRA3: ("SYSTEM_TIME", "EKF_STATUS_REPORT", "WIND", "BATTERY_STATUS"),
}


class StreamRequester:
    """Requests messages at their rates from a system. ACKs carry no message id, so one request is in flight at a time.

    What arrives counts, not what was acknowledged. A reboot of the autopilot (`restart`) forgets all rates. `us`: the
    (system, component) that sends the requests; acknowledgements to others are not ours. `legacy`: a message that
    cannot be had by SET_MESSAGE_INTERVAL is requested with its whole stream by REQUEST_DATA_STREAM, which has no ACK,
    at the highest rate wanted of that stream. Silence is taken for a refusal only where nothing was ever acknowledged.
    """

    def __init__(
        self,
        rates_hz: dict[str, float],
        system_id: int,
        us: tuple[int, int] | None = None,
        *,
        component_id: int = 1,
        legacy: bool = False,
    ) -> None:
        self._rates_hz = dict(rates_hz)
        self._to = (system_id, component_id)
        self._us = us
        self._t_ns = 0  # until data is first asked for: what came before has no time to be counted from
        self._stream_of = {name: stream for stream, names in LEGACY_STREAMS.items() for name in names} if legacy else {}
        self._legacy: list[int] = []
        self._wanted = {getattr(dialect, f"MAVLINK_MSG_ID_{name}"): rate for name, rate in rates_hz.items()}
        self._names = {getattr(dialect, f"MAVLINK_MSG_ID_{name}"): name for name in rates_hz}
        self._queue: list[int] = []
        self._counts: dict[int, int] = dict.fromkeys(self._wanted, 0)  # since the watch of each began
        self._watch: dict[int, tuple[int, int]] = {}  # by message: since when, and for how long
        self._absent: set[int] = set()  # in the last watch, or from the start
        self._look_ns = 0
        self._in_flight: int | None = None
        self._asked_ns = 0
        self._attempts = 0
        self._stale = (0, 0)  # second answers that may still come, and until when
        self._acknowledged = False
        self._unanswered: list[int] = []  # before the first acknowledgement
        self._not_before_ns: dict[int, int] = {}
        self._rounds: dict[int, int] = {}
        self._slow_since_ns: dict[int, int] = {}
        self.denied: set[str] = set()
        self.requests = 0
        self.restart()

    def restart(self) -> None:
        """Ask for everything again."""
        self._queue = list(self._wanted)
        self._in_flight = None
        self._watch.clear()
        self._absent = set(self._wanted)
        self._not_before_ns.clear()
        self._rounds.clear()
        self._unanswered.clear()
        self._slow_since_ns.clear()
        self._legacy.clear()
        self.denied.clear()

    @property
    def settled(self) -> bool:
        """Whether every message has been requested, and its request answered or given up for now."""
        return not self._queue and self._in_flight is None

    @property
    def slow(self) -> tuple[tuple[str, float], ...]:
        """Messages that come at less than SLOW_SHARE of the rate asked for (Hz), by the last watch; not the absent."""
        if not self._slow_since_ns:  # as nearly always; it is asked for in each tick
            return ()
        return tuple((self._names[msg_id], self._wanted[msg_id]) for msg_id in self._slow_since_ns)

    def still_asked_for(self, t_ns: int, needed: Collection[str]) -> tuple[str, float] | None:
        """The first slow message of some that is being asked for again; None once that was tried in vain."""
        for msg_id, since_ns in self._slow_since_ns.items():
            if self._names[msg_id] in needed and t_ns - since_ns < RETRY_AFTER_NS:
                return self._names[msg_id], self._wanted[msg_id]
        return None

    def receive(self, msg_id: int, frame: bytes) -> None:
        """Any complete frame of the autopilot: it is counted, and an acknowledgement of a request is understood."""
        if msg_id in self._counts:
            if msg_id in self._absent and self._t_ns:  # as outputs do, once the vehicle is armed
                self._absent.discard(msg_id)
                self._begin_watch(msg_id)
            self._counts[msg_id] += 1
        elif msg_id == dialect.MAVLINK_MSG_ID_COMMAND_ACK and self._is_for_us(frame):
            message = decode(frame)
            if message is not None and message.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
                self._on_acknowledgement(message.result)

    def data_to_send(self, t_ns: int) -> list[Any]:
        """Requests that are due: SET_MESSAGE_INTERVAL for one message, REQUEST_DATA_STREAM for what is left to it."""
        self._t_ns = t_ns
        due: list[Any] = []
        request = self._interval_request(t_ns)
        if request is not None:
            due.append(request)
        return due + self._stream_requests() if self._legacy else due

    def _is_for_us(self, acknowledgement: bytes) -> bool:
        return self._us is None or target(acknowledgement) in (self._us, EVERYBODY)

    def _on_acknowledgement(self, result: int) -> None:
        if not self._acknowledged:
            self._acknowledged = True
            self._queue += self._unanswered  # those were lost, then
            self._unanswered.clear()
        if self._in_flight is None or result == dialect.MAV_RESULT_IN_PROGRESS:
            return
        if result != dialect.MAV_RESULT_ACCEPTED:
            stale, until_ns = self._stale
            if stale and self._t_ns < until_ns:
                self._stale = (stale - 1, until_ns)
                return  # it may be the answer to a repetition of the request before
            self.denied.add(self._names[self._in_flight])
            self._fall_back(self._in_flight)
        self._begin_watch(self._in_flight)
        self._stale = (self._attempts - 1, self._t_ns + STALE_NS)
        self._in_flight = None

    def _stream_requests(self) -> list[Any]:
        due = []
        for stream in self._legacy:
            rates_hz = [self._rates_hz.get(name, 0.0) for name in LEGACY_STREAMS[stream]]
            rate_hz = math.ceil(max(rates_hz))
            due.append(dialect.MAVLink_request_data_stream_message(*self._to, stream, rate_hz, 1))
        self.requests += len(due)
        self._legacy = []
        return due

    def _give_up(self, msg_id: int) -> None:
        """No answer. What comes all the same is right; else it was lost, where others are answered, and comes again."""
        if self._acknowledged:
            rounds = self._rounds[msg_id] = self._rounds.get(msg_id, 0) + 1
            expected = self._wanted[msg_id] * (self._t_ns - self._watch[msg_id][0]) * 1e-9
            if rounds <= MORE_ROUNDS and self._counts[msg_id] < LEAST_SHARE * expected:
                self._queue.append(msg_id)
            return
        if msg_id not in self._unanswered:
            self._unanswered.append(msg_id)
        if len(self._unanswered) == UNANSWERED:
            for name in self._wanted:
                self._fall_back(name)
        elif len(self._unanswered) > UNANSWERED:
            self._fall_back(msg_id)

    def _fall_back(self, msg_id: int) -> None:
        stream = self._stream_of.get(self._names[msg_id])
        if stream is not None and stream not in self._legacy:
            self._legacy.append(stream)

    def _interval_request(self, t_ns: int) -> Any | None:
        """SET_MESSAGE_INTERVAL for the message in flight, again if it was not acknowledged, or for the next one."""
        self._requeue_slow(t_ns)
        if self._in_flight is not None:
            if t_ns - self._asked_ns < ACK_TIMEOUT_NS:
                return None
            if self._attempts >= ATTEMPTS:
                self._give_up(self._in_flight)
                self._in_flight = None
        if self._in_flight is None:
            if not self._queue:
                return None
            self._in_flight = self._queue.pop(0)
            self._attempts = 0
            if self._in_flight not in self._watch:
                self._begin_watch(self._in_flight)
        self._attempts += 1
        self._asked_ns = t_ns
        self.requests += 1
        interval_us = 1e6 / self._wanted[self._in_flight]
        command = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
        return dialect.MAVLink_command_long_message(*self._to, command, 0, self._in_flight, interval_us, 0, 0, 0, 0, 0)

    def _begin_watch(self, msg_id: int) -> None:
        """Count from now on: first for as short a time as tells a slow stream."""
        first_ns = min(WATCH_NS, max(FIRST_WATCH_NS, round(ENOUGH / self._wanted[msg_id] * 1e9)))
        self._counts[msg_id] = 0
        self._watch[msg_id] = (self._t_ns, first_ns)

    def _requeue_slow(self, t_ns: int) -> None:
        """Put the streams that come too slowly back into the queue, at the end of the watch of each."""
        if t_ns - self._look_ns < LOOK_NS:
            return
        self._look_ns = t_ns
        for msg_id, (from_ns, watch_ns) in self._watch.items():
            if t_ns - from_ns < watch_ns:
                continue
            count, expected = self._counts[msg_id], self._wanted[msg_id] * (t_ns - from_ns) * 1e-9
            if count == 0:
                self._absent.add(msg_id)
            self._counts[msg_id], self._watch[msg_id] = 0, (t_ns, WATCH_NS)
            if expected >= ENOUGH and 0 < count < SLOW_SHARE * expected:
                self._slow_since_ns.setdefault(msg_id, t_ns)
            else:
                self._slow_since_ns.pop(msg_id, None)
            asked = msg_id == self._in_flight or msg_id in self._queue
            if count < LEAST_SHARE * expected and not asked and t_ns >= self._not_before_ns.get(msg_id, 0):
                self._not_before_ns[msg_id] = t_ns + RETRY_AFTER_NS
                self._rounds.pop(msg_id, None)
                self._queue.append(msg_id)
