"""The status of a running daemon, as a JSON line and as a table for the terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from asvhil.autopilot.vehicle_text import vehicle_text
from asvhil.backseat.build import model_file
from asvhil.config import Config
from asvhil.config.registry import CONTROLLERS
from asvhil.daemon.story import LINKS, Story
from asvhil.dynamics.corrected import FACTORS
from asvhil.estimator.learned_words import learned_text
from asvhil.geo import wrap_rad
from asvhil.io.sensors.dropped import dropped_of
from asvhil.supervisor.docking_odds import HORIZONS_S
from asvhil.supervisor.reasons import Reason, describe, explain, remedy
from asvhil.types import EnergyUse, FrontseatStatus, Learned, Outputs, Phase

IDLE = (Reason.WAITING_FOR_HOLD.value, Reason.RELEASED.value)  # of a standby in which nothing but a hold is waited for
COLOURS = {"hold": "green", "standby": "yellow", "prepare": "cyan", "failsafe": "red"}


class StatusTeller:
    """Follows a run tick by tick and tells how it is: the present tick, what went before, and the boat's own words."""

    def __init__(self, config: Config) -> None:
        kind = CONTROLLERS.find(config.controller.name).model
        file = model_file(config)
        of_boat = "physics of" if not kind or file is None else f"{file.name}, {kind} of"
        self._model = f"{config.controller.name}: {of_boat} {config.vehicle.name}"
        self._story = Story(config.supervisor.point_m)
        self._start_ns: int | None = None

    def see(self, outputs: Outputs) -> None:
        """One tick."""
        self._start_ns = outputs.t_ns if self._start_ns is None else self._start_ns
        self._story.see(outputs)

    def status(
        self, outputs: Outputs, links: dict[str, str], overruns: int, vehicle: FrontseatStatus | None
    ) -> dict[str, Any]:
        """The status in JSON types. The tick must have been seen."""
        status = status_of(outputs, links, self._start_ns or outputs.t_ns, overruns)
        status |= {"vehicle": vehicle_text(vehicle), "in_the_way": in_the_way(outputs, vehicle)}
        return {**status, "model": self._model, **self._story.told(outputs)}


def in_the_way(outputs: Outputs, vehicle: FrontseatStatus | None) -> str:
    """What would refuse a hold now, as far as the outputs tell; empty where nothing would, or none is waited for.

    The supervisor looks at more when a hold comes (mode, sticks, fence, the vehicle's kind).
    """
    health = outputs.health
    if outputs.phase is not Phase.STANDBY or health.code not in IDLE:
        return ""
    if not health.link_ok or vehicle is None:
        return describe(explain(Reason.NO_HEARTBEAT))  # what it told before is not known to be so any more
    found = [
        *(() if vehicle.armed else (explain(Reason.NOT_ARMED, hint=vehicle.arming_fault),)),
        *(() if health.estimate_ok else (explain(Reason.NO_ESTIMATE),)),
    ]
    return ", ".join(map(describe, found))


