"""The real ELF files on a simulated ATmega328P with injected voltages and pulses, in simulated time."""

import itertools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.arduino_driver import FIRMWARE, Board, make, mutated, wrong_directions, wrong_speeds

FREQUENCIES_HZ = (0.5, 0.77, 1.0, 1.7, 4.3, 11.0, 30.0, 61.0, 90.0)


def test_all_sixteen_directions_are_exact(elf: Path) -> None:
    assert wrong_directions(elf) == []


def test_speed(uno: Path) -> None:
    assert wrong_speeds(uno, FREQUENCIES_HZ) == []


@pytest.mark.parametrize(
    "bounce",
    ["4 150", "20 7", *(pytest.param(bounce, marks=pytest.mark.thorough) for bounce in ("2 400", "10 40", "4 10"))],
)
def test_bouncing_contacts_change_nothing(uno: Path, bounce: str) -> None:
    assert wrong_speeds(uno, (0.5, 6.0, 90.0), bounce) == []


def test_a_sentence_every_200_ms(elf: Path) -> None:
    """Also with the fastest bouncing cup and a talkative host."""
    with Board(elf) as board:
        board.tell("bounce 4 150")
        board.tell("wind 60 90")
        for _ in range(60):
            board.tell("send $PASVQ,V")
            board.run(0.7)
        times_s = [t_s for t_s, text in board.lines if text.startswith("$WIMWV")]
    intervals_ms = [1000.0 * (b - a) for a, b in itertools.pairwise(times_s)]
    assert len(times_s) == 209
    assert min(intervals_ms) > 195.0 and max(intervals_ms) < 205.0
    assert times_s[-1] - times_s[0] == pytest.approx(208 * 0.2, abs=0.005)  # no drift


@pytest.mark.parametrize("fault", ["open", "short", "mv 2700"])
def test_a_vane_that_is_open_shorted_or_in_between_gives_status_v(uno: Path, fault: str) -> None:
    with Board(uno) as board:
        board.tell("wind 5 45")
        board.run(3.0)
        board.tell(fault if fault.startswith("mv") else f"vane {fault}")
        board.run(1.0)
        told = board.winds(3.0)
        assert len(told) == 15
        assert all(direction == "" and abs(speed - 5.0) < 0.02 for direction, speed in told)  # the cup still works
        board.tell("vane 45")
        board.run(1.2)
        assert {direction for direction, _ in board.winds(1.0)} == {"45.0"}


def test_the_mean_runs_across_north(uno: Path) -> None:
    with Board(uno) as board:
        for _ in range(20):
            for degrees in (337.5, 22.5):
                board.tell(f"vane {degrees}")
                board.run(0.1)
        directions = [float(text.split(",")[1]) for _, text in board.lines[-12:] if text.startswith("$WIMWV")]
    assert len(directions) >= 9
    assert all(min(direction, 360.0 - direction) <= 3.0 for direction in directions)


def test_calm_decays_to_zero(uno: Path) -> None:
    with Board(uno) as board:
        board.tell("wind 8 0")
        board.run(3.0)
        board.tell("hz 0")
        speeds = [speed for _, speed in board.winds(6.0)]
    assert speeds[0] > 6.0 and speeds[-1] == 0.0
    assert speeds == sorted(speeds, reverse=True)


def test_gust(uno: Path) -> None:
    with Board(uno) as board:
        for hz, seconds in ((6.0, 5.0), (15.0, 4.0), (6.0, 5.0)):
            board.tell(f"hz {hz}")
            board.run(seconds)
        gusts = [(t_s, text) for t_s, text in board.lines if text.startswith("$PASVG")]
    assert [round(t_s) for t_s, _ in gusts] == list(range(1, len(gusts) + 1)) and len(gusts) >= 13
    assert float(gusts[-1][1].split(",")[1]) == pytest.approx(10.0, abs=0.02)


def test_version_at_boot_and_on_request(elf: Path) -> None:
    (version,) = re.findall(r'FIRMWARE_VERSION "(.+)"', (FIRMWARE / "sentence.h").read_text())
    with Board(elf) as board:
        assert [text for _, text in board.run(0.1)] == [f"$PASVV,arduino_anemometer,{version},power-on"]
        for question in ("$PASVQ,V*3F", "$PASVQ,V"):
            board.tell(f"send {question}")
            assert [text for _, text in board.run(0.05)] == [f"$PASVV,arduino_anemometer,{version},request"]
        for question in ("$PASVQ,V*3E", "$PASVQ,X", "V", "$PASVQ,V" + " " * 100):
            board.tell(f"send {question}")
            assert not any("PASVV" in text for _, text in board.run(0.05))


def test_raw_readings_on_request(uno: Path) -> None:
    with Board(uno) as board:
        board.tell("vane 67.5")
        board.tell("hz 10")
        board.run(1.05)
        board.tell("send $PASVQ,R")
        (text,) = [text for _, text in board.run(0.05) if "PASVR" in text]
    _, counts, position, closures = text.split(",")
    assert abs(int(counts) - 84) <= 1 and position == "3" and 8 <= int(closures) <= 10


def test_the_watchdog_restarts_a_program_that_hangs(tmp_path: Path) -> None:
    """A copy of the sketch that stops in its loop after two seconds; the vane keeps its voltage, the cup its speed."""
    hang = "void loop() {\n    while (millis() > 2000) {\n    }\n"
    elf = mutated(tmp_path, "arduino_anemometer.ino", ("void loop() {\n", hang))
    with Board(elf) as board:
        board.tell("wind 5 45")
        told = board.run(9.8)
    starts = [(t_s, text) for t_s, text in told if text.startswith("$PASVV")]
    assert [text.split(",")[3] for _, text in starts] == ["power-on", "watchdog", "watchdog", "watchdog"]
    assert all(b - a == pytest.approx(2.5, abs=0.15) for (a, _), (b, _) in itertools.pairwise(starts))
    assert [text for _, text in told if "MWV" in text][-1].startswith("$WIMWV,45.0,R,5.0")


def test_a_reset_is_due_to_the_watchdog(tmp_path: Path) -> None:
    """Without the watchdog the same hang is for ever."""
    hang = "while (millis() > 2000) {\n    }\n"
    elf = mutated(tmp_path, "arduino_anemometer.ino", ("wdt_enable(WDTO_500MS);", ""), ("wdt_reset();", hang))
    with Board(elf) as board:
        assert sum(text.startswith("$PASVV") for _, text in board.run(6.0)) == 1


def test_size(elf: Path) -> None:
    words = subprocess.run(
        ["avr-size", "--format=avr", "--mcu=atmega328p", str(elf)], capture_output=True, text=True, check=True
    ).stdout
    flash, ram = (float(re.findall(rf"{part}:.*\((\d+\.\d+)% Full\)", words)[0]) for part in ("Program", "Data"))
    assert 5.0 < flash < 60.0 and 5.0 < ram < 50.0


@pytest.mark.thorough
def test_a_clean_tree_builds_in_one_go(tmp_path: Path) -> None:
    copy = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, copy, ignore=shutil.ignore_patterns("build"))
    make(copy)
    for board in ("uno", "nano"):
        assert (copy / "build" / f"{board}.hex").read_text().startswith(":10")
    assert {path.name for path in copy.iterdir()} - {path.name for path in FIRMWARE.iterdir()} <= {"build"}
