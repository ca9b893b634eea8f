"""The one way from frames to measurements: chosen by source, at their time and place, calibrated."""

import math

import pytest

from asvhil.backseat.build import build_decoder
from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.io.sensors.decoder import Decoder
from asvhil.types import (
    ApparentWind,
    BowWind,
    Frame,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    TrueWind,
    YawRate,
)
from tests.support import nmea

AUTOPILOT = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
READY = dialect.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0)
FUSED = dialect.MAVLink_global_position_int_message(1000, 404237000, -869212000, 0, 0, 12, -34, 0, 9000)
RAW = dialect.MAVLink_gps_raw_int_message(77, 6, 10, 20, 0, 121, 200, 100, 9000, 10, 0, 300)
ATTITUDE = dialect.MAVLink_attitude_message(1, 0, 0, -2.5, 0, 0, 0.125)
MS = 1_000_000


def decoder(*overrides: str, base: str = "sitl") -> Decoder:
    return build_decoder(load_config(base, overrides))


def from_autopilot(*messages: object, t_ns: int = 5) -> Frame:
    data = b"".join(bytes(message.pack(AUTOPILOT)) for message in messages)  # type: ignore[attr-defined]
    return Frame(t_ns=t_ns, port="autopilot", data=data)


def sentence(body: str, port: str = "anemometer", t_ns: int = 5) -> Frame:
    return Frame(t_ns=t_ns, port=port, data=nmea.sentence(body))


def test_measurements_come_from_the_source_in_use_in_the_order_of_the_bytes() -> None:
    names = [f"sources.{quantity}=[autopilot.GLOBAL_POSITION_INT]" for quantity in ("position", "velocity")]
    fused = decoder(*names)
    status, *found = fused.decode(from_autopilot(READY, ATTITUDE, RAW, FUSED))
    assert isinstance(status, FrontseatStatus)
    assert found == [
        Heading(t_ns=5, psi_rad=-2.5),
        YawRate(t_ns=5, r_radps=0.125),
        Position(t_ns=5, lat_deg=40.4237, lon_deg=-86.9212, h_acc_m=0.3),
        GroundVelocity(t_ns=5, vn_mps=0.12, ve_mps=-0.34, fused=True),
    ]


def test_the_receiver_comes_before_the_filter_that_has_fused_it() -> None:
    _, place, velocity = decoder().decode(from_autopilot(READY, RAW, FUSED))
    assert isinstance(place, Position) and place.lat_deg == 10 * 1e-7
    assert isinstance(velocity, GroundVelocity) and velocity.ve_mps == pytest.approx(1.0) and not velocity.fused


def test_a_fix_has_the_place_and_the_time_that_the_config_gives_its_source() -> None:
    source = "[{link: autopilot, message: GLOBAL_POSITION_INT, delay_s: 0.2, arm_m: [1.5, -0.4]}]"
    _, place, velocity = decoder(f"sources.position={source}", f"sources.velocity={source}").decode(
        from_autopilot(READY, FUSED, t_ns=1000 * MS)
    )
    assert isinstance(place, Position) and isinstance(velocity, GroundVelocity)
    assert (place.t_ns, place.arm_m) == (velocity.t_ns, velocity.arm_m) == (800 * MS, (1.5, -0.4))


def test_every_source_is_as_the_sensors_tell_it() -> None:
    calibrated = decoder("estimator.ekf.compass.deviation_deg=[3, 0, 4, 0, 0]", "estimator.wind.vane_offset_deg=20")
    found = calibrated.decode_every_source(from_autopilot(READY, ATTITUDE, RAW, FUSED))
    assert [name for name, _ in found[1:]] == [
        *["autopilot.ATTITUDE"] * 2,
        *["autopilot.GPS_RAW_INT"] * 2,
        *["autopilot.GLOBAL_POSITION_INT"] * 2,
    ]
    assert found[1][1] == Heading(t_ns=5, psi_rad=-2.5)
    ((name, wind),) = calibrated.decode_every_source(sentence("WIMWV,340.0,R,3.0,M,A"))
    assert name == "anemometer.MWV" and wind == ApparentWind(t_ns=5, speed_mps=3.0, from_rad=math.radians(340.0))


@pytest.mark.parametrize(("reading", "truth"), [(7.0, 0.0), (121.0, 120.0)])
def test_the_deviation_is_taken_from_the_heading_in_use(reading: float, truth: float) -> None:
    """A 3 and C 4: a boat that points north reads 3 + 4 = 7; one that points to 120 reads 120 + 3 - 2 = 121."""
    overrides = (
        "estimator.ekf.compass={deviation_deg: [3, 0, 4, 0, 0], std_deg: 0.4}",
        "links.gnss={endpoint: 'serial:gnss:38400'}",
        "sources.heading=[gnss.HDT]",
    )
    (heading,) = decoder(*overrides).decode(sentence(f"HEHDT,{reading},T", "gnss"))
    assert isinstance(heading, Heading) and heading.t_ns == 5
    assert math.degrees(heading.psi_rad) == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize(
    ("body", "source", "expected"),
    [
        ("WIMWV,350.0,R,3.0,M,A", "MWV", ApparentWind(t_ns=5, speed_mps=3.0, from_rad=math.radians(10.0))),
        ("WIMWV,350.0,T,3.0,M,A", "MWV_T", BowWind(t_ns=5, speed_mps=3.0, from_rad=math.radians(10.0))),
        ("WIMWD,180.0,T,,M,,N,3.0,M", "MWD", TrueWind(t_ns=5, vn_mps=3.0, ve_mps=0.0)),  # told from north: no vane
    ],
)
def test_the_offset_of_the_vane_is_added_to_angles_from_the_bow(body: str, source: str, expected: Measurement) -> None:
    turned = decoder("estimator.wind.vane_offset_deg=20", f"sources.wind=[anemometer.{source}]")
    (wind,) = turned.decode(sentence(body))
    assert type(wind) is type(expected)
    assert [getattr(wind, name) for name in type(wind).__slots__] == pytest.approx(
        [getattr(expected, name) for name in type(wind).__slots__], abs=1e-12
    )


def test_without_a_calibration_readings_stay_as_they_are() -> None:
    plain = decoder()
    (wind,) = plain.decode(sentence("WIMWV,340.0,R,3.0,M,A"))
    assert wind == ApparentWind(t_ns=5, speed_mps=3.0, from_rad=math.radians(340.0))
    assert Heading(t_ns=5, psi_rad=-2.5) in plain.decode(from_autopilot(READY, ATTITUDE))


def test_a_port_without_a_sensor_gives_nothing() -> None:
    without = decoder("links.anemometer=null")
    assert without.decode(sentence("WIMWV,340.0,R,3.0,M,A")) == []
    assert without.decode(Frame(t_ns=5, port="operator", data=b"$")) == []
    assert without.counters() == ()


def test_it_tells_which_source_is_in_use_and_what_came_in() -> None:
    plain = decoder(base="sitl-vn300")
    plain.decode(from_autopilot(READY, FUSED))
    plain.decode(sentence("WIMWV,340.0,R,3.0,M,A"))
    sources = dict(plain.sources(5))
    assert sources["position"] == "autopilot.GLOBAL_POSITION_INT" and sources["wind"] == "anemometer.MWV"
    assert {(s.quantity, s.after) for s in plain.switches(5)} == {
        ("position", "autopilot.GLOBAL_POSITION_INT"),
        ("velocity", "autopilot.GLOBAL_POSITION_INT"),
    }
    assert dict(plain.counters())["anemometer.sentences"] == 1
