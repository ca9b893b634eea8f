"""When the motors are taken and when they are given back: engagement, the pilot's precedence, and the fail-safes."""

from __future__ import annotations

from asvhil.config import PwmConfig, SupervisorConfig
from asvhil.supervisor.mode_request import ModeRequest
from asvhil.supervisor.pilot_watch import PilotWatch
from asvhil.supervisor.situation import Situation
from asvhil.supervisor.stations import station_of_command, station_of_config
from asvhil.types import FrontseatStatus, HoldCommand, Phase, ReleaseCommand, Station, record

RELEASE_REPEATS = 3  # datagrams get lost


@record
class Decision:
    """What this tick may do with the motors.

    `drive`: the controller's command. `neutral`: neutral pulses. `release`: give the channels back, after the
    neutral pulses where both are set. With none of them say nothing. `prepare` asks for mode and arming (simulation
    only), `ask_mode` for a mode alone.
    """

    phase: Phase
    station: Station | None
    reason: str
    drive: bool = False
    neutral: bool = False
    release: bool = False
    prepare: bool = False
    ask_mode: str | None = None


class Supervisor:
    """The state machine of engagement. Whoever is in doubt lets go: only a new command takes the motors again."""

    def __init__(self, config: SupervisorConfig, pwm: PwmConfig, *, overrides_sticks: bool = True) -> None:
        """`overrides_sticks`: the motor commands stand in the place of the pilot's, and show as such in RC_CHANNELS."""
        self._config = config
        self._pilot = PilotWatch(config, pwm, overrides_sticks=overrides_sticks)
        self._phase = Phase.STANDBY
        self._reason = "waiting for a hold command"
        self._station: Station | None = None
        self._auto_pending = config.engage == "auto"
        self._failing_since_ns: int | None = None
        self._release_left = 0
        self._neutral_first = False
        self._control_failed = False
        self._mode = ModeRequest(config.control_mode, config.take_mode_timeout_s)
        self._next_station: Station | None = None  # to be held once the control mode stands

    @property
    def control_ok(self) -> bool:
        """Whether the controller's latest solution was usable."""
        return not self._control_failed

    @property
    def station(self) -> Station | None:
        """The station that is held."""
        return self._station if self._phase in (Phase.HOLD, Phase.FAILSAFE) else None

    def link_ok(self, heartbeat_age_s: float | None) -> bool:
        """Whether the autopilot's heartbeat is recent."""
        return heartbeat_age_s is not None and heartbeat_age_s <= self._config.heartbeat_timeout_s

    # --- commands ------------------------------------------------------------------------------------------

    def on_hold(self, command: HoldCommand, known: Situation) -> str | None:
        """Take up a station. Returns None, or the reason why not."""
        if command.move_only:
            return self._move(command, known)
        refusal = self._why_not(known, known.fault)
        if refusal is not None:
            return refusal
        status, estimate, frame = known.status, known.estimate, known.frame
        assert status is not None and estimate is not None and frame is not None
        station = station_of_command(command, estimate, estimate, frame)
        if isinstance(station, str):
            return station
        if status.mode != self._config.control_mode:
            self._take_mode(command.t_ns, station, status)
        else:
            self._engage(command.t_ns, station, status)
        return None

    def on_release(self, command: ReleaseCommand) -> None:
        """Let go; always granted."""
        self._auto_pending = False
        if self._phase is not Phase.STANDBY:
            self._let_go(command.reason, neutral_first=True, give_back_ns=command.t_ns)

    def note_sent(self, t_ns: int, pulses_us: tuple[int, int]) -> None:
        """What was sent to the motors in this tick."""
        self._pilot.note_sent(t_ns, pulses_us)

    def note_control(self, ok: bool) -> None:
        """Whether the controller's latest solution can be used."""
        self._control_failed = not ok

    # --- each tick -----------------------------------------------------------------------------------------

    def step(self, known: Situation) -> Decision:
        """The decision of this tick from what is known now."""
        if self._phase in (Phase.STANDBY, Phase.PREPARE) and self._auto_pending:
            self._prepare(known)
        if self._next_station is not None:
            self._await_mode(known)
        if self._phase in (Phase.HOLD, Phase.FAILSAFE):
            self._watch(known)
        releasing = self._phase is Phase.STANDBY and self._release_left > 0
        self._release_left -= releasing
        mode = known.status.mode if known.status and self.link_ok(known.heartbeat_age_s) else None
        return Decision(
            phase=self._phase,
            station=self.station,
            reason=self._reason,
            drive=self._phase is Phase.HOLD,
            neutral=self._phase in (Phase.PREPARE, Phase.FAILSAFE) or (releasing and self._neutral_first),
            release=releasing,
            prepare=self._phase is Phase.PREPARE and self._auto_pending,
            ask_mode=self._mode.asking(known.t_ns, mode),
        )

    def _prepare(self, known: Situation) -> None:
        """engage: auto. Wait for readiness, ask for mode and arming with neutral sticks, then hold, once."""
        if known.fault is not None:
            self._wait(known.fault)
            return
        status, frame = known.status, known.frame
        ready = status is not None and self.link_ok(known.heartbeat_age_s) and status.ready
        located = known.estimate is not None and known.estimate.valid
        if status is None or frame is None or not ready or not located:
            self._wait("waiting for the autopilot to be ready")
            return
        if not status.armed or status.mode != self._config.control_mode:
            self._mode.note(status.mode)
            self._phase, self._reason = Phase.PREPARE, f"asking for {self._config.control_mode} and arming"
            return
        at = self._config.station
        assert at is not None  # held by the config's validation
        self._engage(known.t_ns, station_of_config(at, frame), status)

    def _wait(self, reason: str) -> None:
        """Not yet, or no longer, on the way to a hold by itself."""
        if self._phase is Phase.PREPARE:
            self._release_left = RELEASE_REPEATS
        self._phase, self._reason = Phase.STANDBY, reason

    def _take_mode(self, t_ns: int, station: Station, status: FrontseatStatus) -> None:
        """Ask for the control mode, with neutral sticks, before the motors are driven."""
        self._phase, self._reason = Phase.PREPARE, f"asking for {self._config.control_mode}"
        self._station, self._next_station = None, station
        self._auto_pending = False
        self._release_left = 0
        self._mode.take(t_ns, status.mode)

    def _await_mode(self, known: Situation) -> None:
        """Hold once the mode that was asked for stands; give up where something has changed, or after a while."""
        status = known.status
        refusal = self._why_not(known, None)  # outputs follow once the mode stands
        if status is None or refusal is not None:
            self._let_go(refusal or "", neutral_first=True)
            return
        failure = self._mode.failure(known.t_ns, status.mode)
        if failure is not None:
            self._let_go(failure)
        elif status.mode == self._config.control_mode:
            assert self._next_station is not None
            self._engage(known.t_ns, self._next_station, status)

    def _watch(self, known: Situation) -> None:
        """Go on holding while the pilot leaves the motors to us and nothing fails."""
        t_ns = known.t_ns
        pilot = self._pilot.acts(known.status)
        if pilot is not None:
            self._let_go(pilot)
            return
        if known.fault is not None:
            self._let_go(known.fault, neutral_first=True)
            return
        taken = self._pilot.sticks_taken(t_ns, known.status)
        if taken is not None:
            self._let_go(taken if known.unheard is None else known.unheard, neutral_first=known.unheard is not None)
            return
        failure = self._failing(known)
        if failure is None:
            if self._phase is Phase.FAILSAFE:
                self._phase, self._reason = Phase.HOLD, "holding"
            self._failing_since_ns = None
            return
        if self._failing_since_ns is None:
            self._failing_since_ns = t_ns
        if (t_ns - self._failing_since_ns) * 1e-9 >= self._config.failsafe_neutral_s:
            self._let_go(f"{failure}: released", neutral_first=True)
            return
        self._phase, self._reason = Phase.FAILSAFE, failure

    def _failing(self, known: Situation) -> str | None:
        """What is missing to steer by."""
        if not self.link_ok(known.heartbeat_age_s):
            return "autopilot heartbeat lost"
        if known.estimate is None or not known.estimate.valid:
            return "position or heading is stale"
        if self._control_failed:
            return "the controller found no solution"
        return None

    def _why_not(self, known: Situation, fault: str | None) -> str | None:
        """Why a hold cannot begin; `fault`: of the motors, where it counts."""
        status = known.status
        if status is None or not self.link_ok(known.heartbeat_age_s):
            return "no heartbeat from the autopilot"
        if fault is not None:
            return fault
        if not status.armed:
            return "vehicle is not armed"
        if status.mode != self._config.control_mode and not self._config.take_mode:
            return f"mode is {status.mode}, {self._config.control_mode} is needed"
        if known.estimate is None or not known.estimate.valid:
            return "no valid position and heading yet"
        return None

    def _move(self, command: HoldCommand, known: Situation) -> str | None:
        """Move the station that is held. Returns None, or the reason why not."""
        held = self.station
        if held is None or known.estimate is None or known.frame is None:
            return "no station is held: a stream of set-points only moves one, and takes none after a release"
        station = station_of_command(command, held, known.estimate, known.frame)
        if isinstance(station, str):
            return station
        self._station = station
        return None

    def _engage(self, t_ns: int, station: Station, status: FrontseatStatus) -> None:
        self._phase, self._reason = Phase.HOLD, "holding"
        self._station = station
        self._auto_pending = False
        self._next_station = None
        self._mode.taken()
        self._failing_since_ns = None
        self._control_failed = False
        self._release_left = 0
        self._pilot.begin(t_ns, status)

    def _let_go(self, reason: str, *, neutral_first: bool = False, give_back_ns: int | None = None) -> None:
        """Stand by and give the motors back; a pilot who takes them gets them without a word of ours in between.

        The autopilot's mode goes back only where that is asked for: after a failure the boat must not drive on by
        itself, and a pilot's choice stands.
        """
        self._phase, self._reason = Phase.STANDBY, reason
        self._station = None
        self._auto_pending = False
        self._next_station = None
        if give_back_ns is None:
            self._mode.forget()
        else:
            self._mode.give_back(give_back_ns)
        self._failing_since_ns = None
        self._release_left = RELEASE_REPEATS
        self._neutral_first = neutral_first
