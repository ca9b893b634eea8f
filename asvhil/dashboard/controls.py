"""What the page may ask the daemon for: JSON to a control, and a control to frames. Pure functions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.config.controller import EFFORT_PARAMETER, EFFORTS
from asvhil.config.heading import POLICIES
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.encoding import encode_hold, encode_move, encode_neutral, encode_parameter, encode_release
from asvhil.operator.station_parameters import POLICY_PARAMETER
from asvhil.types import record

MOST_M = 5000.0  # beyond it a click means nothing; the daemon's own limits come before
# Controls that choose one of several words: the daemon's parameter, whose value is the word's place.
CHOICES = {"policy": (POLICY_PARAMETER, POLICIES), "effort": (EFFORT_PARAMETER, tuple(EFFORTS))}
ACTIONS = ("hold", "neutral", "release", "move", "heading", *CHOICES)


@record
class PageControl:
    """An action with what it needs: `place_m` north and east in the local frame, `heading_deg` clockwise from north,
    or the word that is chosen.
    """

    action: str
    place_m: tuple[float, float] | None = None
    heading_deg: float | None = None
    chosen: str | None = None

    @property
    def mav_cmd(self) -> int | None:
        """The command that the daemon acknowledges; None for a set-point or a choice, which show in what it tells."""
        return {
            "hold": dialect.MAV_CMD_DO_REPOSITION,
            "neutral": dialect.MAV_CMD_COMPONENT_ARM_DISARM,
            "release": dialect.MAV_CMD_NAV_GUIDED_ENABLE,
        }.get(self.action)

    def is_shown_by(
        self, station_m: tuple[float, float, float] | None, choices: Mapping[str, str | None] = MappingProxyType({})
    ) -> bool:
        """Whether the station (north, east in m, heading in degrees) or the choices are what was asked for."""
        if self.chosen is not None:
            return choices.get(self.action) == self.chosen
        if station_m is None:
            return False
        if self.place_m is not None and math.dist(self.place_m, station_m[:2]) > 0.02:
            return False
        return self.heading_deg is None or abs((station_m[2] - self.heading_deg + 180.0) % 360.0 - 180.0) < 0.1

    def describe(self) -> str:
        """For the list of events."""
        at = "" if self.place_m is None else " to {:.1f} m north, {:.1f} m east".format(*self.place_m)
        heading = "" if self.heading_deg is None else f" {self.heading_deg:.0f} deg"
        chosen = "" if self.chosen is None else f" {self.chosen}"
        return f"{self.action}{at}{heading}{chosen}"


def read_control(body: Any) -> PageControl:
    """The control of a JSON object. Raises ValueError in words for people."""
    if not isinstance(body, dict):
        raise ValueError("a control is a JSON object")
    action = body.get("action")
    if action not in ACTIONS:
        raise ValueError(f"action must be one of {', '.join(ACTIONS)}")
    needs = {"move": {"n_m", "e_m"}, "heading": {"heading_deg"}}.get(action, {action} & set(CHOICES))
    odd = set(body) - {"action"} - needs
    if odd:
        raise ValueError(f"{action} takes no {', '.join(sorted(odd))}")
    if action in CHOICES:
        words = CHOICES[action][1]
        if body.get(action) not in words:
            raise ValueError(f"{action} must be one of {', '.join(words)}")
        return PageControl(action=action, chosen=body[action])
    values = {name: _number(body, name) for name in sorted(needs)}
    if action == "move":
        place_m = (values["n_m"], values["e_m"])
        if math.hypot(*place_m) > MOST_M:
            raise ValueError(f"that is more than {MOST_M:.0f} m from the first position")
        return PageControl(action=action, place_m=place_m)
    if action == "heading":
        if not 0.0 <= values["heading_deg"] <= 360.0:
            raise ValueError("heading_deg must be 0 to 360")
        return PageControl(action=action, heading_deg=values["heading_deg"] % 360.0)
    return PageControl(action=action)


def encode_control(control: PageControl, config: AutopilotLinkConfig) -> bytes:
    """The frame that asks the daemon for it."""
    match control.action:
        case "hold":
            return encode_hold(config, None, None, None)
        case "neutral":
            return encode_neutral(config)
        case "release":
            return encode_release(config)
        case name if control.chosen is not None:
            parameter, words = CHOICES[name]
            return encode_parameter(config, parameter, float(words.index(control.chosen)))
        case _:
            psi_rad = None if control.heading_deg is None else math.radians(control.heading_deg)
            return encode_move(config, control.place_m, psi_rad)


def _number(body: dict[str, Any], name: str) -> float:
    value = body.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{name} must be a number")
    return float(value)
