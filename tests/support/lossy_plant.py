"""A plant at the end of an autopilot's link that loses or changes frames."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Iterable
from typing import Any

from asvhil.io.mavlink.frames import dialect, message_id
from asvhil.types import Frame

Way = Callable[[Frame], Iterable[Frame]]


def whole(frame: Frame) -> Iterable[Frame]:
    """A way that loses nothing."""
    return (frame,)


class PlantBehindLink:
    """A plant whose frames on the autopilot's link go through `from_plant`, and those to it through `to_plant`.

    A way gives what becomes of a frame: nothing, itself, or others. The other links are left alone.
    """

    def __init__(self, plant: Any, from_plant: Way = whole, to_plant: Way = whole) -> None:
        self._plant = plant
        self.from_plant, self.to_plant = from_plant, to_plant

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def advance(self, t_ns: int) -> list[Frame]:
        found: list[Frame] = []
        for frame in self._plant.advance(t_ns):
            found += self.from_plant(frame) if frame.port == "autopilot" else (frame,)
        return found

    def receive(self, frame: Frame) -> None:
        for passed in self.to_plant(frame) if frame.port == "autopilot" else (frame,):
            self._plant.receive(passed)


def losing(loss: float, chance: random.Random) -> Way:
    """A way that loses each frame with a probability."""
    return lambda frame: (frame,) if chance.random() >= loss else ()


def losing_messages(names: Collection[str], then: Way = whole) -> Way:
    """A way that loses the messages of some names; what is left goes another way."""
    lost = {getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in names}
    return lambda frame: () if message_id(frame.data) in lost else then(frame)
