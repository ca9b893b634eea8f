"""ArduPilot's JSON physics interface, sans-IO: servo frames in, the boat's true motion out, in lockstep.

The autopilot sends a frame, waits for the answer, and takes the time in it for its own. It sends the same frame again
where no answer comes within a second, so only a frame with a new number may step the physics.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from asvhil.config import OF_ONE_DEVICE, Config, FaultConfig, GlitchConfig, PlantConfig
from asvhil.errors import ConfigError
from asvhil.geo import GRAVITY_MPS2, ned_to_body, wrap_2pi, wrap_rad
from asvhil.simplant.hil.plant import OFF, HilPlant
from asvhil.simplant.vehicle.wiring import wired_motors
from asvhil.types import Frame, record

PORT = "physics"
FIRST_RATE_HZ = 1200
LOWEST_RATE_HZ = 20  # below, a step would be longer than the 0.05 s that the plant is good for
ANOTHER_AFTER_NS = 500_000_000  # a second autopilot is heard once the first has been silent for that long
COUNTS = 1 << 32

OF_THE_AUTOPILOT = {"transmitter": "SIM_RC_FAIL", "battery": "SIM_BATT_VOLTAGE"}  # faults that it simulates itself
_FORMATS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}  # by magic number
_SIZES = {format_.size for format_ in _FORMATS.values()}
_STATE = (
    '\n{"timestamp":%.9f,"imu":{"gyro":[0,0,%.9f],"accel_body":[%.9f,%.9f,%.5f]},"position":[%.9f,%.9f,0],'
    '"attitude":[0,0,%.9f],"velocity":[%.9f,%.9f,0]%s}\n'
)


@record
class ServoFrame:
    """What the autopilot sends: the rate at which it wants to be stepped, the frame's number, 16 or 32 outputs (us)."""

    rate_hz: int
    count: int
    pwm_us: tuple[int, ...]


@dataclass
class JsonCounters:
    """What came. `lost` are the numbers that were skipped; `bad` datagrams and those of `strangers` get no answer."""

    frames: int = 0
    duplicates: int = 0
    lost: int = 0
    restarts: int = 0
    strangers: int = 0
    bad: int = 0
    why_bad: str = ""


def parse_servos(data: bytes) -> ServoFrame | str:
    """A servo frame, or in words why these bytes are none."""
    if len(data) not in _SIZES:
        return f"{len(data)} bytes where 40 (16 channels) or 72 (32 channels) are right"
    magic = data[0] | data[1] << 8
    format_ = _FORMATS.get(magic)
    if format_ is None or format_.size != len(data):
        return f"magic number {magic} in {len(data)} bytes where 18458 in 40 or 29569 in 72 is right"
    _, rate_hz, count, *pwm_us = format_.unpack(data)
    if rate_hz < LOWEST_RATE_HZ:
        return f"frame rate {rate_hz} where {LOWEST_RATE_HZ} Hz or more is right: SIM_RATE_HZ"
    return ServoFrame(rate_hz=rate_hz, count=count, pwm_us=tuple(pwm_us))


