"""Output of the commands: the live table, progress bars, the summary of a run, and figures as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from asvhil.commands.display import Display
from asvhil.commands.outputs import write_json
from asvhil.files import is_file

if TYPE_CHECKING:
    from asvhil.config import Config


NEEDS_AUTO = "key supervisor.engage: a simulated boat needs auto (nobody is there to say hold)"
END_S = 1.0  # a release so near the end of a log belongs to the end of the run
LINES_KEPT = 64  # statuses that wait for a slow reader of a pipe


class LiveView:
    """The live table on a terminal; on a pipe a line each 10 s and at each change of phase, or JSON lines.

    All of it is written on a thread of its own: no call raises, or waits for a reader.
    """

    def __init__(self, config: Config, title: str, *, as_json: bool = False) -> None:
        from rich.console import Console
        from rich.live import Live

        from asvhil.daemon.status import StatusTeller

        self._title = title
        self._as_json = as_json
        self._console = Console()
        # Without redirection: what others write must not wait for this one's lock.
        live = Live(console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False)
        self._live = live if self._console.is_terminal and not as_json else None
        self._display = Display(keep=LINES_KEPT if self._live is None else 1)
        self._every_ticks = max(1, round(config.daemon.tick_hz / 2.0))
        self._ticks = 0
        self._teller = StatusTeller(config)
        self._said = ("", -1)
        self._noted: dict[str, str] = {}
        self._told_ns = 0
        self._given_ns: int | None = None  # when the station that was told last was given
        self._place = ""  # as it was told last

    @property
    def trouble(self) -> str:
        """Why nothing is shown any more; empty while it is."""
        return self._display.trouble

    def __enter__(self) -> LiveView:
        if self._live is not None:
            self._display.put(self._live.start)
        elif not self._as_json:
            self._display.put(lambda: say(self._console, self._title))
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._display.put(self._live.stop)
        self._display.close()

    def show(self, outputs: Any, links: dict[str, str], overruns: int, vehicle: Any = None) -> None:
        """One tick of a daemon in this process; `vehicle`: what its autopilot says of itself."""
        self._teller.see(outputs)
        self._ticks += 1
        if self._ticks % self._every_ticks == 0:
            self.show_status(self._teller.status(outputs, links, overruns, vehicle))

    def show_status(self, status: dict[str, Any]) -> None:
        """One status, of this process or read from another."""
        self._display.put(lambda: self._write(status))

    def _write(self, status: dict[str, Any]) -> None:
        from asvhil.daemon.status import render

        if self._as_json:
            print(json.dumps(status) + "\n", end="", flush=True)  # a line in one piece
        elif self._live is not None:
            self._live.start()  # which does nothing but the first time
            self._live.update(render(status, self._title), refresh=True)
        else:
            for subject, text in self._news(status).items():
                say(self._console, f"{subject}: {text}")
            for text in self._late_events(status):
                say(self._console, text)
            key = (str(status["phase"]), int(status["t_s"] // 10))
            if key != self._said:
                self._said = key
                distance = status["distance_m"]
                where = "" if distance is None else f", {distance:.2f} m, {status['heading_error_deg']:.1f} deg off"
                where += self._moved(status)
                barred = f"; refuses a hold: {status['in_the_way']}" if status.get("in_the_way") else ""
                say(self._console, f"{status['t_s']:6.1f} s  {status['phase']}: {status['reason']}{where}{barred}")

    def _late_events(self, status: dict[str, Any]) -> list[str]:
        """Stations that were given and requests that were refused since the last status; the rest is told otherwise."""
        from asvhil.daemon.status import event_text, place_text, station_text

        events = [event for event in status.get("events", ()) if event["t_ns"] > self._told_ns]
        self._told_ns = max([self._told_ns, *(event["t_ns"] for event in events)])
        found = [event_text(event) for event in events if event["text"].startswith("refused: ")]
        station = status.get("station")
        given_ns = None if station is None else station["given_ns"]
        if station is not None and given_ns != self._given_ns:
            self._place = place_text(station)
            found.append(f"station: {station_text(station)}")
        self._given_ns = given_ns
        return found

    def _moved(self, status: dict[str, Any]) -> str:
        """Where the station is by now, if it has moved or turned since that was told."""
        from asvhil.daemon.status import place_text

        station = status.get("station")
        if station is None or place_text(station) == self._place:
            return ""
        self._place = place_text(station)
        return f"; station {self._place}"

    def _news(self, status: dict[str, Any]) -> dict[str, str]:
        """Lines for notes, links and sources that have changed; for a link that is up only if it was not before.

        Dropped data are given by cause; the counts are in the table.
        """
        from asvhil.daemon.status import sources_text

        links = {f"link {port}": state.partition(";")[0] for port, state in status["links"].items()}
        dropped = {f"dropped, {port}": ", ".join(causes) for port, causes in status["dropped"].items()}
        sources = {"sources": sources_text(status["sources"])}
        said = self._noted
        heard = sources if any(status["sources"].values()) or "sources" in said else {}
        vehicle = {"autopilot": status["vehicle"].partition(", battery")[0]} if status.get("vehicle") else {}
        self._noted = links | heard | vehicle | dropped | status["notes"]
        return {
            subject: text
            for subject, text in self._noted.items()
            if said.get(subject, "up") != text and not (text == "connecting" and subject in links)
        }


def progress(console: Any, *, spinner: bool = False) -> Any:
    from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn

    if spinner:
        columns: list[Any] = [
            SpinnerColumn(),
            TextColumn("{task.description} {task.completed} ticks"),
            TimeElapsedColumn(),
        ]
    else:
        columns = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()]
    return _shown(console, columns, "ticks" if spinner else "")


def stage_bar(console: Any) -> Any:
    """A bar whose description is the stage of the work."""
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    return _shown(console, (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()))


def byte_bar(console: Any) -> Any:
    """A bar over the bytes of a file."""
    from rich.progress import BarColumn, DownloadColumn, TextColumn, TimeElapsedColumn

    return _shown(console, (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeElapsedColumn()))


def _shown(console: Any, columns: Sequence[Any], unit: str = "") -> Any:
    """A bar of these columns on a terminal; on a pipe a line now and then, with the unit of a count without a total."""
    from rich.progress import Progress

    from asvhil.commands.piped_progress import PipedProgress

    if console.is_terminal:
        return Progress(*columns, console=console, transient=True)
    return PipedProgress(console, unit)


def ticks_to(bar: Any, task: Any) -> Callable[[int], None]:
    """Tells a bar now and then how many ticks are read."""
    return lambda ticks: bar.update(task, completed=ticks) if ticks % 50 == 0 else None


def report_run(log: Path, json_file: Path | None, picture: Path | None, console: Any, wall_s: float | None) -> None:
    from asvhil.logs.run import read_run
    from asvhil.logs.summary import summarise

    with progress(console, spinner=True) as bar:
        task = bar.add_task("report: reading", total=None)
        run_log = read_run(log, on_tick=ticks_to(bar, task))
    figures = summarise(run_log, wall_s)
    write_json(json_file, figures)
    print_summary(console, figures)
    if picture is not None:
        from asvhil.logs.picture import draw_run

        draw_run(run_log, picture, title_of(figures))
        say(console, f"picture {picture}")
    say(console, f"log     {log}")


def title_of(figures: dict[str, Any]) -> str:
    """The title of a run's picture: a simulated run is known by its seed and wind, another one by its date."""
    parts = [figures["vehicle"], figures["controller"]]
    if figures["started"] is not None:
        parts.append(figures["started"])
    if figures["simulated"]:
        wind = figures["wind"]["configured"]
        parts.append(f"wind {wind['speed_mps']:g} m/s toward {wind['toward_deg']:g} deg, seed {figures['seed']}")
    # A stall is in the log as it was.
    if figures["damage"] is not None or figures["damaged_records"] or figures["time_jumps"]:
        parts.append("log not whole")
    return ", ".join(parts)


