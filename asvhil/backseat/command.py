"""Command: what operators ask for, who has the motors, and the station that is held."""

from __future__ import annotations

from collections.abc import Iterable

from asvhil.io.sensors.sources import Switch
from asvhil.operator.operations import Operations, Readings
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.supervisor import Supervisor
from asvhil.types import Control, Frame, Note


class Command:
    """In each tick: `receive` the operators' frames, `step` to the decision, and `data_to_send` once all is known."""

    def __init__(self, operations: Operations, supervisor: Supervisor) -> None:
        self._operations = operations
        self._supervisor = supervisor

    def receive(self, frame: Frame) -> None:
        """Take in a frame of the operator's port."""
        self._operations.receive(frame)

    def step(self, situation: Situation) -> Decision:
        """Decide what was asked for and what becomes of the motors."""
        decision = self._supervisor.step(situation, self._operations.take_requests())
        self._operations.answer(situation.t_ns, decision)
        return decision

    def data_to_send(
        self,
        situation: Situation,
        decision: Decision,
        control: Control | None,
        switches: Iterable[Switch],
        notes: tuple[Note, ...],
        readings: Readings,
    ) -> list[Frame]:
        """Answers, texts on what has changed, and the reports that are due."""
        return self._operations.data_to_send(situation, decision, control, switches, notes, readings)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What the shell has found wrong with itself."""
        return self._operations.shell_notes

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        return self._operations.counters()
