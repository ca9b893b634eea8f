"""`asvhil init`: a config of one's own boat, asked for question by question or given by options."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.boat_questions import GUESSED, HULL, told
from asvhil.commands.options import JsonOption
from asvhil.commands.outputs import check_figures, check_json, check_writable, write_json, writing
from asvhil.commands.views import say
from asvhil.errors import ConfigError
from asvhil.files import is_there, write_text

if TYPE_CHECKING:
    from asvhil.commands.boat_file import OwnBoat
    from asvhil.config import VesselConfig

HULL_PANEL = "The hull: numbers, with a unit if it is another one than here"


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
    from asvhil.dynamics.hull_guess import doubts

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
        own, twin = _files(file or Path(f"{given['name']}.yaml"), force)  # before any question
        check_figures(json_, ("the config", own), ("the config of the twin", twin))

    def texts_of(boat: OwnBoat) -> dict[Path, str]:
        target, twin = _files(file or Path(f"{boat.name}.yaml"), force)
        return {target: boat_text(boat), twin: twin_text(boat, target.name)}

    boat = told(given, anemometer_kind, console, lambda boat: _prove(texts_of(boat)))
    doubt = doubts(boat.hull)
    if doubt:
        typer.echo(f"asvhil: {doubt}", err=True)
    texts = texts_of(boat)
    target, twin = texts
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
        if is_there(path) and not force:
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
