"""What every controller offers to the backseat."""

from __future__ import annotations

from typing import Protocol

from asvhil.types import Control, Estimate, Station, Wind


class Controller(Protocol):
    """Keeps a station: one solution per control period."""

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control: ...

    def reset(self) -> None: ...
