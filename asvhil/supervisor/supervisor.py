"""When the motors are taken and when they are given back: engagement, the pilot's precedence, and the fail-safes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from asvhil.config import SupervisorConfig
from asvhil.supervisor.arming_help import ArmingHelp
from asvhil.supervisor.conditions import Conditions
from asvhil.supervisor.decision import Decision, Request
from asvhil.supervisor.disarmed import BY_ITSELF, Aftermath, cause_of_end
from asvhil.supervisor.heading_policy import HeadingPolicy
from asvhil.supervisor.leader_report import LeaderReport
from asvhil.supervisor.mode_request import ModeRequest
from asvhil.supervisor.pilot_watch import PilotWatch
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.station_motion import AT_REST, Going, StationMotion
from asvhil.supervisor.stations import (
    is_another,
    is_turned,
    station_of_config,
    station_of_hold,
    station_of_move,
    station_of_origin,
    too_far,
)
from asvhil.types import (
    CourseCommand,
    Estimate,
    FrontseatStatus,
    HeadingCommand,
    HoldCommand,
    LeaderMessage,
    MoveCommand,
    NeutralCommand,
    Phase,
    ReleaseCommand,
    Station,
    changed,
)

RELEASE_REPEATS = 3  # datagrams get lost
NEUTRAL_ALONE = 2  # ticks of neutral before a release, where the last override stands: it must be neutral by then
PILOT_FIRST_NS = 1_000_000_000  # a hold command that comes so soon was sent before its sender knew
# Why neutral is sent no longer to a boat that is to be armed: somebody else has its sticks.
THEIRS = (Reason.TRANSMITTER_HEARD, Reason.MODE_CHANGED, Reason.OVERRIDE_NOT_FOLLOWED, Reason.STICK_MOVED)
SETS_OFF_NS = 1_200_000_000  # from the begin of a course on, until the weather is known for a boat in that motion
SETS_OFF_MPS = 0.1  # less of a change of the boat's motion is no other weather
NAMED_LATER_NS = 10_000_000_000  # after a hold has ended for what another vehicle said, until that is known for another


class Supervisor:
    """The state machine of engagement, and the one holder of the station.

    Whoever is in doubt lets go: only a new command takes the motors again.
    """

    def __init__(
        self,
        config: SupervisorConfig,
        *,
        overrides_sticks: bool = True,
        fastest_mps: float = math.inf,
        weak_astern: bool = True,
    ) -> None:
        """`overrides_sticks`: the motor commands stand in the place of the pilot's, and show as such in RC_CHANNELS.

        `fastest_mps`: of a station that the boat can follow. `weak_astern`: its motors give less thrust astern.
        """
        self._config = config
        self._pilot = PilotWatch(config, overrides_sticks=overrides_sticks)
        self._phase = Phase.STANDBY
        self._why = explain(Reason.WAITING_FOR_HOLD)
        self._station: Station | None = None
        self._heading = HeadingPolicy(config.heading, weak_astern=weak_astern)
        self._motion = StationMotion(config.moving, fastest_mps)
        self._going: Going = AT_REST  # what the station went after when that changed last,
        self._going_ns: int | None = None  # and when that was, until the heading has begun anew for it
        self._conditions = Conditions(config)
        self._named_m = 0.0  # by the last hold command: how far off a station may be
        self._auto_pending = config.engage == "auto"
        self._failing_since_ns: int | None = None
        self._release_left = 0
        self._neutral_first = False
        self._keeps_override = False  # by the autopilot, after its end
        self._control_failed = False
        self._mode = ModeRequest(config.control_mode, config.take_mode_timeout_s)
        self._next_station: Station | None = None  # to be held once the control mode stands
        self._arming_help = ArmingHelp(config, self._pilot, overrides_sticks=overrides_sticks)
        self._stopped = False  # by the operator: neutral is sent, and no station is held
        self._just_taken = False  # the motors, in this tick
        self._pilot_ns: int | None = None  # when the pilot took the boat last
        # A hold has ended, or a set-point that asked for one was refused: a stream of set-points that comes again after
        # a gap is no decision to take the boat, which the pilot may have by now.
        self._commands_only = False
        self._ended_ns: int | None = None  # when the last hold ended unasked, while that is the reason to stand by
        self._aftermath = Aftermath(None)

    def step(self, situation: Situation, requests: Sequence[Request] = ()) -> Decision:
        """The decision of this tick: the requests in turn, then what has become of engagement in this situation."""
        self._just_taken = False
        self._carry_on(situation)
        station_before, was_held = self._held, self._phase in (Phase.HOLD, Phase.FAILSAFE)
        if situation.sent is not None:
            self._pilot.note_sent(situation.sent)
        self._keeps_override = situation.status is not None and situation.status.keeps_override
        if situation.control_ok is not None:
            self._control_failed = not situation.control_ok
        answers = tuple([self._answer(request, situation) for request in requests])
        if self._phase in (Phase.STANDBY, Phase.PREPARE) and self._auto_pending:
            self._prepare(situation)
        self._go_on(situation)
        self._name_the_end(situation, was_held=was_held)
        begun = bool(requests) and any(
            isinstance(r, HoldCommand) and a is None for r, a in zip(requests, answers, strict=True)
        )
        asked_for = self._held
        if asked_for is None or station_before is None or asked_for is station_before:
            station_changed = turned = asked_for is not station_before
        else:
            station_changed, turned = is_another(asked_for, station_before), is_turned(asked_for, station_before)
        self._turn(situation, anew=self._has_set_off(situation.t_ns) or begun or turned)
        held = self._held
        releasing = self._phase is Phase.STANDBY and self._release_left > 0
        neutral_alone = self._release_left > RELEASE_REPEATS
        self._release_left -= releasing
        link_ok = self._conditions.link_ok(situation)
        mode = situation.status.mode if situation.status and link_ok else None
        return Decision(
            phase=self._phase,
            why=self._why,
            station=None if held is None else station_of_origin(held, self._config.point_m),
            point=held,
            station_changed=station_changed,
            answers=answers,
            begun=begun,
            drive=self._phase is Phase.HOLD,
            neutral=self._phase in (Phase.PREPARE, Phase.FAILSAFE) or (releasing and self._neutral_first),
            release=releasing and not neutral_alone,
            prepare=self._phase is Phase.PREPARE and self._auto_pending,
            ask_mode=self._mode.advance(situation.t_ns, mode),
            heading_policy=self._heading.policy,
            course=self._motion.course,
            notes=self._motion.notes(held),
            link_ok=link_ok,
            control_ok=not self._control_failed,
        )

    @property
    def _held(self) -> Station | None:
        """The station that is held, of the point of the boat that is kept there."""
        return self._station if self._phase in (Phase.HOLD, Phase.FAILSAFE) else None

    def _carry_on(self, situation: Situation) -> None:
        """Move the station that is held on its course, or after its leader."""
        held, frame = self._held, situation.frame
        if held is None or frame is None:
            return
        at, steered = self._conditions.place(situation), self._phase is Phase.HOLD
        boat_m = (at.n_m, at.e_m) if at is not None and at.valid and steered else None
        outside = self._conditions.outside
        self._station = self._motion.step(situation.t_ns, held, boat_m, lambda after: outside(after, frame))

    def _has_set_off(self, t_ns: int) -> bool:
        """Whether a course has begun, changed or ended, so that the weather of the boat's motion is another at once.

        A station that waits for its boat, or for its leader, does not set off anew, nor does one whose velocity changes
        by little; what changes while the weather of the last change is waited for is looked at after that.
        """
        going = self._motion.going
        if self._going_ns is None and _is_other(going, self._going):
            self._going, self._going_ns = going, t_ns
        if self._going_ns is None or self._held is None:
            return False
        if self._held.moves != (going != AT_REST):
            self._going_ns = t_ns
        if t_ns - self._going_ns < SETS_OFF_NS:
            return False
        self._going_ns = None
        return True

    def _turn(self, situation: Situation, *, anew: bool) -> None:
        """Turn the station that is held as its heading policy says; `anew`: its heading or its weather is another."""
        held = self._held
        if held is None:
            return
        if anew:
            self._heading.begin()
        at = situation.estimate
        boat_rad = at.psi_rad if at is not None and at.valid else None
        push_mps2 = situation.bow_push_mps2
        self._station = self._heading.turned(situation.t_ns, held, situation.bow_rad, boat_rad, push_mps2)

    def _hidden(self, situation: Situation) -> int | None:
        """The channel of a stick that cannot be seen, and so not obeyed."""
        return None if situation.status is None else self._pilot.hidden(situation.status)

    # --- requests ------------------------------------------------------------------------------------------

    def _answer(self, request: Request, situation: Situation) -> Explanation | None:
        """Do what is asked for. Returns None, or why not."""
        match request:
            case HoldCommand():
                refusal = self._hold(request, situation)
                if refusal is None:
                    self._commands_only = False
                elif request.by_setpoint and self._held is None:
                    self._commands_only = True
                return refusal
            case MoveCommand():
                return self._move(request, situation)
            case CourseCommand():
                return self._motion.choose(request) if self._held is not None else explain(Reason.NO_STATION_HELD)
            case LeaderMessage():
                self._lead(request, situation)
                return None
            case HeadingCommand():
                self._heading.choose(request.policy)
                return None
            case NeutralCommand():
                return self._stop(situation)
            case ReleaseCommand():  # always granted
                self._auto_pending = False
                self._commands_only = True
                self._aftermath.acted = True
                if self._phase is not Phase.STANDBY:
                    self._let_go(explain(Reason.RELEASED), neutral_first=True, give_back_ns=request.t_ns)
                return None

    def _hold(self, command: HoldCommand, situation: Situation) -> Explanation | None:
        """Take up a station. Returns None, or why not."""
        self._go_on(situation)  # what the pilot does in this tick comes before what is asked for in it
        if command.by_setpoint and self._commands_only and self._held is None:
            return explain(Reason.NOT_BY_SETPOINT)
        refusal = self._conditions.why_not(situation, situation.fault, self._hidden(situation)) or situation.slow
        pilot_first = self._pilot_ns is not None and situation.t_ns - self._pilot_ns < PILOT_FIRST_NS
        if refusal is None and pilot_first:
            refusal = explain(Reason.PILOT_FIRST)
        if refusal is not None and refusal.reason is Reason.NOT_ARMED and not pilot_first:
            refusal = self._help_arming(command.t_ns, situation.status) or refusal
        if refusal is not None:
            return refusal
        status, estimate, frame = situation.status, self._conditions.place(situation), situation.frame
        assert status is not None and estimate is not None and frame is not None
        station = station_of_hold(command, estimate, frame)
        refusal = self._too_far(station, estimate, command.within_m) or self._conditions.outside(station, frame)
        if refusal is None and command.by_setpoint and self._held is None:
            refusal = self._pilot.steers(status, situation.station_sticks)
        if refusal is not None:
            return refusal
        self._named_m = command.within_m
        if status.mode != self._config.control_mode:
            self._take_mode(command.t_ns, station, status)
        else:
            self._engage(command.t_ns, station, status)
            if command.velocity_mps is not None:
                self._motion.lead(_reported(command.t_ns, station, command.velocity_mps))
        return None

    def _too_far(self, station: Station, estimate: Estimate, named_m: float) -> Explanation | None:
        return too_far(station, estimate, self._config.max_distance_m, named_m)

    def _lead(self, message: LeaderMessage, situation: Situation) -> None:
        """Take in where the leader is, if the station that is held is to follow that one."""
        held, estimate, frame = self._held, self._conditions.place(situation), situation.frame
        if held is None or estimate is None or frame is None:
            return
        if not self._motion.leader or message.system_id != self._motion.leader:
            return
        n_m, e_m = frame.to_ned(message.lat_deg, message.lon_deg)

        def why_not(place: tuple[float, float]) -> Explanation | None:
            station = changed(held, n_m=place[0], e_m=place[1])
            return self._too_far(station, estimate, self._named_m) or self._conditions.outside(station, frame)

        at = changed(held, n_m=n_m, e_m=e_m)
        refusal = self._motion.report(_reported(message.t_ns, at, message.velocity_mps), why_not)
        if refusal is not None:
            self._motion.refuse(message.t_ns, refusal)

    def _move(self, command: MoveCommand, situation: Situation) -> Explanation | None:
        """Move the station that is held. Returns None, or why not."""
        held, estimate, frame = self._held, self._conditions.place(situation), situation.frame
        if held is None or estimate is None or frame is None:
            return explain(Reason.NO_STATION_HELD)
        if held.of_weather and command.psi_rad is not None:
            if command.turns_alone:
                return explain(Reason.HEADING_OF_WEATHER, policy=self._heading.policy)
            command = changed(command, psi_rad=None)  # the place of a set-point counts all the same
        station = station_of_move(command, held, frame)
        refusal = self._too_far(station, estimate, self._named_m) or self._conditions.outside(station, frame)
        if refusal is not None:
            return refusal
        if command.velocity_mps is None:
            self._motion.rest()
            self._station = station
            return None
        refusal = self._motion.lead(_reported(command.t_ns, station, command.velocity_mps))
        if refusal is None:
            self._station = changed(held, psi_rad=station.psi_rad)
        return refusal

    def _stop(self, situation: Situation) -> Explanation | None:
        """Neutral in the place of all that was going on. Returns None, or why not: what others have is not taken."""
        self._go_on(situation)
        self._auto_pending = False
        self._commands_only = True
        if self._phase is Phase.STANDBY:
            return explain(Reason.NOTHING_TO_STOP)
        if self._phase is Phase.PREPARE and not self._stopped and situation.status is not None:
            self._just_taken = True
            self._pilot.begin(situation.t_ns, situation.status)
        self._phase, self._why = Phase.PREPARE, explain(Reason.STOPPED)
        self._stopped = True
        self._next_station = None
        self._arming_help.end()
        self._mode.forget()  # what was going on before the hold shall not go on by itself either
        return None

    def _help_arming(self, t_ns: int, status: FrontseatStatus | None) -> Explanation | None:
        """Send neutral to a boat that is armed with nothing else; what to do meanwhile, None where it is not one."""
        idle = self._phase is Phase.STANDBY or self._arming_help.active
        if status is None or not (idle and self._arming_help.suits(status)):
            return None
        self._phase, self._why = Phase.PREPARE, explain(Reason.SENDING_NEUTRAL)
        self._auto_pending = False
        self._mode.forget()
        return self._arming_help.begin(t_ns, status)

    # --- each tick -----------------------------------------------------------------------------------------

    def _go_on(self, situation: Situation) -> None:
        """What has become of a hold, or of the attempt to begin one, that was there already."""
        if self._next_station is not None:
            self._await_mode(situation)
        if self._arming_help.active:
            self._await_arming(situation)
        if self._stopped:
            self._watch_stopped(situation)
        if self._phase in (Phase.HOLD, Phase.FAILSAFE):
            self._watch(situation)

    def _prepare(self, situation: Situation) -> None:
        """engage: auto. Wait for readiness, ask for mode and arming with neutral sticks, then hold, once."""
        status, frame = situation.status, situation.frame
        hidden = self._hidden(situation)
        why_not = situation.stranger or situation.fault
        if why_not is None and hidden is not None:
            why_not = explain(Reason.STICK_HIDDEN, channel=hidden)
        if why_not is not None:
            self._wait(why_not)
            return
        ready = status is not None and self._conditions.link_ok(situation) and status.ready
        located = situation.estimate is not None and situation.estimate.valid
        if status is None or frame is None or not ready or not located:
            self._wait(explain(Reason.WAITING_FOR_AUTOPILOT))
            return
        if not status.armed or status.mode != self._config.control_mode:
            self._mode.note(status.mode)
            self._phase = Phase.PREPARE
            self._why = explain(Reason.TAKING_MODE_AND_ARMING, mode=self._config.control_mode)
            return
        at = self._config.station
        assert at is not None  # held by the config's validation
        station = station_of_config(at, frame)
        outside = self._conditions.outside(station, frame) or self._conditions.left_fence(situation)
        if outside is not None:
            self._wait(outside)
            return
        self._engage(situation.t_ns, station, status)
        course = CourseCommand(t_ns=situation.t_ns, speed_mps=at.speed_mps, course_rad=math.radians(at.course_deg))
        refusal = self._motion.choose(course)
        if refusal is not None:
            self._motion.refuse_course(refusal)

    def _wait(self, why: Explanation) -> None:
        """Not yet, or no longer, on the way to a hold by itself."""
        if self._phase is Phase.PREPARE:
            self._release_left = RELEASE_REPEATS
        self._phase, self._why = Phase.STANDBY, why

    def _take_mode(self, t_ns: int, station: Station, status: FrontseatStatus) -> None:
        """Ask for the control mode, with neutral sticks, before the motors are driven."""
        self._phase, self._why = Phase.PREPARE, explain(Reason.TAKING_MODE, mode=self._config.control_mode)
        self._next_station = station
        self._stopped = False
        self._arming_help.end()
        self._auto_pending = False
        self._mode.take(t_ns, status.mode)

    def _await_arming(self, situation: Situation) -> None:
        """Go on sending neutral while the boat waits to be armed, and for the hold command after that."""
        alive = situation.status is not None and self._conditions.link_ok(situation)
        failure = self._arming_help.failure(situation) if alive else explain(Reason.NO_HEARTBEAT)
        if failure is not None:
            theirs = failure.reason in THEIRS
            if theirs:
                self._pilot_ns = situation.t_ns
            self._let_go(failure, neutral_first=not theirs)

    def _await_mode(self, situation: Situation) -> None:
        """Hold once the mode that was asked for stands; give up where something has changed, or after a while."""
        status = situation.status
        # A fault of the outputs is none yet: they follow once the mode stands.
        refusal = self._conditions.why_not(situation, None, self._hidden(situation))
        if refusal is not None:
            self._let_go(refusal, neutral_first=True)
            return
        assert status is not None  # else it was refused
        failure = self._pilot.station_stick(status, situation.station_sticks) or self._mode.failure(
            situation.t_ns, status.mode
        )
        if failure is not None:
            if failure.reason is not Reason.MODE_NOT_ENTERED:
                self._pilot_ns = situation.t_ns
            self._let_go(failure)
        elif status.mode == self._config.control_mode:
            assert self._next_station is not None
            self._engage(situation.t_ns, self._next_station, status)

    def _watch_stopped(self, situation: Situation) -> None:
        """Go on sending neutral while the pilot leaves the motors to us and the autopilot is heard."""
        if self._is_ended(situation):
            return
        lost = self._conditions.unheard(situation)
        if lost is not None:
            self._let_go(lost, neutral_first=True)

    def _is_ended(self, situation: Situation) -> bool:
        """Whether the pilot has taken the boat, or something that does not pass has given it back."""
        t_ns, status = situation.t_ns, situation.status
        # Those that came before the motors were taken say nothing of what the pilot wants now.
        passed = () if self._just_taken else situation.statuses
        act: Explanation | None = None
        for one in (*passed[:-1], status):
            act = self._pilot.act(one, situation.station_sticks)
            if act is not None:
                break
        if act is None and status is not None and self._conditions.is_transmitter_lost(status):
            self._let_go(explain(Reason.TRANSMITTER_LOST), neutral_first=True)
            return True
        if act is not None:
            by_itself = act.reason in BY_ITSELF
            self._pilot_ns = self._pilot_ns if by_itself else t_ns
            # Where the station's messages and ours set the same channels, ours would stand until its next one. And what
            # nobody has taken is left at neutral: it may be armed again.
            self._let_go(act, neutral_first=by_itself or act.reason is Reason.STATION_STICK)
            return True
        ends = situation.stranger or self._conditions.lost_station(situation) or situation.fault or situation.motion
        ends = ends or self._conditions.left_fence(situation)
        if ends is not None:
            if ends.reason is Reason.SCRIPT_LET_GO:  # by the pilot's act, which it sees first
                self._pilot_ns = t_ns
            self._let_go(ends, neutral_first=True)
            return True
        taken = self._pilot.sticks_taken(t_ns, status)
        if taken is not None:
            self._pilot_ns = t_ns
            unverified = situation.unverified
            ignored = unverified is not None and taken.reason is Reason.OVERRIDE_NOT_FOLLOWED
            self._let_go(unverified if ignored and unverified is not None else taken, neutral_first=ignored)
        return taken is not None

    def _watch(self, situation: Situation) -> None:
        """Go on holding while the pilot leaves the motors to us and nothing fails."""
        if self._is_ended(situation):
            return
        failure = self._failing(situation)
        if failure is None:
            if self._phase is Phase.FAILSAFE:
                self._phase, self._why = Phase.HOLD, explain(Reason.HOLDING)
            self._failing_since_ns = None
            return
        if self._failing_since_ns is None:
            self._failing_since_ns = situation.t_ns
        elif failure.reason is self._why.reason and "hint" in dict(self._why.detail):
            failure = self._why  # the sensor that was missing first is the cause, and told once
        if (situation.t_ns - self._failing_since_ns) * 1e-9 >= self._config.failsafe_neutral_s:
            self._let_go(failure, neutral_first=True)
            return
        self._phase, self._why = Phase.FAILSAFE, failure

    def _name_the_end(self, situation: Situation, *, was_held: bool) -> None:
        """A second vehicle may end a hold by what it says of itself, before it is known for another one.

        Its heartbeat that says "disarmed" could be the pilot's word, and is not waited on; the reason follows. So does
        that of an autopilot that has disarmed by itself or rebooted, which may tell why after its outputs have stopped;
        not once a person has acted, who may have rebooted it.
        """
        if self._phase is not Phase.STANDBY or self._why.reason is Reason.RELEASED:
            self._ended_ns = None
            return
        if was_held:
            self._ended_ns, self._aftermath = situation.t_ns, Aftermath(situation.status)
        if self._ended_ns is None:
            return
        self._aftermath.note(situation.status)
        if not self._aftermath.acted:
            self._why = cause_of_end(self._why, situation.t_ns - self._ended_ns, situation.status) or self._why
        if situation.stranger is None:
            return
        if situation.t_ns - self._ended_ns <= NAMED_LATER_NS:
            self._why = situation.stranger
        self._ended_ns = None

    def _failing(self, situation: Situation) -> Explanation | None:
        """What is missing to steer by."""
        unheard = self._conditions.unheard(situation)
        if unheard is not None:
            return unheard
        if situation.estimate is None or not situation.estimate.valid:
            return explain(Reason.ESTIMATE_STALE, hint=situation.lacks)
        if self._control_failed:
            return explain(Reason.NO_SOLUTION)
        return None

    def _engage(self, t_ns: int, station: Station, status: FrontseatStatus) -> None:
        self._phase, self._why = Phase.HOLD, explain(Reason.HOLDING)
        self._station = station
        self._motion.begin()
        self._stopped = self._commands_only = False
        self._next_station = None
        self._arming_help.end()
        self._mode.taken()
        self._failing_since_ns = None
        self._control_failed = False
        self._just_taken = True
        self._pilot.begin(t_ns, status)

    def _let_go(self, why: Explanation, *, neutral_first: bool = False, give_back_ns: int | None = None) -> None:
        """Stand by and give the motors back; a pilot who takes them gets them without a message of ours in between.

        But for an autopilot without a receiver, on which the last override stands after its release: it gets neutral
        first, or the motors would run on. Sent in one go with the release, neutral would have no effect.
        The autopilot's mode goes back only where that is asked for: after a failure the boat must not drive on by
        itself, and a pilot's choice stands.
        """
        self._phase, self._why = Phase.STANDBY, why
        self._auto_pending = False
        self._commands_only = True
        self._stopped = False
        self._next_station = None
        self._arming_help.end()
        if give_back_ns is None:
            self._mode.forget()
        else:
            self._mode.give_back(give_back_ns)
        self._release_left = RELEASE_REPEATS + (NEUTRAL_ALONE if self._keeps_override else 0)
        self._neutral_first = neutral_first or self._keeps_override


def _is_other(going: Going, before: Going) -> bool:
    """Whether a station goes so differently that the weather of the boat's motion is another."""
    if going == before:
        return False
    return going[2] != before[2] or math.hypot(going[0] - before[0], going[1] - before[1]) > SETS_OFF_MPS


def _reported(t_ns: int, station: Station, velocity_mps: tuple[float, float]) -> LeaderReport:
    """Where a station is at a time, with its velocity."""
    return LeaderReport(t_ns=t_ns, n_m=station.n_m, e_m=station.e_m, vn_mps=velocity_mps[0], ve_mps=velocity_mps[1])
