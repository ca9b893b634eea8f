"""Random edits of the shipped configs: `python -m bench.yaml_edits --edits 100000 --json FILE`.

Each edit changes the text of a config as people do by mistake, a few times over: a value of another kind or far out of
range, a key misspelt, doubled or moved to another depth, a line gone, an odd character, a piece of another config. It
must load, or be refused in one line that names the file; nothing else, within 10 s, and with flat memory.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import re
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from asvhil.config import load_config
from asvhil.errors import AsvhilError
from asvhil.study.trials.interrupts import interrupts_held_back
from bench.ending import end_in_words

SHIPPED = sorted((Path(__file__).parents[1] / "config").glob("*.yaml"))
SLOWEST_S = 10
ODD_VALUES = (
    *(
        "0",
        "-1",
        "1e308",
        ".nan",
        ".inf",
        "-.inf",
        "1:30",
        "010",
        "0x10",
        "1_000",
        "true",
        "null",
        "~",
        "''",
        "[]",
        "{}",
    ),
    *(
        "[1, 2]",
        "{a: 1}",
        "text",
        "'1.5'",
        "2026-11-27",
        "!!python/object:os.system x",
        "&a [*a]",
        "*b",
        "99999999999999999999",
    ),
    *(
        "udpin:127.0.0.1:14550",
        "serial:/dev/null:9600",
        "[[1, 2], [3]]",
        "\u00b5",
        "1,5",
        "-0.0",
        "1e-320",
        "yes",
        "off",
    ),
)
ODD_CHARACTERS = "\t\x00\x07\u2028\ufeff:#-[]{}&*!|>'\"%@`,?\u00e9"


def edited(text: str, others: list[str], rng: random.Random) -> str:
    """A text with one to four mistakes."""
    for _ in range(rng.randint(1, 4)):
        lines = text.split("\n")
        at = rng.randrange(len(lines))
        line = lines[at]
        match rng.randrange(10):
            case 0 | 1 | 2:  # another value
                lines[at] = re.sub(r":\s.*|:$", lambda _: f": {rng.choice(ODD_VALUES)}", line, count=1)
            case 3:  # a number far away
                lines[at] = re.sub(
                    r"-?\d+\.?\d*", lambda m: str(float(m[0]) * rng.choice((-1.0, 0.0, 1e3, 1e-9))), line
                )
            case 4:  # a letter of a key
                place = rng.randrange(len(line) + 1)
                lines[at] = line[:place] + rng.choice("abcxyz_ ") + line[place + 1 :]
            case 5:
                lines.insert(at, line)
            case 6:
                del lines[at]
            case 7:
                lines[at] = " " * rng.randrange(6) + line.lstrip()
            case 8:
                place = rng.randrange(len(line) + 1)
                lines[at] = line[:place] + rng.choice(ODD_CHARACTERS) + line[place:]
            case 9:
                other = rng.choice(others).split("\n")
                start = rng.randrange(len(other))
                lines[at:at] = other[start : start + rng.randint(1, 12)]
        text = "\n".join(lines)
    return text


def edit_and_load(job: tuple[int, int]) -> tuple[Counter[str], list[str], tuple[int, int]]:
    """(outcomes, faults, resident kB at a fifth and at the end) of a share of the edits, from a seed."""
    seed, count = job
    rng = random.Random(seed)
    texts = [path.read_text(encoding="utf-8") for path in SHIPPED]
    folder = Path(tempfile.mkdtemp())
    for path, text in zip(SHIPPED, texts, strict=True):
        (folder / path.name).write_text(text, encoding="utf-8")  # bases are found beside a config
    target = folder / "edited.yaml"
    outcomes: Counter[str] = Counter()
    faults: list[str] = []
    early_kb = 0
    signal.signal(signal.SIGALRM, _too_slow)
    for number in range(count):
        text = edited(rng.choice(texts), texts, rng)
        target.write_text(text, encoding="utf-8")
        signal.alarm(SLOWEST_S)
        try:
            load_config(target)
            outcomes["loaded"] += 1
        except AsvhilError as error:
            told = str(error)
            outcomes["refused"] += 1
            if "\n" in told or not any(path.name in told for path in (*SHIPPED, target)):
                faults.append(f"seed {seed}, edit {number}: not one line that names the file: {told[:200]!r}")
        except BaseException as error:
            faults.append(f"seed {seed}, edit {number}: {type(error).__name__}: {str(error)[:200]}")
            (folder / f"fault{len(faults)}.yaml").write_text(text, encoding="utf-8")
        finally:
            signal.alarm(0)
        if number == count // 5:
            early_kb = resident_kb()
    return outcomes, faults, (early_kb, resident_kb())


def _too_slow(*_: object) -> None:
    raise TimeoutError(f"took longer than {SLOWEST_S} s")


def resident_kb() -> int:
    return int(Path("/proc/self/status").read_text().split("VmRSS:")[1].split()[0])


def run(edits: int, seed: int, jobs: int) -> dict[str, Any]:
    """The figures of so many edits."""
    from rich.progress import track

    share = 500
    work = [(seed * 1_000_000 + start, min(share, edits - start)) for start in range(0, edits, share)]
    outcomes: Counter[str] = Counter()
    faults: list[str] = []
    memory: list[tuple[int, int]] = []
    with interrupts_held_back():
        pool = multiprocessing.get_context("spawn").Pool(jobs)
    with pool:
        results: Iterator[Any] = pool.imap_unordered(edit_and_load, work)
        for found, told, resident in track(results, total=len(work), description="edits"):
            outcomes += found
            faults += told
            memory.append(resident)
    later = memory[len(memory) // 5 :]
    return {
        "edits": edits,
        "seed": seed,
        **outcomes,
        "faults": faults,
        "resident_kb": {"early": memory[0][1], "most_later": max(last for _, last in later)},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--edits", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    figures = run(args.edits, args.seed, args.jobs)
    if args.json is not None:
        args.json.write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps(figures | {"faults": figures["faults"][:20]}, indent=2))
    sys.exit(bool(figures["faults"]))


if __name__ == "__main__":
    end_in_words(main)
