"""A look at the vehicle over its links: asks and listens, and can say nothing that arms or moves a motor. Sans-IO."""

from __future__ import annotations

from collections import Counter, deque
from typing import Any

from asvhil.autopilot.neighbours import FLOATS, kind_of
from asvhil.autopilot.requirements import Finding
from asvhil.autopilot.vehicle_status import BOOTING
from asvhil.backseat.build import build_firmware_watch, build_link
from asvhil.config import QUANTITIES, Config, Quantity, SourceConfig
from asvhil.config.ports import AUTOPILOT
from asvhil.io.mavlink.frames import Parser, decode, dialect, message_id
from asvhil.io.sensors.decoder import Decoder
from asvhil.io.sensors.sources import quantity_of
from asvhil.preflight.harmless import may_be_said
from asvhil.preflight.lines import Diagnosis, SensorLine
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.types import Frame, FrontseatStatus, Inputs, Measurement, Note, Position, TimeOffset, record

S = 1_000_000_000
LEAST_SETTLE_NS = 3 * S  # of asking for streams, before rates are counted
MOST_SETTLE_NS = 12 * S  # where nothing is answered
LOSSY_SETTLE_NS = 40 * S  # where something is, on a link that loses much
COUNT_NS = 5 * S
ASK_VERSION_NS = S // 2

REFUSALS = (dialect.MAV_RESULT_DENIED, dialect.MAV_RESULT_UNSUPPORTED, dialect.MAV_RESULT_FAILED)


@record
class SourceState:
    """What was heard of one source of a quantity while counting: valid values, and the age of the last at the end."""

    source: SourceConfig
    rate_hz: float
    age_s: float | None


