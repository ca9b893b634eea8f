"""What `asvhil init` has to know of a boat: from the options, and from a person at the terminal."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from asvhil.commands.quantities import quantity
from asvhil.commands.views import say
from asvhil.errors import AsvhilError, ConfigError

if TYPE_CHECKING:
    from asvhil.commands.boat_file import OwnBoat

Value = TypeVar("Value")
Given = Mapping[str, str | None]

NAME = re.compile(r"[a-z][a-z0-9_-]{0,30}")
PWM_US = (1100, 1500, 1900)
# What is asked of the hull: name, unit, and how to find out.
HULL = {
    "length": ("m", "Length of the hulls at the waterline."),
    "beam": ("m", "Width over both hulls."),
    "mass": ("kg", "Mass ready to go, with batteries and payload: put it on a scale."),
    "top_speed": ("m/s", "Speed with both motors full ahead in calm water: a GPS track, or the maker's figure."),
    "motors_apart": ("m", "From one propeller's axis to the other's."),
}
GUESSED = {
    "turn_rate": ("deg/s", "On the spot, one motor full ahead, the other full astern: count the seconds for 360."),
    "thrust": ("N", "Of one motor, full ahead: the data sheet (1 kgf is 9.81 N), or a spring balance at a post."),
}


def told(given: Given, anemometer_kind: str, console: Any, prove: Callable[[OwnBoat], None]) -> OwnBoat:
    """What the options say, and a person at the terminal where they leave something open.

    `prove` raises AsvhilError where a boat will not do. What was answered until then is offered again.
    """
    open_ = [key for key in ("name", "port", *HULL) if given[key] is None]
    if open_ and not sys.stdin.isatty():
        flags = ", ".join("FILE.yaml" if key == "name" else _flag(key) for key in open_)
        raise ConfigError(f"init: without a terminal to ask at, {flags} must be given")
    if anemometer_kind not in ("nmea", "arduino"):
        raise ConfigError(f"--anemometer-kind {anemometer_kind}: nmea or arduino is expected")
    _check_given(given)
    ask = _Questions(given, console) if open_ else _Options(given)
    while True:
        try:
            boat = _boat(_answers(ask), anemometer_kind)
            prove(boat)
        except AsvhilError as error:
            ask.begin_again(error)
        else:
            return boat


def _check_given(given: Given) -> None:
    """ConfigError where an option is wrong whatever the answers: before any question."""
    from asvhil.dynamics.hull_guess import check_figures

    answers = _answers(_OptionsAlone(given))
    check_figures({key: answers[key] for key in HULL | GUESSED})


def _answers(ask: _Options) -> dict[str, Any]:
    answers: dict[str, Any] = {
        "name": ask.value("name", _name, "Name of the boat, in lower case", ""),
        "autopilot": ask.value("autopilot", _autopilot, "Autopilot: ardurover or px4", "ardurover"),
    }
    ask.before_ports()
    port = answers["port"] = ask.value("port", _link, "Port of the autopilot", "")
    wind_link = partial(_wind_link, autopilots=port or "")
    answers["anemometer"] = ask.value("anemometer", wind_link, "Port of the wind sensor, or none", "none")
    ask.before_hull()
    for key, (unit, words) in HULL.items():
        answers[key] = ask.value(key, partial(_figure, key=key), f"{words} ({unit})", "")
    for key, (unit, words) in GUESSED.items():
        answers[key] = ask.value(key, partial(_maybe, key=key), f"{words} ({unit}, ? if unknown)", "?")
    pulses = ",".join(map(str, PWM_US))
    answers["pwm"] = ask.value("pwm", _pwm, "Pulse widths of full astern, off, full ahead (us)", pulses)
    return answers


def _boat(answers: dict[str, Any], anemometer_kind: str) -> OwnBoat:
    """ConfigError where two figures do not go together."""
    from asvhil.commands.boat_file import OwnBoat
    from asvhil.dynamics.hull_guess import HullMeasures, check_measures

    measures = HullMeasures(
        length_m=answers["length"],
        beam_m=answers["beam"],
        mass_kg=answers["mass"],
        top_speed_mps=answers["top_speed"],
        motors_apart_m=answers["motors_apart"],
        turn_degps=answers["turn_rate"],
        thrust_n=answers["thrust"],
    )
    check_measures(measures)
    return OwnBoat(
        name=answers["name"],
        autopilot=answers["autopilot"],
        port=answers["port"],
        anemometer=answers["anemometer"],
        anemometer_kind=anemometer_kind,
        hull=measures,
        pwm_us=answers["pwm"],
    )


class _Options:
    """Answers from the command line alone; what is not given has its default."""

    def __init__(self, given: Given) -> None:
        self._given = given

    def value(self, key: str, parse: Callable[[str], Value], question: str, default: str) -> Value | None:
        text = self._given[key]
        return parse(default if text is None else text)

    def before_ports(self) -> None:
        """Nothing to tell."""

    def before_hull(self) -> None:
        """Nothing to tell."""

    def begin_again(self, error: AsvhilError) -> None:
        """Raises the error: there is nobody to answer otherwise."""
        raise error


class _OptionsAlone(_Options):
    """What the command line says by now; None for all the rest."""

    def value(self, key: str, parse: Callable[[str], Value], question: str, default: str) -> Value | None:
        return None if self._given[key] is None else super().value(key, parse, question, default)


class _Questions(_Options):
    """Answers from the command line where there are some, else from the terminal, again until they are good."""

    def __init__(self, given: Given, console: Any) -> None:
        super().__init__(given)
        self._console = console
        self._answered: dict[str, str] = {}

    def value(self, key: str, parse: Callable[[str], Value], question: str, default: str) -> Value | None:
        if self._given[key] is not None:
            return super().value(key, parse, question, default)
        while True:
            text = str(typer.prompt(question, default=self._answered.get(key, default) or None)).strip()
            try:
                value = parse(text)
            except ConfigError as error:
                typer.echo(f"  {error}")
            else:
                self._answered[key] = text
                return value

    def before_ports(self) -> None:
        from serial.tools.list_ports import comports

        found = ", ".join(sorted(port.device for port in comports())) or "none"
        say(self._console, f"Ports are written as serial:PATH:BAUD, udpin:HOST:PORT or tcp:HOST:PORT. Found: {found}.")

    def before_hull(self) -> None:
        say(self._console, "From here on the hull. A tape measure and a scale are enough; ? where a guess has to do.")

    def begin_again(self, error: AsvhilError) -> None:
        """What two answers together make wrong can be mended by either."""
        typer.echo(f"  {error}")
        say(self._console, "Once more: Enter keeps an answer.")


def _flag(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def _name(text: str) -> str:
    if not NAME.fullmatch(text):
        raise ConfigError(f"name {text}: lower case letters, digits, - and _ are expected, such as mycat")
    from asvhil.config import find_config

    try:
        find_config(text)
    except ConfigError:
        return text
    raise ConfigError(f"name {text}: a config of this name is shipped; your boat needs one of its own")


def _autopilot(text: str) -> str:
    if text not in ("ardurover", "px4"):
        raise ConfigError(f"--autopilot {text}: ardurover or px4 is expected")
    return text


def _link(text: str) -> str:
    """A link spec; the path of a device alone is a serial port."""
    from asvhil.config.link_spec import parse_spec

    if text.startswith("/dev/"):
        path, _, baud = text.partition(":")
        text = f"serial:{path}:{baud or '115200'}"
    return parse_spec(text).text


def _wind_link(text: str, autopilots: str) -> str | None:
    """The wind sensor's port, or none. It cannot be the autopilot's, which is empty where it is not known yet."""
    from asvhil.config.link_spec import shared_place

    if text == "none":
        return None
    link = _link(text)
    place = shared_place(link, autopilots) if autopilots else ""
    if place:
        raise ConfigError(f"--anemometer {text}: the autopilot is on {place} already")
    return link


def _figure(text: str, key: str) -> float:
    """A figure of the hull in SI units."""
    from asvhil.dynamics.hull_guess import check_figures

    value = quantity(_flag(key), text, (HULL | GUESSED)[key][0])
    check_figures({key: value})
    return value


def _maybe(text: str, key: str) -> float | None:
    return None if text in ("?", "") else _figure(text, key)


def _pwm(text: str) -> tuple[int, int, int]:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3 or not all(part.isdecimal() and part.isascii() for part in parts):
        raise ConfigError(f"--pwm {text}: three pulse widths in us are expected, such as 1100,1500,1900")
    astern_us, off_us, ahead_us = (int(part) for part in parts)
    if not 500 <= astern_us < off_us < ahead_us <= 2500:
        raise ConfigError(f"--pwm {text}: rising within 500 to 2500 us is expected; a reversed motor is set elsewhere")
    return astern_us, off_us, ahead_us