def status_of(outputs: Outputs, links: dict[str, str], start_ns: int, overruns: int) -> dict[str, Any]:
    """The status of one tick in JSON types; values that are not known are None."""
    estimate, station, wind = outputs.estimate, outputs.station, outputs.wind
    distance_m = heading_deg = None
    if estimate is not None and station is not None:
        distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        heading_deg = math.degrees(wrap_rad(estimate.psi_rad - station.psi_rad))
    return {
        "t_s": round((outputs.t_ns - start_ns) * 1e-9, 2),
        "phase": outputs.phase.value,
        "reason": outputs.health.reason,
        "code": outputs.health.code,
        "remedy": remedy(outputs.health.code),
        "distance_m": distance_m,
        "heading_error_deg": heading_deg,
        "heading_deg": math.degrees(estimate.psi_rad) % 360.0 if estimate else None,
        "speed_mps": math.hypot(estimate.u_mps, estimate.v_mps) if estimate else None,
        "wind_mps": math.hypot(wind.vn_mps, wind.ve_mps) if wind else None,
        "wind_origin": wind.origin if wind else None,
        "wind_toward_deg": math.degrees(math.atan2(wind.ve_mps, wind.vn_mps)) % 360.0 if wind else None,
        "waves": (
            {
                "peak_hz": outputs.waves.peak_hz,
                "velocity_std_mps": outputs.waves.velocity_std_mps,
                "share": outputs.waves.share,
            }
            if outputs.waves
            else None
        ),
        "docking": (
            {"open_s": outputs.docking.open_s, "stays": list(outputs.docking.stays)} if outputs.docking else None
        ),
        "energy": _energy(outputs.energy),
        "learned": _learned(outputs.learned),
        "pwm_us": list(outputs.pwm_us) if outputs.pwm_us else None,
        "autopilot_clock_s": outputs.autopilot_clock.offset_ns * 1e-9 if outputs.autopilot_clock else None,
        "round_trip_ms": outputs.autopilot_clock.round_trip_ns * 1e-6 if outputs.autopilot_clock else None,
        "sources": dict(outputs.health.sources),
        "dropped": dropped_of(outputs.health.counters),
        "notes": {note.subject: note.text for note in outputs.health.notes},
        "links": links,
        "overruns": overruns,
    }


def _energy(use: EnergyUse | None) -> dict[str, Any] | None:
    """What is taken from the battery, and how the power is known."""
    if use is None:
        return None
    return {"hold_wh": use.hold_wh, "mean_w": use.mean_w, "hours_left": use.hours_left, "by": use.by}


def _learned(learned: Learned | None) -> dict[str, Any] | None:
    """What is learned of the model: the factors by name, in words, and why nothing is learned now."""
    if learned is None:
        return None
    return {
        "factors": dict(zip(FACTORS, learned.factors, strict=True)),
        "std": dict(zip(FACTORS, learned.std, strict=True)),
        "learned_s": learned.learned_s,
        "frozen": learned.frozen,
        "text": learned_text(learned),
    }


def render(status: dict[str, Any], title: str) -> Group:
    """A status as a table for the terminal."""
    table = Table(title=title, show_header=False, title_justify="left", min_width=64)
    table.add_column(style="dim")
    table.add_column()
    phase = str(status["phase"])
    table.add_row("time", f"{status['t_s']:.0f} s")
    table.add_row("phase", Text(f"{phase}: {status['reason']}", style=COLOURS.get(phase, "")))
    table.add_row("what to do", status["remedy"])
    if status.get("in_the_way"):
        table.add_row("refuses a hold", status["in_the_way"])
    if "held_s" in status:
        table.add_row("collected", f"{status['held_s']:.0f} of {status['duration_s']:.0f} s")
    if status.get("vehicle"):
        table.add_row("autopilot", status["vehicle"])
    station = status.get("station")
    if station is not None:
        table.add_row("station", station_text(station))
    table.add_row(
        "to the station", f"{_show(status['distance_m'], 'm')}, {_show(status['heading_error_deg'], 'deg', 1)}"
    )
    table.add_row("heading, speed", f"{_show(status['heading_deg'], 'deg', 1)}, {_show(status['speed_mps'], 'm/s')}")
    docking = status.get("docking")
    if docking is not None:
        table.add_row("docking window", docking_text(docking["open_s"], docking["stays"]))
    energy = status.get("energy")
    if energy is not None:
        table.add_row("energy", energy_text(energy))
    learned = status.get("learned")
    if learned is not None:
        table.add_row("learned", learned["text"] + (f"; frozen: {learned['frozen']}" if learned["frozen"] else ""))
    wind = f"{_show(status['wind_mps'], 'm/s')} toward {_show(status['wind_toward_deg'], 'deg', 0)}"
    guessed = status.get("wind_origin") == "disturbance"
    table.add_row("true wind", f"{wind} (from the disturbance)" if guessed else wind)
    waves = status.get("waves")
    if waves:
        size = f"{waves['velocity_std_mps']:.2f} m/s rms at {waves['peak_hz']:.2f} Hz"
        table.add_row("waves", f"{size}, filtered by {100.0 * waves['share']:.0f} %")
    pwm = status["pwm_us"]
    table.add_row("port, starboard", f"{pwm[0]}, {pwm[1]} us" if pwm else "released")
    clock = f"{_show(status['autopilot_clock_s'], 's', 4)}, round trip {_show(status['round_trip_ms'], 'ms', 1)}"
    table.add_row("autopilot's clock", clock)
    table.add_row("sources", sources_text(status["sources"]))
    for port, causes in status["dropped"].items():
        table.add_row(f"dropped, {port}", counts_text(causes))
    for subject, text in notes_of(status).items():
        table.add_row(subject, text)
    table.add_row("links", ", ".join(f"{port} {state}" for port, state in status["links"].items()))
    if status.get("model"):
        table.add_row("model", status["model"])
    table.add_row("overruns", str(status["overruns"]))
    for number, event in enumerate(status.get("events", ())):
        table.add_row("" if number else "events", event_text(event))
    return Group(table)


