"""What every controller offers to the backseat."""

from __future__ import annotations

from typing import Protocol

from asvhil.types import Control, Estimate, Station, Wind


class Controller(Protocol):
    """Keeps a station: one solution per control period.

    It need not compare stations: the supervisor holds the one in use, and `new_station` says that it is another.

    It may also have `retune(config: ControllerConfig)`, to take settings that operators change, and
    `favour_position(on: bool)`, to keep the position at any heading while the procedure's `r_h` rule says so.
    """

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        """The motor commands of one control period."""
        ...

    def new_station(self) -> None:
        """The station is another one from the next step on: forget what was found for the last."""
        ...

    def reset(self) -> None:
        """Forget everything: the motors have not been ours since the last step."""
        ...