def print_summary(console: Any, figures: dict[str, Any]) -> None:
    from rich.table import Table

    from asvhil.daemon.status import counts_text, shares_text, sources_text
    from asvhil.logs.comparison import run_notes, unscored
    from asvhil.logs.summary import WAYS

    for line in (*run_notes(figures), *unscored(figures)):
        say(console, line)
    table = Table(title=f"from {figures['settled_from_s']:.0f} s on", title_justify="left")
    for heading in ("", "mean", "std", "max"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name in WAYS:
        part = figures[name]
        if part is None or part["penalty_score"] is None:
            continue
        distance, heading = part["distance_m"], part["heading_deg"]
        table.add_row(
            f"distance, {name} (m)",
            f"{distance['mean']:.3f}",
            f"{distance['std']:.3f}",
            f"{distance['max_settled']:.3f}",
        )
        table.add_row(f"heading error, {name} (deg)", f"{heading['mean']:.2f}", f"{heading['std']:.2f}", "")
        table.add_row(f"penalty score, {name}", f"{part['penalty_score']:.2f}", "", "")
    wind = figures["wind"]["estimated"]
    if wind is not None:
        guessed = figures["wind"]["origin"] == "disturbance"
        name = "from the disturbance" if guessed else "estimated"
        table.add_row(f"wind, {name} (m/s)", f"{wind['speed_mps']['mean']:.2f}", f"{wind['speed_mps']['std']:.2f}", "")
        if wind["toward_deg"]["mean"] is not None:
            around = wind["toward_deg"]
            table.add_row(f"wind toward, {name} (deg)", f"{around['mean']:.0f}", f"{around['std']:.0f}", "")
    console.print(table)
    if len(figures["holds"]) > 1 or figures["failsafes"] or _ended_early(figures):
        print_spans(console, figures)
    steps = figures["step_ms"]
    phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in figures["phases"].items())
    timing = f"step p50 {steps['p50']:.2f} ms, p99 {steps['p99']:.2f} ms, max {steps['max']:.1f} ms; " if steps else ""
    factor = figures["realtime_factor"]
    speed_text = f"; {factor:.{0 if factor > 2 else 2}f} times real time" if factor else ""
    say(console, f"{figures['ticks']} ticks, {figures['overruns']} overruns; {timing}{phases}{speed_text}")
    say(console, f"sources at the end: {sources_text(figures['sources'])}")
    if figures["energy_wh"] is not None:
        say(console, f"energy from the battery, {figures['energy_by']}: {figures['energy_wh']:.2f} Wh in all holds")
    shares = shares_text(figures["source_shares"])
    if shares:
        say(console, f"sources, of the time: {shares}")
    for port, causes in figures["dropped"].items():
        say(console, f"dropped, {port}: {counts_text(causes)}")
    for subject, text in figures["notes"].items():
        say(console, f"{subject}: {text}")


