"""Study of endurance: hours of station keeping with a fault every five minutes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from asvhil.study.trials.soak import EVERY_S, LOST_S

GROWTH, DRIFT = 0.05, 0.10  # of resident memory, and of the time of a tick, from the second hour to the last


def judge(run: Mapping[str, Any]) -> dict[str, Any]:
    """The verdicts of a soak: faults after which no hold came back, growth of memory, drift of the time of a tick.

    Growth and drift compare the last hour with the second, None in a soak of less than three. The time of a tick counts
    in that of a boat that is new in the hour.
    """
    hours = run["hourly"]
    lost = [fault for fault in run["faults"] if fault["back_s"] is None]
    known = len(hours) >= 3
    growth = hours[-1]["resident_kb"] / hours[1]["resident_kb"] - 1.0 if known else None
    drift = _of_young(hours[-1]) / _of_young(hours[1]) - 1.0 if known else None
    met = not lost and (growth is None or growth < GROWTH) and (drift is None or abs(drift) < DRIFT)
    return {"lost": lost, "memory_growth": growth, "tick_drift": drift, "met": met}


def _of_young(hour: Mapping[str, float]) -> float:
    return hour["tick_ms"] / hour["young_ms"]


def markdown(study: Mapping[str, Any]) -> str:
    """The verdicts, a table of the kinds of fault, and one of the hours."""
    run, verdict = study["run"], study["verdict"]
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for fault in run["faults"]:
        kinds.setdefault(fault["kind"], []).append(fault)
    growth, drift = verdict["memory_growth"], verdict["tick_drift"]
    lines = [
        f"{run['hours']:g} hours of boat time in lockstep, seed {run['seed']}; {len(run['faults'])} faults, one in "
        f"each {EVERY_S:g} s, and every {EVERY_S:g} s another wind of up to 6 m/s. An operator asks for the hold again "
        f"where it has ended. Lost for good is a hold that is not there {LOST_S:g} s after the end of its fault.",
        "",
        f"Lost for good: {len(verdict['lost'])}. Held for {100.0 * run['held_share']:.2f} % of the time.",
        *(
            []
            if growth is None
            else [
                f"Memory grew by {100.0 * growth:.2f} %, a tick's time by {100.0 * drift:.1f} % of that of a new boat "
                "in the same hour."
            ]
        ),
        "",
        "| fault | times | ended the hold | by | back after its end, median and longest (s) |",
        "| --- | --- | --- | --- | --- |",
    ]
    for kind, faults in sorted(kinds.items()):
        ended = [fault["ended_by"] for fault in faults if fault["ended_by"]]
        back = sorted(fault["back_s"] for fault in faults if fault["back_s"] is not None)
        told = ", ".join(sorted(set(ended))) or "-"
        times = f"{back[len(back) // 2]:.1f}, {back[-1]:.1f}" if back else "never"
        lines.append(f"| {kind} | {len(faults)} | {len(ended)} | {told} | {times} |")
    lines += [
        "",
        "| hour | resident (MB) | tick, median (ms) | of a new boat (ms) | off the station, median and most (m) |",
    ]
    lines += ["| --- | --- | --- | --- | --- |"]
    for number, hour in enumerate(run["hourly"], start=1):
        memory_mb = hour["resident_kb"] / 1024.0
        off = f"{hour['off_m_median']:.2f}, {hour['off_m_most']:.1f}"
        lines.append(f"| {number} | {memory_mb:.1f} | {hour['tick_ms']:.3f} | {hour['young_ms']:.3f} | {off} |")
    return "\n".join(lines) + "\n"
