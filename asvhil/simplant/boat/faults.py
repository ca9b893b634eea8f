"""Faults of the simulated boat: spans of time from the config, or drawn from the seed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from asvhil.config import OF_ONE_DEVICE, FaultConfig, GlitchesConfig, PlantConfig
from asvhil.simplant.boat.vessel import NO_SIGNAL_US
from asvhil.types import record

FOREVER_NS = 2**63
GLITCH_STREAM = 5  # of the plant's seed; 0 to 4 are those of the weather and the sensors
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

    @classmethod
    def of_faults(cls, faults: Iterable[FaultConfig]) -> Present:
        present = tuple(faults)
        self = cls(fault.kind for fault in present)
        self._sensors = {device: _sensor_faults(present, device) for device in ("autopilot", "ins", "nmea")}
        weak = {fault.kind: fault.magnitude for fault in present}
        self.thrust_left = weak.get("port-motor-weak", 1.0), weak.get("starboard-motor-weak", 1.0)
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
            self._now = Present.of_faults(fault for first_ns, end_ns, fault in self._spans if first_ns <= t_ns < end_ns)
            edges = (edge_ns for first_ns, end_ns, _ in self._spans for edge_ns in (first_ns, end_ns))
            self._next_ns = min((edge_ns for edge_ns in edges if edge_ns > t_ns), default=FOREVER_NS)
        return self._now


def all_faults(plant: PlantConfig) -> tuple[FaultConfig, ...]:
    """The faults of the config, and the glitches that its seed draws."""
    if plant.glitches is None:
        return plant.faults
    seed = np.random.SeedSequence(plant.seed, spawn_key=(GLITCH_STREAM,))
    return (*plant.faults, *_glitches(plant.glitches, np.random.default_rng(seed)))


def motor_signals_us(outputs_us: tuple[int, int], faults: frozenset[str], neutral_us: int) -> tuple[int, int]:
    """The pulse widths (port, starboard) that reach the motors: 0 for a dead one, mirrored for a reversed one.

    Swapped: each motor hangs on the other's output. The other kinds name the motor, not the output.
    """
    if not faults:
        return outputs_us
    port_us, starboard_us = reversed(outputs_us) if "motors-swapped" in faults else outputs_us
    return (
        _signal_us(port_us, "port-motor", faults, neutral_us),
        _signal_us(starboard_us, "starboard-motor", faults, neutral_us),
    )


def _signal_us(output_us: int, motor: str, faults: frozenset[str], neutral_us: int) -> int:
    if motor in faults or output_us == NO_SIGNAL_US:
        return NO_SIGNAL_US
    return 2 * neutral_us - output_us if f"{motor}-reversed" in faults else output_us


def _glitches(config: GlitchesConfig, rng: np.random.Generator) -> Iterator[FaultConfig]:
    """Rounds of all kinds in random order, so that a run of a few minutes has each of them."""
    t_s = config.from_s
    while True:
        for number in rng.permutation(len(config.kinds)):
            glitch = config.kinds[number]
            t_s += float(rng.exponential(config.gap_s))
            end_s = t_s + float(rng.uniform(glitch.least_s, glitch.most_s))
            device = glitch.device or (config.device if glitch.kind in OF_ONE_DEVICE else None)
            toward_deg, side = float(rng.uniform(0.0, 360.0)), float(rng.choice((-1.0, 1.0)))
            if end_s > config.until_s:
                return
            fault = FaultConfig(
                kind=glitch.kind,
                from_s=t_s,
                until_s=end_s,
                size=glitch.size,
                toward_deg=toward_deg,
                device=device,
            )
            yield fault.model_copy(update={"size": side * fault.magnitude}) if fault.kind == "heading-jump" else fault
            t_s = end_s + config.rest_s


def _sensor_faults(present: Iterable[FaultConfig], device: str) -> SensorFaults:
    """The faults present in one device; jumps are added."""
    kinds: set[str] = set()
    n_m = e_m = turn_deg = compass_deg = 0.0
    for fault in present:
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
