"""`asvhil init`: a config of one's own boat, asked for question by question or given by options."""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import check_json, check_writable, write_json, writing
from asvhil.commands.quantities import quantity
from asvhil.commands.views import say
from asvhil.errors import ConfigError
from asvhil.files import write_text

if TYPE_CHECKING:
    from asvhil.commands.boat_file import OwnBoat
    from asvhil.config import VesselConfig

Value = TypeVar("Value")

NAME = re.compile(r"[a-z][a-z0-9_-]{0,30}")
PWM_US = (1100, 1500, 1900)
HULL_PANEL = "The hull: numbers, with a unit if it is another one than here"
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


def _hull_option(name: str) -> Any:
    unit, words = (HULL | GUESSED)[name]
    guessed = " Guessed if not given." if name in GUESSED else ""
    return typer.Option(metavar=unit.upper(), help=f"{words}{guessed}", rich_help_panel=HULL_PANEL)


def init(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE.yaml]", help="The config to write; NAME.yaml by default.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the boat, to which its models are bound.")] = None,
    autopilot: Annotated[str | None, typer.Option(help="ardurover (default) or px4.")] = None,
    port: Annotated[
        str | None,
        typer.Option(metavar="LINK", help="The autopilot's: serial:/dev/ttyAMA0:921600, udpin:0.0.0.0:14550, ..."),
    ] = None,
    anemometer: Annotated[
        str | None, typer.Option(metavar="LINK", help="The wind sensor's, such as serial:/dev/ttyACM0:115200, or none.")
    ] = None,
    anemometer_kind: Annotated[
        str, typer.Option(metavar="KIND", help="nmea: any NMEA 0183 sensor; arduino: that of docs/anemometer.md.")
    ] = "nmea",
    length: Annotated[str | None, _hull_option("length")] = None,
    beam: Annotated[str | None, _hull_option("beam")] = None,
    mass: Annotated[str | None, _hull_option("mass")] = None,
    top_speed: Annotated[str | None, _hull_option("top_speed")] = None,
    motors_apart: Annotated[str | None, _hull_option("motors_apart")] = None,
    turn_rate: Annotated[str | None, _hull_option("turn_rate")] = None,
    thrust: Annotated[str | None, _hull_option("thrust")] = None,
    pwm: Annotated[
        str | None, typer.Option(metavar="ASTERN,OFF,AHEAD", help="Pulse widths in us; 1100,1500,1900 by default.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that are there.")] = False,
    json_: JsonOption = None,
) -> None:
    """Write a commented config of your own boat, and one of its simulated twin.

    On a terminal it asks for what the options leave open. The parameters of the hull are guessed from its length, beam,
    mass, top speed, and the distance of its motors.
    """
    from rich.console import Console

    from asvhil.commands.boat_file import boat_text, twin_text
    from asvhil.config import load_config

    check_json(json_)
    console = Console()
    given = {
        "name": name or (file.stem if file is not None else None),
        "autopilot": autopilot,
        "port": port,
        "anemometer": anemometer,
        **{key: value for key, value in zip(HULL, (length, beam, mass, top_speed, motors_apart), strict=True)},
        "turn_rate": turn_rate,
        "thrust": thrust,
        "pwm": pwm,
    }
    if given["name"] is not None:
        _files(file or Path(f"{given['name']}.yaml"), force)  # before any question
    boat = _told(given, anemometer_kind, console)
    target, twin = _files(file or Path(f"{boat.name}.yaml"), force)
    texts = {target: boat_text(boat), twin: twin_text(boat, target.name)}
    _prove(texts)
    for path, text in texts.items():
        with writing(path):
            write_text(path, text)
    vessel = load_config(target).vehicle.vessel
    write_json(json_, {"files": [str(target), str(twin)], "vessel": vessel.model_dump(mode="json")})
    _tell(console, boat, vessel, target, twin)


def _files(target: Path, force: bool) -> tuple[Path, Path]:
    """The files of the boat and of its twin. ConfigError or AsvhilError where they cannot be, or are there already."""
    if target.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"init: {target}: a config file ends in .yaml")
    files = target, target.with_name(f"{target.stem}-sim{target.suffix}")
    for path in files:
        if path.exists() and not force:
            raise ConfigError(f"init: {path} is there already: another name, or --force to overwrite it")
        check_writable(path)
    return files


def _prove(texts: dict[Path, str]) -> None:
    """ConfigError where one of the files would not be a config: what cannot be run is not left behind."""
    from asvhil.config import load_config

    with tempfile.TemporaryDirectory() as folder:
        places = [Path(folder) / path.name for path in texts]
        for place, text in zip(places, texts.values(), strict=True):
            place.write_text(text, encoding="utf-8")
        try:
            for place in places:
                load_config(place)
        except ConfigError as error:
            words = str(error).replace(f"{folder}/", "")
            raise ConfigError(f"init: {words}; nothing was written") from None


