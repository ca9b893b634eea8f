"""A boat that keeps its station for hours while something fails every few minutes, with an operator who holds again."""

from __future__ import annotations

import math
import resource
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from asvhil.config import Config, FaultConfig
from asvhil.config.ports import AUTOPILOT, OPERATOR
from asvhil.geo import LocalFrame
from asvhil.operator.encoding import encode_hold
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.trials.young_boat import YoungBoat, timed_ms
from asvhil.types import Frame, Phase, record

YOUNG_EVERY_S = 60  # a new boat runs for a second so often
EVERY_S = 300.0  # a fault, and another wind
LOST_S = 150.0  # a hold that is not there again so long after the end of its fault is lost for good
ASK_S = 5.0  # a hold that is not kept is asked for again
RESTED_S = 20.0  # between the last fault's end and the next one, at least
MODES = {"ardurover": (0, 4), "px4": (6 << 16, 4 << 16 | 3 << 24)}  # to be held in, and one that ends a hold

# Kinds of `plant.faults` with their longest time (s), and what happens to links, autopilot and pilot.
OF_THE_BOAT = {
    "gnss-silent": 60.0,
    "gnss-jump": 20.0,
    "gnss-frozen": 30.0,
    "heading-jump": 5.0,
    "imu-silent": 60.0,
    "anemometer": 120.0,
    "anemometer-stuck": 120.0,
    "port-motor": 15.0,
    "starboard-motor": 15.0,
}
OF_THE_LOOP = {
    "link down": 20.0,
    "link lossy": 90.0,
    "link one way": 20.0,
    "autopilot reboots": 1.0,
    "pilot's mode": 15.0,
    "pilot's stick": 5.0,
    "pilot disarms": 10.0,
}


@record
class SoakFault:
    """A fault of a soak: seconds after power-on."""

    kind: str
    from_s: float
    until_s: float


def draw_faults(seed: int, hours: float) -> list[SoakFault]:
    """One fault in each span of `EVERY_S`, of a random kind, begin and length; the first span has none."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(11,)))
    longest = {**OF_THE_BOAT, **OF_THE_LOOP}
    kinds = list(longest)
    faults = []
    for number in range(1, int(hours * 3600.0 / EVERY_S)):
        kind = kinds[int(rng.integers(len(kinds)))]
        lasts_s = float(rng.uniform(1.0, max(1.1, longest[kind])))
        start_s = EVERY_S * number + float(rng.uniform(0.0, EVERY_S - lasts_s - LOST_S - RESTED_S))
        faults.append(SoakFault(kind=kind, from_s=start_s, until_s=start_s + lasts_s))
    return faults


def with_faults(config: Config, faults: list[SoakFault]) -> Config:
    """The config of a soak: the boat's faults, and a hold that an operator asks for."""
    own = tuple(
        FaultConfig.model_validate({"kind": fault.kind, "from_s": fault.from_s, "until_s": fault.until_s})
        for fault in faults
        if fault.kind in OF_THE_BOAT
    )
    supervisor = config.supervisor.model_copy(update={"engage": "command"})
    plant = config.plant.model_copy(update={"faults": own})
    return config.model_copy(update={"supervisor": supervisor, "plant": plant})


class SoakLoop(Lockstep):
    """Lockstep with faults of the links, and with a pilot and an operator who want the station kept."""

    def __init__(self, config: Config, faults: list[SoakFault], seed: int) -> None:
        super().__init__(with_faults(config, faults))
        self._faults = [fault for fault in faults if fault.kind in OF_THE_LOOP]
        self._rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(12,)))
        self._start_ns = self.t_ns
        self._present: SoakFault | None = None
        self._ask_s = 0.0
        self._mode, self._other_mode = MODES[config.plant.autopilot]
        station = config.supervisor.station
        assert station is not None  # of `engage: auto`
        heading_rad = math.radians(station.heading_deg)
        self._hold = encode_hold(config.links.autopilot, station.lat_deg, station.lon_deg, heading_rad)

    @property
    def t_s(self) -> float:
        """Seconds after power-on."""
        return (self.t_ns - self._start_ns) * 1e-9

    def receive(self) -> tuple[Frame, ...]:
        return tuple(frame for frame in super().receive() if frame.port != AUTOPILOT or self._passes(True))

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        super().deliver(tuple(frame for frame in frames if frame.port != AUTOPILOT or self._passes(False)))

    def act(self, phase: Phase) -> None:
        """What pilot, autopilot and operator do before the next tick."""
        self._begin_and_end()
        if phase is not Phase.HOLD and self._present is None and self.t_s >= self._ask_s:
            self._ask_s = self.t_s + ASK_S
            seat = self.plant.frontseat
            seat.set_mode(self._mode)
            seat.arm(True)
            self.inject(OPERATOR, self._hold, "10.0.0.7:14550")

    def _passes(self, inward: bool) -> bool:
        match self._present:
            case SoakFault(kind="link down"):
                return False
            case SoakFault(kind="link one way"):
                return not inward
            case SoakFault(kind="link lossy"):
                return float(self._rng.random()) > 0.3
        return True

    def _begin_and_end(self) -> None:
        seat = self.plant.frontseat
        if self._present is not None:
            if self.t_s >= self._present.until_s:
                if self._present.kind == "pilot's stick":
                    seat.set_sticks({4: 1500})
                self._present = None
            return
        if not self._faults or self.t_s < self._faults[0].from_s:
            return
        self._present = self._faults.pop(0)
        match self._present.kind:
            case "autopilot reboots":
                seat.reboot(self.plant.t_ns)
            case "pilot's mode":
                seat.set_mode(self._other_mode)
            case "pilot disarms":
                seat.arm(False)
            case "pilot's stick":
                seat.set_sticks({4: 1700})


