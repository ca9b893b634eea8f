"""What the operator's page costs the daemon: `python -m bench.pages [--fifo] [-o docs/results]`.

In virtual time, the CPU time of each tick with and without the page's questions. In real time, ticks of a daemon that
holds the simulated boat while 20 pages are told how it is, and in turn while the page's server stands still. It takes
some seven minutes; other work on the machine disturbs the second part, less where the daemon has real-time priority
(`--fifo`).
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

import aiohttp

from asvhil.backseat.backseat import Backseat
from asvhil.config import load_config
from asvhil.dashboard.daemon_client import ARRAYS, PERIOD_S, RARELY_ASKED, SELDOM
from asvhil.logs.reader import LogFile
from asvhil.operator.encoding import encode_question
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Inputs, Outputs
from bench.ending import end_in_words
from tests.support.page_bench import dashboard
from tests.support.processes import bench

MARKER = "<!-- below: written by python -m bench.pages -->"
PAGES = 20
SPAN_S = 120.0
ROUNDS, BLOCK_S, SETTLE_S = 6, 20.0, 1.5


class TimedBackseat:
    """A backseat that keeps the CPU time (ms) of its steps."""

    def __init__(self, backseat: Backseat) -> None:
        self._backseat = backseat
        self.step_ms: list[float] = []

    def step(self, inputs: Inputs) -> Outputs:
        start_ns = time.thread_time_ns()
        outputs = self._backseat.step(inputs)
        self.step_ms.append((time.thread_time_ns() - start_ns) * 1e-6)
        return outputs


def cpu_of_ticks(*, asked: bool) -> list[float]:
    """CPU time (ms) of the ticks of a run in virtual time, with or without the page's questions."""
    loop = Lockstep(load_config("sitl"))
    timed = TimedBackseat(loop.backseat)
    loop.backseat = timed  # type: ignore[assignment]
    link, every = loop.config.links.autopilot, round(PERIOD_S * loop.config.daemon.tick_hz)
    for tick in range(round(SPAN_S * loop.config.daemon.tick_hz)):
        if asked and tick % every == 0:
            for msg_id in (ARRAYS, *(RARELY_ASKED if tick % (SELDOM * every) == 0 else ())):
                loop.inject("operator", encode_question(link, msg_id), "127.0.0.1:9")
        loop.tick()
    return timed.step_ms[200:]  # without the start


async def open_pages(address: str) -> None:
    """As many pages as are asked for, each of which takes all that it is told, until this process is ended."""

    async def one(session: aiohttp.ClientSession) -> None:
        while True:
            try:
                async with session.ws_connect(f"{address}live") as page:
                    async for message in page:
                        json.loads(message.data)
            except aiohttp.ClientError:
                await asyncio.sleep(0.2)

    async with aiohttp.ClientSession() as session:
        await asyncio.gather(*(one(session) for _ in range(PAGES)))


def ticks_in_turn(folder: Path, *, fifo: bool) -> dict[str, list[float]]:
    """Times (ms) of the daemon's ticks in real time, without and with the pages; `fifo`: with real-time priority."""
    spans: list[tuple[str, float, float]] = []
    with bench(folder) as at, at.plant(), at.daemon() as daemon, dashboard(*at.sets) as address:
        daemon.wait_for(lambda s: s["phase"] == "hold", 60.0)
        if fifo:
            for task in Path(f"/proc/{daemon.child.pid}/task").iterdir():
                os.sched_setscheduler(int(task.name), os.SCHED_FIFO, os.sched_param(10))
        server = children_named("dashboard")
        words = [sys.executable, "-m", "bench.pages", "--pages", address.partition("#")[0]]
        with subprocess.Popen(words) as pages:
            time.sleep(20.0)
            for number in range(2 * ROUNDS):
                without = number % 2 == 0
                for pid in (server, pages.pid):
                    os.kill(pid, signal.SIGSTOP if without else signal.SIGCONT)
                time.sleep(SETTLE_S)
                start_s = time.time()
                time.sleep(BLOCK_S)
                spans.append(("without" if without else "with", start_s, time.time()))
                print(f"round {number // 2 + 1} of {ROUNDS}: {spans[-1][0]} pages", file=sys.stderr)
            pages.kill()
        daemon.end()
    found: dict[str, list[float]] = {"without": [], "with": []}
    for timing in LogFile(at.log).timing():
        for name, start_s, end_s in spans:
            if start_s <= timing.t_ns * 1e-9 <= end_s:
                found[name].append(timing.step_ns * 1e-6)
    return found


def children_named(word: str) -> int:
    """The child process of ours that has a word among those of its command line."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            parent = (path.parent / "stat").read_text().rpartition(")")[2].split()[1]
            if int(parent) == os.getpid() and word in path.read_bytes().decode().split("\0"):
                return int(path.parent.name)
        except OSError:
            continue
    raise SystemExit(f"no child process runs {word}")


def figures_of(ticks_ms: list[float]) -> dict[str, float]:
    ordered = sorted(ticks_ms)
    return {"ticks": len(ordered), "median_ms": median(ordered), "p99_ms": ordered[int(0.99 * len(ordered))]}


def page_of(figures: dict[str, Any]) -> str:
    """The table."""
    lines = ["| what | ticks | median (ms) | p99 (ms) | p99 with the pages, against without |", f"|{' --- |' * 5}"]
    for title, key in (
        ("CPU time, virtual time", "virtual"),
        (f"wall clock{', SCHED_FIFO' * figures['fifo']}, {PAGES} pages", "real"),
    ):
        for name in ("without", "with"):
            of = figures[key][name]
            share = f"{100.0 * figures[key]['p99_share']:+.1f} %" if name == "with" else ""
            row = (f"{title}: {name}", of["ticks"], f"{of['median_ms']:.2f}", f"{of['p99_ms']:.2f}", share)
            lines.append(f"| {' | '.join(map(str, row))} |")
    lines += ["", f"Load average of the machine (2 cores) meanwhile: {figures['load']:.1f}."]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="the folder with dashboard.md and dashboard.json")
    parser.add_argument("--fifo", action="store_true", help="the daemon with real-time priority, as root")
    parser.add_argument("--pages", metavar="URL", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.pages:
        asyncio.run(open_pages(arguments.pages))
        return
    virtual: dict[str, list[float]] = {"without": [], "with": []}
    for _ in range(3):  # in turn, since the machine's speed drifts
        virtual["without"] += cpu_of_ticks(asked=False)
        virtual["with"] += cpu_of_ticks(asked=True)
    with tempfile.TemporaryDirectory() as name:
        real = ticks_in_turn(Path(name), fifo=arguments.fifo)
    figures: dict[str, Any] = {"load": os.getloadavg()[1], "fifo": arguments.fifo}
    for key, ticks in (("virtual", virtual), ("real", real)):
        figures[key] = {name: figures_of(of) for name, of in ticks.items()}
        figures[key]["p99_share"] = figures[key]["with"]["p99_ms"] / figures[key]["without"]["p99_ms"] - 1.0
    print(page_of(figures))
    if arguments.output:
        page = arguments.output / "dashboard.md"
        above = page.read_text().partition(MARKER)[0] if page.exists() else ""
        page.write_text(f"{above}{MARKER}\n\n{page_of(figures)}\n")
        (arguments.output / "dashboard.json").write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    end_in_words(main)
