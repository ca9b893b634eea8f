"""ArduRover's rules of arming: what it checks all the time, what at the attempt, and arming by the steering stick."""

from __future__ import annotations

from asvhil.simplant.ardurover.parameters import PORT_MOTOR, STARBOARD_MOTOR, Parameters
from asvhil.simplant.vehicle.rc import NEUTRAL_US, RcInputs

OVERRIDES_BEFORE_ARMING_NS = 2_000_000_000
INPUT_NS = 1_000_000_000  # older sticks are not looked at
RUDDER_NS = 2_000_000_000  # of the steering stick at full right, until that arms
FULL_RIGHT = 4000 / 4500
YAW_CHANNEL, YAW_DEAD_ZONE_US = 4, 34
STEERING, THROTTLE, SCRIPT_1 = 26, 70, 94  # SERVOn_FUNCTION


def checks_skipped(parameters: Parameters) -> bool:
    """Whether it arms without any checks."""
    if "ARMING_CHECK" in parameters:
        return parameters["ARMING_CHECK"] == 0.0
    return parameters["ARMING_SKIPCHK"] == -1.0


def failing_checks(
    t_ns: int,
    parameters: Parameters,
    rc: RcInputs,
    *,
    booted: bool,
    safety_on: bool,
    position_used: bool,
    radio_silent: bool,
) -> list[str]:
    """The checks before arming that fail, in the vehicle's words."""
    failing = [] if booted else ["Mode not armable"]
    failing += ["Hardware safety switch"] if safety_on else []
    if failing or checks_skipped(parameters):
        return failing
    if not position_used:
        failing.append("Need Position Estimate")
    waits = not rc.receiver and rc.streamed_ns(t_ns) < OVERRIDES_BEFORE_ARMING_NS
    if radio_silent or (waits and parameters["FS_THR_ENABLE"] != 0.0):
        failing.append("Radio failsafe on")
    return failing + _motor_faults(frozenset(parameters.functions))


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


def sticks_out(
    t_ns: int, rc: RcInputs, channels: tuple[int, int], sticks: tuple[float, float], *, by_rudder: bool
) -> list[str]:
    """Sticks that are not neutral at the attempt to arm; the one that arms is excused, and old input is no input.

    `channels` are those of the two sticks that drive, `sticks` where these stand, in [-1, 1].
    """
    if not rc.seen or not rc.alive(t_ns, INPUT_NS):
        return []
    out = [f"Roll (RC{channels[0]}) is not neutral"] if sticks[0] != 0.0 and not by_rudder else []
    yaw_us = rc.radio_us[YAW_CHANNEL - 1]
    if yaw_us and abs(yaw_us - NEUTRAL_US) > YAW_DEAD_ZONE_US:
        out.append(f"Yaw (RC{YAW_CHANNEL}) is not neutral")
    return out + ([f"Throttle (RC{channels[1]}) is not neutral"] if sticks[1] != 0.0 else [])


class RudderWatch:
    """ARMING_RUDDER: the steering stick, which PILOT_STEER_TYPE 1 makes the port motor's, at full right for 2 s."""

    def __init__(self) -> None:
        self._since_ns: int | None = None

    def asks(self, t_ns: int, sticks: tuple[float, float]) -> bool:
        """Whether the first stick asks for arming now; the second, the throttle, must be in its trim."""
        if not (sticks[0] > FULL_RIGHT and sticks[1] == 0.0):
            self._since_ns = None
            return False
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        if t_ns - self._since_ns < RUDDER_NS:
            return False
        self._since_ns = None
        return True
