"""GNSS, heading and wind sentences by literal bytes, worked by hand; magnetic against true; units; what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.io.sensors.nmea import NmeaCodec
from asvhil.io.sensors.nmea_framing import DropCause
from asvhil.io.sensors.nmea_sentences import EVERYTHING
from asvhil.types import (
    ApparentWind,
    BowWind,
    Frame,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    TrueWind,
)
from tests.support.nmea import sentence

KNOT = 1852.0 / 3600.0


def codec(declination_deg: float | None = None) -> NmeaCodec:
    return NmeaCodec("gnss", EVERYTHING, None if declination_deg is None else math.radians(declination_deg))


def feed(reader: NmeaCodec, data: bytes) -> list[tuple[str, Measurement]]:
    return reader.decode(Frame(t_ns=7, port="gnss", data=data))


def one(data: bytes | str, declination_deg: float | None = None) -> tuple[str, Measurement]:
    (pair,) = feed(codec(declination_deg), data if isinstance(data, bytes) else sentence(data))
    return pair


def fix_of(data: bytes | str, declination_deg: float | None = None) -> tuple[float, ...]:
    """Latitude, longitude, north and east velocity; NaN where the sentence gives none."""
    found = {type(m): m for _, m in feed(codec(declination_deg), data if isinstance(data, bytes) else sentence(data))}
    place, velocity = found.pop(Position, None), found.pop(GroundVelocity, None)
    assert not found and (place is not None or velocity is not None)
    values = [NAN] * 4
    if place is not None:
        assert isinstance(place, Position) and place.t_ns == 7 and math.isnan(place.h_acc_m)
        values[:2] = place.lat_deg, place.lon_deg
    if velocity is not None:
        assert isinstance(velocity, GroundVelocity) and velocity.t_ns == 7
        values[2:] = velocity.vn_mps, velocity.ve_mps
    return tuple(values)


def heading_deg(data: str, declination_deg: float | None = None) -> float:
    _, heading = one(data, declination_deg)
    assert isinstance(heading, Heading)
    return math.degrees(heading.psi_rad)


def nan_ok(*values: float) -> object:
    return pytest.approx(values, nan_ok=True)


NAN = math.nan


# --- position and velocity -------------------------------------------------------------------------------------


def test_gga() -> None:
    data = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"  # of the literature
    assert fix_of(data) == nan_ok(48 + 7.038 / 60, 11 + 31 / 60, NAN, NAN)
    assert one(data)[0] == "GGA"


def test_rmc_south_and_west() -> None:
    north, east = 10.0 * KNOT * math.cos(math.radians(135.0)), 10.0 * KNOT * math.sin(math.radians(135.0))
    body = "GNRMC,120000.00,A,3352.12345,S,15112.54321,W,10.0,135.0,190126,,,A"
    assert fix_of(body) == nan_ok(-(33 + 52.12345 / 60), -(151 + 12.54321 / 60), north, east)


def test_rmc_of_the_literature() -> None:
    data = b"$GPRMC,225446,A,4916.45,N,12311.12,W,000.5,054.7,191194,020.3,E*68\r\n"
    lat, lon, vn, ve = fix_of(data)
    assert (lat, lon) == pytest.approx((49.2741667, -123.1853333))
    assert math.hypot(vn, ve) == pytest.approx(0.5 * KNOT) and math.degrees(math.atan2(ve, vn)) == pytest.approx(54.7)


@pytest.mark.parametrize(
    ("body", "vn", "ve"),
    [
        ("GPVTG,090.0,T,,,10.0,N,18.5,K,A", 0.0, 10.0 * KNOT),  # knots before km/h, as they are finer
        ("GPVTG,000.0,T,,,,N,36.0,K,A", 10.0, 0.0),
        ("GPVTG,,T,080.0,M,,N,36.0,K", 0.0, 10.0),  # magnetic course, 10 degrees east declination
        ("GPVTG,,T,,M,0.2,N,0.4,K,A", 0.0, 0.0),  # at rest receivers leave the course empty
    ],
)
def test_vtg(body: str, vn: float, ve: float) -> None:
    assert fix_of(body, declination_deg=10.0) == nan_ok(NAN, NAN, vn, ve)


def test_rmc_at_rest_without_course_is_no_velocity_and_under_way_an_unknown_one() -> None:
    rest = "GPRMC,120000.00,A,4025.422,N,08655.272,W,0.02,,190126,,,A"
    assert fix_of(rest)[2:] == (0.0, 0.0)
    assert fix_of(rest.replace("0.02", "3.0"))[2:] == nan_ok(NAN, NAN)
    assert fix_of(rest.replace("0.02", ""))[2:] == nan_ok(NAN, NAN)


@pytest.mark.parametrize("talker", ["GP", "GN", "GL", "GA", "BD", "II", "IN", "XX", "ZZ"])
def test_any_talker(talker: str) -> None:
    assert one(f"{talker}HDT,12.5,T")[0] == "HDT"
    found = feed(codec(), sentence(f"{talker}RMC,120000.00,A,4025.422,N,08655.272,W,0.5,10,190126,,,A"))
    assert [name for name, _ in found] == ["RMC", "RMC"]


@given(st.floats(-89.9, 89.9), st.floats(-179.9, 179.9))
def test_any_place_is_read_within_a_millimetre(lat_deg: float, lon_deg: float) -> None:
    def text(value: float, width: int) -> str:
        degrees, minutes = divmod(abs(value) * 60.0, 60.0)
        return f"{int(degrees):0{width}d}{minutes:010.7f}"

    if "60.0000000" in (text(lat_deg, 2)[2:], text(lon_deg, 3)[3:]):
        return
    if not any(digit in text(lat_deg, 2) + text(lon_deg, 3) for digit in "123456789"):
        return  # what receivers without a fix send
    place = f"{text(lat_deg, 2)},{'NS'[lat_deg < 0]},{text(lon_deg, 3)},{'EW'[lon_deg < 0]}"
    found = fix_of(f"GPGGA,120000.00,{place},4,12,0.7,0.0,M,0.0,M,,")
    assert found[:2] == pytest.approx((lat_deg, lon_deg), abs=1e-8)


# --- heading ---------------------------------------------------------------------------------------------------


def test_true_heading() -> None:
    assert one(b"$GPHDT,274.07,T*03\r\n") == ("HDT", Heading(t_ns=7, psi_rad=math.radians(274.07)))


@pytest.mark.parametrize(
    ("body", "declination_deg", "degrees"),
    [
        ("HCHDG,100.0,,,10.0,E", None, 110.0),
        ("HCHDG,100.0,,,10.0,W", None, 90.0),
        ("HCHDG,100.0,2.0,E,10.0,W", None, 92.0),  # deviation of the compass, then variation of the place
        ("HCHDG,100.0,2.0,W,,", -4.5, 93.5),
        ("HCHDG,5.0,,,10.0,W", None, 355.0),
        ("HCHDM,100.0,M", 3.5, 103.5),
        ("HCHDM,359.0,M", 3.5, 2.5),
    ],
)
def test_magnetic_heading(body: str, declination_deg: float | None, degrees: float) -> None:
    assert heading_deg(body, declination_deg) == pytest.approx(degrees)


def test_a_variation_that_the_line_has_told_serves_the_other_sentences() -> None:
    reader = codec()
    assert feed(reader, sentence("HCHDM,100.0,M")) == []  # not known yet
    feed(reader, sentence("GPRMC,120000.00,A,4025.422,N,08655.272,W,0.5,10,190126,4.5,W,A"))
    ((_, heading),) = feed(reader, sentence("HCHDM,100.0,M"))
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(95.5)
    feed(reader, sentence("HCHDG,1.0,,,3.0,E"))
    ((_, heading),) = feed(reader, sentence("HCHDM,100.0,M"))
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(103.0)


@pytest.mark.parametrize(
    "rmc",
    [
        "GPRMC,120001,V,,,,,,,010126,0.0,E,N",
        "GPRMC,120001,V,4025.422,N,08655.272,W,0.5,10,190126,180.0,E,A",
        "GPRMC,120001,A,4025.422,N,08655.272,W,0.5,10,190126,0.0,E,E",  # estimated
        "GPRMC,120001,A,0000.000,N,00000.000,E,0.5,10,190126,0.0,E,A",  # no place yet
    ],
)
def test_what_is_void_teaches_no_variation(rmc: str) -> None:
    reader = codec()
    feed(reader, sentence("GPRMC,120000.00,A,4025.422,N,08655.272,W,0.5,10,190126,12.0,W,A"))
    feed(reader, sentence(rmc))
    ((_, heading),) = feed(reader, sentence("HCHDG,100.0,,,,"))
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(88.0)


def test_a_configured_declination_is_not_overruled_for_headings_without_their_own() -> None:
    reader = codec(1.0)
    feed(reader, sentence("GPRMC,120000.00,A,4025.422,N,08655.272,W,0.5,10,190126,4.5,W,A"))
    ((_, heading),) = feed(reader, sentence("HCHDM,100.0,M"))
    assert isinstance(heading, Heading) and math.degrees(heading.psi_rad) == pytest.approx(101.0)


# --- wind ------------------------------------------------------------------------------------------------------


def test_apparent_and_true_wind_from_the_bow() -> None:
    assert one("WIMWV,45.0,R,10.0,N,A") == (
        "MWV",
        ApparentWind(t_ns=7, speed_mps=pytest.approx(10.0 * KNOT), from_rad=math.pi / 4),
    )
    assert one("WIMWV,90.0,T,36.0,K,A") == (
        "MWV_T",
        BowWind(t_ns=7, speed_mps=pytest.approx(10.0), from_rad=math.pi / 2),
    )


def test_a_calm_has_no_direction_and_is_a_wind() -> None:
    """Ultrasonic anemometers leave the angle empty then; in more wind it is a fault."""
    assert one("IIMWV,,R,000.02,M,A") == ("MWV", ApparentWind(t_ns=7, speed_mps=0.02, from_rad=0.0))
    assert one("IIMWV,,T,0.4,M,A") == ("MWV_T", BowWind(t_ns=7, speed_mps=0.4, from_rad=0.0))
    reader = codec()
    assert feed(reader, sentence("IIMWV,,R,000.60,M,A")) == [] and reader.dropped[DropCause.MISSING_FIELD] == 1


def test_gills_status_of_two_digits_is_known() -> None:
    assert one("IIMWV,120,R,002.10,M,00")[1] == ApparentWind(t_ns=7, speed_mps=2.1, from_rad=math.radians(120.0))
    reader = codec()
    assert feed(reader, sentence("IIMWV,120,R,002.10,M,01")) == [] and reader.dropped[DropCause.VOID] == 1


@pytest.mark.parametrize(
    ("body", "vn", "ve"),
    [
        ("WIMWD,270.0,T,280.0,M,10.0,N,5.0,M", 0.0, 5.0),  # from the west: blows east
        ("WIMWD,000.0,T,,M,10.0,N,,M", -10.0 * KNOT, 0.0),
        ("WIMWD,,T,080.0,M,,N,3.0,M", 0.0, -3.0),  # from magnetic 80, 10 east: from true 90
    ],
)
def test_true_wind_from_the_earth(body: str, vn: float, ve: float) -> None:
    source, wind = one(body, declination_deg=10.0)
    assert source == "MWD" and isinstance(wind, TrueWind)
    assert (wind.vn_mps, wind.ve_mps) == pytest.approx((vn, ve), abs=1e-12)


# --- what is refused -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "counter"),
    [
        ("GPGGA,1,4025.422,N,08655.272,W,0,00,,,M,,M,,", "void"),  # no fix
        ("GPGGA,1,4025.422,N,08655.272,W,6,00,,,M,,M,,", "void"),  # dead reckoning
        ("GPGGA,1,4025.422,N,08655.272,W,8,00,,,M,,M,,", "void"),  # simulator
        ("GPGGA,1,9025.422,N,08655.272,W,1,08,,,M,,M,,", "out_of_range"),  # beyond the pole
        ("GPGGA,1,4025.422,N,19055.272,W,1,08,,,M,,M,,", "out_of_range"),
        ("GPGGA,1,4025.422,,08655.272,W,1,08,,,M,,M,,", "missing_field"),  # no hemisphere
        ("GPGGA,1,,N,,W,1,08,,,M,,M,,", "missing_field"),
        ("GPGGA,1,nan,N,08655.272,W,1,08,,,M,,M,,", "malformed"),
        ("GPGGA,1,4025.422,N", "missing_field"),  # cut short, with a checksum that fits
        ("GPRMC,1,V,4025.422,N,08655.272,W,0.5,10,190126,,,A", "void"),
        ("GPRMC,1,A,4025.422,N,08655.272,W,0.5,10,190126,,,N", "void"),
        ("GPRMC,1,A,4025.422,N,08655.272,W,0.5,10,190126,,,E", "void"),
        ("GPRMC,1,A,4025.422,N,08655.272,W,inf,10,190126,,,A", "malformed"),
        ("GPVTG,090.0,T,,M,3.0,N,,K,N", "void"),
        ("GPVTG,,T,,M,3.0,N,,K,A", "missing_field"),  # under way, whereto is not known
        ("GPHDT,,T", "missing_field"),
        ("GPHDT,nan,T", "malformed"),
        ("GPHDT,100.0,M", "malformed"),  # a magnetic heading where a true one belongs
        ("HCHDT,720.5,T", "out_of_range"),
        ("HCHDM,100.0,T", "malformed"),
        ("GPVTG,090.0,X,,M,3.0,N,,K,A", "malformed"),
        ("GPVTG,090.0,T,,M,3.0,K,,K,A", "malformed"),
        ("WIMWD,270.0,X,,,10.0,N,5.0,M", "malformed"),
        ("WIMWD,270.0,T,,M,,N,5.0,N", "malformed"),
        ("HCHDG,100.0,,,,", "no_declination"),  # magnetic, and no variation known
        ("HCHDG,100.0,,,10.0,X", "malformed"),
        ("HCHDM,100.0,M", "no_declination"),
        ("WIMWD,,T,080.0,M,,N,3.0,M", "no_declination"),
        ("WIMWD,10.0,T,,M,,N,,M", "missing_field"),
        ("WIMWD,10.0,T,,M,,N,-3.0,M", "out_of_range"),
        ("WIMWV,10.0,Q,3.0,M,A", "malformed"),
        ("GPZDA,160012.71,11,03,2004,00,00", "unknown"),
        ("GPGSV,1,1,00", "unknown"),
        ("PGRME,15.0,M,45.0,M,25.0,M", "unknown"),
    ],
)
def test_what_gives_nothing_is_counted(body: str, counter: str) -> None:
    reader = codec()
    assert feed(reader, sentence(body)) == []
    assert {cause: count for cause, count in reader.dropped.items() if count} == {counter: 1}
    assert reader.sentences == 1 and dict(reader.counters())[f"gnss.{counter}"] == 1


def test_sentences_that_nobody_wants_are_ignored() -> None:
    reader = NmeaCodec("gnss", {"HDT"})
    assert [source for source, _ in feed(reader, sentence("GPHDT,1.0,T") + sentence("WIMWV,10,R,3,M,A"))] == ["HDT"]
    assert reader.dropped[DropCause.UNUSED] == 1


def test_split_at_every_byte_gives_the_same() -> None:
    data = sentence("GPHDT,1.0,T") + sentence("GPGGA,1,4025.422,N,08655.272,W,1,08,,,M,,M,,") + sentence("XXHDT,2,T")
    whole = str(feed(codec(), data))
    for cut in range(len(data)):
        reader = codec()
        assert str(feed(reader, data[:cut]) + feed(reader, data[cut:])) == whole
