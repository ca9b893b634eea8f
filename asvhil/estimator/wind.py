"""Apparent to true wind, its low-pass filter, and faults of the anemometer."""

from __future__ import annotations

import math

from asvhil.config import WindFilterConfig
from asvhil.estimator import sensor_health
from asvhil.estimator.sensor_health import FreezeLimits, Track
from asvhil.geo import body_to_ned, ned_to_body, wrap_rad
from asvhil.types import ApparentWind, BowWind, Estimate, Note, TrueWind, Wind

CUPS = FreezeLimits(noise=0.03, motion=0.5)  # m/s
VANE_TURN_RAD = math.radians(35.0)  # one and a half of the steps of a vane with 16 positions
VANE_MOVES_MPS = 1.0  # in less wind a vane may not move
AGREED = 5  # samples that make a wind one to compare others with for as long as it takes
LONGEST_WAIT = 5.0  # times leap_after_s: a squall, however strong, is taken for one then
CALM_MPS = 0.5  # in less wind the direction is undefined


def true_wind(sample: ApparentWind, estimate: Estimate) -> tuple[float, float]:
    """Velocity of the air over ground (m/s, NED): apparent wind by heading, plus the boat's motion."""
    u_air = -sample.speed_mps * math.cos(sample.from_rad) + estimate.u_mps
    v_air = -sample.speed_mps * math.sin(sample.from_rad) + estimate.v_mps
    return body_to_ned(estimate.psi_rad, u_air, v_air)


def apparent_wind(wind_ned: tuple[float, float], estimate: Estimate) -> tuple[float, float]:
    """Speed (m/s) and direction FROM, clockwise from the bow (rad), of a true wind, relative to the moving boat."""
    ahead, abeam = ned_to_body(estimate.psi_rad, *wind_ned)
    ahead, abeam = ahead - estimate.u_mps, abeam - estimate.v_mps
    return math.hypot(ahead, abeam), math.atan2(-abeam, -ahead)


