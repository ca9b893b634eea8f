"""What may be wrong with motors and compass, as the motion that would follow: the hypotheses of the monitor."""

from __future__ import annotations

import math

from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import record


@record
class Hypothesis:
    """One way in which a boat may answer its commands (port, starboard).

    `source`: the command that drives each motor, 0 the port one; `share`: of its thrust, negative where it is reversed,
    and then by the curve of the command's opposite. `off_rad`: how much more than the true heading the compass reads.
    `load`: mass and inertia aboard beside the vessel's, as a share of these. `log_prior`: the natural logarithm of how
    likely a fault is beforehand, against the others. `fault`: what it means; None: the boat can be held.
    """

    source: tuple[int, int] = (0, 1)
    share: tuple[float, float] = (1.0, 1.0)
    off_rad: float = 0.0
    load: float = 0.0
    log_prior: float = 0.0
    fault: Explanation | None = None


def _off(degrees: float) -> Hypothesis:
    hint = "or the motors are swapped and both reversed" if abs(degrees) == 180.0 else ""
    detail = {"hint": hint} if hint else {}
    fault = explain(Reason.HEADING_OFF, degrees=f"{abs(degrees):.0f}", side=_side(degrees), **detail)
    return Hypothesis(off_rad=math.radians(degrees), fault=fault)


def _side(degrees: float) -> str:
    return "" if abs(degrees) == 180.0 else " clockwise" if degrees > 0.0 else " counter-clockwise"


# A boat that is held well enough: weak or fouled motors, a compass that is not turned far, and people and goods aboard.
SOUND: tuple[Hypothesis, ...] = (
    Hypothesis(),
    Hypothesis(share=(0.7, 1.0)),
    Hypothesis(share=(1.0, 0.7)),
    Hypothesis(off_rad=math.radians(20.0)),
    Hypothesis(off_rad=math.radians(-20.0)),
    Hypothesis(load=0.4),
)
# Two faults at once. A motor that was never told to do anything is as well dead as not, and says nothing against one.
TWICE = -2.0
FAULTY: tuple[Hypothesis, ...] = (
    Hypothesis(share=(-1.0, -1.0), fault=explain(Reason.MOTORS_REVERSED)),
    Hypothesis(share=(-1.0, 1.0), fault=explain(Reason.MOTOR_REVERSED, motor="port")),
    Hypothesis(share=(1.0, -1.0), fault=explain(Reason.MOTOR_REVERSED, motor="starboard")),
    Hypothesis(source=(1, 0), fault=explain(Reason.MOTORS_SWAPPED)),
    Hypothesis(
        source=(1, 0),
        share=(-1.0, 1.0),
        log_prior=TWICE,
        fault=explain(Reason.MOTORS_SWAPPED, hint="and port reversed"),
    ),
    Hypothesis(
        source=(1, 0),
        share=(1.0, -1.0),
        log_prior=TWICE,
        fault=explain(Reason.MOTORS_SWAPPED, hint="and starboard reversed"),
    ),
    Hypothesis(share=(0.0, 1.0), fault=explain(Reason.MOTOR_DEAD, motor="port")),
    Hypothesis(share=(1.0, 0.0), fault=explain(Reason.MOTOR_DEAD, motor="starboard")),
    Hypothesis(share=(0.0, 0.0), log_prior=TWICE, fault=explain(Reason.NO_THRUST)),
    *(_off(degrees) for degrees in (45.0, -45.0, 90.0, -90.0, 135.0, -135.0, 180.0)),
)
