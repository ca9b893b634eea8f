"""The firmware on a simulated board in virtual time, and the checks that both the good and the mutated one undergo."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from types import TracebackType

from tests.support.nmea import checksum
from tests.support.paths import FIRMWARE_TESTS, ROOT

HERE = FIRMWARE_TESTS
FIRMWARE = ROOT / "firmware" / "arduino_anemometer"
BUILD = HERE / "build"
HARNESS = BUILD / "simulated-arduino"
MPS_PER_HZ = 2.4 / 3.6
NEEDED = {
    "gcc-avr": shutil.which("avr-g++"),
    "avr-libc": Path("/usr/lib/avr/include/avr/wdt.h").exists(),
    "arduino-core-avr": Path("/usr/share/arduino/hardware/arduino/avr/cores/arduino/Arduino.h").exists(),
    "libsimavr-dev": Path("/usr/include/simavr/sim_avr.h").exists(),
    "libelf-dev": Path("/usr/include/libelf.h").exists(),
    "g++": shutil.which("g++"),
}


def missing_packages() -> list[str]:
    return [package for package, found in NEEDED.items() if not found]


def make(folder: Path, *words: str) -> None:
    """Run make in a folder; its words are the message where it fails."""
    done = subprocess.run(["make", "-s", "-C", str(folder), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def mutated(folder: Path, file: str, *changes: tuple[str, str]) -> Path:
    """The ELF file of a copy of the firmware in which each old text, which must be there once, is a new one."""
    copy = folder / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("nano*"))  # with what is built: the core is the same
    source = (copy / file).read_text()
    for old, new in changes:
        assert source.count(old) == 1, f"{file} holds {old!r} {source.count(old)} times"
        source = source.replace(old, new)
    (copy / file).write_text(source)
    make(copy, "BOARDS=uno")
    return copy / "build" / "uno.elf"


class Board:
    """One simulated Arduino. `lines` are (simulated seconds of the first byte, sentence) of all it has said."""

    def __init__(self, elf: Path) -> None:
        self.child = subprocess.Popen(
            [str(HARNESS), str(elf)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self.lines: list[tuple[float, str]] = []
        assert self.child.stdout is not None
        word, _, self.pty = self.child.stdout.readline().strip().partition(" ")
        assert word == "pty", word

    def tell(self, command: str) -> list[tuple[float, str]]:
        """Do one command; what the board said meanwhile. Its checksums are checked on the way."""
        assert self.child.stdin is not None and self.child.stdout is not None
        self.child.stdin.write(command + "\n")
        said: list[tuple[float, str]] = []
        while answer := self.child.stdout.readline():
            word, _, rest = answer.rstrip("\n").partition(" ")
            if word == "line":
                t_us, _, text = rest.partition(" ")
                said.append((int(t_us) * 1e-6, checked(text)))
                continue
            assert word == "ok", f"{command}: {rest}"
            self.lines += said
            return said
        raise AssertionError(f"{command}: the simulator ended with status {self.child.wait()}")

    def run(self, seconds: float) -> list[tuple[float, str]]:
        return self.tell(f"run {1000.0 * seconds:.3f}")

    def winds(self, seconds: float) -> list[tuple[str, float]]:
        """(direction as printed, speed) of each wind sentence of the next seconds; ("", speed) with status V."""
        found = []
        for _, text in self.run(seconds):
            fields = text.split(",")
            if fields[0] == "$WIMWV":
                assert fields[2] == "R" and fields[4] == "M" and fields[5] == ("A" if fields[1] else "V"), text
                found.append((fields[1], float(fields[3])))
        return found

    def closures(self) -> int:
        """The counter of closures as of the last report."""
        self.tell("send $PASVQ,R")
        (raw,) = [text for _, text in self.run(0.02) if text.startswith("$PASVR")]
        return int(raw.split(",")[3])

    def __enter__(self) -> Board:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self.child.stdin is not None and self.child.stdout is not None
        self.child.stdin.close()
        try:
            self.child.wait(5.0)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()
        self.child.stdout.close()


def checked(text: str) -> str:
    """A sentence without its checksum, which must be right."""
    body, star, digits = text.removeprefix("$").partition("*")
    assert text.startswith("$") and star and len(text) <= 80, text
    assert digits == checksum(body), text
    return f"${body}"


def wrong_directions(elf: Path) -> list[str]:
    """Which of the 16 directions are not told exactly."""
    wrong = []
    with Board(elf) as board:
        for position in range(16):
            board.tell(f"vane {22.5 * position}")
            board.run(1.3)
            told = {direction for direction, _ in board.winds(0.6)}
            if told != {f"{22.5 * position:.1f}"}:
                wrong.append(f"{22.5 * position}: {sorted(told)}")
    return wrong


def wrong_speeds(elf: Path, frequencies_hz: tuple[float, ...], bounce: str = "0 0") -> list[str]:
    """Where a sentence is more than 0.02 m/s off in a steady wind, or a closure is counted twice or not at all."""
    wrong = []
    for hz in frequencies_hz:
        with Board(elf) as board:
            board.run(0.5)
            board.tell(f"bounce {bounce}")
            board.tell(f"hz {hz}")
            board.run(max(1.5, 2.5 / hz))
            speeds = [speed for _, speed in board.winds(max(2.0, 2.0 / hz))]
            worst = max(abs(speed - hz * MPS_PER_HZ) for speed in speeds)
            if worst > 0.02:
                wrong.append(f"{hz} Hz, bounce {bounce}: {worst:.3f} m/s off")
            at_s = board.lines[-1][0]
            board.tell("hz 0")
            expected = round(max(1.5, 2.5 / hz) * hz + max(2.0, 2.0 / hz) * hz)
            board.run(0.5)
            counted = board.closures()
            if abs(counted - expected) > 1:
                wrong.append(f"{hz} Hz, bounce {bounce}: {counted} closures instead of {expected} at {at_s:.1f} s")
    return wrong


def must_run() -> bool:
    """On the build server nothing may be skipped."""
    return bool(os.environ.get("CI"))
