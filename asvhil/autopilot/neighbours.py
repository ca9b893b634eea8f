"""Who else is heard on the autopilot's link: cameras, gimbals, ground stations, programs with our own id. Sans-IO."""

from __future__ import annotations

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import decode, dialect, message_id, source
from asvhil.types import Note

THERE_NS = 10_000_000_000  # who was not heard for longer is gone
KEPT = 64
NOBODY: frozenset[int] = frozenset()
OWN_TIMES = 2  # heartbeats of ours that we have not sent, before it is told

FLOATS = frozenset({dialect.MAV_TYPE_SURFACE_BOAT, dialect.MAV_TYPE_GROUND_ROVER})
_NAMES = {
    dialect.MAV_TYPE_GCS: "ground station",
    dialect.MAV_TYPE_ADSB: "ADS-B receiver",
    dialect.MAV_TYPE_ONBOARD_CONTROLLER: "onboard computer",
    dialect.MAV_TYPE_GENERIC: "",
}
# What a component's number stands for, where its heartbeat does not tell: (first, last, name).
_COMPONENTS = (
    (1, 1, "autopilot"),
    (68, 68, "telemetry radio"),
    (100, 105, "camera"),
    (154, 154, "gimbal"),
    (156, 156, "ADS-B receiver"),
    (171, 175, "gimbal"),
    (190, 190, "ground station"),
    (191, 194, "onboard computer"),
)


def kind_of(mav_type: int) -> str:
    """A vehicle or component in words, by its MAV_TYPE; empty for a generic one."""
    if mav_type in _NAMES:
        return _NAMES[mav_type]
    entry = dialect.enums["MAV_TYPE"].get(mav_type)
    return entry.name.removeprefix("MAV_TYPE_").replace("_", " ").lower() if entry else f"MAV_TYPE {mav_type}"


class _Neighbour:
    def __init__(self) -> None:
        self.heard_ns = 0
        self.kind = ""
        self.is_autopilot = False  # or says so
        self.beats = False  # sends heartbeats


class Neighbours:
    """Every sender on the link but the autopilot itself; which of them matter is told in `notes`."""

    def __init__(self, config: AutopilotLinkConfig) -> None:
        self._config = config
        self._us = (config.system_id, config.component_id)
        self._heard: dict[tuple[int, int], _Neighbour] = {}
        self._own: list[int] = []  # when heartbeats with our id came that were not ours
        self._t_ns = 0

    def take(self, t_ns: int, data: bytes, *, ours: bool) -> None:
        """A complete frame of anybody but the autopilot; `ours`: we have sent it ourselves a moment ago."""
        self._t_ns = t_ns
        sender = source(data)
        beats = message_id(data) == dialect.MAVLINK_MSG_ID_HEARTBEAT
        if sender == self._us:
            if beats and not ours:
                self._own = [*(at for at in self._own if t_ns - at < THERE_NS), t_ns]
            return
        neighbour = self._heard.pop(sender, None)
        if neighbour is None:
            if len(self._heard) >= KEPT:
                self._heard.pop(next(iter(self._heard)))
            neighbour = _Neighbour()
        self._heard[sender] = neighbour
        neighbour.heard_ns = t_ns
        message = decode(data) if beats else None
        if message is not None:
            neighbour.beats = True
            neighbour.kind = kind_of(message.type)
            neighbour.is_autopilot = message.autopilot != dialect.MAV_AUTOPILOT_INVALID

    def names(self, t_ns: int) -> tuple[str, ...]:
        """Those that are there, by kind and number: "camera 1/100"."""
        return tuple(
            _name(sender, neighbour.kind)
            for sender, neighbour in sorted(self._heard.items())
            if t_ns - neighbour.heard_ns < THERE_NS
        )

    def systems(self, t_ns: int) -> frozenset[int]:
        """The system ids of those that send heartbeats, besides ourselves and the autopilot."""
        if not self._heard:  # as on most boats; it is asked for in each tick
            return NOBODY
        there = (sender for sender, n in self._heard.items() if n.beats and t_ns - n.heard_ns < THERE_NS)
        return frozenset(sender[0] for sender in there)

    @property
    def own_id_is_used(self) -> bool:
        """Whether another program sends with our id."""
        return len(self._own) >= OWN_TIMES and self._t_ns - self._own[-1] < THERE_NS

    def notes(self, t_ns: int, *, autopilot_heard: bool) -> tuple[Note, ...]:
        """What people should know of them."""
        self._t_ns = max(self._t_ns, t_ns)
        if not (self._heard or self._own):
            return ()
        found = []
        system_id, component_id = self._config.autopilot_system_id, self._config.autopilot_component_id
        claims = sorted(
            (sender, neighbour.kind)
            for sender, neighbour in self._heard.items()
            if neighbour.is_autopilot and sender[0] == system_id and t_ns - neighbour.heard_ns < THERE_NS
        )
        if claims and autopilot_heard:
            names = ", ".join(_name(sender, kind) for sender, kind in claims)
            text = f"{names}: not the autopilot, though its heartbeat says so"
            found.append(Note(subject="neighbours", text=text, ok=True))
        elif claims:
            heard = _name(*claims[0])
            text = f"{heard} is heard, {system_id}/{component_id} is not (links.autopilot.autopilot_component_id)"
            found.append(Note(subject="neighbours", text=text, ok=False))
        if self.own_id_is_used:
            text = "another program sends as {}/{}: stop it, or give us another".format(*self._us)
            found.append(Note(subject="our own id", text=text, ok=False))
        return tuple(found)


def _name(sender: tuple[int, int], kind: str) -> str:
    system_id, component_id = sender
    usual = next((name for first, last, name in _COMPONENTS if first <= component_id <= last), "component")
    return f"{kind or usual} {system_id}/{component_id}"