def run_soak(
    config: Config, hours: float, seed: int, on_second: Callable[[int], None] = lambda seconds: None
) -> dict[str, Any]:
    """A soak of so many hours, in one go: its faults with what became of the hold, and per hour memory and time.

    A fault's `back_s` is the time from its end to the hold that goes on or is kept again, None where that did not come
    within `LOST_S`. `tick_ms` is the processor time of a tick, plant and backseat, the median of each hour; `young_ms`
    that of a boat and a backseat that were new at the begin of the hour and run beside these, so that a host that is
    slower for a while changes both. They are in a process of their own: building them would add to this one's memory.
    """
    with YoungBoat(config) as young:
        return _soak(config, hours, seed, young, on_second)


def _soak(
    config: Config, hours: float, seed: int, young: YoungBoat, on_second: Callable[[int], None]
) -> dict[str, Any]:
    faults = draw_faults(seed, hours)
    loop = SoakLoop(config, faults, seed)
    weather_rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(13,)))
    hz = config.daemon.tick_hz
    origin = LocalFrame(lat_deg=config.plant.origin_lat_deg, lon_deg=config.plant.origin_lon_deg)
    station = config.supervisor.station
    assert station is not None
    n_m, e_m = origin.to_ned(station.lat_deg, station.lon_deg)
    fates: list[dict[str, Any]] = [
        {"kind": fault.kind, "from_s": fault.from_s, "until_s": fault.until_s, "ended_by": None, "back_s": None}
        for fault in faults
    ]
    hourly: list[dict[str, float]] = []
    ended: Counter[str] = Counter()
    phase = Phase.STANDBY
    spent_ms: list[float] = []
    off_m: list[float] = []
    young_ms: list[float] = []
    held = at = 0
    seconds = round(hours * 3600.0)
    for second in range(seconds):
        if second % round(EVERY_S) == 0:
            loop.plant.weather.set_wind(float(weather_rng.uniform(0.0, 6.0)), float(weather_rng.uniform(0.0, 360.0)))
        if second % 3600 == 0:
            young.renew()
        if second % YOUNG_EVERY_S == 0:
            young_ms += young.ticks_ms(round(hz))
        for _ in range(round(hz)):
            loop.act(phase)
            elapsed_ms, outputs = timed_ms(loop)
            spent_ms.append(elapsed_ms)
            while at + 1 < len(fates) and loop.t_s >= fates[at + 1]["from_s"]:
                at += 1
            if phase is Phase.HOLD and outputs.phase is not Phase.HOLD:
                ended[outputs.health.code] += 1
                if fates and fates[at]["ended_by"] is None and loop.t_s >= fates[at]["from_s"]:
                    fates[at]["ended_by"] = outputs.health.code
            phase = outputs.phase
            held += phase is Phase.HOLD
            if fates and fates[at]["back_s"] is None and phase is Phase.HOLD:
                since_s = loop.t_s - fates[at]["until_s"]
                if 0.0 <= since_s <= LOST_S:
                    fates[at]["back_s"] = since_s
        truth = loop.plant.truth
        off_m.append(math.hypot(truth.n_m - n_m, truth.e_m - e_m))
        on_second(second + 1)
        if (second + 1) % 3600 == 0 or second + 1 == seconds:
            hourly.append(
                {
                    "resident_kb": float(_resident_kb()),
                    "tick_ms": float(np.median(spent_ms)),
                    "young_ms": float(np.median(young_ms)),
                    "off_m_median": float(np.median(off_m)),
                    "off_m_most": float(max(off_m)),
                }
            )
            spent_ms, young_ms, off_m = [], [], []
    return {
        "hours": hours,
        "seed": seed,
        "faults": fates,
        "ended": dict(ended.most_common()),
        "held_share": held / (seconds * hz),
        "hourly": hourly,
        "peak_kb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
    }


def _resident_kb() -> int:
    return int(Path("/proc/self/status").read_text().split("VmRSS:")[1].split()[0])
