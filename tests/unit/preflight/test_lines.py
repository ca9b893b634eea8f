"""A sensor that gives nothing: for each cause other words, over real pseudo-terminals."""

import asyncio
import os
import random
import time
import tty
from collections.abc import Callable

import pytest

from asvhil.config import Quantity, SourceConfig, load_config
from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import dialect
from asvhil.links.endpoint import open_endpoint
from asvhil.preflight.lines import Diagnosis, SensorLine
from asvhil.types import Frame
from tests.support.nmea import sentence

S = 1_000_000_000
CONFIG = load_config("sitl")
WIND = sentence("WIMWV,45.0,R,5.0,M,A")
UBX_PVT = b"\xb5\x62\x01\x07\x5c\x00" + bytes(92) + b"\x12\x34"
HEARTBEAT = bytes(dialect.MAVLink_heartbeat_message(11, 3, 0, 0, 4, 3).pack(dialect.MAVLink(None)))
YPR = bytes.fromhex("FA 01 0800 93502E42 833EF13F 48B504BB 9288")


def resampled(data: bytes, sent_baud: int, read_baud: int) -> bytes:
    """What a UART at one speed makes of bytes that were sent at another: start bit, eight bits, stop bit."""
    level = [1] * 20
    for byte in data:
        level += [0, *(byte >> bit & 1 for bit in range(8)), 1]
    level += [1] * 20

    def at(seconds: float) -> int:
        place = int(seconds * sent_baud)
        return level[place] if place < len(level) else 1

    found, t, step = bytearray(), 0.0, 1.0 / read_baud
    while t < len(level) / sent_baud:
        if at(t) == 1:
            t += step / 16.0
            continue
        bits = [at(t + (1.5 + bit) * step) for bit in range(8)]
        found.append(sum(bit << place for place, bit in enumerate(bits)))
        t += 9.5 * step
    return bytes(found)


def read_through_a_pty(data: bytes, port: str, line: SensorLine) -> None:
    """Bytes written to one end of a pseudo-terminal, read at the other by the link that the daemon uses."""

    async def through() -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        endpoint = await open_endpoint(f"serial:{os.ttyname(slave)}:38400", port, time.monotonic_ns)
        try:
            received = 0
            writer = asyncio.get_running_loop().run_in_executor(None, os.write, master, data)
            while received < len(data):
                frame = await asyncio.wait_for(endpoint.recv(), 5.0)
                received += len(frame.data)
                line.receive(Frame(t_ns=0, port=port, data=frame.data))
            await writer
        finally:
            await endpoint.close()
            os.close(master)
            os.close(slave)

    asyncio.run(through())


def look(
    data: bytes, *, port: str = "anemometer", quantity: Quantity = "wind", message: str = "MWV", age_s: float = 0.5
) -> Diagnosis:
    overrides = [f"links.{port}={{endpoint: 'serial:/dev/null:38400'}}"]
    line = SensorLine(load_config("sitl", tuple(overrides)), port)
    if data:
        read_through_a_pty(data, port, line)
    return line.diagnosis(quantity, SourceConfig(link=port, message=message), round(age_s * S))


def test_the_uart_of_this_test_reads_what_was_sent_at_its_own_speed() -> None:
    assert resampled(WIND, 9600, 9600) == WIND and resampled(WIND, 9600, 9500) == WIND


@pytest.mark.parametrize(
    ("data", "found", "todo"),
    [
        (b"", "not one byte", "is its TX wired to our RX"),
        (resampled(WIND * 30, 4800, 38400), "of them no text", "the speed is wrong: set that of links.anemometer"),
        (resampled(WIND * 30, 38400, 4800), "of them no text", "the speed is wrong"),
        (resampled(WIND * 30, 9600, 38400), "of them no text", "the speed is wrong"),
        (resampled(WIND * 30, 115200, 9600), "of them no text", "the speed is wrong"),
        (random.Random(1).randbytes(900), "of them no text", "the speed is wrong"),
        (b"$WIMWV,45.0,R,5.0,M,A\r\n" * 9, "9 sentences without a checksum", "switch its checksum on"),
        (WIND.replace(b",5.0", b",5.5") * 9, "9 sentences, all with a wrong checksum", "cable, ground and supply"),
        (b"Wind 5.0 m/s from 45\r\n" * 9, "bytes without a sentence, such as 'Wind 5.0 m/s", "is this the right dev"),
        (UBX_PVT * 9, "bytes of UBX of a u-blox receiver", "this link reads NMEA 0183"),
        (HEARTBEAT * 9, "bytes of MAVLink", "this link reads NMEA 0183"),
        (YPR * 9, "bytes of binary messages of a VectorNav", "this link reads NMEA 0183"),
        (
            sentence("IIVWR,45.0,R,5.0,N") * 9 + sentence("WIXDR,C,12.5,C,T") * 2,
            "sends VWR, XDR, and no MWV",
            "sources.wind: [anemometer.VWR] takes it as it is, or have it send MWV",
        ),
        (sentence("WIMWV,45.0,T,5.0,M,A") * 9, "sends MWV_T, and no MWV", "[anemometer.MWV_T] takes it"),
        (sentence("WIXDR,C,12.5,C,T") * 9, "sends XDR, and no MWV", "have it send MWV"),
        (sentence("WIMWV,,R,,M,V") * 9, "9 MWV, 9 marked as not valid by the instrument itself", "its sensor"),
        (sentence("WIMWV,400.0,R,5.0,M,A") * 9, "9 MWV, 9 with a value that no instrument", "sends nonsense"),
        (sentence("WIMWV,,R,,M,A") * 9, "9 MWV, 9 with an empty field", "measures nothing yet"),
        (sentence("WIMWV,4_5,R,5.0,M,A") * 9, "9 MWV, 9 with a field that cannot be read", "settings"),
    ],
)
def test_each_cause_of_a_wind_sensor_has_words_of_its_own(data: bytes, found: str, todo: str) -> None:
    said = look(data)
    assert found in said.found and todo in said.todo, said


