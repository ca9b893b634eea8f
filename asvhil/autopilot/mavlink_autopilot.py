"""The MAVLink session with an autopilot: what all vehicle profiles share. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any

from asvhil.autopilot.after_silence import AfterSilence
from asvhil.autopilot.arming_checks import ArmingChecks
from asvhil.autopilot.ground_stations import GroundStations
from asvhil.autopilot.motor_outputs import IGNORE_CHANNEL, make_output
from asvhil.autopilot.neighbours import FLOATS, Neighbours, kind_of
from asvhil.autopilot.one_vehicle import OneVehicle
from asvhil.autopilot.pace import Pace
from asvhil.autopilot.requirements import Finding, Requirement, judge
from asvhil.autopilot.transmitter import Transmitter
from asvhil.autopilot.wiring import Pulses, Wiring, wiring_of_config
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.ports import AUTOPILOT
from asvhil.config.registry import AUTOPILOTS
from asvhil.io.mavlink.frames import Numbering, Parser, decode, dialect, message_id, pack, source, target
from asvhil.io.mavlink.parameter_client import ParameterClient
from asvhil.io.mavlink.streams import StreamRequester
from asvhil.io.mavlink.timesync import TimeSync
from asvhil.io.sensors.mavlink_sensors import MavlinkSensors
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import StationSticks
from asvhil.types import Frame, FrontseatStatus, Heading, Measurement, Note, Radio, TimeOffset, YawRate

COMMAND_ACK = dialect.MAVLINK_MSG_ID_COMMAND_ACK
HEARTBEAT_NS = 1_000_000_000
REQUEST_NS = 1_000_000_000
CHANNELS_OF = attrgetter(*(f"chan{i}_raw" for i in range(1, 19)))  # of RC_CHANNELS
OUTPUTS_OF = attrgetter(*(f"servo{i}_raw" for i in range(1, 17)))  # of SERVO_OUTPUT_RAW
FIRST_TIME_NS = 300_000_000  # between requests for the autopilot's clock until one was answered
SILENCE_NS = 3_000_000_000  # after which nobody knows what has become of the vehicle
BOOTING = (dialect.MAV_STATE_BOOT, dialect.MAV_STATE_CALIBRATING)
ASK_MODE_AFTER_NS = 1_100_000_000  # since the last heartbeat, while other messages come: mode and arming are asked for
ASK_MODE_NS = 400_000_000
OLD_MODE_NS = 2_000_000_000
# What a hold waits for: pose, and the pilot's sticks. The rest is told, and does without.
HOLD_NEEDS = frozenset({"ATTITUDE", "ATTITUDE_QUATERNION", "GPS_RAW_INT", "GPS2_RAW", "RC_CHANNELS"})
SHARED_NS = 2_000_000_000  # since a ground station's sticks were heard
STRANGER_NS = 10_000_000_000  # since another kind of vehicle was heard


class MavlinkAutopilot:
    """One autopilot: status and measurements in; heartbeat, streams, time, parameters, mode, arming and motors out.

    A profile adds the messages, modes and parameters of its firmware.
    """

    legacy_streams = False  # REQUEST_DATA_STREAM where SET_MESSAGE_INTERVAL is not to be had
    _obeys_stations = False  # their MANUAL_CONTROL and overrides, and only theirs
    bytewise_parameters = False  # integers in PARAM_VALUE by their bytes, not as floats
    optional_parameters: frozenset[str] = frozenset()  # that only some versions of the firmware have

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig) -> None:
        self._config = config
        self._pwm = pwm
        self._overrides_sticks = config.overrides_sticks
        self._kind = AUTOPILOTS.find(config.profile)
        self._modes = self._kind.modes
        self._mode_names = {number: name for name, number in self._modes.items()}
        self._parser = Parser()
        self._own = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._operators = Parser()
        self._known_wiring = self._wire({})
        self._driven_wiring: Wiring | None = None  # that of the time when the motors were taken
        self._driven_sticks_us: Pulses | None = None
        self._output = make_output(config, pwm, self._known_wiring)
        us = config.system_id, config.component_id
        self._streams = StreamRequester(
            config.streams_hz,
            config.autopilot_system_id,
            us,
            component_id=config.autopilot_component_id,
            legacy=self.legacy_streams,
        )
        self._heartbeat_ns: int | None = None
        self._timesync = TimeSync()
        self._time_asked_ns = -HEARTBEAT_NS
        self._judged_changes = -1
        self._findings: list[Finding] = []
        self._wiring_names: tuple[str, ...] = ()
        self.parameters = ParameterClient(
            (), config.autopilot_system_id, config.autopilot_component_id, bytewise=self.bytewise_parameters
        )
        self._take_in_parameters()
        self._neighbours = Neighbours(config)
        own = {(system_id, config.component_id) for system_id in (config.system_id, config.override_system_id)}
        self._stations = GroundStations(tuple(own), config.autopilot_system_id)
        self._station_sticks: list[StationSticks] = []
        self._last_station: StationSticks | None = None
        self._one = OneVehicle()
        self._pace = Pace()
        self._needed = HOLD_NEEDS if config.position_source is None else {*HOLD_NEEDS, config.position_source}
        self._numbering = Numbering()
        self._it = (config.autopilot_system_id, config.autopilot_component_id)
        self._us = us
        self._request_ns: dict[int, int] = {}
        self._other_firmware = ""
        self._other_kind: tuple[int, str] | None = None  # when a vehicle that does not float was heard, and what it was
        self._t_ns = 0
        self._mode_asked_ns = 0
        self._boot_ms: dict[int, int] = {}  # by message
        self._new_clock = False
        self._armed = False
        self._mode = ""
        self._ready = False
        self._booting = False
        self._arming_fault = ""
        self.transmitter = Transmitter()
        self.arming_checks = ArmingChecks()
        self._rc_us: tuple[int, ...] = ()
        self._outputs_us: tuple[int, ...] = ()
        self._sticks_us: Pulses | None = None
        self._motors_us: Pulses | None = None
        self._rc_ns = self._outputs_ns = 0
        self.autopilot_heartbeat_ns: int | None = None
        self.autopilot_heard_ns: int | None = None
        self.impossible = 0
        self.reboots = 0
        self._handlers: dict[int, Callable[[int, Any], Sequence[Measurement] | None]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS: self._on_rc_channels,
            dialect.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._on_servo_output,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self._on_sys_status,
            dialect.MAVLINK_MSG_ID_STATUSTEXT: self._on_text,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._on_attitude,
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME: self._on_system_time,
            dialect.MAVLINK_MSG_ID_COMMAND_ACK: self._on_command_ack,
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            dialect.MAVLINK_MSG_ID_PARAM_VALUE: self.parameters.receive,
            dialect.MAVLINK_MSG_ID_PARAM_ERROR: self._on_param_error,
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: lambda t_ns, m: None,
            **MavlinkSensors(lambda: self._ready, self._pace.was_late).handlers,
        }

    # --- in ------------------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[NamedMeasurement]:
        """(message name, measurement) of all in one frame of the autopilot's port; others and bad bytes give none."""
        found: list[NamedMeasurement] = []
        t_ns = self._t_ns = frame.t_ns
        for data in self._parser.receive(frame.peer, frame.data):
            if source(data) != self._it:
                self._on_neighbour(t_ns, data)
                continue
            msg_id = message_id(data)
            if msg_id == COMMAND_ACK and not self.is_for_us(data):
                self._on_sign_of_life(t_ns)
                continue
            self._streams.receive(data)
            handler = self._handlers.get(msg_id)
            if handler is not None:
                message = decode(data)
                if message is None:
                    self.impossible += 1
                    continue
                self._new_clock = self._one.take(t_ns, frame.peer, message)
                found += [(message.msgname, measurement) for measurement in handler(t_ns, message) or ()]
            self._on_sign_of_life(t_ns)
        return found

    def _on_sign_of_life(self, t_ns: int) -> None:
        """Any message of the autopilot; before its first heartbeat nobody knows what it is of."""
        if self.autopilot_heartbeat_ns is None:
            return
        last_ns, self.autopilot_heard_ns = self.autopilot_heard_ns, t_ns
        if last_ns is None or t_ns - last_ns > SILENCE_NS:
            self._output.on_connect(t_ns)

    def _on_neighbour(self, t_ns: int, data: bytes) -> None:
        """Another component of the vehicle may ask for the time; besides, others are only looked at."""
        self._on_station(t_ns, data)
        self._neighbours.take(t_ns, data, ours=self._numbering.was_sent(t_ns, data))
        system_id, component_id = source(data)
        if message_id(data) != dialect.MAVLINK_MSG_ID_TIMESYNC or system_id != self._it[0]:
            return
        message = decode(data) if component_id != self._us[1] else None
        if message is not None and message.tc1 == 0:
            self._timesync.receive(t_ns, message)

    def receive_of_operator(self, frame: Frame) -> None:
        """A frame of the operator's port: the pilot's ground station counts on every link."""
        for data in self._operators.receive(frame.peer, frame.data, frame.via):
            self._on_station(frame.t_ns, data)

    def _on_station(self, t_ns: int, data: bytes) -> None:
        if self._obeys_stations:
            sticks = self._stations.read(t_ns, data, self.parameters.values, self.wiring)
            if sticks is not None:
                self._station_sticks.append(sticks)
                self._last_station = sticks

    def take_station_sticks(self) -> tuple[StationSticks, ...]:
        """What was heard, since the last call, of sticks of ground stations that the autopilot obeys."""
        heard = tuple(self._station_sticks)
        self._station_sticks.clear()
        return heard

    @property
    def station_heard_ns(self) -> int | None:
        """When a ground station of the pilot was heard last; None: never."""
        return self._stations.heard_ns

    @property
    def receiver_ignored(self) -> bool:
        """Whether the autopilot is told to ignore its receiver, so that a transmitter has no effect."""
        return False

    @property
    def keeps_override(self) -> bool:
        """Whether the last override of a stick stands after its release, for want of a receiver to take its place."""
        return False

    @property
    def driven_sticks_us(self) -> Pulses | None:
        """Where the last command of the motors has put their sticks (RC values); None where it overrides none."""
        return self._driven_sticks_us

    def is_its_own(self, data: bytes) -> bool:
        """Whether a complete frame is the autopilot's: one component of one vehicle, whoever else talks."""
        return source(data) == self._it

    def is_for_us(self, data: bytes) -> bool:
        """Whether a complete frame of it is not an answer to somebody else; MAVLink 1 does not tell to whom one is."""
        return message_id(data) != COMMAND_ACK or target(data) in (self._us, (0, 0))

    def neighbours(self, t_ns: int) -> tuple[str, ...]:
        """Who else is heard on the link, by kind and number."""
        return self._neighbours.names(t_ns)

    @property
    def lost(self) -> int:
        """Frames of the autopilot that did not come, by its sequence numbers, over all ways that it comes by."""
        return self._parser.lost_of(self._it)

    @property
    def stranger(self) -> Explanation | None:
        """Why this is not our boat: it is of another kind, or it is two."""
        if self._one.is_two(self._t_ns):
            return explain(Reason.TWO_VEHICLES, system=self._it[0])
        if self._other_kind is not None and self._t_ns - self._other_kind[0] < STRANGER_NS:
            return explain(Reason.NOT_A_BOAT, kind=self._other_kind[1])
        return None

    @property
    def slow_stream(self) -> Explanation | None:
        """A message that comes much slower than it was asked for, while it is being asked for again."""
        slow = self._streams.still_asked_for(self._t_ns, self._needed)
        return None if slow is None else explain(Reason.STREAM_SLOW, message=slow[0], wanted=f"{slow[1]:g}")

    @property
    def clock(self) -> TimeOffset | None:
        """The autopilot's clock less ours; None before the first exchange."""
        return self._timesync.offset

    @property
    def findings(self) -> list[Finding]:
        """The required parameters, compared with what was read."""
        self._take_in_parameters()
        return self._findings

    @property
    def wiring(self) -> Wiring:
        """How the motors are wired, as far as is known; while they are driven, as of when that began.

        What changes meanwhile is no news of the boat but a fault, which its outputs then show.
        """
        self._take_in_parameters()
        return self._driven_wiring or self._known_wiring

    @property
    def way_fault(self) -> Explanation | None:
        """Why the way to the motors is shut, as far as it tells by itself; None where it is open."""
        return None if self.autopilot_heartbeat_ns is None else self._output.fault(self._t_ns)

    @property
    def unread_wiring(self) -> str:
        """The first parameter of the motors' wiring that is still waited for; empty where none is."""
        self._take_in_parameters()
        return next(filter(self.parameters.is_pending, self._wiring_names), "")

    def _take_in_parameters(self) -> None:
        """Judge what has become known since the last time, and ask for what follows from it."""
        if self._judged_changes == self.parameters.changes:
            return
        self._judged_changes = self.parameters.changes
        values = self.parameters.values
        self._known_wiring = self._wire(values)
        if self._driven_wiring is None:
            self._output.wiring = self._known_wiring
        self._wiring_names = tuple(dict.fromkeys(self._names_of_wiring(values)))
        required = self._requirements(values)
        self._findings = judge(required, values)
        # Those of the wiring first, on which the others rest.
        names = [*((name,) for name in self._wiring_names), *(row.names for row in required)]
        self.parameters.want([*names, *self._names_to_know(values)])

    @property
    def unread_parameters(self) -> tuple[str, ...]:
        """Required parameters that were asked for often enough to be heard of, and have not answered."""
        return tuple(name for name in self.parameters.silent if name not in self.optional_parameters)

    @property
    def settled(self) -> bool:
        """Whether parameters and streams have been asked for, and have answered or been given up for now."""
        return self.parameters.complete and self._streams.settled

    @property
    def booting(self) -> bool:
        """Whether the autopilot says that it still sets itself up: parameters may change then, and writes get lost."""
        return self._booting

    @property
    def after_silence(self) -> AfterSilence | None:
        """What becomes of the motors if this program dies in a hold; None while that is not known."""
        return None

    @property
    def unbounded(self) -> str:
        """Why nothing would stop the motors then; empty where something does, or is not known."""
        after = self.after_silence
        return after.text if after is not None and after.within_s is None else ""

    @property
    def notes(self) -> tuple[Note, ...]:
        """What is wrong with the autopilot, the way to its motors, the pilot's radio, arming, and parameters."""
        lost = self.transmitter.radio is Radio.LOST
        stranger = self.stranger
        said = (
            ("autopilot", self._other_firmware if stranger is None else describe(stranger)),
            ("autopilot's mode", "old: its heartbeat does not come" if self._mode_age_ns() > OLD_MODE_NS else ""),
            ("transmitter", "lost: the pilot's sticks and switches have no effect" if lost else ""),
            ("arming", "" if self._armed else self._arming_fault),
            ("motor output", self._output.hazard),
            ("motor commands", self._output.refused),
            ("ground station", self._station_text()),
            ("streams", self._slow_text()),
            ("autopilot's clock", self._pace_text()),
            ("unread parameters", self._unread_text()),
        )
        heard = self.autopilot_heartbeat_ns is not None
        return (
            *(Note(subject=subject, text=text, ok=False) for subject, text in said if text),
            *self._neighbours.notes(self._t_ns, autopilot_heard=heard),
        )

    def _mode_age_ns(self) -> int:
        """For how long other messages have come without a heartbeat."""
        heard_ns, beat_ns = self.autopilot_heard_ns, self.autopilot_heartbeat_ns
        return 0 if heard_ns is None or beat_ns is None else heard_ns - beat_ns

    def _pace_text(self) -> str:
        if not self._pace.lost_s(self._t_ns):
            return ""
        return "has fallen behind: a simulation that is slower than real time, or a link with a long queue"

    def _station_text(self) -> str:
        """Of a station whose sticks take turns with our commands, while we override sticks."""
        last, driven = self._last_station, self._overrides_sticks and self._driven_wiring is not None
        if not driven or last is None or self._t_ns - last.t_ns > SHARED_NS:
            return ""
        return "{}/{} sends its sticks too: the motors get our commands and its in turn".format(*last.sender)

    def _slow_text(self) -> str:
        slow = self._streams.slow
        if not slow:
            return ""
        more = f", and so do {len(slow) - 1} more" if len(slow) > 1 else ""
        name, wanted_hz = slow[0]
        return describe(explain(Reason.STREAM_SLOW, message=name, wanted=f"{wanted_hz:g}")) + more

    def _unread_text(self) -> str:
        unread = self.unread_parameters
        more = f" and {len(unread) - 1} more" if len(unread) > 1 else ""
        return f"{unread[0]}{more}: no answer yet, unverified" if unread else ""

    def counters(self) -> tuple[tuple[str, int], ...]:
        """Cumulative counts of what came in and what was dropped."""
        frames, bad_crc, unknown, garbage_bytes = self._parser.totals()
        return (
            ("autopilot.frames", frames),
            ("autopilot.bad_crc", bad_crc),
            ("autopilot.garbage_bytes", garbage_bytes),
            ("autopilot.unknown", unknown),
            ("autopilot.lost", self.lost),
            ("autopilot.impossible", self.impossible),
            ("autopilot.reboots", self.reboots),
            ("autopilot.timesync_rejected", self._timesync.rejected),
            ("autopilot.timesync_steps", self._timesync.steps),
            ("autopilot.stream_requests", self._streams.requests),
            ("autopilot.streams_denied", len(self._streams.denied)),
            ("autopilot.parameters_known", len(self.parameters.values)),
            ("autopilot.parameter_requests", self.parameters.requests),
        )

    def _requirements(self, values: Mapping[str, float]) -> tuple[Requirement, ...]:
        """The values that parameters of this autopilot must have, where these are known."""
        return ()

    def _wire(self, values: Mapping[str, float]) -> Wiring:
        """How the motors are wired by these parameters."""
        return wiring_of_config(self._pwm)

    def _names_of_wiring(self, values: Mapping[str, float]) -> Iterable[str]:
        """The parameters that tell it."""
        return ()

    def _names_to_know(self, values: Mapping[str, float]) -> Iterable[tuple[str, ...]]:
        """Parameters that are asked for besides, each under the names that firmware versions give it."""
        return ()

    def _status(self, t_ns: int) -> tuple[FrontseatStatus]:
        self._arming_fault = self.arming_checks.fault(t_ns)
        status = FrontseatStatus(
            t_ns=t_ns,
            armed=self._armed,
            mode=self._mode,
            ready=self._ready,
            rc_us=self._rc_us,
            outputs_us=self._outputs_us,
            motor_channels=self.wiring.channels,
            centres_us=self.wiring.centres_us,
            receiver_ignored=self.receiver_ignored,
            keeps_override=self.keeps_override,
            sticks_us=self._sticks_us,
            motors_us=self._motors_us,
            rc_ns=self._rc_ns,
            outputs_ns=self._outputs_ns,
            radio=self.transmitter.radio,
            arming_fault="" if self._armed else self._arming_fault,
        )
        return (status,)

    def _on_heartbeat(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        if m.autopilot == dialect.MAV_AUTOPILOT_INVALID:
            return ()  # another component of the vehicle, not its autopilot
        if m.type not in FLOATS:
            self._other_kind = (t_ns, kind_of(m.type) or "generic")
            return ()
        self.autopilot_heartbeat_ns = t_ns
        self._other_firmware = "" if m.autopilot == self._kind.mav_autopilot else self._other_make(m.autopilot)
        self._armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        self._mode = self._mode_names.get(m.custom_mode, f"MODE_{m.custom_mode}")
        was_booting, self._booting = self._booting, m.system_status in BOOTING
        if was_booting and not self._booting:
            self.parameters.forget()  # an ArduRover sets the defaults of some last
        if not self._armed:
            self._output.on_disarmed(t_ns)
        return self._status(t_ns)

    def _other_make(self, mav_autopilot: int) -> str:
        """What to tell of an autopilot that is not of the profile's make."""
        names = (kind.name for kind in AUTOPILOTS if kind.mav_autopilot == mav_autopilot)
        make = next(names, f"of make {mav_autopilot} (MAV_AUTOPILOT)")
        return f"is {make}, but links.autopilot.profile is {self._config.profile}"

    def _on_rc_channels(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        self._rc_ns = t_ns
        self._rc_us = tuple([0 if value == IGNORE_CHANNEL else value for value in CHANNELS_OF(m)])
        self._sticks_us = self.wiring.of_sticks(self._rc_us)
        self.transmitter.on_rc_channels(t_ns, m.chancount, m.rssi)
        return self._status(t_ns)

    def _on_servo_output(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        if m.port != 0:
            return ()
        self._outputs_ns = t_ns
        self._outputs_us = OUTPUTS_OF(m)
        self._motors_us = self.wiring.of_outputs(self._outputs_us)
        return self._status(t_ns)

    def _on_sys_status(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        present, enabled = m.onboard_control_sensors_present, m.onboard_control_sensors_enabled
        self.transmitter.on_sys_status(t_ns, present, m.onboard_control_sensors_health)
        self.arming_checks.on_sys_status(enabled, m.onboard_control_sensors_health)
        return self._status(t_ns)

    def _on_text(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        self.arming_checks.on_text(t_ns, m)
        return self._status(t_ns)

    def _on_attitude(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        self._note_boot_time(t_ns, m)
        self._pace.take(t_ns, m.time_boot_ms)
        if not self._ready:
            return ()
        return Heading(t_ns=t_ns, psi_rad=m.yaw), YawRate(t_ns=t_ns, r_radps=m.yawspeed)

    def _on_system_time(self, t_ns: int, m: Any) -> None:
        self._note_boot_time(t_ns, m)

    def _on_command_ack(self, t_ns: int, m: Any) -> None:
        self._output.receive(m)

    def _on_param_error(self, t_ns: int, m: Any) -> None:
        self.parameters.on_error(m)

    def _on_timesync(self, t_ns: int, m: Any) -> None:
        self._timesync.receive(t_ns, m)

    def _note_boot_time(self, t_ns: int, m: Any) -> None:
        """A boot clock that runs back by a second or more is a reboot: rates and readiness are gone.

        Each message is compared with its own kind: bridges leave the time of some at 0, or have it stand still. A clock
        that was heard before is that of another way, or of another vehicle.
        """
        msg_id, boot_ms = m.get_msgId(), m.time_boot_ms
        if boot_ms + 1000 < self._boot_ms.get(msg_id, 0) and self._new_clock:
            self._boot_ms.clear()
            self.reboots += 1
            self._ready = False
            self._streams.restart()
            self._pace.restart()
            self._timesync.restart()
            self.parameters.restart()
            self._output.on_connect(t_ns)
            self.transmitter.restart()
            self.arming_checks.restart()
        self._boot_ms[msg_id] = boot_ms

    # --- out -----------------------------------------------------------------------------------------------

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """What is due: a heartbeat and TIMESYNC each second, and requests once the autopilot has been heard."""
        self._t_ns = t_ns
        connected = self.autopilot_heartbeat_ns is not None
        due: list[Any] = []
        if self._heartbeat_ns is None or t_ns - self._heartbeat_ns >= HEARTBEAT_NS:
            self._heartbeat_ns = t_ns
            due.append(
                dialect.MAVLink_heartbeat_message(
                    dialect.MAV_TYPE_ONBOARD_CONTROLLER,
                    dialect.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    dialect.MAV_STATE_ACTIVE,
                    3,
                )
            )
        if connected and t_ns - self._time_asked_ns >= (FIRST_TIME_NS if self.clock is None else HEARTBEAT_NS):
            self._time_asked_ns = t_ns
            self._timesync.ask()
        due += self._timesync.data_to_send(t_ns)
        if connected:
            due += self._streams.data_to_send(t_ns)
            due += [] if self._booting else self.parameters.data_to_send(t_ns)
            if not (self._armed or self._booting) and self.arming_checks.is_due(t_ns):
                due.append(self._command(dialect.MAV_CMD_RUN_PREARM_CHECKS))
            due += self._questions(t_ns)
        return [self._pack(t_ns, message) for message in due] + self._frames(t_ns, self._output.data_to_send(t_ns))

    def _questions(self, t_ns: int) -> list[Any]:
        """Its mode, where its heartbeats get lost; its hardware's number, where it is heard by several ways."""
        asked = []
        if self._mode_age_ns() > ASK_MODE_AFTER_NS and t_ns - self._mode_asked_ns >= ASK_MODE_NS:
            self._mode_asked_ns = t_ns
            asked.append(dialect.MAVLINK_MSG_ID_HEARTBEAT)
        if self._one.wants_uid(t_ns):
            asked.append(dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        return [self._command(dialect.MAV_CMD_REQUEST_MESSAGE, float(msg_id)) for msg_id in asked]

    def drive(self, t_ns: int, port_us: int, starboard_us: int) -> list[Frame]:
        """Both motors, as pulse widths (us)."""
        if self._overrides_sticks:
            self.transmitter.note_override(t_ns)
        if self._driven_wiring is None:
            self._driven_wiring = self.wiring
        if self._overrides_sticks:
            self._driven_sticks_us = self._driven_wiring.to_sticks((port_us, starboard_us))
        return self._frames(t_ns, self._output.drive(port_us, starboard_us))

    def release(self, t_ns: int) -> list[Frame]:
        """Give the motors back."""
        released = self._output.release(t_ns)
        self._driven_wiring = None
        self._output.wiring = self.wiring
        return self._frames(t_ns, released)

    def request_mode(self, t_ns: int, mode: str) -> list[Frame]:
        """DO_SET_MODE, at most once a second; nothing for a mode that the autopilot does not have."""
        number = self._modes.get(mode)
        if number is None:
            return []
        return self._request(t_ns, dialect.MAV_CMD_DO_SET_MODE, 1.0, *self._mode_parameters(number))

    def request_arming(self, t_ns: int) -> list[Frame]:
        """COMPONENT_ARM_DISARM with all checks, at most once a second."""
        return self._request(t_ns, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def _mode_parameters(self, number: int) -> tuple[float, ...]:
        """param2 and on of DO_SET_MODE."""
        return (float(number),)

    def _request(self, t_ns: int, command: int, *parameters: float) -> list[Frame]:
        last_ns = self._request_ns.get(command)
        if last_ns is not None and t_ns - last_ns < REQUEST_NS:
            return []
        self._request_ns[command] = t_ns
        return [self._pack(t_ns, self._command(command, *parameters))]

    def _command(self, command: int, *parameters: float) -> Any:
        return dialect.MAVLink_command_long_message(*self._it, command, 0, *parameters, *[0] * (7 - len(parameters)))

    def _frames(self, t_ns: int, packed: list[bytes]) -> list[Frame]:
        """Numbered as they leave: receivers count what they miss, and routers drop what looks like a copy."""
        return [Frame(t_ns=t_ns, port=AUTOPILOT, data=self._numbering.number(t_ns, data)) for data in packed]

    def _pack(self, t_ns: int, message: Any) -> Frame:
        return self._frames(t_ns, [pack(message, self._own)])[0]
