"""A simulated boat and a companion for tests: send messages, advance time, read the answers."""

from __future__ import annotations

from typing import Any

from asvhil.config import load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.io.mavlink.texts import TextReader
from asvhil.simplant.plant import Plant
from asvhil.types import Frame

CALM = (
    "plant.weather.wind.speed_mps=0",
    "plant.start_n_m=0",
    "plant.start_e_m=0",
    "plant.sensors.gnss.slow_bias_m=0",
    "plant.sensors.fused_velocity.slow_bias_mps=0",
    "plant.sensors.gnss.white_m=0",
    "plant.sensors.gnss.velocity_white_mps=0",
    "plant.sensors.heading.white_deg=0",
    "plant.sensors.imu.gyro_white_radps=0",
    "plant.sensors.imu.accel_white_mps2=0",
    "plant.sensors.imu.accel_bias_mps2=0",
    "plant.sensors.anemometer.speed_white_mps=0",
)
IGNORE = 65535


class Boat:
    """A plant without noise or wind; `run` gives (time in s, message) of all that was sent, peers aside in `peers`."""

    def __init__(self, *overrides: str) -> None:
        self.config = load_config("sitl", (*CALM, *overrides))
        self.plant = Plant(self.config, 0)
        self.t_ns = 0
        self.log: list[tuple[float, Any]] = []
        self.peers: list[str] = []
        self.raw: list[bytes] = []

    @property
    def seat(self) -> Any:
        return self.plant.frontseat

    def send(self, message: Any, system: int = 1, component: int = 191, peer: str = "companion") -> None:
        data = message.pack(mav.MAVLink(None, srcSystem=system, srcComponent=component))
        self.plant.receive(Frame(t_ns=self.t_ns, port="autopilot", data=data, peer=peer))

    def run(self, seconds: float) -> list[tuple[float, Any]]:
        self.t_ns += round(1e9 * seconds)
        found = []
        for frame in self.plant.advance(self.t_ns):
            if frame.port == "autopilot":
                self.raw.append(frame.data)
                for data in FrameSplitter().receive(frame.data):  # none of a message that the dialect has not
                    found.append((frame.t_ns / 1e9, decode(data)))
                    self.peers.append(frame.peer)
        self.log += found
        return found

    def command(self, number: int, *params: float, **to: Any) -> int | None:
        """The result of a command sent as COMMAND_LONG, or None where it is not acknowledged."""
        values = [*params, *[0.0] * (7 - len(params))]
        self.send(mav.MAVLink_command_long_message(to.pop("system", 1), 1, number, 0, *values), **to)
        acks = of(self.run(0.04), "COMMAND_ACK")
        assert all(ack.command == number for ack in acks)
        return acks[0].result if acks else None

    def interval(self, msg_id: int, interval_us: float) -> int | None:
        return self.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, msg_id, interval_us)

    def override(self, port_us: int, starboard_us: int, system: int = 1) -> None:
        self.send(
            mav.MAVLink_rc_channels_override_message(1, 1, port_us, IGNORE, starboard_us, *[IGNORE] * 5), system=system
        )

    def hold(self, port_us: int, starboard_us: int, seconds: float, rate_hz: float = 10.0) -> None:
        """Stream overrides for a while; they end with the last one."""
        for _ in range(round(seconds * rate_hz)):
            self.override(port_us, starboard_us)
            self.run(1.0 / rate_hz)

    def arm(self, force: float = 0.0) -> int | None:
        return self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, force)

    def mode(self, number: int) -> int | None:
        return self.command(mav.MAV_CMD_DO_SET_MODE, 1.0, number)

    def outputs(self) -> tuple[int, int]:
        self.run(0.02)
        return self.seat.outputs_us

    def texts(self) -> list[str]:
        reader = TextReader()
        found = [reader.receive(message) for message in of(self.log, "STATUSTEXT")]
        return [text for text in found if text is not None]

    def ready(self) -> Boat:
        """Past boot and readiness, with the talk of it forgotten."""
        self.run(3.5)
        self.log.clear()
        return self

    def armed(self) -> Boat:
        self.ready()
        assert self.arm() == 0
        return self


def of(log: list[tuple[float, Any]], name: str) -> list[Any]:
    return [message for _, message in log if message.get_type() == name]


def times(log: list[tuple[float, Any]], name: str) -> list[float]:
    return [t for t, message in log if message.get_type() == name]
