"""Progress on a pipe or in a file, where a bar cannot be drawn: a line now and then."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console
from rich.progress import Progress, Task, TaskID

FIRST_S, EVERY_S = 2.0, 10.0


class PipedProgress(Progress):
    """A Progress that draws nothing, and prints what is being done and how far it is.

    A line comes after FIRST_S of work, and then each EVERY_S; and at the end one for each work that had a line before
    and is finished. `unit`: of what is counted where no total is known.
    """

    def __init__(self, console: Console, unit: str = "") -> None:
        super().__init__(console=console, disable=True)
        self._unit = unit
        self._said: dict[TaskID, float] = {}  # what was done of each work when its last line came
        self._due_s = time.monotonic() + FIRST_S

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """As of Progress."""
        super().advance(task_id, advance)
        self._tell(task_id)

    def update(self, task_id: TaskID, **changes: Any) -> None:
        """As of Progress."""
        super().update(task_id, **changes)
        self._tell(task_id)

    def _tell(self, task_id: TaskID) -> None:
        now_s = time.monotonic()
        if now_s < self._due_s:
            return
        self._due_s = now_s + EVERY_S
        self._say(next(task for task in self.tasks if task.id == task_id))

    def stop(self) -> None:
        """As of Progress."""
        for task in self.tasks:
            if task.finished and self._said.get(task.id, task.completed) != task.completed:
                self._say(task)
        super().stop()

    def _say(self, task: Task) -> None:
        self._said[task.id] = task.completed
        if task.total is not None:
            share = f": {task.percentage:.0f} %"
        else:
            share = f": {task.completed:.0f} {self._unit}".rstrip() if task.completed else ""
        self.console.print(f"{task.description}{share}", markup=False, highlight=False, soft_wrap=True)
