"""Figures of the anemometer's firmware on the simulated ATmega328P: `python -m bench.firmware --json FILE`."""

from __future__ import annotations

import argparse
import itertools
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from bench.ending import end_in_words
from tests.support.arduino_driver import (
    FIRMWARE,
    HERE,
    MPS_PER_HZ,
    Board,
    make,
    missing_packages,
    wrong_directions,
    wrong_speeds,
)

FREQUENCIES_HZ = (0.5, 0.6, 0.77, 1.0, 1.3, 1.7, 2.5, 4.3, 7.0, 11.0, 18.0, 30.0, 45.0, 61.0, 75.0, 90.0)
BOUNCES = ("4 150", "2 400", "10 40", "4 10", "20 7")


def worst_speed_mps(elf: Path) -> float:
    """The largest error of a sentence in a steady wind."""
    worst = 0.0
    for hz in FREQUENCIES_HZ:
        with Board(elf) as board:
            board.tell(f"hz {hz}")
            board.run(max(2.5, 2.5 / hz))
            worst = max([worst, *(abs(speed - hz * MPS_PER_HZ) for _, speed in board.winds(max(3.0, 3.0 / hz)))])
    return worst


def intervals_ms(elf: Path) -> list[float]:
    """Between wind sentences, with a bouncing cup at 90 Hz and a host that asks for the version every 0.7 s."""
    with Board(elf) as board:
        board.tell("bounce 4 150")
        board.tell(f"wind {90.0 * MPS_PER_HZ:.3f} 90")
        for _ in range(60):
            board.tell("send $PASVQ,V")
            board.run(0.7)
        times_s = [t_s for t_s, text in board.lines if text.startswith("$WIMWV")]
    return [1000.0 * (after - before) for before, after in itertools.pairwise(times_s)]


def size_percent(elf: Path) -> tuple[float, float]:
    """Flash and RAM, of what the part has."""
    command = ["avr-size", "--format=avr", "--mcu=atmega328p", str(elf)]
    words = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    flash, ram = (float(re.findall(rf"{part}:.*\((\d+\.\d+)% Full\)", words)[0]) for part in ("Program", "Data"))
    return flash, ram


def measure(board: str) -> dict[str, Any]:
    elf = FIRMWARE / "build" / f"{board}.elf"
    between = intervals_ms(elf)
    flash, ram = size_percent(elf)
    return {
        "directions_right": 16 - len(wrong_directions(elf)),
        "worst_speed_mps": worst_speed_mps(elf),
        "wrong_with_bounces": [words for bounce in BOUNCES for words in wrong_speeds(elf, (0.5, 6.0, 90.0), bounce)],
        "interval_ms": {"least": min(between), "most": max(between), "count": len(between)},
        "flash_percent": flash,
        "ram_percent": ram,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if absent := missing_packages():
        sys.exit(f"the firmware's tools are not installed: {' '.join(absent)}; run `make firmware-sim`")
    for folder in (FIRMWARE, HERE / "harness"):
        make(folder)
    figures = {}
    for board in ("uno", "nano"):
        print(f"{board} ...", file=sys.stderr)
        figures[board] = measure(board)
    text = json.dumps(figures, indent=1)
    print(text)
    if arguments.json:
        arguments.json.write_text(text + "\n")


if __name__ == "__main__":
    end_in_words(main)