class ArduPilotJson:
    """The server's side of the interface. `receive` gives the answer, and what other sensors sent meanwhile."""

    def __init__(self, config: Config) -> None:
        """Raises ConfigError for a fault that the interface cannot carry."""
        for where, fault in _named_faults(config.plant):
            if fault.kind == "gnss" or (fault.kind in OF_ONE_DEVICE and fault.device in (None, "autopilot")):
                raise ConfigError(
                    f"key {where}.kind: ArduPilot's JSON interface carries the true motion and no fix; "
                    f"take {fault.kind} out, and use the autopilot's own SIM_ parameters"
                )
            if fault.kind in OF_THE_AUTOPILOT:
                own = OF_THE_AUTOPILOT[fault.kind]
                raise ConfigError(f"key {where}.kind: take {fault.kind} out, and use the autopilot's own {own}")
        hil, pwm = config.plant.hil, config.vehicle.pwm
        self._port, self._starboard = wired_motors(pwm)
        self._neutral_us, self._band_us = pwm.neutral_us, hil.neutral_band_us
        self._windvane = hil.ardupilot.windvane
        self._vane_rad = 0.0
        self._tail = _optional_parts(hil.ardupilot.rc_us, hil.ardupilot.battery_v)
        self.plant = HilPlant(config, 1.0 / FIRST_RATE_HZ, sample_each_step=False)
        self.counters = JsonCounters()
        self.rate_hz = 0
        self.outputs_us = OFF
        self._peer: str | None = None
        self._heard_ns = 0
        self._count = -1
        self._reply = b""

    def receive(self, frame: Frame) -> list[Frame]:
        """One datagram. The first frame of the answer, if any, goes back to its sender."""
        servos = parse_servos(frame.data)
        counters = self.counters
        if isinstance(servos, str):
            counters.bad += 1
            counters.why_bad = servos
            return []
        if frame.peer != self._peer:
            if self._peer is not None and frame.t_ns - self._heard_ns < ANOTHER_AFTER_NS:
                counters.strangers += 1
                return []
            if self._peer is not None:
                self._restart()
            self._peer = frame.peer
        self._heard_ns = frame.t_ns
        sent: list[Frame] = []
        if servos.count == self._count:
            counters.duplicates += 1
        else:
            sent = self._step(servos)
        return [Frame(t_ns=frame.t_ns, port=PORT, data=self._reply, peer=frame.peer), *sent]

    def _step(self, servos: ServoFrame) -> list[Frame]:
        if self._count >= 0:
            ahead = (servos.count - self._count) % COUNTS  # the number wraps after 41 days at 1200 Hz
            if ahead >= COUNTS // 2 or (servos.count == 0 and ahead > 1):
                self._restart()
            else:
                self.counters.lost += ahead - 1
        self._count = servos.count
        self.counters.frames += 1
        self.rate_hz = servos.rate_hz
        us = servos.pwm_us
        outputs_us = self.outputs_us = self._port.plain_us(us), self._starboard.plain_us(us)
        neutral = all(abs(pulse_us - self._neutral_us) <= self._band_us for pulse_us in outputs_us)
        plant = self.plant
        plant.set_step(1.0 / servos.rate_hz)
        sent = plant.step(outputs_us, neutral=neutral)
        self._reply = self._state()
        return sent

    def _restart(self) -> None:
        self.counters.restarts += 1
        self._count = -1
        self.plant.restart()

    def _state(self) -> bytes:
        """The answer. The boat neither heaves nor tilts, so gravity stays on the z axis of its accelerometers."""
        motion = self.plant.motion
        vn, ve = motion.ground_velocity_ned()
        return (
            _STATE
            % (
                self.plant.t_ns * 1e-9,
                motion.r_radps,
                motion.ax_mps2,
                motion.ay_mps2,
                -GRAVITY_MPS2,
                motion.n_m,
                motion.e_m,
                wrap_rad(motion.psi_rad),
                vn,
                ve,
                self._vane() + self._tail,
            )
        ).encode()

    def _vane(self) -> str:
        """The apparent wind, without the errors of the boat's own anemometer; left out while that is silent."""
        faults = self.plant.faults
        if not self._windvane or "anemometer" in faults:
            return ""
        truth, motion = self.plant.truth, self.plant.motion
        vn, ve = motion.ground_velocity_ned()
        ahead, abeam = ned_to_body(motion.psi_rad, truth.wind_n_mps - vn, truth.wind_e_mps - ve)
        if not faults & {"vane", "anemometer-stuck"}:
            self._vane_rad = wrap_2pi(math.atan2(-abeam, -ahead))
        return f',"windvane":{{"direction":{self._vane_rad:.6f},"speed":{math.hypot(ahead, abeam):.6f}}}'


def _named_faults(plant: PlantConfig) -> Iterator[tuple[str, FaultConfig | GlitchConfig]]:
    """Everything that can break, each with its key."""
    yield from ((f"plant.faults.{number}", fault) for number, fault in enumerate(plant.faults))
    if plant.glitches is not None:
        yield from ((f"plant.glitches.kinds.{number}", kind) for number, kind in enumerate(plant.glitches.kinds))


def _optional_parts(rc_us: tuple[int, ...], battery_v: float | None) -> str:
    parts = ""
    if rc_us:
        sticks = ",".join(f'"rc_{channel}":{pulse_us}' for channel, pulse_us in enumerate(rc_us, 1))
        parts += f',"rc":{{{sticks}}}'
    if battery_v is not None:
        parts += f',"battery":{{"voltage":{battery_v:.3f},"current":0.000}}'
    return parts