class WindFilter:
    """First-order low-pass filter of the true wind, with the standard deviation of the samples.

    Speed and direction have time constants of their own: cups follow a gust at once, while a vane with 16 positions is
    up to 11 degrees off, which only an average over swings of the boat and gusts removes.
    """

    def __init__(self, config: WindFilterConfig) -> None:
        self._config = config
        self._t_ns: int | None = None
        self._vn = self._ve = self._variance = 0.0
        self._agreed = 0  # samples in a row that were near enough to the wind so far
        self._leap_ns: int | None = None  # since when each sample has been far from the wind so far
        self._rejected_ns: int | None = None
        self._cups = Track()
        self._vane_rad = math.nan
        self._vane_since_ns = 0
        self._vane_wind = 0.0, 0.0  # the true wind when the vane last turned, and where it should have stood in it
        self._vane_expected_rad = 0.0
        self._stuck = ""

    def on_apparent_wind(self, sample: ApparentWind, estimate: Estimate) -> None:
        """Add one anemometer sample, with the estimate at its time. A sample of a stuck sensor is not used."""
        if not (math.isfinite(sample.speed_mps) and math.isfinite(sample.from_rad)):
            return
        was_stuck = self._stuck
        self._stuck = self._stuck_part(sample, estimate)
        if self._stuck:
            return
        if was_stuck:
            self._t_ns = None  # samples since then are invalid
        self._add(sample.t_ns, *true_wind(sample, estimate))

    def on_bow_wind(self, sample: BowWind, estimate: Estimate) -> None:
        """Add a true wind relative to the bow, of an instrument that knows the boat's motion but not its heading."""
        self._forget_vane()
        ahead = -sample.speed_mps * math.cos(sample.from_rad)
        abeam = -sample.speed_mps * math.sin(sample.from_rad)
        self._add(sample.t_ns, *body_to_ned(estimate.psi_rad, ahead, abeam))

    def on_true_wind(self, sample: TrueWind) -> None:
        """Add a true wind relative to north."""
        self._forget_vane()
        self._add(sample.t_ns, sample.vn_mps, sample.ve_mps)

    def _forget_vane(self) -> None:
        """Another source is in use: what was stuck of the cups and the vane says nothing of it."""
        if self._stuck:
            self._stuck, self._t_ns = "", None

    def wind(self, t_ns: int) -> Wind | None:
        """The filtered wind at a time, None before the first sample; not valid when stale or stuck."""
        if self._t_ns is None:
            return None
        return Wind(
            t_ns=t_ns,
            vn_mps=self._vn,
            ve_mps=self._ve,
            std_mps=math.sqrt(self._variance),
            valid=not self._stuck and t_ns - self._t_ns <= self._config.stale_after_s * 1e9,
        )

    def notes(self, t_ns: int) -> tuple[Note, ...]:
        """Notes: the anemometer is stuck, silent, or sends implausible values."""
        text = self._stuck
        if not text and self._rejected_ns is not None and t_ns - self._rejected_ns <= self._config.stale_after_s * 1e9:
            text = "implausible"
        if self._t_ns is not None and t_ns - max(self._t_ns, self._cups.received_ns) > self._config.stale_after_s * 1e9:
            text = "silent"
        return (Note(subject="anemometer", text=text, ok=False),) if text else ()

    def _add(self, t_ns: int, vn: float, ve: float) -> None:
        if not (math.isfinite(vn) and math.isfinite(ve)):
            return
        if not self._is_plausible(t_ns, vn, ve):
            self._rejected_ns = t_ns
            return
        config = self._config
        if self._t_ns is None or t_ns - self._t_ns > config.stale_after_s * 1e9:
            self._vn, self._ve, self._variance = vn, ve, 0.0
        else:
            elapsed_s = max(t_ns - self._t_ns, 0) * 1e-9
            gain = 1.0 - math.exp(-elapsed_s / config.speed_time_constant_s)
            turn_gain = 1.0 - math.exp(-elapsed_s / config.time_constant_s)
            dn, de = vn - self._vn, ve - self._ve
            speed = math.hypot(self._vn, self._ve)
            if min(speed, math.hypot(vn, ve)) < CALM_MPS:
                self._vn += gain * dn
                self._ve += gain * de
            else:
                speed += gain * (math.hypot(vn, ve) - speed)
                toward_rad = math.atan2(self._ve, self._vn)
                toward_rad += turn_gain * wrap_rad(math.atan2(ve, vn) - toward_rad)
                self._vn, self._ve = speed * math.cos(toward_rad), speed * math.sin(toward_rad)
            self._variance += turn_gain * (0.5 * (dn * dn + de * de) - self._variance)
        self._t_ns = t_ns
        self._agreed += 1

    def _is_plausible(self, t_ns: int, vn: float, ve: float) -> bool:
        """Whether a sample is plausible: a single outlier would disturb the prediction, and with it the position."""
        config = self._config
        if math.hypot(vn, ve) > config.speed_max_mps:
            return False
        # A wind that is old since each sample after it was rejected is still what they are compared with, if enough of
        # them had agreed with it.
        heard_ns = self._t_ns
        if heard_ns is not None and self._rejected_ns is not None and self._agreed >= AGREED:
            heard_ns = max(heard_ns, self._rejected_ns)
        known = heard_ns is not None and t_ns - heard_ns <= config.stale_after_s * 1e9
        self._agreed = self._agreed if known else 0
        leap_mps = math.hypot(vn - self._vn, ve - self._ve)
        if not known or leap_mps <= config.leap_max_mps:
            self._leap_ns = None
            return True
        self._leap_ns = t_ns if self._leap_ns is None else self._leap_ns
        # What a wrong wind does to the prediction grows as its square.
        wait_s = min((leap_mps / config.leap_max_mps) ** 2, LONGEST_WAIT) * config.leap_after_s
        if t_ns - self._leap_ns < wait_s * 1e9:
            return False
        self._agreed = 0  # with another wind
        return True

    def _stuck_part(self, sample: ApparentWind, estimate: Estimate) -> str:
        """Which part of the anemometer is stuck, as text; empty if none.

        Cups: the same speed to the last bit, from a sensor that used to be noisy. Vane: the same direction, while the
        boat has turned in a wind that was known. On a boat that does not turn, a vane that stays shows nothing.
        """
        if self._config.stuck_after_s is None:
            return ""
        known = self._t_ns is not None
        speed, _ = apparent_wind((self._vn, self._ve), estimate) if known else (sample.speed_mps, 0.0)
        after_ns = round(self._config.stuck_after_s * 1e9)
        self._cups = sensor_health.update(
            self._cups, sample.t_ns, (sample.speed_mps, 0.0), (speed, 0.0), CUPS, after_ns
        )
        self._cups = self._cups if self._cups.frozen else sensor_health.accept(self._cups, sample.t_ns)
        if self._cups.frozen and sample.speed_mps > 0.0:  # zero is normal in a calm
            return "stuck"
        return "vane stuck" if self._is_vane_stuck(sample, estimate, after_ns) else ""

    def _is_vane_stuck(self, sample: ApparentWind, estimate: Estimate, after_ns: int) -> bool:
        if self._t_ns is None:
            return False
        if sample.from_rad != self._vane_rad:
            self._vane_rad, self._vane_since_ns = sample.from_rad, sample.t_ns
            self._vane_wind = self._vn, self._ve
            self._vane_expected_rad = apparent_wind(self._vane_wind, estimate)[1]
            return False
        speed, expected_rad = apparent_wind(self._vane_wind, estimate)
        turned = abs(wrap_rad(expected_rad - self._vane_expected_rad)) > VANE_TURN_RAD
        return self._stuck == "vane stuck" or (
            speed > VANE_MOVES_MPS and turned and sample.t_ns - self._vane_since_ns >= after_ns
        )
