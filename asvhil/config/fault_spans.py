"""Which faults are present at a time, of spans in the config, and what they do to the sensors of each device."""

from __future__ import annotations

import math
from collections.abc import Iterable

from asvhil.config.plant_faults import FaultConfig
from asvhil.types import record

FOREVER_NS = 2**63
DRIFT_NS = 100_000_000  # what drifts moves on so often
OF_DEVICE = {"gnss": ("autopilot", "gnss-silent"), "ins-gnss": ("ins", "gnss-silent")}  # names for one device alone


@record
class SensorFaults:
    """The faults of receiver, heading and IMU of one device.

    `turn_rad` is a jump, which a filter holds off for a while; `compass_rad` has been there since it was mounted.
    """

    jump_n_m: float = 0.0
    jump_e_m: float = 0.0
    turn_rad: float = 0.0
    compass_rad: float = 0.0
    gnss_frozen: bool = False
    gnss_silent: bool = False
    heading_silent: bool = False
    imu_silent: bool = False


SOUND = SensorFaults()


class Present(frozenset[str]):
    """The kinds of fault that are present, the faults of the sensors of each device, and the thrust that is left."""

    _sensors: dict[str, SensorFaults]
    thrust_left: tuple[float, float] = (1.0, 1.0)  # of the port and of the starboard motor
    battery_v: float | None = None  # None: as it should be

    @classmethod
    def of_faults(cls, faults: Iterable[tuple[FaultConfig, float]]) -> Present:
        """Of faults with the seconds since their begin."""
        present = tuple(faults)
        self = cls(fault.kind for fault, _ in present)
        self._sensors = {device: _sensor_faults(present, device) for device in ("autopilot", "ins", "nmea")}
        sizes = {fault.kind: fault.magnitude for fault, _ in present}
        self.thrust_left = sizes.get("port-motor-weak", 1.0), sizes.get("starboard-motor-weak", 1.0)
        self.battery_v = sizes.get("battery")
        return self

    def of(self, device: str) -> SensorFaults:
        """The faults of the sensors of one device: autopilot, ins, nmea."""
        return self._sensors[device] if self else SOUND


HEALTHY = Present()


class Faults:
    """The faults that are present at a time; times count from power-on, ends are not part of a span."""

    def __init__(self, faults: Iterable[FaultConfig], start_ns: int) -> None:
        self._spans = tuple(
            (start_ns + round(1e9 * fault.from_s), start_ns + _ns(fault.to_s), fault) for fault in faults
        )
        self._now = HEALTHY
        self._next_ns = -FOREVER_NS if self._spans else FOREVER_NS

    def at(self, t_ns: int) -> Present:
        """The faults that are present at a time, which must not decrease. Called at each step, so fast."""
        if t_ns >= self._next_ns:
            spans = [(first_ns, fault) for first_ns, end_ns, fault in self._spans if first_ns <= t_ns < end_ns]
            self._now = Present.of_faults((fault, 1e-9 * (t_ns - first_ns)) for first_ns, fault in spans)
            edges = (edge_ns for first_ns, end_ns, _ in self._spans for edge_ns in (first_ns, end_ns))
            self._next_ns = min((edge_ns for edge_ns in edges if edge_ns > t_ns), default=FOREVER_NS)
            if "heading-drift" in self._now:
                self._next_ns = min(self._next_ns, t_ns + DRIFT_NS)
        return self._now


def _sensor_faults(present: Iterable[tuple[FaultConfig, float]], device: str) -> SensorFaults:
    """The faults present in one device, with the seconds since their begin; jumps are added."""
    kinds: set[str] = set()
    n_m = e_m = turn_deg = compass_deg = 0.0
    for fault, age_s in present:
        only, kind = OF_DEVICE.get(fault.kind, (fault.device, fault.kind))
        if only not in (None, device):
            continue
        kinds.add(kind)
        if kind == "gnss-jump":
            n_m += fault.magnitude * math.cos(math.radians(fault.toward_deg))
            e_m += fault.magnitude * math.sin(math.radians(fault.toward_deg))
        elif kind == "heading-jump":
            turn_deg += fault.magnitude
        elif kind == "compass-turned":
            compass_deg += fault.magnitude
        elif kind == "heading-drift":
            compass_deg += fault.magnitude * age_s
    return SensorFaults(
        jump_n_m=n_m,
        jump_e_m=e_m,
        turn_rad=math.radians(turn_deg),
        compass_rad=math.radians(compass_deg),
        gnss_frozen="gnss-frozen" in kinds,
        gnss_silent="gnss-silent" in kinds,
        heading_silent="heading-silent" in kinds,
        imu_silent="imu-silent" in kinds,
    )


def _ns(seconds: float) -> int:
    return FOREVER_NS if math.isinf(seconds) else round(1e9 * seconds)
