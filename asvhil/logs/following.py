"""A replay that follows the record, for where it cannot be exact: a machine of other arithmetic, or an inexact solver.

Once a command differs in its last bits the outputs part for good, since the recorded boat does not answer the replayed
commands. So each solution is compared with the recorded one, and the recorded one is handed on, with the plan that the
next solution starts from. Every tick is compared so, with a tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from asvhil.backseat.build import build_backseat, build_controller, build_model
from asvhil.config import Config
from asvhil.controller.protocol import Controller
from asvhil.logs.encoding import decode_outputs, encode_outputs
from asvhil.logs.reader import LogFile
from asvhil.types import Control, Estimate, Outputs, Station, Wind, changed, record

TOLERANCE = 1e-6  # of a number, or of its size where that is above 1


@record
class Difference:
    """A field that differs: in which tick from 0, when, the two values, and by how much (infinite for other kinds)."""

    tick: int
    t_ns: int
    field: str
    size: float


@record
class Followed:
    """Every tick of a log compared: the first difference beyond the tolerance, and the largest of all; None: none.

    `compared` of the `ticks` had outputs, and of these `differing` are not equal to the byte.
    """

    ticks: int
    compared: int
    differing: int
    last_ns: int
    beyond: Difference | None
    largest: Difference | None


class FollowingController:
    """A controller that hands on the recorded solution, and keeps its own for the comparison."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._follow: Callable[[Control], None] | None = getattr(controller, "follow", None)
        self.recorded: Control | None = None
        self.own: Control | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)  # what controllers may have besides: retune, favour_position

    def begin_tick(self, recorded: Control | None) -> None:
        """The recorded solution of the tick that is about to be stepped, None where there was none."""
        self.recorded, self.own = recorded, None

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        self.own = self._controller.step(estimate, wind, station)
        if self.recorded is None:
            return self.own
        if self._follow is not None:
            self._follow(self.recorded)
        return self.recorded

    def new_station(self) -> None:
        self._controller.new_station()

    def reset(self) -> None:
        self._controller.reset()


def follow(log: LogFile, config: Config, model_file: Path | None, on_tick: Callable[[int], None]) -> Followed:
    """Step a fresh backseat through a whole log, with the recorded solutions in place of its own."""
    model = build_model(config, model_file)
    controller = FollowingController(build_controller(config, model))
    backseat = build_backseat(config, model=model, controller=controller)
    beyond: Difference | None = None
    largest: Difference | None = None
    ticks = compared = differing = last_ns = 0
    for tick, (inputs, data) in enumerate(log.ticks(up_to_gap=True)):
        recorded = None if data is None else decode_outputs(data, log.path)
        controller.begin_tick(None if recorded is None else recorded.control)
        outputs = backseat.step(inputs)
        ticks, last_ns = tick + 1, inputs.t_ns
        on_tick(ticks)
        if data is None or recorded is None:
            continue
        compared += 1
        own = changed(outputs, control=controller.own) if outputs.control is not None else outputs
        found = [
            Difference(tick=tick, t_ns=inputs.t_ns, field=field, size=size)
            for field, size in _differences(recorded, own)
        ]
        if not found:
            continue
        differing += 1
        worst = max(found, key=lambda one: one.size)
        if largest is None or worst.size > largest.size:
            largest = worst
        if beyond is None:
            beyond = next((one for one in found if not one.size <= TOLERANCE), None)
    return Followed(
        ticks=ticks, compared=compared, differing=differing, last_ns=last_ns, beyond=beyond, largest=largest
    )


def _differences(recorded: Outputs, own: Outputs) -> Iterator[tuple[str, float]]:
    """The fields that differ, with the two values, and by how much."""
    left, right = (encode_outputs(_acting(outputs)) for outputs in (recorded, own))
    if left != right:
        yield from _walk("", msgspec.json.decode(left), msgspec.json.decode(right))


def _acting(outputs: Outputs) -> Outputs:
    """Outputs without what their other fields tell as well: frames, and by how many QPs a solution was found."""
    control = outputs.control
    if control is not None:
        control = changed(control, iterations=0)
    return changed(outputs, frames=(), control=control)


def _walk(path: str, a: Any, b: Any) -> Iterator[tuple[str, float]]:
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            yield from _walk(f"{path}.{key}" if path else key, a.get(key), b.get(key))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for i, (left, right) in enumerate(zip(a, b, strict=True)):
            yield from _walk(f"{path}[{i}]", left, right)
    elif a != b or type(a) is not type(b):
        yield f"{path}: {_shown(a)} recorded, {_shown(b)} replayed", _size(a, b)


def _size(a: Any, b: Any) -> float:
    if not (isinstance(a, float) and isinstance(b, float)):
        return math.inf
    return abs(a - b) / max(abs(a), 1.0)


def _shown(value: Any) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= 60 else f"{text[:57]}..."
