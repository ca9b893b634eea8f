"""`asvhil status`: how a running daemon is."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.operate import DaemonOption
from asvhil.commands.options import SetOption
from asvhil.commands.views import say
from asvhil.errors import LinkError

if TYPE_CHECKING:
    from rich.table import Table

EVERY_S = 1.0
COLOURS = {"active": "green", "standby": "yellow", "critical": "red", "emergency": "bold red"}


def status(
    config: DaemonOption = "field",
    set_: SetOption = [],  # noqa: B006
    watch: Annotated[bool, typer.Option("--watch", help="Once a second, until interrupted.")] = False,
    json_: Annotated[bool, typer.Option("--json", help="A JSON line instead of a table.")] = False,
) -> None:
    """Show how the running daemon is: phase and reason, distance, station, notes, computer. It changes nothing."""
    from rich.console import Console
    from rich.live import Live

    from asvhil.config import load_config
    from asvhil.links.operator_listener import OperatorListener

    settings = load_config(config, tuple(set_))
    link = settings.links.operator
    listener = OperatorListener(settings.links.autopilot, link.endpoint, link.signing)
    console = Console()
    name = settings.vehicle.name
    if not watch:
        _show(console, name, listener.look(), json_)
        return
    if json_ or not console.is_terminal:
        while True:
            _show(console, name, _look(listener), json_)
            time.sleep(EVERY_S)
    with Live(console=console, auto_refresh=False) as live:
        while True:
            live.update(_table(name, _look(listener)), refresh=True)
            time.sleep(EVERY_S)


def _look(listener: Any) -> dict[str, Any]:
    """As `look`; a daemon that is gone may come back."""
    try:
        found: dict[str, Any] = listener.look()
    except LinkError as error:
        return {"phase": None, "reason": str(error), "state": None, "notes": {}}
    return found


def _show(console: Any, name: str, look: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(look) + "\n", end="", flush=True)
    elif console.is_terminal:
        console.print(_table(name, look))
    else:
        for subject, text in _rows(look):
            say(console, f"{subject}: {text}")


def _rows(look: dict[str, Any]) -> list[tuple[str, str]]:
    """What there is to tell, in lines."""
    rows = [("phase", f"{look['phase'] or 'unknown'}: {look['reason']}")]
    barred = _in_the_way(look)
    if barred:
        rows.append(("refuses a hold", barred))
    if look["state"] in ("critical", "emergency"):
        rows.append(("state", look["state"]))
    if look.get("distance_m") is not None:
        rows.append(("to the station", f"{look['distance_m']:.2f} m, {look['heading_error_deg']:.1f} deg"))
    docking = look.get("docking")
    if docking is not None:
        from asvhil.daemon.status import docking_text

        rows.append(("docking window", docking_text(docking["open_s"], docking["stays"])))
    energy = look.get("energy")
    if energy is not None:
        from asvhil.daemon.status import energy_text

        rows.append(("energy", energy_text(energy)))
    station = look.get("station")
    if station is not None:
        place = f"{station['lat_deg']:.7f}, {station['lon_deg']:.7f}, heading {station['heading_deg']:.1f} deg"
        rows.append(("station", place))
    equipment = _equipment(look.get("boat") or {})
    if equipment:
        rows.append(("receiver and battery", equipment))
    computer = look.get("computer")
    if computer is not None:
        known = (
            ("load", computer["load_percent"], "%"),
            ("temperature", computer["temperature_degc"], "deg C"),
            ("memory free", computer["ram_free_mib"], "MiB"),
            ("disk free", computer["disk_free_mib"], "MiB"),
        )
        told = [f"{what} {value} {unit}" for what, value, unit in known if value is not None]
        rows.append(("computer", ", ".join(told)))
    return rows + list(look["notes"].items())


def _in_the_way(look: dict[str, Any]) -> str:
    """As `daemon.status.in_the_way`, of what the link tells, which of a silent autopilot is nothing."""
    from asvhil.daemon.status import IDLE
    from asvhil.supervisor.reasons import Reason, describe, explain

    boat = look.get("boat")
    if boat is None or look["reason"] not in [describe(explain(Reason(code))) for code in IDLE]:
        return ""
    if boat.get("armed") is None:
        return describe(explain(Reason.NO_HEARTBEAT))
    missing = ((Reason.NOT_ARMED, boat["armed"]), (Reason.NO_ESTIMATE, boat.get("estimate_ok")))
    return ", ".join(describe(explain(reason)) for reason, there in missing if not there)


def _equipment(boat: dict[str, float | None]) -> str:
    """Fix, satellites and battery in words; empty where nothing is known."""
    from asvhil.autopilot.vehicle_text import equipment_text

    fix, satellites = (None if boat.get(name) is None else round(boat[name] or 0.0) for name in ("fix", "satellites"))
    return equipment_text(fix, satellites, boat.get("battery_v"), boat.get("battery_percent"))


def _table(name: str, look: dict[str, Any]) -> Table:
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"asvhil {name}", show_header=False, title_justify="left", min_width=64)
    table.add_column(style="dim")
    table.add_column()
    for subject, text in _rows(look):
        style = COLOURS.get(look["state"] or "", "red") if subject == "phase" else ""
        table.add_row(subject, Text(text, style=style))
    return table
