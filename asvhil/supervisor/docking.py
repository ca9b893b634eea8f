"""Docking windows while a station is held: open or not, and how likely one stays open. Sans-IO.

A window is open as long as the boat is slow, turns slowly and lies in a sector about the target heading (the paper's
definition). What ends one is a peak of speed, yaw rate or heading error, so the forecast looks at how often such peaks
come: by Rice's formula for the rate at which a Gaussian signal crosses a limit,

    nu = sigma_dot / (2 pi sigma) exp(-(L - mean)^2 / (2 sigma^2)),

from the mean, variance and rate of change of the last minutes, and by how often windows have ended of late. Where they
end rarely, it is most of all the way back to the station that ends one, so that the distance counts. `docking_odds`
makes a probability of these and of the present state.
"""

from __future__ import annotations

import math

from asvhil.geo import ned_to_body, wrap_rad
from asvhil.supervisor.docking_odds import stays_open
from asvhil.supervisor.stations import LEAP_M
from asvhil.types import DockingWindow, Estimate, Station

DOCKING_SPEED_MPS = 0.5
DOCKING_RATE_RADPS = math.radians(5.0)
DOCKING_RADIUS_M = 15.0
DOCKING_SECTOR_DEG = 40.0  # in all, about the target heading

GAP_NS = 1_000_000_000  # without an estimate or a station for so long all is forgotten
EVERY_S = 1.0  # between two samples of the statistics
EVERY_NS = round(EVERY_S * 1e9)
FORGET_S = 300.0  # time constant with which the motion and the windows that have ended are forgotten
HALF_SECTOR_RAD = math.radians(0.5 * DOCKING_SECTOR_DEG)
LEAST_S = 20.0  # of statistics, before there is a forecast
PRIOR_ENDS, PRIOR_S = 0.5, 15.0  # what is taken for granted of the windows before the first
LEAST_RATE = 1e-5  # per second: rarer peaks are alike
CALM_LOG = -2.0  # of the rate of ends: below, windows end rarely
TURNED_RAD = math.radians(5.0)  # by which an operator turns a station for its window to be another


def relative_velocity(estimate: Estimate, station: Station) -> tuple[float, float]:
    """The boat's velocity relative to its station (u, v in m/s): whoever docks goes along with one that moves."""
    if not station.moves:
        return estimate.u_mps, estimate.v_mps
    u_mps, v_mps = ned_to_body(estimate.psi_rad, station.vn_mps, station.ve_mps)
    return estimate.u_mps - u_mps, estimate.v_mps - v_mps


def inside(estimate: Estimate, station: Station) -> bool:
    """Whether an estimate is in a docking window of a station."""
    return (
        math.hypot(*relative_velocity(estimate, station)) < DOCKING_SPEED_MPS
        and abs(estimate.r_radps) < DOCKING_RATE_RADPS
        and math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m) < DOCKING_RADIUS_M
        and abs(wrap_rad(estimate.psi_rad - station.psi_rad)) < HALF_SECTOR_RAD
    )


class Peaks:
    """How often a signal crosses a limit to either side: its moments with forgetting, and Rice's rate of them."""

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self.reset()

    def reset(self) -> None:
        self._last: float | None = None
        self._weight = self._mean = self._square = self._change = 0.0

    def add(self, value: float) -> None:
        """A sample, `EVERY_S` after the last one."""
        keep = 1.0 - EVERY_S / FORGET_S
        self._weight = keep * self._weight + 1.0
        gain = 1.0 / self._weight
        self._mean += gain * (value - self._mean)
        self._square += gain * (value * value - self._square)
        if self._last is not None:
            self._change += gain * ((value - self._last) ** 2 - self._change)
        self._last = value

    @property
    def rate_per_s(self) -> float:
        """Crossings of both limits in a second."""
        variance = self._square - self._mean * self._mean
        if variance <= 0.0:
            return 0.0
        crossings = math.sqrt(self._change / variance) / (EVERY_S * math.tau)
        return crossings * math.fsum(
            math.exp(-((self.limit - side * self._mean) ** 2) / (2.0 * variance)) for side in (1.0, -1.0)
        )


