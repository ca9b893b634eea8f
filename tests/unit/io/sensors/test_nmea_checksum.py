"""The checksum of NMEA 0183, against sentences that others have written down."""

import pytest

from asvhil.io.sensors.nmea_checksum import nmea_checksum, nmea_sentence
from tests.support.nmea import sentence


@pytest.mark.parametrize(
    "line",
    [
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47",
        "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A",
        "$*00",
    ],
)
def test_sentences_from_the_literature(line: str) -> None:
    body = line[1:-3]
    assert nmea_checksum(body.encode()) == int(line[-2:], 16)
    assert nmea_sentence(body) == f"{line}\r\n".encode() == sentence(body)
