"""What the page may ask the daemon for: JSON to a control, and a control to frames. Pure functions."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.config.controller import EFFORT_PARAMETER, EFFORTS
from asvhil.config.heading import POLICIES
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.encoding import encode_hold, encode_move, encode_neutral, encode_release
from asvhil.operator.station_parameters import (
    COURSE_PARAMETER,
    COURSE_PARAMETERS,
    FOLLOW_PARAMETER,
    POLICY_PARAMETER,
    SPEED_PARAMETER,
    WAY_PARAMETER,
)
from asvhil.types import record

MOST_M = 5000.0  # beyond it a click means nothing; the daemon's own limits come before
FASTEST_MPS = 10.0  # likewise of a station
# Controls that choose one of several words: the daemon's parameter, whose value is the word's place.
CHOICES = {"policy": (POLICY_PARAMETER, POLICIES), "effort": (EFFORT_PARAMETER, tuple(EFFORTS))}
# What each control needs beside its name.
NEEDS = {
    **{"hold": set(), "neutral": set(), "release": set(), "stay": set()},
    **{"move": {"n_m", "e_m"}, "heading": {"heading_deg"}, "drift": {"speed_mps", "course_deg"}},
    **{"follow": {"system_id"}},
    **{name: {name} for name in CHOICES},
}
MAY_HAVE = {"drift": {"way_m"}}
MOTION = (SPEED_PARAMETER, COURSE_PARAMETER, WAY_PARAMETER, FOLLOW_PARAMETER)


@record
class PageControl:
    """An action with what it needs: `place_m` north and east in the local frame, `heading_deg` clockwise from north,
    the word that is chosen, the velocity of a station that moves, as speed (m/s) and course (degrees from north), and
    its way in `way_m` (0: without an end), or the MAVLink system id of a `leader`.
    """

    action: str
    place_m: tuple[float, float] | None = None
    heading_deg: float | None = None
    chosen: str | None = None
    velocity: tuple[float, float] | None = None
    way_m: float = 0.0
    leader: int | None = None

    @property
    def mav_cmd(self) -> int | None:
        """The command that the daemon acknowledges; None for a set-point, which shows in what it tells."""
        return {
            "hold": dialect.MAV_CMD_DO_REPOSITION,
            "neutral": dialect.MAV_CMD_COMPONENT_ARM_DISARM,
            "release": dialect.MAV_CMD_NAV_GUIDED_ENABLE,
        }.get(self.action)

    def settings(self, before: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
        """What it sets of the daemon's parameters, in turn. `before`: those of MOTION that are in force.

        Of a motion the speed, which starts it, comes last; but first where the station moves on a course already, for
        of these it is the speed that may be refused, and then that course and its way stand.
        """
        if self.chosen is not None:
            parameter, words = CHOICES[self.action]
            return ((parameter, float(words.index(self.chosen))),)
        if self.velocity is not None:
            speed_mps, course_deg = self.velocity
            speed = (SPEED_PARAMETER, speed_mps)
            rest = ((COURSE_PARAMETER, course_deg), (WAY_PARAMETER, self.way_m))
            on_course = before.get(SPEED_PARAMETER, 0.0) > 0.0 and not before.get(FOLLOW_PARAMETER, 0.0)
            return (speed, *rest) if on_course else (*rest, speed)
        if self.leader is not None:
            return ((FOLLOW_PARAMETER, float(self.leader)),)
        return ((SPEED_PARAMETER, 0.0),) if self.action == "stay" else ()

    def is_shown_by(self, station_m: tuple[float, float, float] | None, way_m: float = 0.0) -> bool:
        """Whether the station (north, east in m, heading in degrees) is what was asked for.

        `way_m`: how far it may have gone on since, if it moves.
        """
        if station_m is None:
            return False
        if self.place_m is not None and math.dist(self.place_m, station_m[:2]) > 0.02 + way_m:
            return False
        return self.heading_deg is None or abs((station_m[2] - self.heading_deg + 180.0) % 360.0 - 180.0) < 0.1

    def describe(self) -> str:
        """For the list of events."""
        at = "" if self.place_m is None else " to {:.1f} m north, {:.1f} m east".format(*self.place_m)
        heading = "" if self.heading_deg is None else f" {self.heading_deg:.0f} deg"
        chosen = "" if self.chosen is None else f" {self.chosen}"
        velocity = "" if self.velocity is None else " {:g} m/s toward {:.0f} deg".format(*self.velocity)
        way = f" for {self.way_m:g} m" if self.way_m else ""
        leader = "" if self.leader is None else f" system {self.leader}"
        return f"{self.action}{at}{heading}{chosen}{velocity}{way}{leader}"


def read_control(body: Any) -> PageControl:
    """The control of a JSON object. Raises ValueError in words for people."""
    if not isinstance(body, dict):
        raise ValueError("a control is a JSON object")
    action = body.get("action")
    if not isinstance(action, str) or action not in NEEDS:
        raise ValueError(f"action must be one of {', '.join(NEEDS)}")
    needs, may_have = NEEDS[action], MAY_HAVE.get(action, set())
    odd = set(body) - {"action"} - needs - may_have
    if odd:
        raise ValueError(f"{action} takes no {', '.join(sorted(odd))}")
    if action in CHOICES:
        words = CHOICES[action][1]
        if body.get(action) not in words:
            raise ValueError(f"{action} must be one of {', '.join(words)}")
        return PageControl(action=action, chosen=body[action])
    values = {name: _number(body, name) for name in sorted(needs | may_have & set(body))}
    if action == "move":
        place_m = (values["n_m"], values["e_m"])
        if math.hypot(*place_m) > MOST_M:
            raise ValueError(f"that is more than {MOST_M:.0f} m from the first position")
        return PageControl(action=action, place_m=place_m)
    if action == "heading":
        if not 0.0 <= values["heading_deg"] <= 360.0:
            raise ValueError("heading_deg must be 0 to 360")
        return PageControl(action=action, heading_deg=values["heading_deg"] % 360.0)
    if action == "drift":
        if not 0.0 < values["speed_mps"] <= FASTEST_MPS:
            raise ValueError(f"speed_mps must be above 0, and at most {FASTEST_MPS:g}")
        if not 0.0 <= values["course_deg"] <= 360.0:
            raise ValueError("course_deg must be 0 to 360")
        way_m = values.get("way_m", 0.0)
        if not 0.0 <= way_m <= MOST_M:
            raise ValueError(f"way_m must be 0, for no end, or at most {MOST_M:g}")
        course_deg = _on_link(values["course_deg"]) % 360.0
        return PageControl(action=action, velocity=(values["speed_mps"], course_deg), way_m=way_m)
    if action == "follow":
        most = COURSE_PARAMETERS[FOLLOW_PARAMETER]
        if values["system_id"] != round(values["system_id"]) or not 1 <= values["system_id"] <= most:
            raise ValueError(f"system_id must be a whole number from 1 to {most:g}")
        return PageControl(action=action, leader=round(values["system_id"]))
    return PageControl(action=action)


def encode_control(control: PageControl, config: AutopilotLinkConfig) -> bytes:
    """The frame that asks the daemon for it, where it sets no parameters."""
    match control.action:
        case "hold":
            return encode_hold(config, None, None, None)
        case "neutral":
            return encode_neutral(config)
        case "release":
            return encode_release(config)
        case _:
            psi_rad = None if control.heading_deg is None else math.radians(control.heading_deg)
            return encode_move(config, control.place_m, psi_rad)


def _on_link(value: float) -> float:
    """As a float of the link has it: 359.999999 is 360 there."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def _number(body: dict[str, Any], name: str) -> float:
    value = body.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{name} must be a number")
    try:
        number = float(value)
    except OverflowError:  # a whole number of 400 digits
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} must be a number")
    return number
