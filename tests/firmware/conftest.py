"""Builds what these tests run, once: the firmware for both boards, the simulator around it, its logic on the host."""

from __future__ import annotations

import fcntl
from pathlib import Path

import pytest

from tests.support.arduino_driver import BUILD, FIRMWARE, HERE, make, missing_packages, must_run


@pytest.fixture(scope="session", autouse=True)
def tools() -> None:
    if absent := missing_packages():
        words = f"the firmware's tools are not installed: {' '.join(absent)} (`make firmware` installs them as root)"
        if must_run():
            pytest.fail(words)
        pytest.skip(words)
    with (FIRMWARE / "Makefile").open() as one_at_a_time:  # test runs beside each other build in the same folders
        fcntl.flock(one_at_a_time, fcntl.LOCK_EX)
        make(FIRMWARE)
        make(HERE / "harness")
        make(HERE / "host")


@pytest.fixture(scope="session", params=["uno", pytest.param("nano", marks=pytest.mark.thorough)])
def elf(request: pytest.FixtureRequest) -> Path:
    return FIRMWARE / "build" / f"{request.param}.elf"


@pytest.fixture(scope="session")
def uno() -> Path:
    return FIRMWARE / "build" / "uno.elf"


@pytest.fixture(scope="session")
def logic() -> Path:
    return BUILD / "test_logic"
