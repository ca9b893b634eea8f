"""Watches mode, arming and sticks while the motors are ours, for signs that the pilot wants the boat back."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from asvhil.config import SupervisorConfig
from asvhil.supervisor.disarmed import disarmed_by_itself
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.types import FrontseatStatus, Radio

ECHO_TOLERANCE_US = 4  # RC_CHANNELS shows overrides as they came; MANUAL_CONTROL is rounded on the way
STICKS = (1, 2, 3, 4)
CENTRE_US = 1500  # of a stick that has not been heard yet
STATION_NS = 500_000_000  # since a ground station's sticks were heard
# A station whose sticks rest takes turns with us on the same channels. Where its messages are not heard here, so long
# may reports in a row show its sticks and none of our commands, as by chance of the times at which they come.
REST_NS = 10_000_000_000


class PilotWatch:
    """Holds the autopilot's reports against how the sticks stood at the start, and against what we have sent since."""

    def __init__(self, config: SupervisorConfig, *, overrides_sticks: bool) -> None:
        """`overrides_sticks`: the motor commands stand in the place of the pilot's, and show as such in RC_CHANNELS."""
        self._config = config
        self._overrides_sticks = overrides_sticks
        # Where the sticks are the pilot's own, any movement of them is theirs.
        self._stick_channels = config.stick_channels if overrides_sticks else tuple({*STICKS, *config.stick_channels})
        self._echo_ns = round(config.override_echo_s * 1e9)
        self._engaged_ns = 0
        self._ours_ns = 0  # when a report was last seen that shows a command of ours
        self._station_us: dict[int, tuple[int, int]] = {}  # by channel: when a station's stick was heard, and where
        self._stick_baseline: dict[int, int] = {}
        self._resting_us: tuple[int, ...] | None = None  # channels that were looked at last, and no stick had moved
        self._before_us: tuple[int, int] = (0, 0)  # the motors' sticks when they were taken
        self._sent: deque[MotorPulses] = deque()

    def begin(self, t_ns: int, status: FrontseatStatus) -> None:
        """The motors are ours from now on: as the sticks stand now they are at rest.

        Where they were ours until now, the echo of what was sent last is still on its way.
        """
        self._engaged_ns = self._ours_ns = t_ns
        while self._sent and self._sent[0].t_ns < t_ns - self._echo_ns:
            self._sent.popleft()
        self._stick_baseline = {channel: _channel(status, channel) or CENTRE_US for channel in self._stick_channels}
        self._resting_us = None
        self._before_us = _motor_sticks(status)

    def note_sent(self, pulses: MotorPulses) -> None:
        """Remember what was sent, to tell the echo of our override from the pilot's sticks."""
        self._sent.append(pulses)
        horizon_ns = pulses.t_ns - 2 * self._echo_ns
        while len(self._sent) > 1 and self._sent[1].t_ns <= horizon_ns:  # the one that stood at the horizon is kept
            self._sent.popleft()

    def act(self, status: FrontseatStatus | None, heard: Sequence[StationSticks] = ()) -> Explanation | None:
        """What the pilot has done to have the boat back; None while there is nothing.

        `heard`: of the sticks of ground stations, by their own messages.
        """
        if status is None:
            return None
        if not status.armed:
            return disarmed_by_itself(status) or explain(Reason.DISARMED)
        if status.mode != self._config.control_mode:
            return explain(Reason.MODE_CHANGED, mode=status.mode)
        theirs = self.station_stick(status, heard)
        if theirs is not None:
            return theirs
        if status.rc_us == self._resting_us:
            return None
        for channel, baseline_us in self._stick_baseline.items():
            now_us = _channel(status, channel)
            if now_us and abs(now_us - baseline_us) > self._config.stick_threshold_us:
                return explain(Reason.STICK_MOVED, channel=channel)
        self._resting_us = status.rc_us
        return None

    def station_stick(self, status: FrontseatStatus, heard: Sequence[StationSticks]) -> Explanation | None:
        """Which stick of a ground station is off its centre, by the station's own messages."""
        for sticks in heard:
            for channel, now_us in sticks.channels:
                self._station_us[channel] = sticks.t_ns, now_us
                rest_us = self._rest_us(status, channel)
                if rest_us is not None and abs(now_us - rest_us) > self._config.stick_threshold_us:
                    return explain(Reason.STATION_STICK, channel=channel, station="{}/{}".format(*sticks.sender))
        return None

    def steers(self, status: FrontseatStatus, heard: Sequence[StationSticks]) -> Explanation | None:
        """Which of the motors' sticks is off centre before they are taken: somebody steers the boat.

        None where their commands stand nowhere in the place of the sticks: nobody knows then what those move.
        """
        theirs = self.station_stick(status, heard)
        if theirs is not None or not self._overrides_sticks:
            return theirs
        for channel, rest_us in zip(status.motor_channels, status.centres_us, strict=True):
            now_us = _channel(status, channel)
            if now_us and abs(now_us - rest_us) > self._config.stick_threshold_us:
                return explain(Reason.PILOT_STEERS, channel=channel)
        return None

    def sticks_taken(self, t_ns: int, status: FrontseatStatus | None) -> Explanation | None:
        """Which of the motors' own channels shows something else than our commands: somebody else has the boat.

        At first, while nobody knows yet whether our commands are heeded, only a stick that has moved is the pilot's.
        Later resting sticks of a ground station are excused where they come in turn with our commands. A report is
        judged when it comes. One that stands because no other follows, as on a link that is lost, says nothing new, and
        what was sent before it is not kept for ever.
        """
        if status is None or not self._overrides_sticks or status.sticks_us is None:
            return None
        told_ns = status.rc_ns or t_ns
        if self._sent and told_ns < self._sent[-1].t_ns - self._echo_ns:
            return None
        now_us = _motor_sticks(status)
        if not all(now_us) or told_ns < self._engaged_ns:
            return None
        sent_us: list[tuple[int, int]] = []
        for us in self._echoed_us(told_ns):
            if _apart_us(now_us, us) <= ECHO_TOLERANCE_US:
                self._ours_ns = told_ns
                return None
            sent_us.append(us)
        channel = _first_apart(status.motor_channels, now_us, sent_us)
        off_us = _apart_us(now_us, status.centres_us)
        if told_ns - self._engaged_ns < self._echo_ns:  # the echo of the first overrides may still be on its way
            moved_us = _apart_us(now_us, self._before_us)  # far, where they were not known: then it is the centre's
            moved = min(off_us, moved_us) > self._config.stick_threshold_us
            return explain(Reason.STICK_MOVED, channel=channel) if moved else None
        if not sent_us or self._is_of_station(told_ns, status.motor_channels, now_us, sent_us):
            return None
        no_transmitter = status.keeps_override or status.radio is Radio.ABSENT
        rests = no_transmitter and off_us <= self._config.stick_threshold_us
        if rests and self._engaged_ns < self._ours_ns and told_ns - self._ours_ns <= REST_NS:
            return None
        return explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=channel)

    def hidden(self, status: FrontseatStatus) -> int | None:
        """A channel whose movement is to end a hold, but that our commands hide: it moves a motor of this boat."""
        hidden = hidden_sticks(self._config, status.motor_channels) if self._overrides_sticks else ()
        return next(iter(hidden), None)

    def _rest_us(self, status: FrontseatStatus, channel: int) -> int | None:
        """Where a stick rests, None for a channel that is not watched."""
        if channel in status.motor_channels:
            return status.centres_us[status.motor_channels.index(channel)]
        return self._stick_baseline.get(channel)

    def _is_of_station(
        self, told_ns: int, channels: tuple[int, int], now_us: tuple[int, int], sent_us: list[tuple[int, int]]
    ) -> bool:
        """Whether sticks are those of a ground station whose messages are heard, where it does not move them all."""
        for motor, channel in enumerate(channels):
            heard_ns, station_us = self._station_us.get(channel, (0, 0))
            theirs = told_ns - heard_ns < STATION_NS and abs(now_us[motor] - station_us) <= ECHO_TOLERANCE_US
            if not theirs and not _shows_ours(motor, now_us, sent_us):
                return False
        return True

    def _echoed_us(self, told_ns: int) -> Iterator[tuple[int, int]]:
        """What a report may show: sent within the time of an echo before it, or standing when that time began.

        The latest comes first, and is most often what it shows.
        """
        for pulses in reversed(self._sent):
            if pulses.t_ns <= told_ns:
                yield pulses.us if pulses.sticks_us is None else pulses.sticks_us
            if pulses.t_ns <= told_ns - self._echo_ns:
                break


