"""Apparent to true wind, and its low-pass."""

from __future__ import annotations

import math

from asvhil.config import WindFilterConfig
from asvhil.geo import body_to_ned
from asvhil.types import BowWind, Estimate, TrueWind, Wind, WindSample


def true_wind(sample: WindSample, estimate: Estimate) -> tuple[float, float]:
    """Velocity of the air over ground (m/s, NED): apparent wind by heading, plus the boat's motion."""
    u_air = -sample.speed_mps * math.cos(sample.from_rad) + estimate.u_mps
    v_air = -sample.speed_mps * math.sin(sample.from_rad) + estimate.v_mps
    return body_to_ned(estimate.psi_rad, u_air, v_air)


class WindFilter:
    """First-order low-pass of the true wind vector, and the spread of the samples about it."""

    def __init__(self, config: WindFilterConfig) -> None:
        self._config = config
        self._t_ns: int | None = None
        self._vn = self._ve = self._variance = 0.0

    def on_sample(self, sample: WindSample, estimate: Estimate) -> None:
        """Take in one anemometer sample with the estimate of its time."""
        self._take(sample.t_ns, *true_wind(sample, estimate))

    def on_bow_wind(self, sample: BowWind, estimate: Estimate) -> None:
        """Take in true wind that is told from the bow: the instrument knows the boat's motion, not its heading."""
        ahead, abeam = -sample.speed_mps * math.cos(sample.from_rad), -sample.speed_mps * math.sin(sample.from_rad)
        self._take(sample.t_ns, *body_to_ned(estimate.psi_rad, ahead, abeam))

    def on_true_wind(self, sample: TrueWind) -> None:
        """Take in true wind that is told from the earth."""
        self._take(sample.t_ns, sample.vn_mps, sample.ve_mps)

    def _take(self, t_ns: int, vn: float, ve: float) -> None:
        if not (math.isfinite(vn) and math.isfinite(ve)):
            return
        stale_ns = self._config.stale_after_s * 1e9
        if self._t_ns is None or t_ns - self._t_ns > stale_ns:
            self._vn, self._ve, self._variance = vn, ve, 0.0
        else:
            gain = 1.0 - math.exp(-max(t_ns - self._t_ns, 0) * 1e-9 / self._config.time_constant_s)
            dn, de = vn - self._vn, ve - self._ve
            self._vn += gain * dn
            self._ve += gain * de
            self._variance += gain * (0.5 * (dn * dn + de * de) - self._variance)
        self._t_ns = t_ns

    def wind(self, t_ns: int) -> Wind | None:
        """The filtered wind at a time, or None before the first sample; not valid once it is stale."""
        if self._t_ns is None:
            return None
        return Wind(
            t_ns=t_ns,
            vn_mps=self._vn,
            ve_mps=self._ve,
            std_mps=math.sqrt(self._variance),
            valid=t_ns - self._t_ns <= self._config.stale_after_s * 1e9,
        )
