"""How soon an autopilot that is set wrong is found, and if it is named right: `python -m bench.motor_faults`.

In lockstep, with gusts and sensor noise: every mistake, with all messages, without PARAM_VALUE, and without RC_CHANNELS
as well; then boats that are set right, of which none may be let go.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track
from rich.table import Table

from asvhil.supervisor.reasons import Reason
from bench.ending import end_in_words
from tests.support.motor_faults import BLIND_REASON, WRONG, Trial

LOST = {"parameters read": (), "no PARAM_VALUE": ("PARAM_VALUE",), "nor RC_CHANNELS": ("PARAM_VALUE", "RC_CHANNELS")}
WINDS = ((3.0, 0.0), (6.0, 90.0), (1.0, 45.0))  # m/s, toward degrees
RIGHT_S = 60.0


def trial(parameters: dict[str, float], lost: tuple[str, ...], seed: int, wind: tuple[float, float]) -> Trial:
    weather = (f"plant.weather.wind.speed_mps={wind[0]}", f"plant.weather.wind.toward_deg={wind[1]}")
    return Trial(parameters, f"plant.seed={seed}", *weather, lost=lost)


def measure(name: str, lost: str, seeds: int) -> dict[str, Any]:
    """The slowest of all seeds and winds, and how many were named right."""
    parameters, reason = WRONG[name]
    if lost == "nor RC_CHANNELS" and reason is Reason.OVERRIDES_IGNORED:
        reason = BLIND_REASON
    seconds: list[float | None] = []
    named, said = 0, ""
    for seed in range(1, seeds + 1):
        for wind in WINDS:
            run = trial(parameters, LOST[lost], seed, wind)
            found_s, outputs = run.hold()
            said = run.texts[-1] if found_s == 0.0 else outputs.health.reason
            named_parameter = any(part in said for part in (*parameters, "RC1_MIN"))
            right = named_parameter if found_s == 0.0 else outputs.health.code == reason
            named += right and found_s is not None
            seconds.append(found_s)
    found = [s for s in seconds if s is not None]
    return {
        "case": name,
        "messages": lost,
        "runs": len(seconds),
        "found": len(found),
        "named": named,
        "slowest_s": max(found, default=None),
        "said": said,
    }


def held(lost: str, seeds: int) -> dict[str, Any]:
    """Boats that are set right: how many are still held at the end."""
    runs = [
        trial({}, LOST[lost], seed, wind).hold(limit_s=RIGHT_S)[0] is None
        for seed in range(1, seeds + 1)
        for wind in WINDS
    ]
    return {"messages": lost, "runs": len(runs), "held": sum(runs), "seconds": RIGHT_S}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=3)
    options.add_argument("--json", type=Path, metavar="FILE")
    given = options.parse_args()
    console = Console()
    cases = [(name, lost) for name in WRONG for lost in LOST]
    rows = [measure(*case, given.seeds) for case in track(cases, "mistakes", console=console, transient=True)]
    right = [held(lost, given.seeds) for lost in track(list(LOST), "set right", console=console, transient=True)]
    table = Table("case", "messages", "runs", "let go", "named right", "slowest (s)", "said")
    for row in rows:
        slowest = "-" if row["slowest_s"] is None else f"{row['slowest_s']:.2f}"
        table.add_row(
            row["case"], row["messages"], *(str(row[key]) for key in ("runs", "found", "named")), slowest, row["said"]
        )
    console.print(table)
    for row in right:
        console.print(f"set right, {row['messages']}: {row['held']} of {row['runs']} held for {row['seconds']:.0f} s")
    if given.json is not None:
        given.json.write_text(json.dumps({"mistakes": rows, "right": right}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    end_in_words(main)