def test_a_sensor_that_has_stopped() -> None:
    said = look(WIND * 20, age_s=7.4)
    assert said.found == f"silent for 7 s, after {20 * len(WIND)} bytes" and "a loose plug" in said.todo
    assert look(WIND * 20).found == "20 MWV, none in time"


@pytest.mark.parametrize(
    ("port", "quantity", "message", "data", "found", "todo"),
    [
        ("gnss", "position", "GGA", sentence("GPGGA,1,,,,,0,00") * 5, "5 GGA, 5 marked as not valid", "open sky"),
        ("gnss", "position", "GGA", sentence("GPRMC,1,V") * 5, "sends RMC, and no GGA", "sources.position: [gnss.RMC]"),
        ("gnss", "heading", "HDM", sentence("HCHDM,10.0,M") * 5, "with a magnetic direction", "links.gnss.declination"),
        ("gnss", "heading", "HDG", sentence("HCHDG,500.0,,,,") * 5, "no instrument can mean", "nonsense"),
        ("gnss", "position", "GGA", UBX_PVT * 9, "UBX", "NMEA 0183"),
        ("ins", "position", "BINARY", b"", "not one byte", "links.ins.endpoint"),
        (
            "ins",
            "position",
            "BINARY",
            sentence("VNYMR,1,2,3,4,5,6,7,8,9,1,1,2") * 5,
            "5 ASCII sentences",
            "send BINARY",
        ),
        ("ins", "position", "VNINS", YPR * 5, "5 binary messages, and no VNINS", "have it send VNINS"),
        ("ins", "position", "BINARY", YPR * 5, "5 messages, and none with this quantity", "hold the field"),
        ("ins", "position", "BINARY", UBX_PVT * 5, "UBX", "this link reads VectorNav's"),
        ("ins", "position", "BINARY", WIND * 5, "bytes of NMEA sentences", "this link reads VectorNav's"),
        ("ins", "position", "BINARY", random.Random(1).randbytes(900), "of them no text", "speed"),
    ],
)
def test_other_sensors(port: str, quantity: Quantity, message: str, data: bytes, found: str, todo: str) -> None:
    said = look(data, port=port, quantity=quantity, message=message)
    assert found in said.found and todo in said.todo, said


def test_a_line_that_cannot_be_opened_is_told_as_that() -> None:
    line = SensorLine(load_config("sitl"), "anemometer")
    with pytest.raises(LinkError) as caught:
        asyncio.run(open_endpoint("serial:/dev/nowhere:38400", "anemometer", time.monotonic_ns))
    line.state = str(caught.value)
    said = line.diagnosis("wind", SourceConfig(link="anemometer", message="MWV"), S)
    assert "/dev/nowhere" in said.found and said.todo.startswith("is the device there, and free?")


def test_whatever_comes_the_words_are_one_line() -> None:
    noise = random.Random(2)
    makers: list[Callable[[], bytes]] = [
        lambda: noise.randbytes(noise.randrange(1, 300)),
        lambda: bytes(noise.choices(b"$*,\r\nWIMWV0123456789.\x1b[31m\xb5b\xfd", k=300)),
        lambda: sentence("WI\x1b[2JX,1"),
    ]
    for _ in range(300):
        line = SensorLine(CONFIG, "anemometer")
        for _ in range(3):
            line.receive(Frame(t_ns=0, port="anemometer", data=noise.choice(makers)()))
        said = line.diagnosis("wind", SourceConfig(link="anemometer", message="MWV"), S)
        assert said.found and said.todo and (said.found + said.todo).isprintable()
