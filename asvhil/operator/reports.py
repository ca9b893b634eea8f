"""What operators get without asking: heartbeat, named values, the station as a position target, texts. Sans-IO."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from asvhil import __version__
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.encoding import STATION_ONLY
from asvhil.operator.goto import DENIED, IGNORE_VELOCITY
from asvhil.operator.state_arrays import BoatState, docking_values, energy_values, state_arrays
from asvhil.supervisor.reasons import Explanation, describe
from asvhil.types import DockingWindow, EnergyUse, Note, Phase, record

INFO, NOTICE, WARNING = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_NOTICE, dialect.MAV_SEVERITY_WARNING
ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)
HEARTBEAT_ID = dialect.MAVLINK_MSG_ID_HEARTBEAT
VERSION_ID = dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
INTERVAL_ID = dialect.MAVLINK_MSG_ID_MESSAGE_INTERVAL
VALUES_ID = dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT
TARGET_ID = dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT
TEXT_ID = dialect.MAVLINK_MSG_ID_STATUSTEXT
COMPUTER_ID = dialect.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS
ARRAYS_ID = dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY  # on request alone
FASTEST_US = 100_000.0  # the slowest daemon has a tick for no more
SLOWEST_US = 2e9  # MESSAGE_INTERVAL tells no more
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
)
PHASES = (Phase.STANDBY, Phase.PREPARE, Phase.HOLD, Phase.FAILSAFE)
STATES = {
    Phase.STANDBY: dialect.MAV_STATE_STANDBY,
    Phase.PREPARE: dialect.MAV_STATE_STANDBY,
    Phase.HOLD: dialect.MAV_STATE_ACTIVE,
    Phase.FAILSAFE: dialect.MAV_STATE_CRITICAL,
}


@record
class OperatorReport:
    """Errors to the station that is held, the latest solution, and the station itself.

    What is not known is NaN; `station` is (latitude, longitude in degrees, heading in rad), None where none is held,
    and `station_moves_mps` its velocity (north, east), None where it has none.
    `adrift`: a failure has ended the hold, and nobody has taken the motors since. `why` tells the phase's reason,
    `notes` what is wrong; `computer` is the latest ONBOARD_COMPUTER_STATUS. `boat` is for displays.
    """

    phase: Phase = Phase.STANDBY
    distance_m: float = math.nan
    heading_error_rad: float = math.nan
    solve_ms: float = math.nan
    iterations: float = math.nan
    control_ok: bool = True
    station: tuple[float, float, float] | None = None
    station_moves_mps: tuple[float, float] | None = None
    adrift: bool = False
    why: Explanation | None = None
    notes: tuple[Note, ...] = ()
    computer: Any = None
    boat: BoatState = BoatState()
    docking: DockingWindow | None = None
    energy: EnergyUse | None = None

    def texts(self) -> list[tuple[int, str]]:
        """The phase and its reason, mode and sources, then the notes: (severity, text)."""
        said = [] if self.why is None else [(NOTICE, f"{self.phase}: {describe(self.why)}")]
        said += [(INFO, f"{subject}: {text}") for subject, text in self.boat.words()]
        return said + [(NOTICE if note.ok else WARNING, f"{note.subject}: {note.text}") for note in self.notes]


class Reports:
    """The rates of the reports, as MAV_CMD_SET_MESSAGE_INTERVAL may change them, and their messages."""

    def __init__(self, report_hz: float) -> None:
        report_us = 1e6 / report_hz if report_hz > 0.0 else -1.0
        self._usual_us = {HEARTBEAT_ID: 1e6, VALUES_ID: report_us, TARGET_ID: report_us, COMPUTER_ID: 1e6}
        self._interval_us = dict(self._usual_us)
        self._due_ns: dict[int, int] = {}
        self._start_ns: int | None = None
        self._interval_asked: int = VALUES_ID

    def command(self, m: Any) -> tuple[int, int | None]:
        """Commands about messages: the MAV_RESULT, and the id of a message to `build` after its acknowledgement."""
        msg_id = int(m.param1) if abs(m.param1) < 2.0**24 else -1  # also not where it is NaN
        match m.command:
            case dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
                return self._set_interval(msg_id, m.param2), None
            case dialect.MAV_CMD_GET_MESSAGE_INTERVAL if msg_id in self._interval_us:
                self._interval_asked = msg_id
                return ACCEPTED, INTERVAL_ID
            case dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
                return ACCEPTED, VERSION_ID
            case dialect.MAV_CMD_REQUEST_MESSAGE if msg_id in (*self._interval_us, VERSION_ID, TEXT_ID, ARRAYS_ID):
                return ACCEPTED, msg_id
            case dialect.MAV_CMD_REQUEST_MESSAGE | dialect.MAV_CMD_GET_MESSAGE_INTERVAL:
                return DENIED, None
            case _:
                return int(dialect.MAV_RESULT_UNSUPPORTED), None

    def _set_interval(self, msg_id: int, interval_us: float) -> int:
        """-1 stops, 0 is the usual rate; the MAV_RESULT. The heartbeat's rate is not to be changed."""
        if msg_id not in self._interval_us or msg_id == HEARTBEAT_ID or math.isnan(interval_us):
            return DENIED
        if interval_us not in (-1.0, 0.0) and not FASTEST_US <= interval_us <= SLOWEST_US:
            return DENIED
        self._interval_us[msg_id] = self._usual_us[msg_id] if interval_us == 0.0 else interval_us
        self._due_ns.pop(msg_id, None)
        return ACCEPTED

    def take_due(self, t_ns: int, report: OperatorReport, *, quiet: bool = False) -> list[Any]:
        """Messages whose time has come, each then due again one interval on; `quiet`: the heartbeat alone."""
        found: list[Any] = []
        for msg_id, interval_us in self._interval_us.items():
            if interval_us < 0.0 or (quiet and msg_id != HEARTBEAT_ID) or t_ns < self._due_ns.get(msg_id, t_ns):
                continue
            interval_ns = round(interval_us * 1e3)
            due_ns = self._due_ns.get(msg_id, t_ns) + interval_ns
            self._due_ns[msg_id] = due_ns if due_ns > t_ns else t_ns + interval_ns  # after a pause no burst
            found += self.build(t_ns, msg_id, report)
        return found

    def build(self, t_ns: int, msg_id: int, report: OperatorReport) -> list[Any]:
        """The messages of one kind; none where the report has nothing for it."""
        self._start_ns = t_ns if self._start_ns is None else self._start_ns
        t_ms = (t_ns - self._start_ns) // 1_000_000 % 2**32
        if msg_id == HEARTBEAT_ID:
            return [self._heartbeat(report)]
        if msg_id == VERSION_ID:
            return [_version()]
        if msg_id == INTERVAL_ID:
            asked = self._interval_asked
            return [dialect.MAVLink_message_interval_message(asked, round(self._interval_us[asked]))]
        if msg_id == VALUES_ID:
            return [dialect.MAVLink_named_value_float_message(t_ms, *row) for row in _rows(report)]
        if msg_id == COMPUTER_ID:
            return [] if report.computer is None else [_anew(report.computer)]
        if msg_id == ARRAYS_ID:
            return state_arrays(t_ms * 1000, report.boat)
        return [] if report.station is None else [_target(t_ms, report.station, report.station_moves_mps)]

    @staticmethod
    def _heartbeat(report: OperatorReport) -> Any:
        phase = report.phase
        mode = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (
            dialect.MAV_MODE_FLAG_GUIDED_ENABLED if phase is Phase.HOLD else 0
        )
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_ONBOARD_CONTROLLER,
            dialect.MAV_AUTOPILOT_INVALID,
            mode,
            PHASES.index(phase),
            dialect.MAV_STATE_EMERGENCY if report.adrift else STATES[phase],
            3,
        )


