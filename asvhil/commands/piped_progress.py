"""Progress on a pipe or in a file, where a bar cannot be drawn: a line now and then."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console
from rich.progress import Progress, TaskID

EVERY_S = 10.0


class PipedProgress(Progress):
    """A Progress that draws nothing, and each EVERY_S of work prints what is being done and how far it is."""

    def __init__(self, console: Console) -> None:
        super().__init__(console=console, disable=True)
        self._told_s = time.monotonic()

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
        if now_s - self._told_s < EVERY_S:
            return
        self._told_s = now_s
        task = next(task for task in self.tasks if task.id == task_id)
        share = f"{task.completed:.0f}" if task.total is None else f"{task.percentage:.0f} %"
        self.console.print(f"{task.description}: {share}", markup=False, highlight=False, soft_wrap=True)
