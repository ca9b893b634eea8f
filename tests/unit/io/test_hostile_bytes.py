"""Random bytes, and real streams with bytes changed, through every codec: nothing raises, no buffer grows."""

import random
from collections.abc import Callable, Iterator

import pytest

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.autopilot.px4 import Px4Autopilot
from asvhil.config import AutopilotLinkConfig, PwmConfig, load_config
from asvhil.io.mavlink.frames import FrameSplitter, Parser
from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_framing import MAX_LINE
from asvhil.io.sensors.nmea_sentences import EVERYTHING
from asvhil.io.sensors.vectornav.codec import VectorNavCodec
from asvhil.logs.tlog import read_tlog
from asvhil.operator.encoding import encode_hold, encode_release
from asvhil.operator.session import OperatorSession
from asvhil.simplant.plant import Plant
from asvhil.types import Frame
from tests.support.paths import DATA

MANY = 120_000
OURS = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0")
TLOG = DATA / "ardurover-4.6.3-json-boat-drive.tlog"


class Subject:
    """One codec: how it is fed, how much it holds back, and how much it may."""

    def __init__(self, feed: Callable[[Frame], object], held: Callable[[], int], bound: int) -> None:
        self._feed, self._held, self._bound = feed, held, bound
        self.results = 0

    def feed(self, data: bytes, peer: str = "") -> None:
        self.results += len(self._feed(Frame(t_ns=self.results, port="any", data=data, peer=peer)))  # type: ignore[arg-type]
        assert self._held() <= self._bound


def parsers_hold(codec: object) -> int:
    """The bytes in every splitter of every MAVLink parser that an object has."""
    parsers = [value for value in vars(codec).values() if isinstance(value, Parser)]
    assert parsers
    return max((len(splitter._buffer) for parser in parsers for splitter in parser._splitters.values()), default=0)


def autopilot() -> Subject:
    codec = ArduRoverAutopilot(OURS, PwmConfig())
    return Subject(codec.receive, lambda: parsers_hold(codec), FrameSplitter.MAX_BUFFER)


def px4() -> Subject:
    codec = Px4Autopilot(OURS.model_copy(update={"profile": "px4", "output": "set_actuator"}), PwmConfig())
    return Subject(codec.receive, lambda: parsers_hold(codec), FrameSplitter.MAX_BUFFER)


def operator() -> Subject:
    codec = OperatorSession(OURS)
    return Subject(codec.receive, lambda: parsers_hold(codec), FrameSplitter.MAX_BUFFER)


def nmea() -> Subject:
    codec = NmeaCodec("gnss", EVERYTHING)
    return Subject(codec.decode, lambda: codec.held, MAX_LINE)


def vectornav() -> Subject:
    codec = VectorNavCodec("ins")
    return Subject(codec.decode, lambda: len(codec._buffer), VectorNavCodec.MAX_BUFFER)


CODECS = [autopilot, px4, operator, nmea, vectornav]


def chunks(data: bytes, noise: random.Random) -> Iterator[bytes]:
    at = 0
    while at < len(data):
        size = noise.choice((1, 7, 60, 280, 4096))
        yield data[at : at + size]
        at += size


def recorded() -> dict[Callable[[], Subject], bytes]:
    """A stream that each codec understands."""
    boat = Plant(load_config("sitl-vn300", ("links.gnss.endpoint=serial:gnss:115200",)), 0)
    sent = boat.advance(30_000_000_000)
    mavlink = b"".join(data for _, data in read_tlog(TLOG))[:300_000]
    vnins = b"$VNERR,03*72\r\n$VNYMR,+1,-2,+3,-0,-0,+0,-1.2,-0.1,-9.7,-0.1,+0.2,-0.3*4F\r\n"
    ins = vnins.join(frame.data for frame in sent if frame.port == "ins")
    line = b"".join(frame.data for frame in sent if frame.port == "gnss")
    line += b"".join(frame.data for frame in sent if frame.port == "anemometer")
    holds = b"".join(encode_hold(OURS, 40.0 + 1e-4 * i, -86.0, 0.1 * i) + encode_release(OURS) for i in range(300))
    packed = Plant(load_config("sitl-px4"), 0).advance(60_000_000_000)
    modes = b"".join(frame.data for frame in packed if frame.port == "autopilot")
    return {autopilot: mavlink, px4: modes, operator: holds, nmea: line, vectornav: ins}


STREAMS = recorded()


@pytest.mark.parametrize("make", CODECS)
@pytest.mark.parametrize("seed", [1, 2])
def test_random_bytes(make: Callable[[], Subject], seed: int) -> None:
    noise, subject = random.Random(seed), make()
    for chunk in chunks(noise.randbytes(MANY), noise):
        subject.feed(chunk)
    subject.feed(b"\n" + bytes(300))
    before = subject.results
    for _ in range(3):  # a header in the noise may claim what follows it, once
        subject.feed(STREAMS[make][:20_000])
    assert subject.results > before + 10


@pytest.mark.parametrize("make", CODECS)
@pytest.mark.parametrize("alphabet", [b"\xfa\xfd\xfe\x00\x01\x08", b"$*,\r\nVNINS0123456789.-", b"\xfa\x7f\xff\x80"])
def test_bytes_that_look_like_beginnings(make: Callable[[], Subject], alphabet: bytes) -> None:
    noise, subject = random.Random(3), make()
    for _ in range(MANY // 8000):
        subject.feed(bytes(noise.choices(alphabet, k=4000)))


@pytest.mark.parametrize("make", CODECS)
@pytest.mark.parametrize("every", [3000, 300, 30])
def test_mutated_streams(make: Callable[[], Subject], every: int) -> None:
    """One byte in `every` is changed, taken out, doubled, or has a bit flipped."""
    noise, subject = random.Random(every), make()
    clean = STREAMS[make]
    whole = make()
    whole.feed(clean)
    data = bytearray(clean)
    for _ in range(len(clean) // every):
        at = noise.randrange(len(data))
        match noise.randrange(4):
            case 0:
                data[at] = noise.randrange(256)
            case 1:
                del data[at]
            case 2:
                data.insert(at, data[at])
            case 3:
                data[at] ^= 1 << noise.randrange(8)
    for chunk in chunks(bytes(data), noise):
        subject.feed(chunk)
    assert 0 < subject.results <= whole.results
    assert every < 3000 or subject.results > 0.8 * whole.results


@pytest.mark.parametrize("make", [autopilot, operator])
def test_a_thousand_peers_do_not_pile_up(make: Callable[[], Subject]) -> None:
    noise, subject = random.Random(4), make()
    for number in range(1000):
        subject.feed(b"\xfd\xff\x00" + noise.randbytes(200), peer=f"10.0.0.1:{number}")
