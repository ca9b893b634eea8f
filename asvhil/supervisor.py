"""When the motors are taken and when they are given back: engagement, the pilot's precedence, and the fail-safes."""

from __future__ import annotations

import math
from collections import deque

from asvhil.config import PwmConfig, SupervisorConfig
from asvhil.geo import LocalFrame
from asvhil.mode_keeper import ModeKeeper
from asvhil.types import (
    Estimate,
    FrontseatStatus,
    HoldCommand,
    Phase,
    ReleaseCommand,
    Station,
    record,
)

MAX_STATION_DISTANCE_M = 2000.0  # the local plane is good to a few centimetres within it
ECHO_TOLERANCE_US = 40  # dead zones of an autopilot bend small commands by up to 30 us
RELEASE_REPEATS = 3  # datagrams get lost
STICKS = (1, 2, 3, 4)


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
        self._motor_channels = (pwm.port_channel, pwm.starboard_channel) if overrides_sticks else ()
        # Where the sticks are the pilot's own, any movement of them is his.
        self._stick_channels = config.stick_channels if overrides_sticks else tuple({*STICKS, *config.stick_channels})
        self._echo_ns = round(config.override_echo_s * 1e9)
        self._phase = Phase.STANDBY
        self._reason = "waiting for a hold command"
        self._station: Station | None = None
        self._auto_pending = config.engage == "auto"
        self._engaged_ns = 0
        self._failing_since_ns: int | None = None
        self._failure = ""
        self._stick_baseline: dict[int, int] = {}
        self._sent: deque[tuple[int, tuple[int, int]]] = deque()
        self._release_left = 0
        self._neutral_first = False
        self._control_failed = False
        self._mode = ModeKeeper(config.control_mode, config.take_mode_timeout_s)
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

    def on_hold(
        self,
        command: HoldCommand,
        status: FrontseatStatus | None,
        heartbeat_age_s: float | None,
        estimate: Estimate | None,
        frame: LocalFrame | None,
        fault: str | None = None,
    ) -> str | None:
        """Take up a station. Returns None, or the reason why not; `fault`: why the motors would not do as told."""
        if command.move_only:
            return self._move(command, estimate, frame)
        refusal = self._why_not(status, heartbeat_age_s, estimate, fault)
        if refusal is not None:
            return refusal
        assert status is not None and estimate is not None and frame is not None
        station = self._station_of(command, estimate, frame)
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
        """Remember what was sent, to tell the echo of our override from the pilot's sticks."""
        self._sent.append((t_ns, pulses_us))
        horizon_ns = t_ns - 2 * self._echo_ns
        while self._sent and self._sent[0][0] < horizon_ns:
            self._sent.popleft()

    def note_control(self, ok: bool) -> None:
        """Whether the controller's latest solution can be used."""
        self._control_failed = not ok

    # --- each tick -----------------------------------------------------------------------------------------

    def step(
        self,
        t_ns: int,
        status: FrontseatStatus | None,
        heartbeat_age_s: float | None,
        estimate: Estimate | None,
        frame: LocalFrame | None,
        fault: str | None = None,
        unheard: str | None = None,
    ) -> Decision:
        """The decision of this tick from what is known now.

        `fault`: why the motors do not, or would not, do as told. `unheard`: what it means if the motors' sticks do not
        show our commands; None once they have, for then somebody else has them.
        """
        if self._phase in (Phase.STANDBY, Phase.PREPARE) and self._auto_pending:
            self._prepare(t_ns, status, heartbeat_age_s, estimate, frame, fault)
        if self._next_station is not None:
            self._await_mode(t_ns, status, heartbeat_age_s, estimate)
        if self._phase in (Phase.HOLD, Phase.FAILSAFE):
            self._watch(t_ns, status, heartbeat_age_s, estimate, fault, unheard)
        releasing = self._phase is Phase.STANDBY and self._release_left > 0
        self._release_left -= releasing
        return Decision(
            phase=self._phase,
            station=self.station,
            reason=self._reason,
            drive=self._phase is Phase.HOLD,
            neutral=self._phase in (Phase.PREPARE, Phase.FAILSAFE) or (releasing and self._neutral_first),
            release=releasing,
            prepare=self._phase is Phase.PREPARE and self._auto_pending,
            ask_mode=self._mode.asking(t_ns, status.mode if status and self.link_ok(heartbeat_age_s) else None),
        )

    def _prepare(
        self,
        t_ns: int,
        status: FrontseatStatus | None,
        heartbeat_age_s: float | None,
        estimate: Estimate | None,
        frame: LocalFrame | None,
        fault: str | None,
    ) -> None:
        """engage: auto. Wait for readiness, ask for mode and arming with neutral sticks, then hold, once."""
        linked = self.link_ok(heartbeat_age_s)
        if fault is not None:
            if self._phase is Phase.PREPARE:
                self._release_left = RELEASE_REPEATS
            self._phase, self._reason = Phase.STANDBY, fault
            return
        if status is None or not linked or not status.ready or estimate is None or not estimate.valid or frame is None:
            if self._phase is Phase.PREPARE:
                self._release_left = RELEASE_REPEATS
            self._phase, self._reason = Phase.STANDBY, "waiting for the autopilot to be ready"
            return
        if not status.armed or status.mode != self._config.control_mode:
            self._mode.note(status.mode)
            self._phase, self._reason = Phase.PREPARE, f"asking for {self._config.control_mode} and arming"
            return
        at = self._config.station
        assert at is not None  # held by the config's validation
        n_m, e_m = frame.to_ned(at.lat_deg, at.lon_deg)
        station = Station(n_m=n_m, e_m=e_m, psi_rad=math.radians(at.heading_deg))
        self._engage(t_ns, station, status)

    def _take_mode(self, t_ns: int, station: Station, status: FrontseatStatus) -> None:
        """Ask for the control mode, with neutral sticks, before the motors are driven."""
        self._phase, self._reason = Phase.PREPARE, f"asking for {self._config.control_mode}"
        self._station, self._next_station = None, station
        self._auto_pending = False
        self._release_left = 0
        self._mode.take(t_ns, status.mode)

    def _await_mode(
        self, t_ns: int, status: FrontseatStatus | None, heartbeat_age_s: float | None, estimate: Estimate | None
    ) -> None:
        """Hold once the mode that was asked for stands; give up where something has changed, or after a while."""
        refusal = self._why_not(status, heartbeat_age_s, estimate, None)  # outputs follow once the mode stands
        if status is None or refusal is not None:
            self._let_go(refusal or "", neutral_first=True)
            return
        failure = self._mode.failure(t_ns, status.mode)
        if failure is not None:
            self._let_go(failure)
        elif status.mode == self._config.control_mode:
            assert self._next_station is not None
            self._engage(t_ns, self._next_station, status)

    def _watch(
        self,
        t_ns: int,
        status: FrontseatStatus | None,
        heartbeat_age_s: float | None,
        estimate: Estimate | None,
        fault: str | None,
        unheard: str | None,
    ) -> None:
        pilot = self._pilot_acts(status)
        if pilot is not None:
            self._let_go(pilot)
            return
        if fault is not None:
            self._let_go(fault, neutral_first=True)
            return
        taken = self._sticks_taken(t_ns, status)
        if taken is not None:
            self._let_go(taken if unheard is None else unheard, neutral_first=unheard is not None)
            return
        failure = self._failing(heartbeat_age_s, estimate)
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

    def _pilot_acts(self, status: FrontseatStatus | None) -> str | None:
        """What the pilot has done to have the boat back; None while he has not."""
        if status is None:
            return None
        if not status.armed:
            return "disarmed"
        if status.mode != self._config.control_mode:
            return f"mode changed to {status.mode}"
        for channel, baseline_us in self._stick_baseline.items():
            now_us = _channel(status, channel)
            if now_us and abs(now_us - baseline_us) > self._config.stick_threshold_us:
                return f"stick of channel {channel} moved"
        return None

    def _sticks_taken(self, t_ns: int, status: FrontseatStatus | None) -> str | None:
        """Whether the motors' own sticks show something else than our commands: somebody else has the boat."""
        if status is None:
            return None
        told_ns = status.rc_ns or t_ns
        if told_ns - self._engaged_ns < self._echo_ns:
            return None  # the echo of the first overrides may still be on its way
        sent_us = [pulses for sent_ns, pulses in self._sent if told_ns - self._echo_ns <= sent_ns <= told_ns]
        for motor, channel in enumerate(self._motor_channels):
            now_us = _channel(status, channel)
            if not now_us or not sent_us:
                continue
            least_us, most_us = min(us[motor] for us in sent_us), max(us[motor] for us in sent_us)
            if not least_us - ECHO_TOLERANCE_US <= now_us <= most_us + ECHO_TOLERANCE_US:
                return f"channel {channel} does not follow the override"
        return None

    def _failing(self, heartbeat_age_s: float | None, estimate: Estimate | None) -> str | None:
        if not self.link_ok(heartbeat_age_s):
            return "autopilot heartbeat lost"
        if estimate is None or not estimate.valid:
            return "position or heading is stale"
        if self._control_failed:
            return "the controller found no solution"
        return None

    def _why_not(
        self,
        status: FrontseatStatus | None,
        heartbeat_age_s: float | None,
        estimate: Estimate | None,
        fault: str | None,
    ) -> str | None:
        if status is None or not self.link_ok(heartbeat_age_s):
            return "no heartbeat from the autopilot"
        if fault is not None:
            return fault
        if not status.armed:
            return "vehicle is not armed"
        if status.mode != self._config.control_mode and not self._config.take_mode:
            return f"mode is {status.mode}, {self._config.control_mode} is needed"
        if estimate is None or not estimate.valid:
            return "no valid position and heading yet"
        return None

    def _station_of(self, command: HoldCommand, estimate: Estimate, frame: LocalFrame) -> Station | str:
        n_m, e_m = estimate.n_m, estimate.e_m
        if command.lat_deg is not None and command.lon_deg is not None:
            n_m, e_m = frame.to_ned(command.lat_deg, command.lon_deg)
        psi_rad = estimate.psi_rad if command.psi_rad is None else command.psi_rad
        return _within_reach(Station(n_m=n_m, e_m=e_m, psi_rad=psi_rad), estimate)

    def _move(self, command: HoldCommand, estimate: Estimate | None, frame: LocalFrame | None) -> str | None:
        held = self.station
        if held is None or estimate is None or frame is None:
            return "no station is held: a stream of set-points only moves one, and takes none after a release"
        n_m, e_m = held.n_m, held.e_m
        if command.lat_deg is not None and command.lon_deg is not None:
            n_m, e_m = frame.to_ned(command.lat_deg, command.lon_deg)
        psi_rad = held.psi_rad if command.psi_rad is None else command.psi_rad
        station = _within_reach(Station(n_m=n_m, e_m=e_m, psi_rad=psi_rad), estimate)
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
        self._engaged_ns = t_ns
        self._failing_since_ns = None
        self._control_failed = False
        self._release_left = 0
        self._sent.clear()
        baseline = {channel: _channel(status, channel) for channel in self._stick_channels}
        self._stick_baseline = {channel: value for channel, value in baseline.items() if value}

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


def _within_reach(station: Station, estimate: Estimate) -> Station | str:
    distance_m = math.hypot(station.n_m - estimate.n_m, station.e_m - estimate.e_m)
    if not distance_m <= MAX_STATION_DISTANCE_M:
        return f"station is {distance_m / 1000.0:.1f} km away, 2 km at most"
    return station


def _channel(status: FrontseatStatus, channel: int) -> int:
    """RC value of a channel in us, 0 where unknown."""
    return status.rc_us[channel - 1] if len(status.rc_us) >= channel else 0
