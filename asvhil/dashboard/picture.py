"""What is known of a running daemon by its operator link: messages in, JSON for the page out. Sans-IO."""

from __future__ import annotations

import math
import re
from collections import deque
from typing import Any

from asvhil.dashboard.controls import CHOICES
from asvhil.dashboard.note_subjects import NoteSubjects
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.texts import TextReader
from asvhil.links.operator_listener import STATES, computer_status
from asvhil.operator.remarks import OVER
from asvhil.operator.reports import PHASES
from asvhil.operator.state_arrays import PLAN_ID, STATE_ID, read_plan, read_state
from asvhil.operator.station_parameters import FOLLOW_PARAMETER

STALE_S = 0.6  # since the last answer: three questions in vain, and shown well within a second
NOTE_S = 4.0  # a note, or anything else that is told once a second, is gone where it is told no more
RESTART_S = 2.0  # of silence: no daemon starts again sooner, and what one before it told is not its own
HISTORY_S = 1.0
HISTORY_ROWS = 900
EVENTS = 200
WORDS = ("mode", "sources")
ORIGIN_FIELDS = ("origin_lat_deg", "origin_lat_rest_deg", "origin_lon_deg", "origin_lon_rest_deg")
HISTORY_FIELDS = ("n_m", "e_m", "distance_m", "heading_error_deg", "port", "starboard")
Json = dict[str, Any]


