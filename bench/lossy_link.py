"""What a lossy link to an autopilot that is set right is taken for: `python -m bench.lossy_link`.

In virtual time: 60 preflights and 60 starts with a first hold for each share of frames that is lost each way.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import track

from asvhil.study.trials.interrupts import interrupts_held_back
from bench.ending import end_in_words
from tests.support.lossy_link import CheckStart, HoldStart, check_start, hold_start

LOSSES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4)


def checked(loss: float, starts: Sequence[CheckStart]) -> dict[str, Any]:
    """The figures of one loss."""
    return {
        "loss": loss,
        "starts": len(starts),
        "with_false_findings": sum(bool(start.false) for start in starts),
        "would_write": sum(bool(start.fixable) for start in starts),
        "with_unverified": sum(bool(start.unverified) for start in starts),
        "median_s": statistics.median(start.seconds for start in starts),
        "longest_s": max(start.seconds for start in starts),
        "false": dict(Counter(item for start in starts for item in start.false)),
    }


def held(loss: float, starts: Sequence[HoldStart]) -> dict[str, Any]:
    """The figures of one loss."""
    granted = [start.granted_s for start in starts if start.granted_s is not None]
    return {
        "loss": loss,
        "starts": len(starts),
        "for_a_parameter": sum(start.for_a_parameter for start in starts),
        "granted": len(granted),
        "granted_at_once": sum(not start.refused for start in starts),
        "slowest_grant_s": max(granted, default=None),
        "held_to_the_end": sum(not start.ended and start.granted_s is not None for start in starts),
        "median_held_s": statistics.median(start.held_s for start in starts),
        "least_held_s": min(start.held_s for start in starts),
        "fail_safes": sum(start.fail_safes for start in starts),
        "neutral_share": sum(s.neutral_s for s in starts) / max(sum(s.held_s for s in starts), 1e-9),
        "ended": dict(Counter(start.ended for start in starts if start.ended)),
        "refused": dict(Counter(reason for start in starts for reason in start.refused)),
    }


def rows(checks: list[dict[str, Any]], holds: list[dict[str, Any]]) -> list[str]:
    """Both tables in Markdown."""

    def reasons(counts: dict[str, int]) -> str:
        return ", ".join(f"{count} {name}" for name, count in counts.items()) or "none"

    lines = [
        "| lost each way | false findings | would write | something unverified | median (s) | longest (s) |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in checks:
        of = row["starts"]
        lines.append(
            f"| {row['loss']:.0%} | {row['with_false_findings']} of {of} | {row['would_write']} of {of} "
            f"| {row['with_unverified']} of {of} | {row['median_s']:.1f} | {row['longest_s']:.1f} |"
        )
    lines += [
        "",
        "| lost each way | refused or ended for a parameter | granted at once | slowest grant (s) | held to the end "
        "| least held (s) | fail-safes | of the time neutral | ended by | refused as |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in holds:
        of, slowest = row["starts"], row["slowest_grant_s"]
        lines.append(
            f"| {row['loss']:.0%} | {row['for_a_parameter']} of {of} | {row['granted_at_once']} of {of} "
            f"| {'-' if slowest is None else f'{slowest:.1f}'} | {row['held_to_the_end']} of {row['granted']} "
            f"| {row['least_held_s']:.1f} | {row['fail_safes']} | {row['neutral_share']:.2%} "
            f"| {reasons(row['ended'])} | {reasons(row['refused'])} |"
        )
    return lines


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--starts", type=int, default=60)
    options.add_argument("--hold", type=float, default=60.0, metavar="SECONDS")
    options.add_argument("--config", default="sitl", help="sitl or sitl-px4")
    options.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of the config; repeatable")
    options.add_argument("--jobs", type=int, default=1)
    options.add_argument("--json", type=Path, metavar="FILE")
    given = options.parse_args()
    console = Console()
    seeds = range(1, given.starts + 1)
    checks, holds = [], []
    check = partial(check_start, config=given.config)
    hold = partial(hold_start, hold_s=given.hold, config=given.config, overrides=tuple(given.set))
    pool = ProcessPoolExecutor(given.jobs)
    try:
        with interrupts_held_back():
            pool.submit(int)  # starts the processes
        for loss in track(LOSSES, "lossy links", console=console, transient=True):
            checks.append(checked(loss, list(pool.map(check, [loss] * len(seeds), seeds))))
            starts = list(pool.map(hold, [loss] * len(seeds), seeds))
            holds.append(held(loss, starts))
    finally:
        pool.shutdown(cancel_futures=True)
    print("\n".join(rows(checks, holds)))
    if given.json is not None:
        figures = {"config": given.config, "set": given.set, "checks": checks, "holds": holds}
        given.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    end_in_words(main)
