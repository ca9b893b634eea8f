"""A look at a running daemon by its operator link: its phase with the reason, its notes, errors, station, computer."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from typing import Any

from asvhil.config import AutopilotLinkConfig
from asvhil.config.link_spec import LinkSpec, parse_spec
from asvhil.config.mavlink import SigningConfig
from asvhil.config.ports import OPERATOR
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import decode, dialect, source
from asvhil.io.mavlink.signature_filter import SignatureFilter
from asvhil.io.mavlink.texts import TextReader
from asvhil.links.link import why
from asvhil.links.operator_client import KINDS, RESEND_S, called, with_key
from asvhil.operator.encoding import encode_presence, encode_question
from asvhil.operator.remarks import OVER
from asvhil.operator.reports import PHASES
from asvhil.operator.state_arrays import DOCKING_FIELDS, ENERGY_FIELDS, STATE_ID, read_state
from asvhil.supervisor.energy import CURVE, MEASURED
from asvhil.types import Frame

STATES = {
    dialect.MAV_STATE_STANDBY: "standby",
    dialect.MAV_STATE_ACTIVE: "active",
    dialect.MAV_STATE_CRITICAL: "critical",
    dialect.MAV_STATE_EMERGENCY: "emergency",
}
QUESTIONS = (
    dialect.MAVLINK_MSG_ID_HEARTBEAT,
    dialect.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT,
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT,
    dialect.MAVLINK_MSG_ID_ONBOARD_COMPUTER_STATUS,
    dialect.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY,
    dialect.MAVLINK_MSG_ID_STATUSTEXT,  # the last: once its answer is there, all are
)
AFTER_S = 0.15  # the rest of a burst
Look = dict[str, Any]


class OperatorListener:
    """Asks a daemon how it is. Raises LinkError where nobody answers."""

    def __init__(self, config: AutopilotLinkConfig, endpoint: str, signing: SigningConfig | None = None) -> None:
        self._config = config
        self._endpoint = endpoint
        self._daemon = (config.system_id, config.component_id)
        self._signer, verifier = with_key(signing)
        self._accepts = SignatureFilter((), verifier)
        spec = parse_spec(endpoint)
        if spec.scheme not in KINDS:
            listens = "udpin: or tcpin:, such as udpin:127.0.0.1:14660"
            raise LinkError(f"{endpoint}: the daemon does not listen there; links.operator.endpoint must be {listens}")
        self._spec: LinkSpec = spec

    def look(self, timeout_s: float = 2.0) -> Look:
        """How the daemon is now; what is not known is None."""
        end_s = time.monotonic() + timeout_s
        reason = "no answer"
        while time.monotonic() < end_s:
            try:
                with called(self._spec) as link:
                    while time.monotonic() < end_s:
                        self._ask(link)
                        look = self._hear(link, min(time.monotonic() + RESEND_S, end_s))
                        if look is not None:
                            return look
            except ConnectionError as error:  # not up, or not up yet
                reason = "no answer" if self._spec.scheme == "udpin" else why(error)
                time.sleep(0.1)
            except OSError as error:
                raise LinkError(f"{self._endpoint}: cannot be reached ({why(error)})") from None
        raise LinkError(f"{self._endpoint}: {reason}; is `asvhil run` up, with its operator link there?")

    def _ask(self, link: Any) -> None:
        for data in (encode_presence(), *(encode_question(self._config, msg_id) for msg_id in QUESTIONS)):
            link.sendall(data if self._signer is None else self._signer.sign(data, time.time_ns()))

    def _hear(self, link: Any, until_s: float) -> Look | None:
        """What comes until a moment after the last answer; None where that does not come."""
        look: Look = {"phase": None, "state": None, "reason": None, "notes": {}, "station": None, "computer": None}
        values: dict[str, float] = {}
        texts = TextReader()
        for message in self._messages(link, until_s):
            match message.get_type():
                case "HEARTBEAT" if message.custom_mode < len(PHASES):
                    look["phase"] = PHASES[message.custom_mode].value
                    look["state"] = STATES.get(message.system_status, str(message.system_status))
                case "NAMED_VALUE_FLOAT":
                    values[message.name] = message.value
                case "POSITION_TARGET_GLOBAL_INT":
                    look["station"] = {
                        "lat_deg": message.lat_int * 1e-7,
                        "lon_deg": message.lon_int * 1e-7,
                        "heading_deg": math.degrees(message.yaw) % 360.0,
                        "speed_mps": math.hypot(message.vx, message.vy),
                        "course_deg": math.degrees(math.atan2(message.vy, message.vx)) % 360.0,
                    }
                case "DEBUG_FLOAT_ARRAY" if message.array_id == STATE_ID:
                    look["boat"] = read_state(message)
                case "ONBOARD_COMPUTER_STATUS":
                    look["computer"] = computer_status(message)
                case "STATUSTEXT":
                    _take_text(look, texts.receive(message))
        if look["phase"] is None or look["reason"] is None:
            return None
        look["distance_m"] = values.get("dist_err")
        look["heading_error_deg"] = values.get("head_err")
        look["solve_ms"] = values.get("solve_ms")
        look["docking"] = _docking(values)
        look["energy"] = _energy(values)
        return look

    def _messages(self, link: Any, until_s: float) -> Iterator[Any]:
        """What the daemon sends until a time, or until shortly after its last answer."""
        answers = 0
        while (left_s := until_s - time.monotonic()) > 0.0:
            link.settimeout(left_s)
            data = b""
            with contextlib.suppress(TimeoutError):
                data = link.recv(65536)
                if not data:
                    raise ConnectionResetError
            heard = Frame(t_ns=time.monotonic_ns(), port=OPERATOR, data=data, peer=self._endpoint)
            for frame in self._accepts.receive(heard, time.time_ns()) if data else ():
                message = decode(frame) if source(frame) == self._daemon else None
                if message is None:
                    continue
                if message.get_type() == "COMMAND_ACK" and message.command == dialect.MAV_CMD_REQUEST_MESSAGE:
                    answers += 1
                    if answers == len(QUESTIONS):
                        until_s = min(until_s, time.monotonic() + AFTER_S)
                yield message


def _docking(values: dict[str, float]) -> dict[str, Any] | None:
    """Seconds that the docking window has been open, None while it is not, and the probabilities; None: not told."""
    open_s, *stays = (values.get(name) for name in DOCKING_FIELDS)
    if open_s is None:
        return None
    return {"open_s": open_s or None, "stays": [likely for likely in stays if likely is not None] if open_s else []}


def _energy(values: dict[str, float]) -> dict[str, Any] | None:
    """Wh of the hold, mean power, hours left, each None where not told, and how the power is known; None: no news."""
    if not any(name in values for name in ENERGY_FIELDS):
        return None
    hold_wh, mean_w, hours_left, measured = (values.get(name) for name in ENERGY_FIELDS)
    by = "" if measured is None else MEASURED if measured else CURVE
    return {"hold_wh": hold_wh, "mean_w": mean_w, "hours_left": hours_left, "by": by}


def _take_text(look: Look, text: str | None) -> None:
    """A text is the phase with its reason, or a note; each is SUBJECT: TEXT."""
    subject, separator, rest = (text or "").partition(": ")
    if not separator:
        return
    if subject in [phase.value for phase in PHASES]:
        look["reason"] = rest
    elif rest not in OVER:
        look["notes"][subject] = rest


def computer_status(m: Any) -> Look:
    """ONBOARD_COMPUTER_STATUS in JSON types, without what it does not tell."""
    unknown = 2**32 - 1
    cores = [load for load in m.cpu_cores if load <= 100]
    hot = [degrees for degrees in m.temperature_core if degrees != 127]
    return {
        "load_percent": round(sum(cores) / len(cores)) if cores else None,
        "temperature_degc": max(hot) if hot else None,
        "ram_free_mib": m.ram_total - m.ram_usage if unknown not in (m.ram_total, m.ram_usage) else None,
        "disk_free_mib": m.storage_total[0] - m.storage_usage[0] if m.storage_total[0] != unknown else None,
        "up_s": m.uptime / 1000.0,
    }
