"""NMEA as instruments send it: fields left out, blanks, line ends, TAG blocks; and what none of them can mean."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_fields import KNOTS_TO_MPS, RANGES
from asvhil.io.sensors.nmea_framing import MAX_LINE, DropCause, NmeaFramer
from asvhil.io.sensors.nmea_sentences import DECODERS, EVERYTHING
from asvhil.types import ApparentWind, BowWind, Frame, GroundVelocity, Heading, Measurement, Position, TrueWind, YawRate
from tests.support.nmea import checksum, sentence

KN = KNOTS_TO_MPS


def codec() -> NmeaCodec:
    return NmeaCodec("line", EVERYTHING, math.radians(10.0))


def read(data: bytes | str, reader: NmeaCodec | None = None) -> list[Measurement]:
    data = data if isinstance(data, bytes) else sentence(data)
    return [m for _, m in (reader or codec()).decode(Frame(t_ns=7, port="line", data=data))]


def values(data: bytes | str) -> list[float]:
    """All numbers of all measurements, angles in degrees."""
    found: list[float] = []
    for m in read(data):
        match m:
            case Position():
                found += [m.lat_deg, m.lon_deg]
            case GroundVelocity() | TrueWind():
                found += [m.vn_mps, m.ve_mps]
            case Heading():
                found += [math.degrees(m.psi_rad)]
            case YawRate():
                found += [math.degrees(m.r_radps)]
            case ApparentWind() | BowWind():
                found += [m.speed_mps, math.degrees(m.from_rad)]
    return found


def cause(data: bytes | str) -> DropCause:
    """Why a sentence was dropped; it must have been, and for one cause."""
    reader = codec()
    assert read(data, reader) == []
    ((why, count),) = [(why, count) for why, count in reader.dropped.items() if count]
    assert count == 1
    return why


# --- what a person would understand ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        # Compasses: fields left out at the end, blanks for empty ones, a blank before the star.
        (b"$HCHDG,101.5*47\r\n", [111.5]),
        (b"$HCHDG,101.5,,*47\r\n", [111.5]),
        (b"$HCHDG,101.5,,,4.0,W*3A\r\n", [97.5]),
        (b"$HCHDG,101.5, , , , *47\r\n", [111.5]),
        (sentence("HCHDG, 101.5 ,  ,,3.5,E"), [105.0]),
        (sentence("HCHDG,101.5,0.0,,3.5,E"), [105.0]),  # no deviation needs no side
        (sentence("HCHDG,101.5,,,3.5,"), [111.5]),  # a variation without its side is none
        (b"$HEHDT,274.07*61\r\n", [274.07]),
        (sentence("HDT,12.5,T"), [12.5]),  # without a talker
        (sentence("hehdt,12.5,t"), [12.5]),
        (sentence("HCHDM,100"), [110.0]),
        (sentence("HETHS,274.07,A"), [274.07]),
        (sentence("HETHS,360"), [0.0]),
        (sentence("HEHDT,.5,T"), [0.5]),
        (sentence("HEHDT,5.,T"), [5.0]),
        (sentence("HEHDT,+005.0,T"), [5.0]),
        (sentence("TIROT,-60.0,A"), [-1.0]),
        (sentence("TIROT,90"), [1.5]),
        # Receivers: no mode, no date, no course at rest, no letters.
        (sentence("GPRMC,120000,A,4025.,N,08655.272,W,3.0,90.0"), [40 + 25 / 60, -86 - 55.272 / 60, 0.0, 3 * KN]),
        (sentence("GPRMC,,A,4025.422,N,08655.272,W"), [40 + 25.422 / 60, -86 - 55.272 / 60]),
        (sentence("GPRMC,120000,A, 4025.422,N, 8655.272,W,0.0,"), [40 + 25.422 / 60, -86 - 55.272 / 60, 0.0, 0.0]),
        (sentence("GPVTG,90.0,T,,M,3.0"), [0.0, 3 * KN]),
        (sentence("GPVTG,90.0,,,,3.0,,5.5,"), [0.0, 3 * KN]),
        (sentence("GPVTG,090.0,080.0,003.0,005.5"), [0.0, 3 * KN]),  # before version 2
        (sentence("GPVTG,,T,80.0,M,,N,36.0"), [0.0, 10.0]),
        (sentence("GPGGA,,4025.,N,8655.272,W,2"), [40 + 25 / 60, -86 - 55.272 / 60]),
        (sentence("GPGGA,,25.5,N,5.25,E,1"), [25.5 / 60, 5.25 / 60]),
        (sentence("GPGLL,4025.422,N,08655.272,W"), [40 + 25.422 / 60, -86 - 55.272 / 60]),
        (sentence("GPGLL,4025.422,N,08655.272,W,120000.00,A,D"), [40 + 25.422 / 60, -86 - 55.272 / 60]),
        (sentence("GNGNS,120000,4025.422,N,08655.272,W,NA,12,0.9"), [40 + 25.422 / 60, -86 - 55.272 / 60]),
        # Wind sensors.
        (sentence("WIMWV,45.0,R,10.0,N"), [10 * KN, 45.0]),
        (sentence("WIMWV,360,T,36,K,A"), [10.0, 0.0]),
        (sentence("WIMWV,045.,R,010.,M,A, "), [10.0, 45.0]),
        (sentence("IIVWR,45.0,R,,N,5.0,M"), [5.0, 45.0]),
        (sentence("IIVWR,45.0,L,10.0,N"), [10 * KN, 315.0]),
        (sentence("IIVWT,180,L,,,,,36,K"), [10.0, 180.0]),
        (sentence("WIMWD,270.0,,,,,,5.0"), [0.0, 5.0]),
    ],
)  # fmt: skip
def test_instruments_in_the_wild(data: bytes, expected: list[float]) -> None:
    assert values(data) == pytest.approx(expected, abs=1e-9)


GOOD = "WIMWV,45.0,R,5.0,M,A"
FRAMES: dict[str, Callable[[str], bytes]] = {
    "CR alone": lambda body: b"$%s*%s\r" % (body.encode(), checksum(body).encode()),
    "LF alone": lambda body: b"$%s*%s\n" % (body.encode(), checksum(body).encode()),
    "lower case": lambda body: b"$%s*%s\r\n" % (body.encode(), checksum(body).lower().encode()),
    "blank before the star, counted": lambda body: sentence(body + " "),
    "blank before the star, not counted": lambda body: b"$%s *%s\r\n" % (body.encode(), checksum(body).encode()),
    "blanks behind": lambda body: b"$%s*%s \t \r\n" % (body.encode(), checksum(body).encode()),
    "a blank after the dollar": lambda body: b"$ %s*%s\r\n" % (body.encode(), checksum(body).encode()),
    "NUL between lines": lambda body: b"\x00\x00" + sentence(body) + b"\x00",
    "TAG block": lambda body: b"\\s:st01,c:1700000000*" + b"3A\\" + sentence(body),
    "two TAG blocks": lambda body: b"\\g:1-2-77*00\\\\s:a*00\\" + sentence(body),
    "exclamation mark": lambda body: b"!" + sentence(body)[1:],
    "rest of a line before": lambda body: b"8.2,K,A*3" + sentence(body),
}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=list(FRAMES))
@pytest.mark.parametrize("body", [GOOD, "WIMWV,100.0,R,5.1,M,A", "HCHDT,1.0,T"])
def test_frames_in_the_wild(frame: Callable[[str], bytes], body: str) -> None:
    data = frame(body) * 3
    whole = read(data)
    assert len(whole) == 3 and len(set(map(str, whole))) == 1
    for cut in range(1, len(data)):
        reader = codec()
        assert read(data[:cut], reader) + read(data[cut:], reader) == whole


def test_a_checksum_of_one_digit() -> None:
    assert values(b"$GPHDT,15.4,T*5\r\n") == pytest.approx([15.4])


def test_sentences_without_any_line_end_are_told_apart_by_their_beginnings() -> None:
    data = sentence(GOOD).strip() * 100
    assert len(read(data)) == 99  # the last may go on
    assert len([m for at in range(0, len(data), 11) for m in read(data[at : at + 11], READER)]) == 99


READER = codec()


# --- what nobody would ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"$WIMWV,45.0,R,5.0,M,A\r\n", "no_checksum"),
        (b"$WIMWV,45.0,R,5.0,M,A*\r\n", "no_checksum"),
        (b"$WIMWV,45.0,R,5.0,M,A*2\r\n", "bad_checksum"),
        (b"$WIMWV,45.0,R,5.0,M,A*ZZ\r\n", "bad_checksum"),
        (sentence(GOOD).replace(b"45.0", b"45.1"), "bad_checksum"),
        (sentence(GOOD).strip() + b"7\r\n", "bad_checksum"),
        (sentence(GOOD).strip() + b",x\r\n", "bad_checksum"),
        (sentence(GOOD + "," * MAX_LINE), "too_long"),
        (b"x" * (MAX_LINE + 1), "too_long"),
        (b"Wind sensor ready\r\n", "garbage"),
        ("WIXDR,C,12.5,C,AIRT", "unknown"),
        ("PASHR,1,2,3", "unknown"),
        ("", "unknown"),
        ("WIMWV,45.0,R,5.0,M,V", "void"),
        ("WIMWV,,,,,V", "void"),
        ("HETHS,,V", "void"),
        ("HETHS,10.0,S", "void"),
        ("TIROT,1.0,V", "void"),
        ("GPGLL,4025.422,N,08655.272,W,120000.00,V,N", "void"),
        ("GPGLL,4025.422,N,08655.272,W,120000.00,A,E", "void"),
        ("GNGNS,120000,4025.422,N,08655.272,W,NN,12,0.9", "void"),
        ("GPGGA,,,,,,0", "void"),
        ("GPRMC,,V", "void"),
        ("GPGGA,,0000.000,N,00000.000,E,1", "void"),
        ("GPRMC", "missing_field"),
        ("GPVTG", "missing_field"),
        ("HCHDG", "missing_field"),
        ("HCHDG, ,,,3.0,E", "missing_field"),
        ("HCHDG,100.0,2.0", "missing_field"),  # to which side the compass deviates is not told
        ("WIMWV,45.0,R,5.0", "missing_field"),  # in which unit?
        ("WIMWV,45.0,,5.0,M,A", "missing_field"),
        ("WIMWV,45.0", "missing_field"),
        ("IIVWR,45.0,,5.0,N", "missing_field"),
        ("IIVWR,45.0,R", "missing_field"),
        ("WIMWD,270.0,T", "missing_field"),
        ("WIMWD,,,,,5.0,N", "missing_field"),
        ("GPGGA,,4025.422,N,08655.272,W", "missing_field"),
        ("WIMWV,1e1,R,5.0,M,A", "malformed"),
        ("WIMWV,0x10,R,5.0,M,A", "malformed"),
        ("WIMWV,4_5,R,5.0,M,A", "malformed"),
        ("WIMWV,4 5,R,5.0,M,A", "malformed"),
        ("WIMWV,.,R,5.0,M,A", "malformed"),
        ("WIMWV,-,R,5.0,M,A", "malformed"),
        ("WIMWV,45.0,R,inf,M,A", "malformed"),
        ("WIMWV,45.0,R,5.0,MM,A", "malformed"),
        ("WIMWV," + "9" * 31 + ",R,5.0,M,A", "malformed"),
        ("GPGGA,,40:25.4,N,08655.272,W,1", "malformed"),
        ("GPGGA,,-4025.4,N,08655.272,W,1", "malformed"),
        ("GPGGA,,4025.422,W,08655.272,N,1", "malformed"),
        ("GPRMC,,A,4025.422,N,08655.272,W,x,1", "malformed"),
        ("GPGGA,,4060.000,N,08655.272,W,1", "out_of_range"),
        ("GPGGA,,4099.999,N,08655.272,W,1", "out_of_range"),
        ("GPGGA,,9000.001,N,08655.272,W,1", "out_of_range"),
        ("GPGLL,4025.422,N,18000.001,W", "out_of_range"),
        ("GPGGA,,4025.422,N,08655.272,W,77", "out_of_range"),
        ("GPRMC,,A,4025.422,N,08655.272,W,3.0,361.0", "out_of_range"),
        ("GPRMC,,A,4025.422,N,08655.272,W,-3.0,1.0", "out_of_range"),
        ("GPRMC,,A,4025.422,N,08655.272,W,1002,1.0", "out_of_range"),
        ("GPRMC,,A,4025.422,N,08655.272,W,3.0,1.0,,200.0,E", "out_of_range"),
        ("GPVTG,-1.0,T,,M,3.0,N", "out_of_range"),
        ("GPVTG,400.0,,3.0", "out_of_range"),
        ("HCHDG,400.0,,,3.0,E", "out_of_range"),
        ("HCHDG,-5.0,,,3.0,E", "out_of_range"),
        ("HCHDG,100.0,,,181.0,E", "out_of_range"),
        ("HCHDG,100.0,,,-3.0,E", "out_of_range"),
        ("HCHDG,100.0,270.0,E", "out_of_range"),
        ("HEHDT,360.1,T", "out_of_range"),
        ("HCHDM,655.35,M", "out_of_range"),
        ("HETHS,999.9,A", "out_of_range"),
        ("TIROT,99999,A", "out_of_range"),
        ("WIMWV,400.0,R,5.0,M,A", "out_of_range"),
        ("WIMWV,-45.0,T,5.0,M,A", "out_of_range"),
        ("WIMWV,45.0,R,-0.1,M,A", "out_of_range"),
        ("WIMWV,45.0,R,999,K,A", "out_of_range"),
        ("IIVWR,181,R,5.0,N", "out_of_range"),
        ("IIVWT,10,R,500.0,N", "out_of_range"),
        ("WIMWD,720.0,T,,M,5.0,N", "out_of_range"),
        ("WIMWD,70.0,T,,M,500.0,N", "out_of_range"),
        (sentence("HEHDT,274.07,T").replace(b"7.T", b"7.T"), None),
        ("HEHDT,27\u00e9,T", "malformed"),
    ],
)  # fmt: skip
def test_what_nobody_would_understand_is_counted_by_its_cause(data: bytes | str, why: str | None) -> None:
    if why is None:
        assert len(read(data)) == 1
    else:
        assert cause(data + b"\r\n" if isinstance(data, bytes) else data) == why


NUMBERS = st.one_of(
    st.floats(-1e4, 1e4).map(lambda value: f"{value:.1f}"),
    st.integers(-400, 400).map(str),
    st.sampled_from(["", " ", ".", "5.", ".5", "nan", "-", "1e3", "4025.422", "08655.272", "99999.99"]),
)
LETTERS = st.sampled_from(["", " ", *"ARTVMNKSEWLD", "t", "9", "AA"])


def plausible(m: Measurement) -> bool:
    """In what can be, whatever came in."""
    match m:
        case Position():
            return abs(m.lat_deg) <= 90.0 and abs(m.lon_deg) <= 180.0
        case GroundVelocity():
            return math.hypot(m.vn_mps, m.ve_mps) <= RANGES["ground speed"][1] + 1e-6
        case TrueWind():
            return math.hypot(m.vn_mps, m.ve_mps) <= RANGES["wind speed"][1] + 1e-6
        case Heading():
            return 0.0 <= m.psi_rad < math.tau
        case YawRate():
            return abs(m.r_radps) <= math.radians(RANGES["turn rate"][1] / 60.0) + 1e-6
        case ApparentWind() | BowWind():
            return 0.0 <= m.speed_mps <= RANGES["wind speed"][1] and 0.0 <= m.from_rad < math.tau
    return False


@given(st.sampled_from(sorted(DECODERS)), st.lists(st.one_of(NUMBERS, LETTERS), max_size=14))
def test_any_fields_give_what_can_be_or_are_counted(name: str, fields: list[str]) -> None:
    reader = codec()
    found = read(sentence(",".join(["II" + name.removesuffix("_T"), *fields])), reader)
    assert all(map(plausible, found)) and sum(reader.dropped.values()) == (not found) and reader.sentences == 1


WHOLE = [
    "HCHDG,101.5,1.5,W,4.0,W", "HEHDT,274.07,T", "WIMWV,45.0,R,10.0,N,A", "WIMWD,270.0,T,280.0,M,10.0,N,5.0,M",
    "GPVTG,090.0,T,080.0,M,3.0,N,5.5,K,A", "GPRMC,120000,A,4025.422,N,08655.272,W,3.0,90.0,190126,4.0,W,A",
    "GPGGA,120000,4025.422,N,08655.272,W,1,08,0.9,545.4,M,46.9,M,,", "IIVWR,45.0,L,10.0,N,5.1,M,18.5,K",
    "GPGLL,4025.422,N,08655.272,W,120000,A,A", "TIROT,-12.5,A", "HETHS,101.5,A", "GNGNS,1,4025.422,N,08655.272,W,AA,12",
]  # fmt: skip


@given(st.sampled_from(WHOLE), st.data())
def test_a_changed_byte_gives_the_same_values_or_none(body: str, data: st.DataObject) -> None:
    """One changed byte never passes the checksum; two may, by chance, and then the ranges hold."""
    line, good = bytearray(sentence(body)), read(body)
    at = data.draw(st.integers(0, len(line) - 1))
    line[at] = data.draw(st.integers(0, 255).filter(lambda byte: byte != line[at]))
    reader = codec()
    assert read(bytes(line) + b"\r\n", reader) in ([], good)
    assert read(b"\r\n" + sentence(body), reader) == good


@given(st.sampled_from(WHOLE), st.lists(st.sampled_from(["", " ", "\t", "  "]), min_size=15, max_size=15))
def test_blanks_around_fields_change_nothing(body: str, blanks: list[str]) -> None:
    spaced = ",".join(f"{blank}{field}{blank}" for blank, field in zip(blanks, body.split(","), strict=False))
    assert read(spaced) == read(body) != []


@given(st.sampled_from(WHOLE), st.integers(0, 6))
def test_what_is_empty_at_the_end_may_be_left_out(body: str, extra: int) -> None:
    assert read(body + "," * extra) == read(body) != []


@given(st.binary(max_size=600), st.integers(1, 50))
def test_the_framer_holds_one_line_and_cuts_alike_in_any_chunks(data: bytes, size: int) -> None:
    framer, whole = NmeaFramer(), NmeaFramer()
    parts = [body for at in range(0, len(data), size) for body in framer.receive(data[at : at + size])]
    assert framer.held <= MAX_LINE
    bodies = [body for body in whole.receive(data) if not isinstance(body, DropCause)]
    assert [body for body in parts if not isinstance(body, DropCause)] == bodies
