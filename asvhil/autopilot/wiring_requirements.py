"""What a motor's wiring needs on any autopilot: its function on one output, and travel to both of its ends. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from asvhil.autopilot.requirements import Requirement, exactly, within
from asvhil.autopilot.wiring import Motor, outputs_with
from asvhil.config import MotorOutputConfig
from asvhil.types import Cause


def function_row(
    side: str,
    config: MotorOutputConfig,
    function: int,
    output: int,
    names: Sequence[str],
    values: Mapping[str, float],
    why: str,
) -> Requirement:
    """That one output has the motor's function, and if the config names one that it is this.

    `output` is where it is taken to be; `names` are the parameters of the outputs' functions, from output 1.
    """
    having = outputs_with(function, names, values)
    if config.output is None and len(having) > 1:
        which = f"outputs {' and '.join(map(str, having))}: name one by vehicle.pwm.{side}.output"
        return exactly(names[having[-1] - 1], 0, f"two {side} motors", which, Cause.STUCK)
    if config.output is None and not having and names[output - 1] in values:
        # Nothing is certain while any output may still have it.
        output = next((n for n, name in enumerate(names, start=1) if name not in values), output)
    return exactly(names[output - 1], function, f"no {side} motor", why, Cause.STUCK)


def travel_rows(low: str, high: str, motor: Motor, room_us: float = 0.0) -> tuple[Requirement, Requirement]:
    """That an output reaches both ends of its motor, and has some room about its neutral.

    `low` and `high` are the parameters of its shortest and longest pulse.
    """
    shortest_us, longest_us = sorted((motor.astern_us, motor.ahead_us))
    shortest, longest = ("ahead", "astern") if motor.reversed else ("astern", "ahead")
    lows_us = 500, min(shortest_us, motor.neutral_us - room_us)
    highs_us = max(longest_us, motor.neutral_us + room_us), 2500
    reach = "the output must reach full {}"
    return (
        within(low, lows_us, shortest_us, f"full {shortest} cut off", reach.format(shortest), Cause.SCALED),
        within(high, highs_us, longest_us, f"full {longest} cut off", reach.format(longest), Cause.SCALED),
    )