def notes_of(status: dict[str, Any]) -> dict[str, str]:
    """The notes of a status by subject, but for that on the links, which are shown with more of each."""
    return {subject: text for subject, text in status["notes"].items() if subject != LINKS}


def station_text(station: dict[str, float | None]) -> str:
    """Place and heading of a station, and how far off the boat was when it was given."""
    from_m = station.get("from_m")
    return place_text(station) + ("" if from_m is None else f"; {from_m:.1f} m away at the start")


def place_text(station: dict[str, float | None]) -> str:
    """Where a station is by now, and its heading."""
    return f"{station['lat_deg']:.7f}, {station['lon_deg']:.7f}, heading {station['heading_deg']:.1f} deg"


def event_text(event: dict[str, Any]) -> str:
    """The time of day of this computer, and what happened."""
    return f"{datetime.fromtimestamp(event['t_ns'] * 1e-9):%H:%M:%S} {event['text']}"


def sources_text(sources: dict[str, str]) -> str:
    """The source in use for each quantity, such as "position autopilot.GPS_RAW_INT, wind not heard"."""
    return ", ".join(f"{quantity} {name or 'not heard'}" for quantity, name in sources.items()) or "-"


def shares_text(shares: dict[str, dict[str, float]]) -> str:
    """Of each quantity that had more than one source, the share of time of each: "position ins.BINARY 99 %, ...".

    Less than half a per cent is shown as "<1 %"; empty where every quantity had one source throughout.
    """
    return "; ".join(
        f"{quantity} " + ", ".join(f"{name or 'not heard'} {_percent(share)}" for name, share in of_quantity.items())
        for quantity, of_quantity in shares.items()
        if len(of_quantity) > 1
    )


def _percent(share: float) -> str:
    """Never 100 % of what is not all."""
    return "<1 %" if share < 0.005 else ">99 %" if share > 0.995 else f"{100.0 * share:.0f} %"


def counts_text(causes: dict[str, int]) -> str:
    """Counts by cause, such as "3 bad checksum, 1 out of range"."""
    return ", ".join(f"{count} {cause}" for cause, count in causes.items())


def _show(value: float | None, unit: str, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f} {unit}"


def docking_text(open_s: float | None, stays: Sequence[float]) -> str:
    """A docking window in words."""
    if open_s is None:
        return "not open"
    likely = ", ".join(f"{h:.0f} s: {100.0 * p:.0f} %" for h, p in zip(HORIZONS_S, stays, strict=False))
    return f"open for {open_s:.0f} s" + (f"; stays open for another {likely}" if likely else "")


def energy_text(energy: dict[str, Any]) -> str:
    """What is taken from the battery in words, such as "12.3 Wh in this hold, 246 W (curve), 2.1 h left"."""
    forms = (
        ("hold_wh", "{:.1f} Wh in this hold"),
        ("mean_w", f"{{:.0f}} W ({energy['by']})"),
        ("hours_left", "{:.1f} h left"),
    )
    return ", ".join(form.format(energy[key]) for key, form in forms if energy[key] is not None) or "not known yet"