class DockingWatch:
    """Follows the windows of the station that is held; `features` are those of the forecast, None while it has none."""

    def __init__(self) -> None:
        self._signals = (
            Peaks(DOCKING_SPEED_MPS),
            Peaks(DOCKING_SPEED_MPS),
            Peaks(DOCKING_RATE_RADPS),
            Peaks(HALF_SECTOR_RAD),
        )
        self._forget()

    def _forget(self) -> None:
        for signal in self._signals:
            signal.reset()
        self._open_ns: int | None = None
        self._sampled_ns: int | None = None
        self._seen_ns = 0
        self._known_s = self._open_s = self._ends = 0.0
        self._station: Station | None = None
        self._put_n_m = self._put_e_m = self._put_rad = 0.0  # by operators, since the window's statistics began
        self.features: tuple[float, ...] | None = None
        self._stays: tuple[float, ...] = ()

    def step(
        self, t_ns: int, estimate: Estimate | None, station: Station | None, *, put: bool = False
    ) -> DockingWindow | None:
        """In each tick, with the station that is held: its window. None without a valid estimate or a station.

        `put`: an operator has moved the station or given it a heading since the last tick. What it turns by itself,
        with the weather or as the boat happens to lie, goes on with the same window.
        """
        if estimate is None or not estimate.valid or station is None:
            if t_ns - self._seen_ns > GAP_NS:
                self._forget()
            return None
        if t_ns - self._seen_ns > GAP_NS or (put and self._is_another(station)):
            self._forget()
        self._seen_ns, self._station = t_ns, station
        if not inside(estimate, station):
            self._ends += self._open_ns is not None
            self._open_ns = self.features = None
            self._stays = ()
        elif self._open_ns is None:
            self._open_ns = t_ns
        if self._sampled_ns is None or t_ns - self._sampled_ns >= EVERY_NS:
            self._sampled_ns = t_ns
            self._sample(t_ns, estimate, station)
        open_s = None if self._open_ns is None else (t_ns - self._open_ns) * 1e-9
        return DockingWindow(open_s=open_s, stays=self._stays)

    def _is_another(self, station: Station) -> bool:
        """Whether operators have put it elsewhere since its statistics began; a set-point that jitters has not."""
        before = self._station
        if before is None:
            return False
        self._put_n_m += station.n_m - before.n_m
        self._put_e_m += station.e_m - before.e_m
        self._put_rad += wrap_rad(station.psi_rad - before.psi_rad)
        return math.hypot(self._put_n_m, self._put_e_m) > LEAP_M or abs(self._put_rad) > TURNED_RAD

    def _sample(self, t_ns: int, estimate: Estimate, station: Station) -> None:
        off_rad = wrap_rad(estimate.psi_rad - station.psi_rad)
        values = *relative_velocity(estimate, station), estimate.r_radps, off_rad
        for signal, value in zip(self._signals, values, strict=True):
            signal.add(value)
        self._known_s += EVERY_S
        keep = 1.0 - EVERY_S / FORGET_S
        self._ends *= keep
        self._open_s = keep * self._open_s + (EVERY_S if self._open_ns is not None else 0.0)
        if self._open_ns is None or self._known_s < LEAST_S:
            return
        peaks = math.fsum(signal.rate_per_s for signal in self._signals)
        ends = math.log((self._ends + PRIOR_ENDS) / (self._open_s + PRIOR_S))
        nearest = max(abs(value) / signal.limit for signal, value in zip(self._signals, values, strict=True))
        calm = max(0.0, CALM_LOG - ends)
        distance_m = math.hypot(estimate.n_m - station.n_m, estimate.e_m - station.e_m)
        self.features = 1.0, math.log(peaks + LEAST_RATE), ends, nearest, calm, calm * distance_m
        self._stays = stays_open(self.features)
