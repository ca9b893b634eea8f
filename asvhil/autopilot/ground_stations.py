"""Which senders an ArduRover takes for its ground stations, and how their sticks stand. Sans-IO.

A station's sticks count only where the autopilot itself would obey them: anybody else's could end every hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from asvhil.autopilot.ardurover_wiring import CHANNEL_MAP, stick_channels
from asvhil.autopilot.wiring import Wiring
from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import decode, dialect, message_id, source
from asvhil.supervisor.situation import StationSticks

USUAL_STATION = 255  # of both firmwares, where the parameter is not known
FIRST_NAMES = ("SYSID_MYGCS", "MAV_GCS_SYSID")  # the name since 4.7
LAST_NAME = "MAV_GCS_SYSID_HI"
IGNORED, RELEASED, RELEASED_HIGH, NO_AXIS = 65535, 0, 65534, 32767
OBEYED_CHANNELS = 16  # of the 18 in RC_CHANNELS_OVERRIDE
AXIS = 1000.0
SHARED_NS = 2_000_000_000  # since a ground station's sticks were heard
HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
STICK_MESSAGES = frozenset({dialect.MAVLINK_MSG_ID_MANUAL_CONTROL, dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE})


def station_systems(values: Mapping[str, float]) -> tuple[int, int]:
    """The first and the last system id whose sticks and heartbeats the autopilot takes for its ground station's.

    One with SYSID_MYGCS; from 4.7 on MAV_GCS_SYSID to MAV_GCS_SYSID_HI, where the latter is higher. SYSID_ENFORCE
    changes nothing here: these are let in, and the sticks of all others are dropped in any case.
    """
    first = round(next((values[name] for name in FIRST_NAMES if name in values), USUAL_STATION))
    return first, max(first, round(values.get(LAST_NAME, 0.0)))


def is_station(system_id: int, values: Mapping[str, float]) -> bool:
    """Whether the autopilot takes a system for its ground station."""
    first, last = station_systems(values)
    return first <= system_id <= last


def names_of_stations(link: AutopilotLinkConfig, values: Mapping[str, float]) -> Iterator[tuple[str, ...]]:
    """The parameters that tell it, and of the sticks that drive where motor commands do not need them."""
    yield FIRST_NAMES
    if FIRST_NAMES[1] in values:
        yield (LAST_NAME,)
    yield ("RC_OPTIONS",)
    if link.output == "script":
        yield from ((name,) for name in CHANNEL_MAP)
        yield from ((f"RC{channel}_{part}",) for channel in stick_channels(values) for part in ("MIN", "TRIM", "MAX"))


class GroundStations:
    """Reads the sticks (MANUAL_CONTROL, RC_CHANNELS_OVERRIDE) and heartbeats of ground stations, on whatever link.

    `heard_ns` is when one was heard last; None: never.
    """

    def __init__(self, own: Sequence[tuple[int, int]], vehicle_system: int) -> None:
        """`own`: (system id, component id) that our own such messages have, which may come back by another link."""
        self._own = frozenset(own)
        self._vehicle = vehicle_system
        self.heard_ns: int | None = None
        self._sticks: list[StationSticks] = []
        self._last: StationSticks | None = None

    def receive(self, t_ns: int, data: bytes, values: Mapping[str, float], wiring: Wiring) -> None:
        """A complete frame of anybody; what `read` makes of it is kept until it is taken."""
        sticks = self.read(t_ns, data, values, wiring)
        if sticks is not None:
            self._sticks.append(sticks)
            self._last = sticks

    def take_sticks(self) -> tuple[StationSticks, ...]:
        """What was heard of sticks since the last call."""
        heard = tuple(self._sticks)
        self._sticks.clear()
        return heard

    def shared_text(self, t_ns: int) -> str:
        """Of a station whose sticks take turns with our overrides, for people; empty where there is none."""
        if self._last is None or t_ns - self._last.t_ns > SHARED_NS:
            return ""
        return "{}/{} sends its sticks too: the motors get our commands and its in turn".format(*self._last.sender)

    def read(self, t_ns: int, data: bytes, values: Mapping[str, float], wiring: Wiring) -> StationSticks | None:
        """What a complete frame says of sticks; None where it says nothing that the autopilot would obey.

        `values` are the autopilot's parameters, as far as they are known.
        """
        sender, msg_id = source(data), message_id(data)
        if msg_id not in STICK_MESSAGES and msg_id != HEARTBEAT:
            return None
        if sender in self._own or not self._is_pilots(sender[0], values):
            return None
        message = decode(data)
        if message is None:
            return None
        if msg_id == HEARTBEAT:
            if message.type == dialect.MAV_TYPE_GCS:
                self.heard_ns = t_ns
            return None
        if not is_station(sender[0], values):
            return None
        self.heard_ns = t_ns
        if message.get_type() == "MANUAL_CONTROL":
            channels = self._of_axes(message, wiring)
        else:
            channels = self._of_channels(message)
        if not channels:
            return None
        set_us = dict(channels)
        both = wiring.of_sticks([set_us.get(channel, 0) for channel in range(1, OBEYED_CHANNELS + 1)])
        return StationSticks(
            t_ns=t_ns, sender=sender, channels=channels, motors_us=both if both is not None and all(both) else None
        )

    def _is_pilots(self, system_id: int, values: Mapping[str, float]) -> bool:
        """Whether the pilot may be there; where the autopilot takes the vehicle itself for its station, anybody may."""
        return is_station(system_id, values) or (is_station(self._vehicle, values) and system_id != self._vehicle)

    def _of_axes(self, m: Any, wiring: Wiring) -> tuple[tuple[int, int], ...]:
        """y and z over the travel of the two channels that drive; the target must be named."""
        if m.target != self._vehicle:
            return ()
        return tuple(
            (channel, int(stick.low_us + (stick.high_us - stick.low_us) * (axis + AXIS) / (2.0 * AXIS)))
            for channel, stick, axis in zip(wiring.channels, wiring.sticks, (m.y, m.z), strict=True)
            if axis != NO_AXIS
        )

    def _of_channels(self, m: Any) -> tuple[tuple[int, int], ...]:
        if m.target_system not in (0, self._vehicle):
            return ()
        raw = ((channel, getattr(m, f"chan{channel}_raw")) for channel in range(1, OBEYED_CHANNELS + 1))
        return tuple((channel, us) for channel, us in raw if us not in (IGNORED, RELEASED, RELEASED_HIGH))
