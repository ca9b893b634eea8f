"""Whether the vehicle that has the autopilot's ids is our boat: it floats, has the profile's firmware, and is one."""

from __future__ import annotations

from typing import Any

from asvhil.autopilot.neighbours import FLOATS, kind_of
from asvhil.autopilot.one_vehicle import OneVehicle
from asvhil.config.registry import AUTOPILOTS, AutopilotKind
from asvhil.io.mavlink.frames import dialect
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain

STRANGER_NS = 10_000_000_000  # since another kind of vehicle was heard


class VehicleIdentity:
    """Follows the heartbeats; `one` is told of every message by its owner."""

    def __init__(self, system_id: int, kind: AutopilotKind, one: OneVehicle) -> None:
        self._system_id = system_id
        self._kind = kind
        self._one = one
        self._other_firmware = ""
        self._other_kind: tuple[int, str] | None = None  # when a vehicle that does not float was heard, and what it was

    def on_heartbeat(self, t_ns: int, m: Any) -> bool:
        """Whether it is that of a vehicle of ours; else it tells nothing of mode and arming."""
        if m.autopilot == dialect.MAV_AUTOPILOT_INVALID:
            return False  # another component of the vehicle, not its autopilot
        if m.type not in FLOATS:
            self._other_kind = (t_ns, kind_of(m.type) or "generic")
            return False
        self._other_firmware = "" if m.autopilot == self._kind.mav_autopilot else self._describe_make(m.autopilot)
        return True

    def stranger(self, t_ns: int) -> Explanation | None:
        """Why this is not our boat: it is of another kind, or it is two."""
        if self._one.is_two(t_ns):
            return explain(Reason.TWO_VEHICLES, system=self._system_id)
        if self._other_kind is not None and t_ns - self._other_kind[0] < STRANGER_NS:
            return explain(Reason.NOT_A_BOAT, kind=self._other_kind[1])
        return None

    def text(self, t_ns: int) -> str:
        """What is wrong with it, for people; empty where nothing is."""
        stranger = self.stranger(t_ns)
        return self._other_firmware if stranger is None else describe(stranger)

    def _describe_make(self, mav_autopilot: int) -> str:
        """An autopilot that is not of the profile's make."""
        names = (kind.name for kind in AUTOPILOTS if kind.mav_autopilot == mav_autopilot)
        make = next(names, f"of make {mav_autopilot} (MAV_AUTOPILOT)")
        return f"is {make}, but links.autopilot.profile is {self._kind.name}"
