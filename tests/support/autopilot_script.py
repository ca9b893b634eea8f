"""The simulated boat with the script on its autopilot, armed in HOLD, and a companion that sends it orders."""

from __future__ import annotations

import struct
import zlib
from typing import Any

from asvhil.autopilot.script_protocol import AliveSign, Order, ScriptReason, ScriptState
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.types import Frame
from tests.support.paths import ROOT
from tests.support.simplant_boat import IGNORE, Boat, of

SCRIPT = (ROOT / "firmware" / "ardupilot_script" / "asvhil.lua").read_text(encoding="ascii")
PATH = "/APM/scripts/asvhil.lua"
HOLD, MANUAL = 4, 0
OWN, AUTOPILOT = (1, 191), (1, 1)
# Nobody at a transmitter, as on a boat that is driven from a ground station.
NO_PILOT = ("plant.frontseat.rc_receiver=false", "plant.frontseat.mygcs_system_id=255")
NEUTRAL = (1500, 1500)


def parameters(**more: float) -> str:
    given = {"SCR_ENABLE": 1.0, "FS_THR_ENABLE": 0.0, **more}
    return f"plant.frontseat.parameters={{{', '.join(f'{name}: {value}' for name, value in given.items())}}}"


def order_frame(
    order: int,
    start: int,
    count: int,
    pulses_us: tuple[int, int],
    *,
    sender: tuple[int, int] = OWN,
    target: tuple[int, int] = AUTOPILOT,
    version: int = 1,
    payload_type: int = 42353,
    length: int = 16,
    check_xor: int = 0,
    check_as: tuple[int, int] | None = None,
) -> bytes:
    """An order as a frame with a right MAVLink checksum, whatever is wrong inside."""
    body = struct.pack("<BBHIHH", version, order, start, count, *pulses_us)
    head = struct.pack("<BBHBBB", *(check_as or sender), payload_type, *target, length)
    payload = body + struct.pack("<I", zlib.crc32(head + body) ^ check_xor)
    message = mav.MAVLink_tunnel_message(*target, payload_type, length, payload.ljust(128, b"\0"))
    return bytes(message.pack(mav.MAVLink(None, srcSystem=sender[0], srcComponent=sender[1])))


class ScriptBoat(Boat):
    """`start` begins a session, `drive` goes on with it; `motors` are the pulses at both outputs."""

    def __init__(self, text: str = SCRIPT, *overrides: str, **more: float) -> None:
        super().__init__(parameters(**more), *NO_PILOT, *overrides)
        self.seat.files[PATH] = text.encode("ascii")
        self.alive = AliveSign()
        self.session = 0
        self.count = 0
        self.run(3.5)
        assert self.mode(HOLD) == 0

    def armed(self) -> ScriptBoat:
        assert self.arm() == 0, self.texts()
        self.run(0.6)
        return self

    def run(self, seconds: float) -> list[tuple[float, Any]]:
        found = super().run(seconds)
        for message in of(found, "NAMED_VALUE_FLOAT"):
            self.alive.receive(self.t_ns, message)
        return found

    @property
    def state(self) -> ScriptState:
        assert self.alive.state is not None, "the script gives no sign of life"
        return self.alive.state

    @property
    def reason(self) -> ScriptReason | None:
        return self.state.reason

    @property
    def motors(self) -> tuple[int, int]:
        """After one more main loop."""
        self.run(0.02)
        return self.now

    @property
    def now(self) -> tuple[int, int]:
        """As they are."""
        servo_us = self.seat.rover.servo_us
        return servo_us[0], servo_us[2]

    def put(self, frame: bytes, seconds: float = 0.02) -> None:
        self.plant.receive(Frame(t_ns=self.t_ns, port="autopilot", data=frame, peer="companion"))
        self.run(seconds)

    def next_order(self, pulses_us: tuple[int, int], order: int = Order.DRIVE, **wrong: Any) -> bytes:
        self.count += 1
        given = {"start": self.session, "count": self.count, **wrong}
        return order_frame(order, pulses_us=pulses_us, **given)

    def drive(self, pulses_us: tuple[int, int], **wrong: Any) -> None:
        self.put(self.next_order(pulses_us, **wrong))

    def start(self, pulses_us: tuple[int, int] = (1600, 1400), **wrong: Any) -> ScriptBoat:
        self.session, self.count = self.state.start, 0
        self.drive(pulses_us, **wrong)
        return self

    def driving(self) -> ScriptBoat:
        """Armed, with a session that drives."""
        self.armed().start((1600, 1400))
        assert self.motors == (1600, 1400)
        return self

    def emergency_stop(self, on: bool) -> None:
        assert self.command(mav.MAV_CMD_DO_AUX_FUNCTION, 31.0, 2.0 if on else 0.0) == 0

    def stick(self, first_us: int, second_us: int) -> None:
        """The pilot's sticks, from a ground station."""
        self.send(
            mav.MAVLink_rc_channels_override_message(1, 1, first_us, IGNORE, second_us, *[IGNORE] * 5),
            system=255,
            component=190,
            peer="station",
        )
        self.run(0.02)
