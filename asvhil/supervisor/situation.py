"""What a tick is decided by: one record of all that is known of the boat, its autopilot and its motors."""

from __future__ import annotations

import math

from asvhil.geo import LocalFrame
from asvhil.supervisor.reasons import Explanation
from asvhil.types import Estimate, FrontseatStatus, record


@record
class MotorPulses:
    """What was sent to both motors, and when; `sticks_us` is where it put their sticks, where it overrides those."""

    t_ns: int
    us: tuple[int, int]
    sticks_us: tuple[int, int] | None = None


@record
class StationSticks:
    """What a ground station, (system id, component id), says of its sticks: (channel from 1, us) of those it moves.

    `motors_us` is what the two that drive command (port, starboard), in pulses of `vehicle.pwm`; None unless it moves
    both.
    """

    t_ns: int
    sender: tuple[int, int]
    channels: tuple[tuple[int, int], ...]
    motors_us: tuple[int, int] | None = None


@record
class Situation:
    """None: not known, or not yet.

    `status` is the last of the autopilot's so far, `statuses` are those that came in this tick: a pilot may have taken
    the boat and given it back between two ticks, above all where a late link hands on all at once.
    `heartbeat_age_s`: since the autopilot told its mode and arming; `heard_age_s`: since it told anything, where None
    since its heartbeat. `stranger`: why the vehicle on the link is not ours to drive.
    `slow`: what comes too slowly to begin a hold, while it is being asked for again.
    `fault`: why the motors do not, or would not, follow the commands. `unverified`: what it means if the motors' sticks
    do not show our commands; None once they have, for then somebody else has them. `motion`: why a boat that is held
    does not move as it is told to. `lacks`: which sensors the estimate does without, and why. `control_ok`: whether the
    solution of the last tick can be used; None where there was none. `sent`: what the last tick sent to the motors.
    `station_age_s`: since anything was heard of the pilot's ground station; None: never. `station_sticks`: what was
    heard, since the last tick, of sticks of ground stations that the autopilot obeys. `bow_rad`: the heading with the
    mean force of the weather on the bow, and that force over the boat's mass there.
    """

    t_ns: int
    status: FrontseatStatus | None = None
    statuses: tuple[FrontseatStatus, ...] = ()
    heartbeat_age_s: float | None = None
    heard_age_s: float | None = None
    stranger: Explanation | None = None
    estimate: Estimate | None = None
    frame: LocalFrame | None = None
    slow: Explanation | None = None
    fault: Explanation | None = None
    unverified: Explanation | None = None
    motion: Explanation | None = None
    lacks: str = ""
    control_ok: bool | None = None
    sent: MotorPulses | None = None
    station_age_s: float | None = None
    station_sticks: tuple[StationSticks, ...] = ()
    bow_rad: float | None = None
    bow_push_mps2: float = math.inf
