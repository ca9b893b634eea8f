"""`asvhil plant`: the simulated boat as a vehicle on the network, or as the physics of an autopilot in the loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ConfigArgument, FaultOption, SetOption
from asvhil.commands.views import say, twin_hint
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.config import Config
    from asvhil.simplant.hil.server import HilServer
    from asvhil.simplant.plant import Truth

SHOW_NS = 200_000_000


def plant(
    config: ConfigArgument = "sitl",
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    ardupilot_json: Annotated[
        bool, typer.Option("--ardupilot-json", help="Be the physics of an ArduPilot (--model JSON), on UDP 9002.")
    ] = False,
    px4_hil: Annotated[
        bool, typer.Option("--px4-hil", help="Be the simulator of a PX4, on TCP 4560 or a serial port.")
    ] = False,
    endpoint: Annotated[
        str | None,
        typer.Option(
            metavar="LINK", help="With either: where, such as udpin:0.0.0.0:9002 or serial:/dev/ttyACM0:921600."
        ),
    ] = None,
    fault: FaultOption = [],  # noqa: B006
    duration: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds to run; until interrupted by default.")
    ] = None,
    quiet: Annotated[bool, typer.Option(help="No status line.")] = False,
) -> None:
    """Run the simulated boat as a vehicle on the network, or as the physics of an autopilot in the loop."""
    from asvhil.config import load_config
    from asvhil.config.fault_text import with_faults

    if ardupilot_json and px4_hil:
        raise ConfigError("plant: give --ardupilot-json or --px4-hil, not both")
    if endpoint is not None and not (ardupilot_json or px4_hil):
        raise ConfigError("plant: --endpoint goes with --ardupilot-json or --px4-hil; else it is plant.links.autopilot")
    settings = with_faults(load_config(config, tuple(set_)), fault, duration)
    hint = twin_hint(config)
    if hint and settings.supervisor.engage != "auto":
        typer.echo(f"asvhil: warning: {config}: simulated by the ports of the real boat{hint}", err=True)
    if ardupilot_json or px4_hil:
        _serve_autopilot(settings, px4_hil, endpoint, duration, quiet)
    else:
        _be_the_vehicle(settings, duration, quiet)


def _be_the_vehicle(settings: Config, duration: float | None, quiet: bool) -> None:
    import asyncio

    from asvhil.links.clock import Clock
    from asvhil.simplant.server import PlantServer

    title = f"{settings.vehicle.name} on {settings.plant.links.autopilot}"
    last_ns = 0

    def run(show: Callable[[str], None] | None) -> None:
        def on_truth(truth: Truth) -> None:
            nonlocal last_ns
            if show is not None and truth.t_ns - last_ns >= SHOW_NS:
                last_ns = truth.t_ns
                show(_pose(truth))

        asyncio.run(PlantServer(settings, Clock(), on_truth).run(duration))

    _with_status_line(title, quiet, run)


def _serve_autopilot(
    settings: Config, px4_hil: bool, endpoint: str | None, duration: float | None, quiet: bool
) -> None:
    import asyncio

    from asvhil.links.clock import Clock
    from asvhil.simplant.hil.server import ArduPilotJsonServer, Px4HilServer

    hil = settings.plant.hil
    kind: type[HilServer] = Px4HilServer if px4_hil else ArduPilotJsonServer
    where = endpoint or (hil.px4.endpoint if px4_hil else hil.ardupilot.endpoint)

    server = kind(settings, where, Clock())

    def run(show: Callable[[str], None] | None) -> None:
        def on_status(status: str) -> None:
            if show is not None:
                show(f"{_pose(server.plant.truth)}; {status}")

        asyncio.run(server.run(duration, on_status))

    _with_status_line(f"{settings.vehicle.name} for {kind.title} on {where}", quiet, run)


def _pose(truth: Truth) -> str:
    return f"{truth.n_m:.2f} m N, {truth.e_m:.2f} m E, {math.degrees(truth.psi_rad) % 360.0:.1f} deg"


def _with_status_line(title: str, quiet: bool, run: Callable[[Callable[[str], None] | None], Any]) -> None:
    """Call `run` with a status line that it may change. On a pipe only the title is printed."""
    from rich.console import Console
    from rich.text import Text

    console = Console()
    if quiet or not console.is_terminal:
        if not quiet:
            say(console, title)
        run(None)
        return
    with console.status(Text(title)) as status:
        run(lambda line: status.update(Text(f"{title}: {line}")))
