"""The shell of a preflight in virtual time: what happens while its question stands, and what is written then."""

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from asvhil.autopilot.requirements import Finding
from asvhil.errors import AsvhilError
from asvhil.preflight.runner import Preflight
from asvhil.types import Frame, Inputs
from tests.support.dock import TICK_NS, Dock

WRONG = "plant.frontseat.parameters={RC3_DZ: 30}"


class DockVisit:
    """The simulated vehicle in the place of the links; a tick takes no time."""

    def __init__(self, dock: Dock) -> None:
        self._dock = dock

    async def __aenter__(self) -> "DockVisit":
        return self

    async def __aexit__(self, *_: object) -> None:
        """Nothing to close."""

    def states(self) -> dict[str, str]:
        return {"autopilot": "up"}

    def remarks(self, port: str) -> str:
        return ""

    async def tick(self, step: Callable[[Inputs], Iterable[Frame]], pause_s: float) -> int:
        dock = self._dock
        dock.t_ns += TICK_NS
        for frame in step(Inputs(t_ns=dock.t_ns, frames=tuple(dock.plant.advance(dock.t_ns)))):
            dock.plant.receive(frame)
        await asyncio.sleep(0.0)
        return dock.t_ns


def asked(dock: Dock, meanwhile: Callable[[], Any], seconds: float = 3.0) -> tuple[Preflight, list[str]]:
    """A preflight whose question is answered with yes, some seconds after something has happened; what was written."""
    preflight = Preflight(dock.config, timeout_s=15.0)
    preflight._visit = DockVisit(dock)  # type: ignore[assignment]

    async def choose(wrong: list[Finding]) -> bool:
        meanwhile()
        end_ns = dock.t_ns + round(seconds * 1e9)
        while dock.t_ns < end_ns:
            await asyncio.sleep(0.0)
        return True

    written = asyncio.run(preflight.run(choose))
    return preflight, [finding.name for finding in written]


def test_what_was_agreed_to_is_written() -> None:
    dock = Dock(WRONG)
    _, written = asked(dock, lambda: None)
    assert written == ["RC3_DZ"]
    assert dock.plant.frontseat.rover.parameters["RC3_DZ"] == 0.0


def test_a_vehicle_that_is_armed_during_the_question_is_not_written_to() -> None:
    dock = Dock(WRONG)
    with pytest.raises(AsvhilError, match="the vehicle is armed: nothing was written"):
        asked(dock, lambda: dock.plant.frontseat.arm(True))
    assert dock.plant.frontseat.rover.parameters["RC3_DZ"] == 30.0


def test_what_goes_wrong_during_the_question_is_not_written_unasked() -> None:
    dock = Dock(WRONG)
    parameters = dock.plant.frontseat.rover.parameters
    preflight, written = asked(dock, lambda: parameters.update(RC1_DZ=30.0), seconds=70.0)
    assert written == ["RC3_DZ"] and parameters["RC1_DZ"] == 30.0
    assert [finding.name for finding in preflight.survey.fixable] == ["RC1_DZ"]


def test_an_autopilot_that_restarts_during_the_question_is_looked_at_anew() -> None:
    dock = Dock(WRONG)
    preflight, written = asked(dock, lambda: dock.plant.frontseat.reboot(dock.t_ns))
    assert written == ["RC3_DZ"]
    assert preflight.survey.stage == "done" and not preflight.survey.fixable
