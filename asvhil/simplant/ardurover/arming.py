"""ArduRover's rules of arming: what it checks all the time, what at the attempt, and arming by the steering stick."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asvhil.simplant.ardurover.parameters import PORT_MOTOR, STARBOARD_MOTOR
from asvhil.simplant.vehicle.rc import NEUTRAL_US

if TYPE_CHECKING:
    from asvhil.simplant.ardurover.rover import Rover

OVERRIDES_BEFORE_ARMING_NS = 2_000_000_000
INPUT_NS = 1_000_000_000  # older sticks are not looked at
RUDDER_NS = 2_000_000_000  # of the steering stick at full right, until that arms
FULL_RIGHT = 4000 / 4500
YAW_CHANNEL, YAW_DEAD_ZONE_US = 4, 34
STEERING, THROTTLE, SCRIPT_1 = 26, 70, 94  # SERVOn_FUNCTION


def failing_checks(rover: Rover) -> list[str]:
    """The checks before arming that fail, in the vehicle's words."""
    failing = [] if rover.booted else ["Mode not armable"]
    failing += ["Hardware safety switch"] if rover.safety_on else []
    if failing or rover.checks_skipped:
        return failing
    if not rover.ready(rover.t_ns):
        failing.append("Need Position Estimate")
    rc = rover.rc
    waits = not rc.receiver and rc.streamed_ns(rover.t_ns) < OVERRIDES_BEFORE_ARMING_NS
    if rover.radio_silent or (waits and rover.parameters["FS_THR_ENABLE"] != 0.0):
        failing.append("Radio failsafe on")
    return failing + _motor_faults(frozenset(rover.parameters.functions))


def _motor_faults(functions: frozenset[int]) -> list[str]:
    """Of the functions of the outputs. These texts begin with PreArm at an attempt to arm too."""
    left, right = PORT_MOTOR in functions, STARBOARD_MOTOR in functions
    if not functions & {PORT_MOTOR, STARBOARD_MOTOR, THROTTLE, STEERING, SCRIPT_1}:
        return ["PreArm: no motor, sail or scripting outputs defined"]
    if left is not right:
        return ["PreArm: check skid steering config"]
    if (THROTTLE in functions) is not (STEERING in functions):
        return ["PreArm: check steering and throttle config"]
    return []


def sticks_out(rover: Rover, by_rudder: bool) -> list[str]:
    """Sticks that are not neutral at the attempt to arm; the one that arms is excused, and old input is no input."""
    if not rover.rc.seen or not rover.rc.alive(rover.t_ns, INPUT_NS):
        return []
    (port, starboard), (first, second) = rover.mapped, rover.sticks()
    out = [f"Roll (RC{port}) is not neutral"] if first != 0.0 and not by_rudder else []
    yaw_us = rover.rc.radio_us[YAW_CHANNEL - 1]
    if yaw_us and abs(yaw_us - NEUTRAL_US) > YAW_DEAD_ZONE_US:
        out.append(f"Yaw (RC{YAW_CHANNEL}) is not neutral")
    return out + ([f"Throttle (RC{starboard}) is not neutral"] if second != 0.0 else [])


class RudderWatch:
    """ARMING_RUDDER: the steering stick, which PILOT_STEER_TYPE 1 makes the port motor's, at full right for 2 s."""

    def __init__(self) -> None:
        self._since_ns: int | None = None

    def asks(self, rover: Rover) -> bool:
        """Whether the stick asks for arming now; the throttle must be in its trim."""
        able = rover.booted and not rover.armed and not rover.radio_silent and rover.parameters["ARMING_RUDDER"] != 0.0
        first, second = rover.sticks() if able else (0.0, 0.0)
        if not (first > FULL_RIGHT and second == 0.0):
            self._since_ns = None
            return False
        self._since_ns = rover.t_ns if self._since_ns is None else self._since_ns
        if rover.t_ns - self._since_ns < RUDDER_NS:
            return False
        self._since_ns = None
        return True
