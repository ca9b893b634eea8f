"""The report of a run, or of two: one HTML file that needs nothing else, and its figures as PNGs."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, StrictUndefined

from asvhil.logs.comparison import Table, comparison_notes, comparison_rows, figure_text, run_notes, unscored
from asvhil.logs.report_figures import ReportFigure, compare_figure, report_figures
from asvhil.logs.run import RunLog
from asvhil.logs.summary import WAYS
from asvhil.types import Phase, record

TEMPLATE = Path(__file__).with_name("report.html.j2")
WINDOWS_MOST = 20  # docking windows in the table, the longest ones
EVENTS_MOST = 200


@record
class Reported:
    """A run to report: the name that it is called by, its title, its data, and its figures (`summary.summarise`)."""

    name: str
    title: str
    run: RunLog
    figures: Mapping[str, Any]


@record
class Report:
    """The text of the page, and the figures in it, each with the name of its file's ending."""

    html: str
    pictures: tuple[tuple[str, bytes], ...]


def report_page(
    first: Reported, second: Reported | None = None, *, on_figure: Callable[[str], None] = lambda name: None
) -> Report:
    """The page of one run, or of two with a comparison before them; `on_figure` is told what is drawn next."""
    pictures: list[tuple[str, bytes]] = []
    sections = []
    both = [first] if second is None else [first, second]
    for number, reported in enumerate(both, 1):
        drawn = report_figures(reported.run, on_figure)
        suffix = f"-{number}" if second is not None else ""
        pictures += [(f"{figure.name}{suffix}", figure.png) for figure in drawn]
        sections.append(_section(reported, drawn))
    comparison = None
    if second is not None:
        figure = compare_figure([(reported.name, reported.run) for reported in both])
        pictures.append((figure.name, figure.png))
        named = [(one.name, one.figures) for one in both]
        comparison = {
            "rows": comparison_rows(*named),
            "notes": comparison_notes(*named),
            "figure": _inline(figure),
        }
    page = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True).from_string(TEMPLATE.read_text())
    return Report(html=page.render(runs=sections, comparison=comparison), pictures=tuple(pictures))


def _section(reported: Reported, drawn: Sequence[ReportFigure]) -> dict[str, Any]:
    run, figures = reported.run, reported.figures
    minutes = f"{run.duration_s / 60.0:.1f} min" if run.duration_s >= 120.0 else f"{run.duration_s:.0f} s"
    kind = {"lockstep": "in virtual time", "live": "in real time"}.get(figures["mode"] or "", "")
    boat = "simulated boat" if figures["simulated"] else "boat"
    windows, left = _windows(figures)
    return {
        "name": reported.name,
        "title": reported.title,
        "subtitle": f"{reported.name}: {boat} {kind}, {minutes}, config {figures['config_hash']}",
        "settled": f"{figures['settled_from_s']:.0f} s",
        "notes": [*run_notes(figures), *unscored(figures)],
        "scores": _scores(figures),
        "work": _work(figures),
        "spans": [{}, *_spans(run)],
        "holds": _holds(figures),
        "windows": windows,
        "windows_left": left,
        "figures": [_inline(figure) for figure in drawn],
        "events": _events(run)[:EVENTS_MOST],
        "events_left": max(0, len(run.events) - EVENTS_MOST),
        "sources": _sources(run),
        "timing": _timing(figures),
        "machine": [
            ["", ""],
            *([name, text] for name, text in run.metadata.get("versions", {}).items()),
            *_model(run.metadata.get("model", {})),
        ],
        "counters": [["", ""], *([name, str(count)] for name, count in run.counters.items() if count)],
        "config": yaml.safe_dump(json.loads(run.config.canonical_json()), sort_keys=True, width=100),
    }


def _scores(figures: Mapping[str, Any]) -> Table:
    head = ["", "mean", "std", "max"]
    rows: Table = [head]
    for way in WAYS:
        part = figures[way]
        if part is None or part["penalty_score"] is None:
            continue
        distance, heading = part["distance_m"], part["heading_deg"]
        rows += [
            [f"distance, {way} (m)", *(figure_text(distance[key], 3) for key in ("mean", "std", "max_settled"))],
            [f"heading error, {way} (deg)", figure_text(heading["mean"], 2), figure_text(heading["std"], 2), ""],
            [
                f"the same, circular, {way} (deg)",
                figure_text(heading["circular_mean"], 2),
                figure_text(heading["circular_std"], 2),
                "",
            ],
            [f"penalty score, {way}", figure_text(part["penalty_score"], 2), "", ""],
            [f"VRX's score, {way}", figure_text(part["vrx_score"], 3), "", ""],
        ]
    wind = figures["wind"]["estimated"]
    if wind is not None:
        name = "from the disturbance" if figures["wind"]["origin"] == "disturbance" else "estimated"
        rows.append([f"wind, {name} (m/s)", *(figure_text(wind["speed_mps"][key], 2) for key in ("mean", "std")), ""])
        around = [figure_text(wind["toward_deg"][key], 0) for key in ("mean", "std")]
        rows.append([f"wind blows toward, {name} (deg)", *around, ""])
    return rows


