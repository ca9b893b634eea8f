"""A mean wind as people give it, SPEED@DEG from the station's heading, and as the config keeps it, from north."""

from __future__ import annotations

import math

from asvhil.config.plant_weather import MOST_WIND_MPS
from asvhil.config.root import Config
from asvhil.errors import ConfigError
from asvhil.types import record


@record
class WindSector:
    """Mean wind of one condition: speed (m/s), and where it blows toward from the station's heading (degrees)."""

    speed_mps: float
    toward_deg: float

    def __str__(self) -> str:
        return f"{self.speed_mps:g}@{self.toward_deg:g}"


def parse_wind(text: str) -> WindSector:
    """SPEED@DEG, such as 6@90. ConfigError where it is none."""
    speed, sign, toward = text.partition("@")
    try:
        speed_mps, toward_deg = float(speed), float(toward) if sign else 0.0
    except ValueError:
        speed_mps = toward_deg = math.nan
    if not (math.isfinite(speed_mps) and math.isfinite(toward_deg)):
        raise ConfigError(
            f"--wind {text}: SPEED@DEG is expected, such as 3@90 (m/s, toward, from the station's heading)"
        )
    if not 0.0 <= speed_mps <= MOST_WIND_MPS:
        raise ConfigError(f"--wind {text}: a speed of 0 to {MOST_WIND_MPS:g} m/s is expected, not {speed_mps:g}")
    return WindSector(speed_mps=speed_mps, toward_deg=toward_deg)


def parse_course(text: str) -> tuple[float, float]:
    """Speed (m/s) and course (degrees from north, in [0, 360)) of SPEED@DEG, such as 0.3@90. ConfigError where none."""
    speed, sign, course = text.partition("@")
    try:
        speed_mps, course_deg = float(speed), float(course) if sign else math.nan
    except ValueError:
        speed_mps = course_deg = math.nan
    if not (math.isfinite(speed_mps) and math.isfinite(course_deg)):
        raise ConfigError(f"--drift {text}: SPEED@DEG is expected, such as 0.3@90 (m/s, toward, from north)")
    if speed_mps < 0.0:
        raise ConfigError(f"--drift {text}: a speed of 0 m/s or more is expected, not {speed_mps:g}")
    return speed_mps, course_deg % 360.0


def station_heading_deg(config: Config) -> float:
    """The heading of a config's station, 0 without one."""
    station = config.supervisor.station
    return 0.0 if station is None else station.heading_deg


def from_north_deg(toward_deg: float, heading_deg: float) -> float:
    """A direction from the station's heading as one from north, in [0, 360)."""
    return (toward_deg + heading_deg) % 360.0


def wind_keys(wind: WindSector, config: Config) -> dict[str, float]:
    """The keys below plant.weather.wind that make this the mean wind at the config's station."""
    toward_deg = from_north_deg(wind.toward_deg, station_heading_deg(config))
    return {"speed_mps": wind.speed_mps, "toward_deg": toward_deg}
