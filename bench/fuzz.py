"""Coverage-guided fuzzing of every codec: `python -m bench.fuzz --bytes 10000000 --json FILE` (needs `atheris`).

Each target of `fuzz_targets` runs in a process of its own, instrumented by atheris (libFuzzer), until it has been
given so many bytes; an exception, or an input that takes longer than 20 s, ends it with the input in --crashes.
Afterwards the inputs that it found worth keeping go through the target again, without instrumentation, several times
over: the memory must stay flat. Seeded: the same seed and version give the same inputs.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from bench.ending import end_in_words

SLOWEST_S = 20
PASSES = 6


def fuzz(name: str, budget: int, seed: int, corpus: Path, crashes: Path) -> None:
    """The process of one target: ends it."""
    import atheris

    with atheris.instrument_imports(include=["asvhil"]):
        from bench.fuzz_targets import TARGETS
    run, seeds = TARGETS[name]()
    for number, data in enumerate(seeds):
        (corpus / f"seed{number}").write_bytes(data)
    given, executions, start_s = 0, 0, time.monotonic()

    def once(data: bytes) -> None:
        nonlocal given, executions
        run(data)
        given += len(data)
        executions += 1
        if given >= budget:
            figures = {"bytes": given, "executions": executions, "seconds": round(time.monotonic() - start_s, 1)}
            (corpus.parent / "figures.json").write_text(json.dumps(figures))
            os._exit(0)  # libFuzzer knows no budget of bytes

    options = [f"-seed={seed}", f"-timeout={SLOWEST_S}", f"-artifact_prefix={crashes}/{name}-", "-rss_limit_mb=4096"]
    atheris.Setup([sys.argv[0], *options, "-max_len=4096", "-len_control=20", str(corpus)], once)
    atheris.Fuzz()


def memory(name: str, corpus: Path) -> None:
    """The process that runs the inputs again: prints resident memory (kB) after the first passes and at the end."""
    from bench.fuzz_targets import TARGETS

    run, _ = TARGETS[name]()
    inputs = [path.read_bytes() for path in sorted(corpus.iterdir())][:400]
    resident = []
    for _ in range(PASSES):
        for data in inputs:
            run(data)
        status = Path("/proc/self/status").read_text()
        resident.append(int(status.split("VmRSS:")[1].split()[0]))
    print(json.dumps({"inputs": len(inputs), "resident_kb": [resident[1], resident[-1]]}))


def one(name: str, budget: int, seed: int, crashes: Path) -> dict[str, Any]:
    """A target, fuzzed and run again: its figures; `crash` is the last line of its error."""
    folder = Path(tempfile.mkdtemp())
    corpus = folder / "corpus"
    corpus.mkdir()
    module = [sys.executable, "-m", "bench.fuzz", "--corpus", str(corpus), "--crashes", str(crashes)]
    try:
        command = [*module, "--fuzz", name, "--bytes", str(budget), "--seed", str(seed)]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        if done.returncode != 0:
            lines = [
                line for line in done.stderr.splitlines() if "Error" in line or "ERROR" in line or "timeout" in line
            ]
            return {"target": name, "crash": (lines or done.stderr.splitlines()[-1:] or ["?"])[0]}
        figures: dict[str, Any] = json.loads((folder / "figures.json").read_text())
        again = subprocess.run([*module, "--memory", name], capture_output=True, text=True, check=True)
        return {"target": name, "crash": None, **figures, **json.loads(again.stdout.splitlines()[-1])}
    finally:
        shutil.rmtree(folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--target", action="append", help="default: all")
    parser.add_argument("--bytes", type=int, default=10_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--crashes", type=Path, default=Path("crashes"))
    parser.add_argument("--json", type=Path)
    for hidden in ("--fuzz", "--memory", "--corpus"):
        parser.add_argument(hidden, help=argparse.SUPPRESS)
    args = parser.parse_args()
    args.crashes.mkdir(parents=True, exist_ok=True)
    if args.fuzz:
        fuzz(args.fuzz, args.bytes, args.seed, Path(args.corpus), args.crashes)
    if args.memory:
        memory(args.memory, Path(args.corpus))
        return
    from bench.fuzz_targets import TARGETS  # not before `fuzz`, which instruments what it imports

    unknown = set(args.target or ()) - TARGETS.keys()
    if unknown:
        parser.error(f"--target {min(unknown)}: one of {', '.join(sorted(TARGETS))} is expected")
    rows = []
    for name in args.target or TARGETS:
        row = one(name, args.bytes, args.seed, args.crashes)
        rows.append(row)
        told = row["crash"] or (
            f"{row['bytes'] / 1e6:.1f} MB, {row['executions']} runs, {row['seconds']} s; "
            f"resident {row['resident_kb'][0]} to {row['resident_kb'][1]} kB over {row['inputs']} inputs"
        )
        print(f"{name}: {told}", flush=True)
    if args.json is not None:
        args.json.write_text(json.dumps({"bytes": args.bytes, "seed": args.seed, "targets": rows}, indent=2) + "\n")
    sys.exit(any(row["crash"] for row in rows))


if __name__ == "__main__":
    end_in_words(main)
