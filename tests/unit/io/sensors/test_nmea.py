"""NMEA wind sentences by literal bytes; hostile bytes are counted and never raise."""

import math
import random

import pynmeagps
import pytest

from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.types import ApparentWind, Frame
from tests.support.nmea import sentence


def feed(codec: NmeaCodec, data: bytes, t_ns: int = 7) -> list[ApparentWind]:
    found = [m for _, m in codec.decode(Frame(t_ns=t_ns, port="anemometer", data=data))]
    return [m for m in found if isinstance(m, ApparentWind)]


@pytest.mark.parametrize(
    ("data", "speed", "angle_deg"),
    [
        (b"$WIMWV,214.8,R,0.1,K,A*28\r\n", 0.1 / 3.6, 214.8),  # literal sentence of the NMEA literature
        (sentence("WIMWV,045.0,R,10.0,N,A"), 5.14444, 45.0),
        (sentence("WIMWV,0.0,R,5.2,M,A"), 5.2, 0.0),
        (sentence("IIMWV,359.9,R,10.0,S,A"), 4.4704, 359.9),
    ],
)
def test_apparent_wind(data: bytes, speed: float, angle_deg: float) -> None:
    (sample,) = feed(NmeaCodec("anemometer"), data)
    assert sample.t_ns == 7
    assert sample.speed_mps == pytest.approx(speed, rel=1e-4)
    assert sample.from_rad == pytest.approx(math.radians(angle_deg))


@pytest.mark.parametrize(
    ("data", "counter"),
    [
        (b"$WIMWV,214.8,R,0.1,K,A*29\r\n", "bad_checksum"),  # wrong checksum
        (sentence("WIMWV,214.8,R,0.1,M,V"), "void"),  # the instrument says so itself
        (sentence("WIMWV,,R,,M,V"), "void"),
        (sentence("WIMWV,,R,,M,A"), "missing_field"),
        (sentence("WIMWV,10.0,R,-3.0,M,A"), "out_of_range"),
        (sentence("WIMWV,10.0,R,3.0,X,A"), "malformed"),
        (sentence("WIMWV,10.0,R,nan,M,A"), "malformed"),
        (sentence("WIMWV,10.0,T,3.0,M,A"), "unused"),  # true wind: not what this source gives
        (sentence("GPZDA,160012.71,11,03,2004,-1,00"), "unknown"),
        (b"no sentence at all\n", "garbage"),
    ],
)
def test_what_is_no_wind_is_counted(data: bytes, counter: str) -> None:
    codec = NmeaCodec("anemometer")
    assert feed(codec, data) == []
    assert dict(codec.counters())[f"anemometer.{counter}"] == 1


def test_any_chunking_gives_the_same_samples() -> None:
    data = sentence("WIMWV,10.0,R,3.0,M,A") * 5
    for size in (1, 2, 7, 26):
        codec = NmeaCodec("anemometer")
        found = [s for at in range(0, len(data), size) for s in feed(codec, data[at : at + size])]
        assert len(found) == 5


def test_our_speed_and_angle_are_those_of_the_library_that_writes_them() -> None:
    message = pynmeagps.NMEAMessage("WI", "MWV", 0, angle=123.4, reference="R", speed=7.8, speedu="M", status="A")
    (sample,) = feed(NmeaCodec("anemometer"), message.serialize())
    assert (sample.speed_mps, math.degrees(sample.from_rad)) == pytest.approx((7.8, 123.4))


def test_hostile_bytes_never_raise_and_the_next_sentence_is_read() -> None:
    noise = random.Random(2)
    codec = NmeaCodec("anemometer")
    for _ in range(250):
        feed(codec, noise.randbytes(4096))
    good = sentence("WIMWV,45.0,R,5.2,M,A")
    for _ in range(3000):
        body = bytearray(good[1:-5])
        for _ in range(3):
            body[noise.randrange(len(body))] = noise.randrange(32, 127)
        feed(codec, sentence(body.decode()))
    assert codec.held <= 256
    feed(codec, b"\n")
    assert len(feed(codec, good)) == 1
