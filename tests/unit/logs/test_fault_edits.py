"""Faults in the bytes of a line, however these were cut on the way."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import pytest

from asvhil.config import FaultConfig, load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, pack
from asvhil.io.sensors.nmea_checksum import nmea_sentence
from asvhil.io.sensors.nmea_framing import NmeaFramer
from asvhil.logs.fault_edits import FaultEdits
from asvhil.types import Frame, Inputs

S = 1_000_000_000
SENDER = dialect.MAVLink(None, 7, 1)


def fix(number: int) -> bytes:
    """GPS_RAW_INT at 45 N 10 E, a metre farther north each time."""
    lat, lon = 450_000_000 + 90 * number, 100_000_000
    message = dialect.MAVLink_gps_raw_int_message(number * 200_000, 3, lat, lon, 5, 1, 1, 100 + number, 9000, 12)
    return pack(message, SENDER)


def attitude(yaw_rad: float) -> bytes:
    return pack(dialect.MAVLink_attitude_message(0, 0.1, 0.2, yaw_rad, 0.0, 0.0, 0.3), SENDER)


def edited(faults: Sequence[FaultConfig], chunks: Sequence[tuple[float, str, bytes]]) -> list[Frame]:
    """Frames of (time in s, port, bytes), a tick for each, edited."""
    edits = FaultEdits(faults, load_config("sitl-bream"))
    found: list[Frame] = []
    for t_s, port, data in [(0.0, "autopilot", b""), *chunks]:
        t_ns = round(t_s * S)
        inputs = Inputs(t_ns=t_ns, frames=(Frame(t_ns=t_ns, port=port, data=data),) if data else ())
        found += edits.apply(inputs).frames
    return found


def messages(frames: Sequence[Frame]) -> list[Any]:
    splitter = FrameSplitter()
    return [decode(whole) for frame in frames for whole in splitter.receive(frame.data)]


def sentences(frames: Sequence[Frame]) -> list[str]:
    framer = NmeaFramer()
    return [body.decode() for frame in frames for body in framer.receive(frame.data) if isinstance(body, bytes)]


def test_outside_of_a_fault_the_very_same_inputs_pass() -> None:
    edits = FaultEdits([FaultConfig(kind="gnss-jump", from_s=5.0)], load_config("sitl"))
    inputs = Inputs(t_ns=S, frames=(Frame(t_ns=S, port="autopilot", data=b"\x00" + fix(1) + b"\xfd"),))
    assert edits.apply(inputs) is inputs and edits.edited == 0


@pytest.mark.parametrize("size", [1, 7, 40, 64, 1000])
def test_messages_cut_anywhere_are_edited_and_none_is_lost(size: int) -> None:
    stream = b"".join(fix(number) + attitude(0.01 * number) for number in range(40))
    chunks = [stream[at : at + size] for at in range(0, len(stream), size)]
    timed = [(0.1 + 3.0 * at / len(chunks), "autopilot", chunk) for at, chunk in enumerate(chunks)]
    found = messages(edited([FaultConfig(kind="gnss-jump", from_s=1.0, until_s=2.0, size=20.0, toward_deg=0.0)], timed))
    sound = messages([Frame(t_ns=0, port="autopilot", data=stream)])
    assert [message.get_msgId() for message in found] == [message.get_msgId() for message in sound]
    moved_m = [round((a.lat - b.lat) / 90) for a, b in zip(found, sound, strict=True) if hasattr(a, "lat")]
    assert set(moved_m) <= {0, 20} and (size == 1000 or moved_m.count(20) in (12, 13, 14))
    assert sum(a != b for a, b in itertools.pairwise(moved_m)) == 2  # a begin and an end


def test_a_receiver_that_is_frozen_has_new_times_and_a_silent_one_has_not() -> None:
    chunks = [(0.2 * number, "autopilot", fix(number)) for number in range(1, 11)]
    for kind, times in (("gnss-frozen", 10), ("gnss-silent", 5)):
        found = messages(edited([FaultConfig(kind=kind, from_s=1.05)], chunks))
        assert [message.lat for message in found[4:]] == [450_000_450] * 6
        assert len({message.time_usec for message in found}) == times and found[9].vel == found[4].vel


def test_a_receiver_that_never_had_a_fix_gets_none() -> None:
    (message,) = messages(edited([FaultConfig(kind="gnss-silent")], [(1.0, "autopilot", fix(1))]))
    assert message.fix_type == dialect.GPS_FIX_TYPE_NO_FIX


def test_a_filter_follows_a_jump_after_ten_seconds_and_a_turned_compass_at_once() -> None:
    chunks = [(float(t_s), "autopilot", attitude(3.0)) for t_s in range(1, 20)]
    found = messages(edited([FaultConfig(kind="heading-jump", from_s=2.0, size=60.0)], chunks))
    assert [message.yaw for message in found[:11]] == [pytest.approx(3.0)] * 11
    assert found[11].yaw == pytest.approx(3.0 + math.pi / 3.0 - math.tau) and found[11].pitch == pytest.approx(0.2)
    found = messages(edited([FaultConfig(kind="compass-turned", from_s=2.0, size=-90.0)], chunks))
    assert found[1].yaw == pytest.approx(3.0 - math.pi / 2.0)


def test_a_quaternion_turns_as_the_angles_do() -> None:
    message = dialect.MAVLink_attitude_quaternion_message(0, math.cos(0.4), 0.0, 0.0, math.sin(0.4), 0.0, 0.0, 0.1)
    found = messages(
        edited([FaultConfig(kind="compass-turned", size=90.0)], [(1.0, "autopilot", pack(message, SENDER))])
    )
    assert 2.0 * math.atan2(found[0].q4, found[0].q1) == pytest.approx(0.8 + math.pi / 2.0)


RMC = "GPRMC,120000.00,A,4500.00000,N,01000.00000,E,1.000,90.00,010126,1.0,E,A"


@pytest.mark.parametrize(
    ("kind", "body", "expected"),
    [
        ("gnss-silent", RMC, "GPRMC,120000.00,V,,,,,,,010126,1.0,E,A"),
        ("gnss-silent", "GPGGA,1,4500.0,N,01000.0,E,1,12,0.8,0,M,0,M,,", "GPGGA,1,,,,,0,12,0.8,0,M,0,M,,"),
        ("gnss-jump", RMC, RMC.replace("4500.00000", "4500.010798").replace("01000.00000", "01000.000000")),
        ("heading-jump", "HCHDG,350.0,,,4.5,E", "HCHDG,50.00,,,4.5,E"),
        ("compass-turned", "HEHDT,10.0,T", "HEHDT,100.00,T"),
        ("heading-silent", "HEHDT,10.0,T", None),
        ("gnss-jump", "GPZDA,120000.00,01,01,2026,00,00", "GPZDA,120000.00,01,01,2026,00,00"),
        ("nmea", RMC, None),
    ],
)
def test_sentences_of_a_receiver(kind: str, body: str, expected: str | None) -> None:
    fault = FaultConfig.model_validate({"kind": kind, "toward_deg": 0.0})
    found = sentences(edited([fault], [(1.0, "gnss", nmea_sentence(body))]))
    assert found == ([] if expected is None else [expected])


def test_a_frozen_receiver_repeats_all_but_the_time() -> None:
    later = RMC.replace("120000.00", "120001.00").replace("4500.00000", "4500.00500").replace("1.000", "2.000")
    chunks = [(1.0, "gnss", nmea_sentence(RMC)), (2.0, "gnss", nmea_sentence(later))]
    found = sentences(edited([FaultConfig(kind="gnss-frozen", from_s=1.5)], chunks))
    assert found == [RMC, RMC.replace("120000.00", "120001.00")]


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("anemometer", []),
        ("anemometer-stuck", ["WIMWV,90.0,R,3.00,M,A"]),
        ("vane", ["WIMWV,90.0,R,4.00,M,A"]),
        ("cups", ["WIMWV,180.0,R,3.00,M,A"]),
    ],
)
@pytest.mark.parametrize("size", [3, 100])
def test_parts_of_an_anemometer(kind: str, expected: list[str], size: int) -> None:
    first, second = nmea_sentence("WIMWV,90.0,R,3.00,M,A"), nmea_sentence("WIMWV,180.0,R,4.00,M,A")
    chunks = [(1.0, "anemometer", first)]
    chunks += [(2.0, "anemometer", second[at : at + size]) for at in range(0, len(second), size)]
    found = sentences(edited([FaultConfig.model_validate({"kind": kind, "from_s": 1.5})], chunks))
    assert found == ["WIMWV,90.0,R,3.00,M,A", *expected]
