"""Wind with gusts, waves, and a constant current, uniform over the area of the simulated boat."""

from __future__ import annotations

import math

import numpy as np

from asvhil.config import WeatherConfig, WindConfig
from asvhil.simplant.boat.noise import NormalSource, OrnsteinUhlenbeck
from asvhil.simplant.boat.waves import Waves


class Weather:
    """Mean wind plus Ornstein-Uhlenbeck gusts along and across it, and the current, as NED velocities (m/s).

    With `wind.spread` the two processes are those of the logarithm of the speed, and of the direction, instead.
    `mean_mps` is the speed of the mean wind; a change of it takes effect with the next step, of a wind with gusts.
    `waves` are stepped by the vessel; None if there are none.
    """

    __slots__ = (
        "_across",
        "_along",
        "_east",
        "_log_mean",
        "_north",
        "_spread",
        "_still",
        "_toward_rad",
        "current_e_mps",
        "current_n_mps",
        "mean_mps",
        "waves",
        "wind_e_mps",
        "wind_n_mps",
    )

    def __init__(self, config: WeatherConfig, step_s: float, seed: np.random.SeedSequence) -> None:
        wind, current = config.wind, config.current
        along_seed, across_seed, wave_seed = seed.spawn(3)
        self._spread = wind.spread is not None
        self.set_wind(wind.speed_mps, wind.toward_deg)
        along_std, across_std = _standard_deviations(wind)
        self._log_mean = -0.5 * along_std**2  # of a speed over its mean
        self._along = OrnsteinUhlenbeck(along_std, wind.gust_time_s, step_s, NormalSource(along_seed))
        self._across = OrnsteinUhlenbeck(across_std, wind.gust_time_s, step_s, NormalSource(across_seed))
        self._still = along_std == 0.0 and across_std == 0.0
        self.current_n_mps = current.speed_mps * math.cos(math.radians(current.toward_deg))
        self.current_e_mps = current.speed_mps * math.sin(math.radians(current.toward_deg))
        self.wind_n_mps = self.wind_e_mps = 0.0
        rough = config.waves.orbital_std_mps > 0.0 or config.waves.yaw_std_radps > 0.0
        self.waves = Waves(config.waves, wind.toward_deg, step_s, wave_seed) if rough else None
        self._compose(self._along.value, self._across.value)

    def set_wind(self, speed_mps: float, toward_deg: float) -> None:
        """Another mean wind from the next step on, of a wind with gusts; these and the waves stay as they are."""
        self.mean_mps = speed_mps
        self._toward_rad = math.radians(toward_deg)
        self._north = math.cos(math.radians(toward_deg))
        self._east = math.sin(math.radians(toward_deg))

    def set_step(self, step_s: float) -> None:
        """Steps of another length from now on, of the waves too."""
        self._along.set_step(step_s)
        self._across.set_step(step_s)
        if self.waves is not None:
            self.waves.set_step(step_s)

    def advance(self) -> None:
        """Advance the gusts by one step."""
        if self._still:
            return
        self._compose(self._along.advance(), self._across.advance())

    def _compose(self, along: float, across: float) -> None:
        if self._spread:
            speed_mps = self.mean_mps * math.exp(self._log_mean + along)
            self.wind_n_mps = speed_mps * math.cos(self._toward_rad + across)
            self.wind_e_mps = speed_mps * math.sin(self._toward_rad + across)
            return
        along += self.mean_mps
        self.wind_n_mps = self._north * along - self._east * across
        self.wind_e_mps = self._east * along + self._north * across


def _standard_deviations(wind: WindConfig) -> tuple[float, float]:
    """Of the gusts along and across (m/s), or of the logarithm of the speed and of the direction (rad)."""
    if wind.spread is None:
        return wind.gust_along * wind.speed_mps, wind.gust_across * wind.speed_mps
    if wind.speed_mps == 0.0:
        return 0.0, 0.0
    return math.sqrt(math.log1p((wind.spread.speed_mps / wind.speed_mps) ** 2)), math.radians(wind.spread.toward_deg)
