"""A session with one operator, without a link."""

from __future__ import annotations

import math

from asvhil.config import OperatorLinkConfig, load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.operator.reports import OperatorReport
from asvhil.operator.session import OperatorRequest, OperatorSession
from asvhil.supervisor.reasons import Explanation
from asvhil.types import Frame

S = 1_000_000_000
CONFIG = load_config("sitl").links.autopilot
GCS = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
LAT, LON = 404237000, -869212000
ALL = 0b111111111111
POSITION_ONLY = 0b110111111000  # position; not yaw, rates or accelerations


class Bench:
    """An operator's link, its clock, and a ground station's mouth and ears."""

    def __init__(self, parameters: tuple[str, ...] = (), **operator: object) -> None:
        self.link = OperatorSession(CONFIG, OperatorLinkConfig(**operator), parameters)  # type: ignore[arg-type]
        self.t_ns = 0

    def say(self, message, peer: str = "gcs:1", after_ns: int = 100_000_000) -> list[OperatorRequest]:  # type: ignore[no-untyped-def]
        self.t_ns += after_ns
        data = bytes(message.pack(GCS))
        return self.link.receive(Frame(t_ns=self.t_ns, port="operator", data=data, peer=peer))

    def hear(self, situation: OperatorReport = OperatorReport(), values=lambda name: 0.5) -> list:  # type: ignore[no-untyped-def,type-arg]  # noqa: B008
        self.t_ns += 1
        return messages(self.link.data_to_send(self.t_ns, situation, values))

    def answer(self, request: OperatorRequest, refusal: Explanation | None, after_ns: int = 0) -> list:  # type: ignore[type-arg]
        """The acknowledgement and the texts that answer a request."""
        self.t_ns += after_ns
        self.link.answer(self.t_ns, request, refusal)
        return [m for m in self.hear() if m.get_type() in ("COMMAND_ACK", "STATUSTEXT")]


def messages(frames: list[Frame]) -> list:  # type: ignore[type-arg]
    return [decode(data) for frame in frames for data in FrameSplitter().receive(frame.data)]


def acks(heard: list) -> list[tuple[int, int, int]]:  # type: ignore[type-arg]
    return [(m.command, m.result, m.get_srcComponent()) for m in heard if m.get_type() == "COMMAND_ACK"]


def reposition(frame: int = 0, x: int = LAT, y: int = LON, yaw: float = math.nan, to=(1, 191)):  # type: ignore[no-untyped-def]
    return dialect.MAVLink_command_int_message(*to, frame, 192, 0, 0, -1, 0, 0, yaw, x, y, 0)


def setpoint(mask: int = POSITION_ONLY, frame: int = 6, x: int = LAT, y: int = LON, to=(1, 191), **fields: float):  # type: ignore[no-untyped-def]
    values = {
        "vx": 0.0,
        "vy": 0.0,
        "vz": 0.0,
        "afx": 0.0,
        "afy": 0.0,
        "afz": 0.0,
        "yaw": 0.0,
        "yaw_rate": 0.0,
        **fields,
    }
    return dialect.MAVLink_set_position_target_global_int_message(0, *to, frame, mask, x, y, 0.0, *values.values())


def loiter_long(lat: float, lon: float, yaw_deg: float = math.nan):  # type: ignore[no-untyped-def]
    return dialect.MAVLink_command_long_message(1, 191, 17, 0, 0, 0, 0, yaw_deg, lat, lon, 0)


NAMES = tuple(f"P_{number}" for number in range(12))
