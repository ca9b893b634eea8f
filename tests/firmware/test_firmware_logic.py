"""The firmware's logic on the host, under AddressSanitizer and UndefinedBehaviorSanitizer."""

import re
import subprocess
from pathlib import Path

import pytest

from tests.support.arduino_driver import FIRMWARE, HERE

NAMES = re.findall(r"^    TEST\((\w+)\)", (HERE / "host" / "test_logic.cpp").read_text(), re.MULTILINE)


@pytest.mark.parametrize("name", NAMES)
def test_logic(logic: Path, name: str) -> None:
    done = subprocess.run([str(logic), name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_test_of_the_program_is_run(logic: Path) -> None:
    listed = subprocess.run([str(logic), "--list"], capture_output=True, text=True, check=True).stdout.split()
    assert listed == NAMES and len(NAMES) >= 15


def test_a_ladder_with_two_levels_alike_is_not_compiled(tmp_path: Path) -> None:
    config = (FIRMWARE / "config.h").read_text().replace("    891,", "    998,")
    (tmp_path / "config.h").write_text(config)
    (tmp_path / "vane.cpp").write_text((FIRMWARE / "vane.cpp").read_text())
    (tmp_path / "vane.h").write_text((FIRMWARE / "vane.h").read_text())
    command = ["g++", "-std=c++11", "-fsyntax-only", str(tmp_path / "vane.cpp")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "less than 6 counts apart" in done.stderr