def _told(given: dict[str, str | None], anemometer_kind: str, console: Any) -> OwnBoat:
    """What the options say, and a person at the terminal where they leave something open."""
    from asvhil.commands.boat_file import OwnBoat
    from asvhil.dynamics.hull_guess import HullMeasures, check_measures, doubts

    needed = ("name", "port", *HULL)
    open_ = [key for key in needed if given[key] is None]
    if open_ and not sys.stdin.isatty():
        flags = ", ".join("FILE.yaml" if key == "name" else f"--{key.replace('_', '-')}" for key in open_)
        raise ConfigError(f"init: without a terminal to ask at, {flags} must be given")
    if anemometer_kind not in ("nmea", "arduino"):
        raise ConfigError(f"--anemometer-kind {anemometer_kind}: nmea or arduino is expected")
    ask = _Questions(given, console) if open_ else _Options(given)
    boat_name = ask.value("name", _name, "Name of the boat, in lower case", "")
    profile = ask.value("autopilot", _autopilot, "Autopilot: ardurover or px4", "ardurover")
    ask.before_ports()
    link = ask.value("port", _link, "Port of the autopilot", "")
    wind = ask.value("anemometer", _no_link, "Port of the wind sensor, or none", "none")
    ask.before_hull()
    hull = {
        key: ask.value(key, partial(quantity, _flag(key), unit=unit), f"{words} ({unit})", "")
        for key, (unit, words) in HULL.items()
    }
    guessed = {
        key: ask.value(key, partial(_maybe, _flag(key), unit=unit), f"{words} ({unit}, ? if unknown)", "?")
        for key, (unit, words) in GUESSED.items()
    }
    pulses = ask.value("pwm", _pwm, "Pulse widths of full astern, off, full ahead (us)", ",".join(map(str, PWM_US)))
    measures = HullMeasures(
        length_m=hull["length"],
        beam_m=hull["beam"],
        mass_kg=hull["mass"],
        top_speed_mps=hull["top_speed"],
        motors_apart_m=hull["motors_apart"],
        turn_degps=guessed["turn_rate"],
        thrust_n=guessed["thrust"],
    )
    check_measures(measures)
    doubt = doubts(measures)
    if doubt:
        typer.echo(f"asvhil: {doubt}", err=True)
    return OwnBoat(
        name=boat_name,
        autopilot=profile,
        port=link,
        anemometer=wind,
        anemometer_kind=anemometer_kind,
        hull=measures,
        pwm_us=pulses,
    )


class _Options:
    """Answers from the command line alone; what is not given has its default."""

    def __init__(self, given: dict[str, str | None]) -> None:
        self._given = given

    def value(self, key: str, parse: Callable[[str], Value], question: str, default: str) -> Value:
        text = self._given[key]
        return parse(default if text is None else text)

    def before_ports(self) -> None:
        """Nothing to tell."""

    def before_hull(self) -> None:
        """Nothing to tell."""


class _Questions(_Options):
    """Answers from the command line where there are some, else from the terminal, again until they are good."""

    def __init__(self, given: dict[str, str | None], console: Any) -> None:
        super().__init__(given)
        self._console = console

    def value(self, key: str, parse: Callable[[str], Value], question: str, default: str) -> Value:
        if self._given[key] is not None:
            return super().value(key, parse, question, default)
        while True:
            text = typer.prompt(question, default=default or None)
            try:
                return parse(str(text).strip())
            except ConfigError as error:
                typer.echo(f"  {error}")

    def before_ports(self) -> None:
        from serial.tools.list_ports import comports

        found = ", ".join(sorted(port.device for port in comports())) or "none"
        say(self._console, f"Ports are written as serial:PATH:BAUD, udpin:HOST:PORT or tcp:HOST:PORT. Found: {found}.")

    def before_hull(self) -> None:
        say(self._console, "From here on the hull. A tape measure and a scale are enough; ? where a guess has to do.")


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


def _no_link(text: str) -> str | None:
    return None if text == "none" else _link(text)


def _maybe(option: str, text: str, unit: str) -> float | None:
    return None if text in ("?", "") else quantity(option, text, unit)


def _pwm(text: str) -> tuple[int, int, int]:
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3 or not all(part.isdecimal() and part.isascii() for part in parts):
        raise ConfigError(f"--pwm {text}: three pulse widths in us are expected, such as 1100,1500,1900")
    astern_us, off_us, ahead_us = (int(part) for part in parts)
    if not 500 <= astern_us < off_us < ahead_us <= 2500:
        raise ConfigError(f"--pwm {text}: rising within 500 to 2500 us is expected; a reversed motor is set elsewhere")
    return astern_us, off_us, ahead_us


def _tell(console: Any, boat: OwnBoat, vessel: VesselConfig, target: Path, twin: Path) -> None:
    ahead_n, astern_n = vessel.thrust_curve[-1][1], -vessel.thrust_curve[0][1]
    say(
        console,
        f"{target}: {boat.name}, {vessel.mass_kg:g} kg, motors of {ahead_n:g} N ahead and {astern_n:g} N astern",
    )
    say(console, f"{twin}: the same boat, simulated")
    say(console, "What next:")
    for command, words in (
        (f"asvhil config check {target}", "whether the file is right, and whose hull and model are in use"),
        (f"asvhil sitl {twin} --lockstep --duration 120", "the simulated boat keeps a station"),
        (f"asvhil learn {twin}", "a rehearsal of the afternoon on the water (needs torch: pip install '.[train]')"),
        (f"asvhil check {target}", "on the boat: links, parameters, sensors"),
    ):
        say(console, f"  {command:<56} {words}")
