"""What is heard of an autopilot by MAVLink: measurements, its status, and what is wrong with it. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from asvhil.autopilot.after_silence import AfterSilence
from asvhil.autopilot.copies import Copies
from asvhil.autopilot.ground_stations import GroundStations
from asvhil.autopilot.identity import VehicleIdentity
from asvhil.autopilot.motor_outputs import make_output
from asvhil.autopilot.neighbours import Neighbours
from asvhil.autopilot.one_vehicle import OneVehicle
from asvhil.autopilot.pace import Pace
from asvhil.autopilot.parameter_watch import ParameterRules, ParameterWatch
from asvhil.autopilot.requirements import Finding
from asvhil.autopilot.sender import AutopilotSender
from asvhil.autopilot.vehicle_status import VehicleStatus
from asvhil.autopilot.wiring import Wiring, wiring_of_config
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.registry import AUTOPILOTS
from asvhil.io.mavlink.frames import Parser, decode, decode_checked, dialect, message_id, source, target
from asvhil.io.mavlink.parameter_client import ParameterClient
from asvhil.io.mavlink.streams import StreamRequester
from asvhil.io.mavlink.timesync import TimeSync
from asvhil.io.sensors.mavlink_sensors import MavlinkSensors
from asvhil.io.sensors.protocol import NamedMeasurement
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.supervisor.situation import StationSticks
from asvhil.types import Frame, Heading, Measurement, Note, Radio, TimeOffset, YawRate

HEARTBEAT = dialect.MAVLINK_MSG_ID_HEARTBEAT
ESTIMATOR_SILENT = "does not say any more what it knows: its position is not used"
COMMAND_ACK = dialect.MAVLINK_MSG_ID_COMMAND_ACK
GPS_RAW_INT = dialect.MAVLINK_MSG_ID_GPS_RAW_INT
SILENCE_NS = 3_000_000_000  # after which nobody knows what has become of the vehicle
OLD_MODE_NS = 2_000_000_000
# What a hold waits for: pose, and the pilot's sticks. The rest is told, and does without.
HOLD_NEEDS = frozenset({"ATTITUDE", "ATTITUDE_QUATERNION", "GPS_RAW_INT", "GPS2_RAW", "RC_CHANNELS"})

SAID = (  # the subjects of the notes, in turn
    *("autopilot", "autopilot's mode", "transmitter", "arming", "motor output", "motor commands", "ground station"),
    *("streams", "autopilot's estimator", "autopilot's clock", "unread parameters"),
)


class AutopilotListener:
    """The receiving half of `MavlinkAutopilot`, with the protocols that have an end in either half.

    A profile adds the messages of its firmware, and what its parameters mean (`rules`).
    """

    legacy_streams = False  # REQUEST_DATA_STREAM where SET_MESSAGE_INTERVAL is not to be had
    bytewise_parameters = False  # integers in PARAM_VALUE by their bytes, not as floats
    _obeys_stations = False  # their MANUAL_CONTROL and overrides, and only theirs
    _keeps_overrides = False  # goes on with the last one where there is no receiver that it listens to

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, rules: ParameterRules | None = None) -> None:
        """Without `rules` the motors are wired as the config says, and no parameter is asked for."""
        rules = rules or ParameterRules(wiring=lambda values: wiring_of_config(pwm))
        kind = AUTOPILOTS.find(config.profile)
        self._config = config
        self._pwm = pwm
        self._overrides_sticks = config.overrides_sticks
        self._sender = AutopilotSender(config)
        self._us, self._it = self._sender.us, self._sender.it
        self._parser = Parser()
        self._operators = Parser()
        self._output = make_output(config, pwm, rules.wiring({}))
        self._streams = StreamRequester(
            config.requested_hz,
            config.autopilot_system_id,
            self._us,
            component_id=config.autopilot_component_id,
            legacy=self.legacy_streams,
        )
        self._needed = HOLD_NEEDS if config.position_source is None else {*HOLD_NEEDS, config.position_source}
        self._timesync = TimeSync()
        self.parameters = ParameterClient((), *self._it, bytewise=self.bytewise_parameters)
        self._known = ParameterWatch(rules, self.parameters, self._output)
        self._vehicle = VehicleStatus(
            kind.modes, self._known, keeps_overrides=self._keeps_overrides and self._overrides_sticks
        )
        self.transmitter = self._vehicle.transmitter
        self.arming_checks = self._vehicle.arming_checks
        self._one = OneVehicle()
        self._copies = Copies()
        self._identity = VehicleIdentity(config.autopilot_system_id, kind, self._one)
        self._neighbours = Neighbours(config)
        own = {(system_id, config.component_id) for system_id in (config.system_id, config.override_system_id)}
        self._stations = GroundStations(tuple(own), config.autopilot_system_id)
        self._pace = Pace()
        self._sensors = MavlinkSensors(
            self._vehicle.ready,
            lambda: self._vehicle.knows_attitude,
            self._pace.was_late,
            self._pace.age_ns,
            lambda: self._known.trim_rad,
        )
        self._t_ns = 0
        self._boot_ms: dict[int, int] = {}  # by message
        self._new_clock = False
        self.autopilot_heartbeat_ns: int | None = None
        self.autopilot_heard_ns: int | None = None
        self.impossible = 0
        self.reboots = 0
        self._handlers: dict[int, Callable[[int, Any], Sequence[Measurement] | None]] = {
            dialect.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            dialect.MAVLINK_MSG_ID_RC_CHANNELS: self._vehicle.on_rc_channels,
            dialect.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._vehicle.on_servo_output,
            dialect.MAVLINK_MSG_ID_SYS_STATUS: self._vehicle.on_sys_status,
            dialect.MAVLINK_MSG_ID_BATTERY_STATUS: self._vehicle.on_battery,
            dialect.MAVLINK_MSG_ID_STATUSTEXT: self._vehicle.on_text,
            dialect.MAVLINK_MSG_ID_ATTITUDE: self._on_attitude,
            dialect.MAVLINK_MSG_ID_SYSTEM_TIME: self._note_boot_time,
            dialect.MAVLINK_MSG_ID_COMMAND_ACK: lambda t_ns, m: self._output.receive(m),
            dialect.MAVLINK_MSG_ID_TIMESYNC: self._timesync.receive,
            dialect.MAVLINK_MSG_ID_PARAM_VALUE: self.parameters.receive,
            dialect.MAVLINK_MSG_ID_PARAM_ERROR: lambda t_ns, m: self.parameters.on_error(m),
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: lambda t_ns, m: None,
            **self._sensors.handlers,
        }

    # --- in ------------------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[NamedMeasurement]:
        """(message name, measurement) of all in one frame of the autopilot's port; others and bad bytes give none."""
        found: list[NamedMeasurement] = []
        t_ns, peer = frame.t_ns, frame.peer
        self._t_ns = t_ns
        for data in self._parser.receive(peer, frame.data):
            if source(data) != self._it:
                self._on_neighbour(t_ns, data)
                continue
            msg_id = message_id(data)
            if msg_id == COMMAND_ACK and not self.is_for_us(data):
                self._on_sign_of_life(t_ns)
                continue
            self._streams.receive(msg_id, data)
            handler = self._handlers.get(msg_id)
            if handler is not None:
                message = decode_checked(data)
                if message is None:
                    self.impossible += 1
                    continue
                copy = self._copies.is_copy(t_ns, peer, data)
                if not copy or msg_id != HEARTBEAT:  # whose late mode is no other vehicle's
                    self._new_clock = self._one.take(t_ns, peer, message)
                if copy or self._copies.is_older(t_ns, peer, message, new_clock=self._new_clock):
                    self._on_sign_of_life(t_ns)
                    continue
                if msg_id == GPS_RAW_INT:
                    self._vehicle.on_fix(message)
                for measurement in handler(t_ns, message) or ():
                    found.append((message.msgname, measurement))
            self._on_sign_of_life(t_ns)
        return found

    def receive_of_operator(self, frame: Frame) -> None:
        """A frame of the operator's port: the pilot's ground station counts on every link."""
        if self._obeys_stations:
            for data in self._operators.receive(frame.peer, frame.data, frame.via):
                self._stations.receive(frame.t_ns, data, self.parameters.values, self._known.wiring)

    def _on_sign_of_life(self, t_ns: int) -> None:
        """Any message of the autopilot; before its first heartbeat nobody knows what it is of."""
        if self.autopilot_heartbeat_ns is None:
            return
        last_ns, self.autopilot_heard_ns = self.autopilot_heard_ns, t_ns
        if last_ns is None or t_ns - last_ns > SILENCE_NS:
            self._output.on_connect(t_ns)

    def _on_neighbour(self, t_ns: int, data: bytes) -> None:
        """Another component of the vehicle may ask for the time; besides, others are only looked at."""
        if self._obeys_stations:
            self._stations.receive(t_ns, data, self.parameters.values, self._known.wiring)
        self._neighbours.take(t_ns, data, ours=self._sender.was_sent(t_ns, data))
        system_id, component_id = source(data)
        if message_id(data) != dialect.MAVLINK_MSG_ID_TIMESYNC or system_id != self._it[0]:
            return
        message = decode(data) if component_id != self._us[1] else None
        if message is not None and message.tc1 == 0:
            self._timesync.receive(t_ns, message)

    def _on_heartbeat(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        if not self._identity.on_heartbeat(t_ns, m):
            return ()
        self.autopilot_heartbeat_ns = t_ns
        if self._vehicle.on_heartbeat(t_ns, m):
            self.parameters.forget()  # an ArduRover sets the defaults of some last
        if not self._vehicle.armed:
            self._output.on_disarmed(t_ns)
        return self._vehicle.status(t_ns)

    def _on_attitude(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        self._note_boot_time(t_ns, m)
        self._pace.take(t_ns, m.time_boot_ms)
        if not self._vehicle.knows_attitude:
            return ()
        self._sensors.level.note(t_ns, m.roll, m.pitch)
        return Heading(t_ns=t_ns, psi_rad=m.yaw), YawRate(t_ns=t_ns, r_radps=m.yawspeed)

    def _note_boot_time(self, t_ns: int, m: Any) -> None:
        """A boot clock that runs back by a second or more is a reboot: rates and readiness are gone.

        Each message is compared with its own kind: bridges leave the time of some at 0, or have it stand still. A clock
        that was heard before is that of another way, or of another vehicle.
        """
        msg_id, boot_ms = m.get_msgId(), m.time_boot_ms
        if boot_ms + 1000 < self._boot_ms.get(msg_id, 0) and self._new_clock:
            self._boot_ms.clear()
            self.reboots += 1
            self._vehicle.restart(t_ns - 1_000_000 * boot_ms)
            self._streams.restart()
            self._pace.restart()
            self._sensors.restart()
            self._timesync.restart()
            self.parameters.restart()
            self._output.on_connect(t_ns)
        else:
            self._vehicle.disarming.note_clock()
        self._boot_ms[msg_id] = boot_ms

    # --- what is known of it -------------------------------------------------------------------------------

    def is_its_own(self, data: bytes) -> bool:
        """Whether a complete frame is the autopilot's: one component of one vehicle, whoever else talks."""
        return source(data) == self._it

    def is_for_us(self, data: bytes) -> bool:
        """Whether a complete frame of it is not an answer to somebody else; MAVLink 1 does not tell to whom one is."""
        return message_id(data) != COMMAND_ACK or target(data) in (self._us, (0, 0))

    def take_station_sticks(self) -> tuple[StationSticks, ...]:
        """What was heard, since the last call, of sticks of ground stations that the autopilot obeys."""
        return self._stations.take_sticks()

    @property
    def station_heard_ns(self) -> int | None:
        """When a ground station of the pilot was heard last; None: never."""
        return self._stations.heard_ns

    @property
    def keeps_override(self) -> bool:
        """Whether the last override of a stick stands after its release, for want of a receiver to take its place."""
        return self._vehicle.keeps_override

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
        return self._identity.stranger(self._t_ns)

    @property
    def slow_stream(self) -> Explanation | None:
        """A message that comes much slower than it was asked for, while it is being asked for again."""
        slow = self._streams.still_asked_for(self._t_ns, self._needed)
        return None if slow is None else _explain_slow(*slow)

    @property
    def clock(self) -> TimeOffset | None:
        """The autopilot's clock less ours; None before the first exchange."""
        return self._timesync.offset

    @property
    def findings(self) -> list[Finding]:
        """The required parameters, compared with what was read."""
        return self._known.findings

    @property
    def wiring(self) -> Wiring:
        """How the motors are wired, as far as is known; while they are driven, as of when that began."""
        return self._known.wiring

    @property
    def way_fault(self) -> Explanation | None:
        """Why the way to the motors is shut, as far as it tells by itself; None where it is open."""
        return None if self.autopilot_heartbeat_ns is None else self._output.fault(self._t_ns)

    @property
    def unread_wiring(self) -> str:
        """The first parameter of the motors' wiring that is still waited for; empty where none is."""
        return self._known.unread_wiring

    @property
    def unread_parameters(self) -> tuple[str, ...]:
        """Required parameters that were asked for often enough to be heard of, and have not answered."""
        return self._known.unread

    @property
    def settled(self) -> bool:
        """Whether parameters and streams have been asked for, and have answered or been given up for now."""
        return self.parameters.complete and self._streams.settled

    @property
    def booting(self) -> bool:
        """Whether the autopilot says that it still sets itself up: parameters may change then, and writes get lost."""
        return self._vehicle.booting

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
        vehicle, t_ns = self._vehicle, self._t_ns
        lost = self.transmitter.radio is Radio.LOST
        said = (
            self._identity.text(t_ns),
            "old: its heartbeat does not come" if self._mode_age_ns() > OLD_MODE_NS else "",
            "lost: the pilot's sticks and switches have no effect" if lost else "",
            "" if vehicle.armed else vehicle.arming_fault,
            self._output.hazard,
            self._output.refused,
            self._station_text(),
            self._slow_text(),
            ESTIMATOR_SILENT if vehicle.estimator_is_silent(t_ns) else "",
            self._pace.text(t_ns),
            self._known.unread_text,
        )
        neighbours = self._neighbours.notes(t_ns, autopilot_heard=self.autopilot_heartbeat_ns is not None)
        if not any(said):  # as in nearly every tick
            return neighbours
        own = [Note(subject=subject, text=text, ok=False) for subject, text in zip(SAID, said, strict=True) if text]
        return (*own, *neighbours)

    def _mode_age_ns(self) -> int:
        """For how long other messages have come without a heartbeat."""
        heard_ns, beat_ns = self.autopilot_heard_ns, self.autopilot_heartbeat_ns
        return 0 if heard_ns is None or beat_ns is None else heard_ns - beat_ns

    def _station_text(self) -> str:
        """Of a station whose sticks take turns with our commands, while we override sticks."""
        driven = self._overrides_sticks and self._known.driven_wiring is not None
        return self._stations.shared_text(self._t_ns) if driven else ""

    def _slow_text(self) -> str:
        slow = self._streams.slow
        if not slow:
            return ""
        more = f", and so do {len(slow) - 1} more" if len(slow) > 1 else ""
        return describe(_explain_slow(*slow[0])) + more

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


def _explain_slow(message: str, wanted_hz: float) -> Explanation:
    return explain(Reason.STREAM_SLOW, message=message, wanted=f"{wanted_hz:g}")