class Survey:
    """Stepped like a backseat; `stage` tells where it is, and the rest what was found once it is done."""

    def __init__(self, config: Config) -> None:
        self.config = config
        self.link = build_link(config)
        self._decoder = Decoder.from_config(config, self.link.receive)
        self._firmware = build_firmware_watch(config)
        self._lines = {port: SensorLine(config, port) for port in config.links.sensor_links()}
        self._sources: dict[Quantity, tuple[SourceConfig, ...]] = config.sources.resolved(config.links)
        self._wanted = {name: getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in config.links.autopilot.streams_hz}
        self._parser = Parser()
        own = config.links.autopilot
        self._mav = dialect.MAVLink(None, srcSystem=own.system_id, srcComponent=own.component_id)
        self._t_ns = 0
        self._heard_ns: int | None = None
        self._count_ns: int | None = None
        self._counts: Counter[int] = Counter()
        self._valid: dict[tuple[Quantity, str], deque[int]] = {}
        self._places: dict[str, Position] = {}  # the last valid one of each source
        self._version_asked_ns: int | None = None
        self.version_refused = False
        self._frames = 0
        self.bytes_heard = 0
        self.heartbeat: Any | None = None  # of the boat, the last
        self.stranger: Explanation | None = None  # why what was heard in its place, at any time, is not our boat
        self.version: Any | None = None
        self.unix_ns: tuple[int, int] | None = None  # the autopilot's time of day, and ours when it came
        self.rc_channels: int | None = None
        self.status: FrontseatStatus | None = None

    # --- while it runs -------------------------------------------------------------------------------------

    @property
    def stage(self) -> str:
        """waiting (for a heartbeat), booting, asking, counting, done."""
        if self._heard_ns is None:
            return "waiting" if self.heartbeat is None else "booting"
        if self._count_ns is None:
            return "asking"
        return "counting" if self._t_ns < self._count_ns + COUNT_NS else "done"

    @property
    def progress(self) -> float:
        """From 0 to 1, after the first heartbeat."""
        if self._heard_ns is None:
            return 0.0
        if self._count_ns is None:
            return 0.5 * min((self._t_ns - self._heard_ns) / LEAST_SETTLE_NS, 1.0)
        return 0.5 + 0.5 * min((self._t_ns - self._count_ns) / COUNT_NS, 1.0)

    def step(self, inputs: Inputs) -> list[Frame]:
        """One tick: what came in, and what goes out."""
        self._t_ns = t_ns = inputs.t_ns
        for frame in inputs.frames:
            self._read(frame)
        self.stranger = self.link.stranger or self.stranger
        if self.link.booting:
            self._heard_ns = self._count_ns = None  # also where it has been restarted meanwhile
        if self._heard_ns is not None and self._count_ns is None:
            asked_ns = t_ns - self._heard_ns
            longest_ns = LOSSY_SETTLE_NS if self.link.parameters.values else MOST_SETTLE_NS
            if asked_ns >= longest_ns or (asked_ns >= LEAST_SETTLE_NS and self.link.settled):
                self._count_ns = t_ns
                self._counts.clear()
                self._valid.clear()
                self._places.clear()
        out = [frame for frame in self.link.data_to_send(t_ns) if may_be_said(frame.data)]
        return out + self._ask_version(t_ns) + self._firmware.data_to_send(t_ns)

    def fix(self, chosen: list[Finding] | None = None) -> list[Finding]:
        """Have all that is `fixable` written, or what was chosen of it; `fixing` until all were read back."""
        wrong = self.fixable if chosen is None else chosen
        for finding in wrong:
            assert finding.wanted is not None
            self.link.parameters.write(finding.name, finding.wanted)
        return wrong

    @property
    def fixing(self) -> bool:
        """Whether a written value has not come back yet, and may still."""
        return bool(self.link.parameters.writing)

    # --- what was found ------------------------------------------------------------------------------------

    @property
    def findings(self) -> list[Finding]:
        """Of the parameters."""
        return self.link.findings

    @property
    def fixable(self) -> list[Finding]:
        """Those that were read, are wrong and have a value to be written."""
        return [f for f in self.findings if f.fixable]

    @property
    def clock(self) -> TimeOffset | None:
        return self.link.clock

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Who else was heard on the autopilot's link, by kind and number."""
        return self.link.neighbours(self._t_ns)

    @property
    def firmware(self) -> Note | None:
        """Of the anemometer; None where nothing is known of it."""
        return self._firmware.note()

    @property
    def lost_share(self) -> float:
        """Of the autopilot's frames, by its sequence numbers."""
        lost = self.link.lost
        return lost / max(lost + self._frames, 1)

    def rate_hz(self, name: str) -> float:
        """Of a message of the autopilot."""
        return self._counts[self._wanted[name]] / self._counted_s

    def sources(self) -> dict[Quantity, tuple[SourceState, ...]]:
        """How each source of each quantity was heard."""
        return {q: tuple(self._state(q, s) for s in self._sources[q]) for q in QUANTITIES}

    @property
    def place(self) -> Position | None:
        """Where the boat is, by the first source of its position that tells."""
        return next((self._places[s.name] for s in self._sources["position"] if s.name in self._places), None)

    def diagnosis(self, quantity: Quantity, source: SourceConfig) -> Diagnosis:
        """Why a source on a sensor link gives nothing."""
        return self._lines[source.link].diagnosis(quantity, source, self._end())

    def note_link(self, port: str, state: str) -> None:
        """The state of a link: up, or why not."""
        if port in self._lines:
            self._lines[port].state = state

    # --- parts ---------------------------------------------------------------------------------------------

    @property
    def _counted_s(self) -> float:
        assert self._count_ns is not None
        return min(self._t_ns - self._count_ns, COUNT_NS) / S

    def _state(self, quantity: Quantity, source: SourceConfig) -> SourceState:
        times = self._valid.get((quantity, source.name), ())
        age_s = (self._end() - times[-1]) / S if times else None
        return SourceState(source=source, rate_hz=len(times) / self._counted_s, age_s=age_s)

    def _end(self) -> int:
        assert self._count_ns is not None
        return min(self._t_ns, self._count_ns + COUNT_NS)

    def _read(self, frame: Frame) -> None:
        if frame.port == AUTOPILOT:
            self.bytes_heard += len(frame.data)
        if frame.port in self._lines:
            self._lines[frame.port].receive(frame)
        if frame.port == self._firmware.port:
            self._firmware.receive(frame)
        for name, measurement in self._decoder.decode_every_source(frame):
            if isinstance(measurement, FrontseatStatus):
                self.status = measurement
            elif self.stage == "counting":
                self._note(name, measurement)
        if frame.port == AUTOPILOT:
            self._look(frame)

    def _look(self, frame: Frame) -> None:
        """What the link itself has no use for."""
        for data in self._parser.receive(frame.peer, frame.data):
            if not (self.link.is_its_own(data) and self.link.is_for_us(data)):
                continue
            self._frames += 1
            msg_id = message_id(data)
            if self.stage == "counting":
                self._counts[msg_id] += 1
            message = decode(data) if msg_id in _LOOKED_AT else None
            if message is None:
                continue
            if msg_id == dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
                self.version = message
            elif msg_id == dialect.MAVLINK_MSG_ID_COMMAND_ACK:
                answers = message.command == dialect.MAV_CMD_REQUEST_MESSAGE
                self.version_refused |= answers and message.result in REFUSALS
            elif msg_id == dialect.MAVLINK_MSG_ID_SYSTEM_TIME and message.time_unix_usec:
                self.unix_ns = (message.time_unix_usec * 1000, frame.t_ns)
            elif msg_id == dialect.MAVLINK_MSG_ID_RC_CHANNELS:
                self.rc_channels = message.chancount
            elif msg_id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
                self._on_heartbeat(frame.t_ns, message)

    def _on_heartbeat(self, t_ns: int, message: Any) -> None:
        """One that has the autopilot's ids; whatever sends it."""
        autopilot = message.autopilot != dialect.MAV_AUTOPILOT_INVALID
        if not autopilot or message.type not in FLOATS:
            kind = kind_of(message.type) or "generic"
            self.stranger = explain(Reason.NOT_A_BOAT, kind=kind if autopilot else f"{kind}, no autopilot")
            return
        self.heartbeat = message
        if self._heard_ns is None and message.system_status not in BOOTING:
            self._heard_ns = t_ns

    def _note(self, name: str, measurement: Measurement) -> None:
        quantity = quantity_of(measurement)
        if quantity is not None and any(source.name == name for source in self._sources[quantity]):
            self._valid.setdefault((quantity, name), deque()).append(measurement.t_ns)
            if isinstance(measurement, Position):
                self._places[name] = measurement

    def _ask_version(self, t_ns: int) -> list[Frame]:
        if self._heard_ns is None or self.version is not None or self.version_refused:
            return []
        if self._version_asked_ns is not None and t_ns - self._version_asked_ns < ASK_VERSION_NS:
            return []
        self._version_asked_ns = t_ns
        message = dialect.MAVLink_command_long_message(
            self.config.links.autopilot.autopilot_system_id,
            self.config.links.autopilot.autopilot_component_id,
            dialect.MAV_CMD_REQUEST_MESSAGE,
            0,
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
            *[0] * 6,
        )
        return [Frame(t_ns=t_ns, port=AUTOPILOT, data=bytes(message.pack(self._mav)))]


_LOOKED_AT = frozenset(
    {
        dialect.MAVLINK_MSG_ID_COMMAND_ACK,
        dialect.MAVLINK_MSG_ID_HEARTBEAT,
        dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        dialect.MAVLINK_MSG_ID_SYSTEM_TIME,
        dialect.MAVLINK_MSG_ID_RC_CHANNELS,
    }
)