class BoatPicture:
    """`t_s` is of a clock that nobody sets, in seconds; `receive` takes decoded messages of the daemon's component."""

    def __init__(self, fence_deg: tuple[tuple[float, float], ...] = ()) -> None:
        """`fence_deg`: corners of the geofence, as in the config."""
        self._fence_deg = fence_deg
        self._texts = TextReader()
        self._heard_s: float | None = None
        self._trouble = "no answer yet"
        self._phase: str | None = None
        self._state: str | None = None
        self._reason = ""
        self._boat: dict[str, float | None] = {}
        self._plan: list[tuple[float, float, float]] = []
        self._plan_s = 0.0
        self._station_deg: Json | None = None
        self._settings: dict[str, tuple[float, float]] = {}  # the daemon's parameters: when they were told, value
        self._told: dict[str, tuple[float, Any]] = {}  # what is told once a second, by name: when, and what
        self._subjects = NoteSubjects()
        self._notes: dict[str, tuple[str, bool, float]] = {}  # subject: text, ok, when it was heard last
        self._events: deque[Json] = deque(maxlen=EVENTS)
        self._event_number = 0
        self._origin: tuple[float | None, ...] = ()
        self._track = 0  # its number: each has an origin of its own
        self._history: deque[list[float | None]] = deque(maxlen=HISTORY_ROWS)
        self._was_stale = True

    # --- in ------------------------------------------------------------------------------------------------

    def receive(self, t_s: float, message: Any) -> None:
        """Take in a message."""
        if message.get_type() != "STATUSTEXT":
            self._subjects.end_list()
        match message.get_type():
            case "DEBUG_FLOAT_ARRAY" if message.array_id == STATE_ID:
                self._on_state(t_s, message)
            case "DEBUG_FLOAT_ARRAY" if message.array_id == PLAN_ID:
                self._plan, self._plan_s = read_plan(message), t_s
            case "HEARTBEAT" if message.custom_mode < len(PHASES):
                self._phase = PHASES[message.custom_mode].value
                state = STATES.get(message.system_status, str(message.system_status))
                if state == "emergency" and self._state != state:
                    self._tell(t_s, "emergency: a failure has ended the hold, and nobody has the motors", ok=False)
                self._state = state
            case "POSITION_TARGET_GLOBAL_INT":
                self._station_deg = {"lat": message.lat_int * 1e-7, "lon": message.lon_int * 1e-7}
            case "ONBOARD_COMPUTER_STATUS":
                self._told["computer"] = t_s, computer_status(message)
            case "PARAM_VALUE":
                self._settings[message.param_id] = t_s, message.param_value
                for action, (name, words) in CHOICES.items():
                    if message.param_id == name and 0 <= message.param_value < len(words):
                        self._told[action] = t_s, words[int(message.param_value)]
                if message.param_id == FOLLOW_PARAMETER and 0 <= message.param_value <= 255:
                    self._told["leader"] = t_s, int(message.param_value)
            case "STATUSTEXT":
                text = self._texts.receive(message)
                self._subjects.hear(t_s, text)
                if text is not None:
                    self._on_text(t_s, text, ok=message.severity >= dialect.MAV_SEVERITY_NOTICE)

    def tells_setting(self, name: str, value: float, since_s: float) -> bool:
        """Whether the daemon has told since then that a parameter has a value, as exactly as a float of the link."""
        told = self.setting(name, since_s)
        return told is not None and math.isclose(told, value, rel_tol=1e-5, abs_tol=1e-6)

    def setting(self, name: str, since_s: float) -> float | None:
        """A parameter of the daemon, if it was told since then."""
        told_s, told = self._settings.get(name, (-math.inf, math.nan))
        return told if told_s >= since_s else None

    def is_note(self, text: str) -> bool:
        """Whether a text is a note, and not the answer to a request."""
        return self._subjects.has(text)

    def note_trouble(self, text: str) -> None:
        """Why the daemon is not heard, as far as the link tells."""
        self._trouble = text

    def tell(self, t_s: float, text: str, *, ok: bool) -> None:
        """An event of the page's own, such as a control that somebody has used."""
        self._tell(t_s, text, ok=ok)

    def _on_state(self, t_s: float, message: Any) -> None:
        if self._heard_s is not None and t_s - self._heard_s > RESTART_S:
            self._told.clear()
            self._notes.clear()
        self._heard_s = t_s
        self._boat = read_state(message)
        origin = tuple(self._boat.get(name) for name in ORIGIN_FIELDS)
        if None not in origin and origin != self._origin:
            self._history.clear()  # in metres from another place
            self._track, self._origin = self._track + 1, origin
        if self._was_stale:
            self._tell(t_s, "the daemon answers", ok=True)
            self._was_stale = False
        if t_s - self._plan_s > STALE_S:
            self._plan = []
        if self._boat.get("station_n_m") is None:
            self._station_deg = None
        if not self._history or t_s - (self._history[-1][0] or 0.0) >= HISTORY_S:
            self._history.append([round(t_s, 2), *(_short(self._boat[name]) for name in HISTORY_FIELDS)])

    def _on_text(self, t_s: float, text: str, *, ok: bool) -> None:
        """SUBJECT: TEXT, as an answer or because something has changed; or a text without a subject."""
        subject, separator, rest = text.partition(": ")
        if separator and subject in [phase.value for phase in PHASES]:
            if (self._phase, self._reason) != (subject, rest):
                self._tell(t_s, text, ok=subject != "failsafe")
            self._phase, self._reason = subject, rest
        elif separator and subject in WORDS:
            if subject == "mode" and self._last_told(subject) not in (None, rest):
                self._tell(t_s, f"the autopilot's {text}", ok=True)
            self._told[subject] = t_s, rest
        elif separator and rest in OVER:
            self._notes.pop(subject, None)
            self._tell(t_s, text, ok=True)
        elif self.is_note(text):
            before = self._notes.get(subject)
            self._notes[subject] = rest, ok, t_s
            is_news = not ok and (before is None or before[1] or _shape(before[0]) != _shape(rest))
            if is_news and not self._has_told(t_s, text):
                self._tell(t_s, text, ok=False)
        else:
            self._tell(t_s, text, ok=ok)

    def _has_told(self, t_s: float, text: str) -> bool:
        """Whether a text is among the latest events, as the first word of a new note is."""
        return any(event["text"] == text and t_s - event["t"] < NOTE_S for event in self._events)

    def _tell(self, t_s: float, text: str, *, ok: bool) -> None:
        self._event_number += 1
        self._events.append({"id": self._event_number, "t": round(t_s, 2), "text": text, "ok": ok})

    # --- out -----------------------------------------------------------------------------------------------

    @property
    def station_m(self) -> tuple[float, float, float] | None:
        """North, east (m) and heading (degrees) of the station that is held."""
        n, e, heading = (self._boat.get(f"station_{name}") for name in ("n_m", "e_m", "heading_deg"))
        return None if n is None or e is None or heading is None else (n, e, heading)

    @property
    def station_mps(self) -> float:
        """How fast that station moves over ground."""
        n_mps, e_mps = (self._boat.get(f"station_{name}_mps") for name in ("vn", "ve"))
        return math.hypot(n_mps or 0.0, e_mps or 0.0)

    @property
    def choices(self) -> Json:
        """The words of CHOICES that are in force; None where the daemon has no such choice, or has not told."""
        return {name: self._last_told(name) for name in CHOICES}

    @property
    def leader(self) -> int:
        """The system id of the vehicle that the station follows; 0 for none."""
        return self._last_told("leader") or 0

    def _last_told(self, name: str) -> Any:
        """What was told of a name; None where it was not, or not lately."""
        return self._told.get(name, (0.0, None))[1]

    def is_stale(self, t_s: float) -> bool:
        """Whether what is shown is older than it may be."""
        return self._heard_s is None or t_s - self._heard_s > STALE_S

    def live(self, t_s: float, after_event: int = 0) -> Json:
        """How it is now, with the events after a number."""
        stale = self.is_stale(t_s)
        if stale and not self._was_stale:
            self._tell(t_s, "the daemon does not answer", ok=False)
            self._was_stale = True
        if not stale:
            self._notes = {subject: note for subject, note in self._notes.items() if t_s - note[2] < NOTE_S}
            self._told = {name: told for name, told in self._told.items() if t_s - told[0] < NOTE_S}
        age_s = None if self._heard_s is None else round(t_s - self._heard_s, 2)
        return {
            "kind": "live",
            "t": round(t_s, 2),
            "age_s": age_s,
            "stale": stale,
            "trouble": self._trouble if stale else "",
            "phase": self._phase,
            "state": self._state,
            "reason": self._reason,
            **{name: self._last_told(name) or "" for name in WORDS},
            "boat": {name: _short(value) for name, value in self._boat.items()},
            "plan": [[_short(value) for value in row] for row in self._plan],
            "station_deg": self._station_deg,
            "fence_m": self._fence_m(),
            "computer": self._last_told("computer"),
            "choices": self.choices,
            "leader": self.leader,
            "track": self._track,
            "notes": [{"subject": s, "text": text, "ok": ok} for s, (text, ok, _) in self._notes.items()],
            "events": [event for event in self._events if event["id"] > after_event],
        }

    def values(self, t_s: float) -> list[str]:
        """What is known in numbers, and the phase, as `name=value`; nothing of it is old."""
        if self.is_stale(t_s):
            return []
        known = [f"asvhil-{name}={_short(value)}" for name, value in self._boat.items() if value is not None]
        return [f"asvhil-phase={self._phase}", *known]

    def _fence_m(self) -> list[list[float]]:
        """Corners in the local frame; none until it is known where that is."""
        lat, lat_rest, lon, lon_rest = (self._boat.get(name) for name in ORIGIN_FIELDS)
        if not self._fence_deg or lat is None or lat_rest is None or lon is None or lon_rest is None:
            return []
        frame = LocalFrame(lat_deg=lat + lat_rest, lon_deg=lon + lon_rest)
        return [[round(x, 2) for x in frame.to_ned(*corner)] for corner in self._fence_deg]

    @property
    def last_event(self) -> int:
        """The number of the newest event."""
        return self._event_number

    def history(self) -> Json:
        """What a page that has just been opened has missed."""
        fields = ["t", *HISTORY_FIELDS]
        return {"kind": "history", "track": self._track, "fields": fields, "rows": list(self._history)}


def _short(value: float | None) -> float | None:
    """Seven digits are what a float of the link has."""
    return None if value is None else float(f"{value:.7g}")


def _shape(text: str) -> str:
    """A text without its numbers, which may change in each answer."""
    return re.sub(r"[\d.]+", "#", text)
