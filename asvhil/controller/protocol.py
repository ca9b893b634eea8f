"""The interface of every controller."""

from __future__ import annotations

from typing import Protocol

from asvhil.types import Control, Estimate, Station, Wind


class Controller(Protocol):
    """Keeps a station: one solution per control period.

    The supervisor owns the station in use; `new_station` is called when it is another one.

    It may also have `retune(config: ControllerConfig)`, to take settings that operators change, and
    `favour_position(on: bool)`, to keep the position at any heading while the procedure's `r_h` rule requires it; and
    `follow(control: Control)`, to go on from another solution of the last step than its own.
    """

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """The motor commands of one control period."""
        ...

    def new_station(self) -> None:
        """The station is another one from the next step on: drop state that belongs to the last one."""
        ...

    def reset(self) -> None:
        """Drop all state: others have had the motors since the last step."""
        ...
