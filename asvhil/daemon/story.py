"""What an operator wants to see beside the present tick: how far off a station was at first, and what has happened."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

from asvhil.config.ports import OPERATOR
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import decode, dialect, message_id
from asvhil.io.mavlink.texts import TextReader
from asvhil.supervisor.stations import is_another, station_of_point
from asvhil.types import Frame, Outputs, Station

KEPT = 8
ASKED = (
    dialect.MAV_CMD_DO_REPOSITION,
    dialect.MAV_CMD_NAV_GUIDED_ENABLE,
    dialect.MAV_CMD_DO_SET_MODE,
    dialect.MAV_CMD_COMPONENT_ARM_DISARM,
)
OF_ANSWERS = (dialect.MAVLINK_MSG_ID_COMMAND_ACK, dialect.MAVLINK_MSG_ID_STATUSTEXT)
REPEATED_NS = 2_000_000_000  # since a refusal was last sent: the same again answers a repetition of the request
LINKS = "links"  # the note on all links, which the terminal shows apart


class Story:
    """Follows the outputs of a run, tick by tick, and keeps its last events."""

    def __init__(self, point_m: tuple[float, float]) -> None:
        """`point_m`: `supervisor.point_m`."""
        self._point_m = point_m
        self._events: deque[dict[str, Any]] = deque(maxlen=KEPT)
        self._phase = ""
        self._noted: set[str] = set()
        self._station: Station | None = None
        self._given_ns = 0
        self._from_m: float | None = None
        self._refused: list[tuple[Frame, tuple[int, ...], str]] = []  # of late, with whom and what was refused

    def see(self, outputs: Outputs) -> None:
        """One tick."""
        phase = outputs.phase.value
        if phase != self._phase:
            self._phase = phase
            self._add(outputs.t_ns, f"{phase}: {outputs.health.reason}")
        wrong = {note.subject: note.text for note in outputs.health.notes if not note.ok and note.subject != LINKS}
        for subject in wrong.keys() - self._noted:
            self._add(outputs.t_ns, f"{subject}: {wrong[subject]}")
        self._noted = set(wrong)
        for text in self._refusals(outputs):
            self._add(outputs.t_ns, f"refused: {text}")
        self._note_station(outputs)

    def told(self, outputs: Outputs) -> dict[str, Any]:
        """The part of a status that this is, in JSON types. `station` is None while none is held."""
        return {"station": self._place(outputs), "events": list(self._events)}

    def _add(self, t_ns: int, text: str) -> None:
        self._events.append({"t_ns": t_ns, "text": text})

    def _note_station(self, outputs: Outputs) -> None:
        """A station that moves on its course, or turns with the weather, is given once."""
        # That of the point: about it the boat's origin goes round while a heading turns.
        station = None if outputs.station is None else station_of_point(outputs.station, self._point_m)
        before, self._station = self._station, station
        given = station is not None and (before is None or is_another(station, before))
        if given:
            self._given_ns = outputs.t_ns
        at, origin = outputs.estimate, outputs.station
        if at is None or origin is None:
            self._from_m = None
        elif given:
            self._from_m = math.hypot(at.n_m - origin.n_m, at.e_m - origin.e_m)

    def _place(self, outputs: Outputs) -> dict[str, float | None] | None:
        station, origin = outputs.station, outputs.origin_deg
        if station is None or origin is None:
            return None
        point = station_of_point(station, self._point_m)
        lat_deg, lon_deg = LocalFrame(lat_deg=origin[0], lon_deg=origin[1]).to_geodetic(point.n_m, point.e_m)
        heading_deg = math.degrees(station.psi_rad) % 360.0
        return {
            "lat_deg": lat_deg,
            "lon_deg": lon_deg,
            "heading_deg": heading_deg,
            "from_m": self._from_m,
            "given_ns": self._given_ns,
        }

    def _refusals(self, outputs: Outputs) -> list[str]:
        """Why commands of operators were refused in this tick: the text that was sent before the acknowledgement.

        A sender that has missed the answer asks again, and is answered again: that is one refusal.
        """
        if not any(frame.port == OPERATOR and message_id(frame.data) in OF_ANSWERS[:1] for frame in outputs.frames):
            return []
        found, said, reader = [], "", TextReader()
        for frame in outputs.frames:
            message = decode(frame.data) if frame.port == OPERATOR and message_id(frame.data) in OF_ANSWERS else None
            if message is None:
                continue
            if message.get_type() == "STATUSTEXT":
                said = reader.receive(message) or said
            elif message.command in ASKED and message.result != dialect.MAV_RESULT_ACCEPTED:
                words = said or f"MAV_RESULT {message.result}"
                asked = (message.command, message.target_system, message.target_component)
                if not self._is_repeated(frame, asked, words):
                    found.append(words)
        return found

    def _is_repeated(self, frame: Frame, asked: tuple[int, ...], words: str) -> bool:
        """Whether the same was sent to the same sender a moment ago, or to it by another link."""
        self._refused = [one for one in self._refused if frame.t_ns - one[0].t_ns < REPEATED_NS]
        same = [one for one in self._refused if one[1:] == (asked, words)]
        self._refused.append((frame, asked, words))
        return any(one.address == frame.address or one.via != frame.via for one, *_ in same)