def _ended_early(figures: dict[str, Any]) -> bool:
    """Whether the last hold was ended by something else than the end of the run, which releases just before it."""
    from asvhil.supervisor.reasons import Reason

    ended = [hold for hold in figures["holds"] if hold["ended"] is not None]
    return bool(ended) and not any(
        release["code"] in (Reason.RELEASED, Reason.STOPPED) and figures["duration_s"] - release["at_s"] < END_S
        for release in figures["releases"]
        if release["at_s"] > ended[-1]["to_s"]
    )


def print_spans(console: Any, figures: dict[str, Any]) -> None:
    """A line for each hold, fail-safe and release, in the order of their times; a hold's tells what ended it."""
    from asvhil.logs.summary import WAYS
    from asvhil.types import Phase

    lines: list[tuple[float, str]] = []
    for hold in figures["holds"]:
        means = ((way, hold[way]["distance_m"]["mean"]) for way in WAYS if hold[way] is not None)
        where = next((f", {mean:.2f} m off ({way})" for way, mean in means if mean is not None), "")
        ended = "" if hold["ended"] is None else f", ended by {hold['ended']}"
        lines.append((hold["from_s"], f"hold {hold['number']} to {hold['to_s']:.1f} s{where}{ended}"))
    for failsafe in figures["failsafes"]:
        lines.append((failsafe["from_s"], f"failsafe to {failsafe['to_s']:.1f} s: {failsafe['reason']}"))
    for release in figures["releases"]:
        if release["after"] == Phase.HOLD:
            continue  # told with the hold
        lines.append((release["at_s"], f"released after {release['after']}: {release['reason']}"))
    for at_s, text in sorted(lines):
        say(console, f"{at_s:7.1f} s  {text}")


def say(console: Any, text: str, end: str = "\n") -> None:
    """Print plain text: no markup, no colours, no line wrapping."""
    console.print(text, markup=False, highlight=False, soft_wrap=True, end=end)


# --- files ---------------------------------------------------------------------------------------------------


def twin_hint(config: str) -> str:
    """Which config is the simulated twin of that of a boat, where `asvhil init` has put one beside it."""
    twin = Path(config).with_name(f"{Path(config).stem}-sim.yaml")
    return f"; the simulated twin of this boat is {twin}" if is_file(twin) else ""


def tell_borrowed_hull(config: Config, name: str, overrides: Sequence[str]) -> None:
    """One line on stderr where a config of one's own still has a shipped boat's hull."""
    from asvhil.config.borrowed import borrowed_from
    from asvhil.dynamics.hull import hull_text
    from asvhil.preflight.computer import OWN_HULL

    home = borrowed_from(name, overrides)
    if home:
        hull = hull_text(config.vehicle.vessel)
        typer.echo(f"asvhil: warning: {name}: the hull is that of the shipped {home} ({hull}); {OWN_HULL}", err=True)