def _rows(report: OperatorReport) -> Sequence[tuple[bytes, float]]:
    """Names of at most 10 bytes, and values; those that are not known are left out."""
    optional = docking_values(report.docking) | energy_values(report.energy)
    rows = (
        (b"phase", float(PHASES.index(report.phase))),
        (b"dist_err", report.distance_m),
        (b"head_err", math.degrees(report.heading_error_rad)),
        (b"solve_ms", report.solve_ms),
        (b"solve_iter", report.iterations),
        (b"solve_ok", float(report.control_ok)),
        *((name.encode(), value) for name, value in optional.items() if value is not None),
    )
    return [row for row in rows if math.isfinite(row[1])]


def _anew(message: Any) -> Any:
    """A message that was received, to be sent."""
    return type(message)(*(getattr(message, name) for name in message.fieldnames))


def _version() -> Any:
    """AUTOPILOT_VERSION: our version and capabilities."""
    major, minor, patch = [*(int(part) for part in re.findall(r"\d+", __version__)), 0, 0, 0][:3]
    number = major << 24 | minor << 16 | patch << 8 | int(dialect.FIRMWARE_VERSION_TYPE_OFFICIAL)
    return dialect.MAVLink_autopilot_version_message(CAPABILITIES, number, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0)


def _target(t_ms: int, station: tuple[float, float, float], moves_mps: tuple[float, float] | None) -> Any:
    lat_deg, lon_deg, psi_rad = station
    vn, ve = moves_mps or (0.0, 0.0)
    return dialect.MAVLink_position_target_global_int_message(
        t_ms,
        dialect.MAV_FRAME_GLOBAL_INT,
        STATION_ONLY if moves_mps is None else STATION_ONLY & ~IGNORE_VELOCITY,
        round(lat_deg * 1e7),
        round(lon_deg * 1e7),
        0.0,
        vn,
        ve,
        0.0,
        0.0,
        0.0,
        0.0,
        psi_rad,
        0.0,
    )
