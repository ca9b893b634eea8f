"""A wind from the station's heading, and what the config makes of it."""

import pytest

from asvhil.config import load_config
from asvhil.config.mean_wind import from_north_deg, parse_wind, station_heading_deg, wind_keys


@pytest.mark.parametrize(
    ("toward_deg", "heading_deg", "expected"),
    [(90.0, 0.0, 90.0), (-90.0, 0.0, 270.0), (90.0, 300.0, 30.0), (0.0, 360.0, 0.0), (-45.0, -45.0, 270.0)],
)
def test_a_direction_from_the_stations_heading_becomes_one_from_north(
    toward_deg: float, heading_deg: float, expected: float
) -> None:
    assert from_north_deg(toward_deg, heading_deg) == expected


def test_the_keys_of_a_wind_turn_with_the_station_of_the_config() -> None:
    turned = load_config("sitl", ("supervisor.station.heading_deg=100",))
    assert wind_keys(parse_wind("3@90"), turned) == {"speed_mps": 3.0, "toward_deg": 190.0}
    without = load_config("sitl", ("supervisor.engage=command", "supervisor.station=null"))
    assert station_heading_deg(without) == 0.0
    assert wind_keys(parse_wind("3@90"), without) == {"speed_mps": 3.0, "toward_deg": 90.0}


def test_a_wind_reads_back_from_its_own_text() -> None:
    for text in ("3@90", "6.5@-45", "0@0"):
        assert str(parse_wind(text)) == text