def hidden_sticks(config: SupervisorConfig, motor_channels: tuple[int, int]) -> tuple[int, ...]:
    """The channels that are to end a hold, but that commands in the place of the sticks hide: they move a motor."""
    return tuple(channel for channel in config.stick_channels if channel in motor_channels)


def _channel(status: FrontseatStatus, channel: int) -> int:
    """RC value of a channel in us, 0 where unknown."""
    return status.rc_us[channel - 1] if len(status.rc_us) >= channel else 0


def _motor_sticks(status: FrontseatStatus) -> tuple[int, int]:
    """RC values of the motors' sticks."""
    port, starboard = status.motor_channels
    return _channel(status, port), _channel(status, starboard)


def _apart_us(a: tuple[int, int], b: tuple[int, int]) -> int:
    """How far two pairs are apart, by the stick that is further."""
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]))


def _shows_ours(motor: int, now_us: tuple[int, int], sent_us: list[tuple[int, int]]) -> bool:
    """Whether the stick of a motor (0: port, 1: starboard) shows any of what was sent."""
    return any(abs(now_us[motor] - us[motor]) <= ECHO_TOLERANCE_US for us in sent_us)


def _first_apart(channels: tuple[int, int], now_us: tuple[int, int], sent_us: list[tuple[int, int]]) -> int:
    """The first channel that shows nothing of what was sent; the first of all where each does, of different times."""
    apart = (channel for motor, channel in enumerate(channels) if not _shows_ours(motor, now_us, sent_us))
    return next(apart, channels[0])