def _work(figures: Mapping[str, Any]) -> Table:
    phases = ", ".join(f"{phase} {seconds:.1f} s" for phase, seconds in figures["phases"].items())
    return [
        ["", ""],
        ["energy (mean squared command)", figure_text(figures["energy"], 4)],
        *([] if figures["energy_by"] is None else [_energy(figures)]),
        ["reversals of a motor per minute", figure_text(figures["reversals_per_min"], 2)],
        ["change of a motor's command per second", figure_text(figures["change_per_s"], 3)],
        ["time in each phase", phases],
        *([] if figures["learned"] is None else [["learned of the model", figures["learned"]["text"]]]),
    ]


def _energy(figures: Mapping[str, Any]) -> list[str]:
    return [f"energy from the battery, {figures['energy_by']} (Wh)", figure_text(figures["energy_wh"], 2)]


def _spans(run: RunLog) -> list[dict[str, Any]]:
    found, number = [], 0
    for before, span in zip((None, *run.spans), run.spans, strict=False):
        number += span.phase is Phase.HOLD
        if before is None and span.phase is Phase.STANDBY:
            continue  # nothing has happened yet
        names = {
            Phase.HOLD: f"hold {number}",
            Phase.FAILSAFE: "fail-safe",
            Phase.STANDBY: "released",
            Phase.PREPARE: "on the way to a hold",
        }
        row = {
            "from_s": f"{span.from_s:.1f}",
            "to_s": f"{span.to_s:.1f}",
            "what": names[span.phase],
            "reason": span.reason,
            "ended": span.ended or "",
            "bad": span.phase is Phase.FAILSAFE,
        }
        found.append(row)
    return found


def _events(run: RunLog) -> list[dict[str, Any]]:
    """Notes as they came, changed and went; one that was no trouble has nothing to recover from."""
    found: list[dict[str, Any]] = []
    was_ok: dict[str, bool] = {}
    for event in run.events:
        ended = "over" if was_ok.get(event.subject, True) else "as it should be again"
        was_ok[event.subject] = event.ok
        text = event.text or ended
        found.append({"at_s": f"{event.t_s:.1f}", "subject": event.subject, "text": text, "ok": event.ok})
    return found


def _holds(figures: Mapping[str, Any]) -> Table:
    """The figures of each hold, of a run with several."""
    if len(figures["holds"]) < 2:
        return [[]]
    rows: Table = [
        ["hold", "length (s)", "way", "distance (m)", "heading error (deg)", "ps", "docking (s)", "energy", "Wh"]
    ]
    for hold in figures["holds"]:
        for way in WAYS:
            part = hold[way]
            if part is None or part["penalty_score"] is None:
                continue
            rows.append(
                [
                    str(hold["number"]),
                    f"{hold['to_s'] - hold['from_s']:.1f}",
                    way,
                    figure_text(part["distance_m"]["mean"], 2),
                    figure_text(part["heading_deg"]["mean"], 2),
                    figure_text(part["penalty_score"], 2),
                    figure_text(hold["docking"][way]["longest_s"], 0),
                    figure_text(hold["energy"], 4),
                    figure_text(hold["energy_wh"], 2),
                ]
            )
    return rows


def _windows(figures: Mapping[str, Any]) -> tuple[Table, int]:
    """The longest docking windows in the order of their times, and how many more there are."""
    rows: Table = [["way", "from (s)", "to (s)", "length (s)", "distance (m)", "heading error (deg)"]]
    left = 0
    for way in WAYS:
        docking = figures["docking"][way]
        windows = [] if docking is None else docking["windows"]
        longest = sorted(windows, key=lambda window: -window["length_s"])[:WINDOWS_MOST]
        left += len(windows) - len(longest)
        for window in sorted(longest, key=lambda window: window["from_s"]):
            lengths = (f"{window[key]:.1f}" for key in ("from_s", "to_s", "length_s"))
            off = figure_text(window["distance_m"]["mean"], 2), figure_text(window["heading_deg"]["abs_mean"], 2)
            rows.append([way, *lengths, *off])
    return rows, left


def _sources(run: RunLog) -> Table:
    rows: Table = [["quantity", "source at the end", "of the time"]]
    for quantity, source in run.sources.items():
        shares = run.source_shares.get(quantity, {})
        text = ", ".join(f"{name or 'none'} {100.0 * share:.1f} %" for name, share in shares.items())
        rows.append([quantity, source or "none", text])
    for port, causes in run.dropped.items():
        rows.append([f"dropped, {port}", "", ", ".join(f"{count} {cause}" for cause, count in causes.items())])
    return rows


def _timing(figures: Mapping[str, Any]) -> str:
    steps = figures["step_ms"]
    text = f"{figures['ticks']} ticks, {figures['overruns']} overruns"
    if steps is None:
        return text
    return f"{text}; step p50 {steps['p50']:.2f} ms, p99 {steps['p99']:.2f} ms, max {steps['max']:.1f} ms"


def _model(model: Mapping[str, str]) -> Table:
    return [["model file", model["file"]], ["its SHA-256", model["sha256"]]] if "file" in model else []


def _inline(figure: ReportFigure) -> dict[str, str]:
    return {
        "name": figure.name,
        "caption": figure.caption,
        "base64": base64.b64encode(figure.png).decode(),
    }
