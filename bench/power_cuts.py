"""Power cuts while a station is kept, and what is left of the log: `python -m bench.power_cuts --json FILE`.

Each cut: `asvhil sitl` runs in real time, and at a random moment its whole process tree gets SIGKILL. Then the log is
made what a disk may have of it: all that an fsync had returned for, and of the rest nothing, a part, zeros, or noise of
the size it had. `asvhil log recover` makes a log of it, which is read by this project and, where they are given, by
`rerun mcap check` and by @mcap/core (CRCs checked). Lost is the time from the last recovered tick to the kill.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rich.progress import track

from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from bench.ending import end_in_words

ASKED_S = 0.5
TAILS = ("nothing", "a part", "zeros", "noise")
# What an fsync had returned for, told by the process that called it: the size before the call.
SHIM = """
import os
_fsync, _told = os.fsync, os.open(os.environ["SYNCED"], os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
def fsync(fd):
    size = os.fstat(fd).st_size
    _fsync(fd)
    os.write(_told, f"{os.fstat(fd).st_ino} {size}\\n".encode())
os.fsync = fsync
"""
READER = """
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers } from "@mcap/support";
import { readFile } from "node:fs/promises";
const data = await readFile(process.argv[2]);
const readable = {
  size: async () => BigInt(data.length),
  read: async (at, size) => new Uint8Array(data.buffer, data.byteOffset + Number(at), Number(size)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
let count = 0;
for await (const message of reader.readMessages({ validateCrcs: true })) count += 1;
console.log(count);
"""


def processes_of(session: int) -> list[int]:
    """The processes of a session."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session:
            found.append(int(stat.parent.name))
    return found


def cut_power(folder: Path, after_s: float, seed: int) -> tuple[Path, int]:
    """The log of a run that was killed `after_s` after its first ticks were synced, and the time of the kill (ns)."""
    (folder / "shim").mkdir()
    (folder / "shim" / "sitecustomize.py").write_text(SHIM)
    paths = [str(folder / "shim"), *filter(None, [os.environ.get("PYTHONPATH")])]
    env = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "SYNCED": str(folder / "synced")}
    command = [sys.executable, "-m", "asvhil", "sitl", "--duration", "300", "--seed", str(seed)]
    command += ["--set", f"recorder.directory={folder / 'runs'}"]
    boat = subprocess.Popen(
        command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        end_s = time.monotonic() + 60.0
        while not (logs := list(folder.glob("runs/*/log.mcap"))) or len(synced_sizes(logs[0], folder / "synced")) < 2:
            if time.monotonic() > end_s or boat.poll() is not None:
                raise SystemExit("the run made no log")
            time.sleep(0.05)
        time.sleep(after_s)
    finally:
        tree = processes_of(boat.pid)
        killed_ns = time.time_ns()
        for pid in tree:
            os.kill(pid, signal.SIGKILL)
        boat.wait()
    return logs[0], killed_ns


def synced_sizes(log: Path, synced: Path) -> list[int]:
    """The sizes of a log for which an fsync has returned, the metadata's first."""
    inode = log.stat().st_ino
    told = synced.read_text().splitlines() if synced.exists() else []
    return [int(size) for name, size in map(str.split, told) if int(name) == inode]


def tear(log: Path, synced: Path, tail: str, noise: random.Random) -> int:
    """Leave of a log what the disk may have of it: how many bytes had been synced."""
    kept, data = max(synced_sizes(log, synced)), log.read_bytes()
    rest = len(data) - kept
    more = {
        "nothing": b"",
        "a part": data[kept : kept + noise.randint(0, rest)],
        "zeros": bytes(rest),
        "noise": noise.randbytes(rest),
    }
    log.write_bytes(data[:kept] + more[tail])
    return kept


def read_by_others(log: Path, rerun: str | None, node: Path | None) -> dict[str, str]:
    """What other readers say: "ok", or their last line."""
    said = {}
    if rerun is not None:
        done = subprocess.run([rerun, "mcap", "check", str(log)], capture_output=True, text=True, check=False)
        rows = [line.split()[0] for line in done.stdout.splitlines() if "/asvhil/" in line or "/frames/" in line]
        good = done.returncode == 0 and rows and set(rows) == {"ok"}
        said["rerun"] = "ok" if good else (done.stdout + done.stderr).strip().splitlines()[-1]
    if node is not None:
        script = node / "read.mjs"
        script.write_text(READER)
        done = subprocess.run(["node", str(script), str(log)], capture_output=True, text=True, check=False)
        counted = sum(1 for _ in LogFile(log).pieces()) > 0 and done.returncode == 0
        said["@mcap/core"] = "ok" if counted else (done.stderr.strip().splitlines() or ["?"])[-1]
    return said


def one(seed: int, rerun: str | None, node: Path | None) -> dict[str, Any]:
    """One cut and what came of it."""
    noise = random.Random(seed)
    tail = TAILS[seed % len(TAILS)]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        log, killed_ns = cut_power(folder, noise.uniform(1.0, 12.0), seed)
        tear(log, folder / "synced", tail, noise)
        target = folder / "recovered.mcap"
        command = [sys.executable, "-m", "asvhil", "log", "recover", str(log), "-o", str(target)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not target.exists():
            return {"seed": seed, "tail": tail, "status": done.returncode, "said": done.stderr.strip(), "lost_s": None}
        last_ns = max(inputs.t_ns for inputs, _ in LogFile(target).ticks())
        result = replay(target)
        return {
            "seed": seed,
            "tail": tail,
            "status": done.returncode,
            "lost_s": (killed_ns - last_ns) * 1e-9,
            "ticks": result.ticks,
            "exact": result.mismatch is None and result.compared >= result.ticks - 1,
            "readers": read_by_others(target, rerun, node),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cuts", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rerun", metavar="COMMAND", help="the `rerun` of rerun-sdk")
    parser.add_argument("--node", type=Path, metavar="FOLDER", help="a folder with @mcap/core and @mcap/support")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    cuts = [one(args.seed + k, args.rerun, args.node) for k in track(range(args.cuts), description="power cuts")]
    lost = sorted(cut["lost_s"] for cut in cuts if cut["lost_s"] is not None)
    readers = {name: sum(cut.get("readers", {}).get(name) == "ok" for cut in cuts) for name in ("rerun", "@mcap/core")}
    figures = {
        "cuts": len(cuts),
        "recovered": len(lost),
        "within_asked": sum(seconds <= ASKED_S for seconds in lost),
        "lost_s": {"median": lost[len(lost) // 2], "max": lost[-1]} if lost else None,
        "replayed_exactly": sum(cut.get("exact", False) for cut in cuts),
        "accepted_by": readers,
        "each": cuts,
    }
    if args.json is not None:
        args.json.write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps({name: part for name, part in figures.items() if name != "each"}, indent=2))


if __name__ == "__main__":
    end_in_words(main)
