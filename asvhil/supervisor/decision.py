"""What the supervisor is asked, and what it decides: the record between a tick's situation and its commands."""

from __future__ import annotations

from asvhil.supervisor.reasons import Explanation
from asvhil.types import (
    CourseCommand,
    HeadingCommand,
    HoldCommand,
    LeaderMessage,
    MoveCommand,
    NeutralCommand,
    Note,
    Phase,
    ReleaseCommand,
    Station,
    record,
)

Request = HoldCommand | MoveCommand | CourseCommand | LeaderMessage | HeadingCommand | NeutralCommand | ReleaseCommand


@record
class Decision:
    """What this tick may do with the motors, why, and the answers to what was asked.

    `drive`: the controller's command. `neutral`: neutral pulses. `release`: give the channels back, after the
    neutral pulses where both are set. With none of them say nothing. `prepare` asks for mode and arming (simulation
    only), `ask_mode` for a mode alone.
    `answers`: for each request in turn None where it is granted, or why not; `begun`: a hold was granted.
    `station` is that of the boat's origin, None while none is held; `point`: where the point of the boat that is kept
    there (`supervisor.point_m`) shall be, which is what operators say and are told. `station_changed`: it is another
    one than in the last tick, and not the same that has turned with the weather, or has moved on its course or by
    centimetres.
    `control_ok`: the latest solution, but for that of this tick, could be used. `link_ok`: the autopilot is heard.
    """

    phase: Phase
    why: Explanation
    station: Station | None
    point: Station | None = None
    station_changed: bool = False
    answers: tuple[Explanation | None, ...] = ()
    begun: bool = False
    drive: bool = False
    neutral: bool = False
    release: bool = False
    prepare: bool = False
    ask_mode: str | None = None
    heading_policy: str = "fixed"
    course: CourseCommand | None = None
    notes: tuple[Note, ...] = ()
    link_ok: bool = False
    control_ok: bool = True
