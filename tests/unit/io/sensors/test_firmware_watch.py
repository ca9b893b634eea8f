"""The version sentence of the anemometer's firmware: read in any chunks, asked for, compared, told in words."""

import random

import pytest

from asvhil.backseat.build import build_backseat
from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.sensors.firmware import ASK_NS, FIRMWARE, PATIENCE, QUERY, VERSION, FirmwareWatch
from asvhil.types import Frame, Inputs
from tests.support.nmea import sentence

BOOT = b"$PASVV,arduino_anemometer,1.0.1,power-on*3B\r\n"


def feed(watch: FirmwareWatch, data: bytes) -> None:
    watch.receive(Frame(t_ns=0, port="anemometer", data=data))


def test_the_version_at_boot_in_any_chunks() -> None:
    for size in (1, 3, 20, 100):
        watch = FirmwareWatch("anemometer", FIRMWARE)
        data = b"WV,1.0,R,0.0,M,A*00\r\n" + BOOT
        for at in range(0, len(data), size):
            feed(watch, data[at : at + size])
        note = watch.note()
        assert note is not None and note.ok and note.text == f"{FIRMWARE} {VERSION}"
        assert watch.data_to_send(10 * ASK_NS) == []


def test_it_asks_until_it_is_answered() -> None:
    watch = FirmwareWatch("anemometer", FIRMWARE)
    assert watch.data_to_send(0) == [] and watch.note() is None  # nothing is heard there: nobody to ask
    feed(watch, b"$WIMWV,22.5,R,0.00,M,A*25\r\n")
    asked = [t_ns for t_ns in range(0, 4 * ASK_NS, ASK_NS // 8) if watch.data_to_send(t_ns)]
    assert asked == [0, ASK_NS, 2 * ASK_NS, 3 * ASK_NS] and PATIENCE == 3
    note = watch.note()
    assert note is not None and not note.ok
    assert note.text == f"tells no version; links.anemometer.firmware expects {FIRMWARE} {VERSION}"
    feed(watch, sentence(f"PASVV,{FIRMWARE},{VERSION},request"))
    note = watch.note()
    assert note is not None and note.ok and watch.data_to_send(99 * ASK_NS) == []


def test_the_question_is_one_that_the_firmware_understands() -> None:
    assert sentence("PASVQ,V") == QUERY


def test_another_instrument_is_not_asked_but_may_tell() -> None:
    watch = FirmwareWatch("anemometer", None)
    feed(watch, b"$WIMWV,22.5,R,0.00,M,A*25\r\n")
    assert watch.data_to_send(0) == [] and watch.note() is None
    feed(watch, sentence("PASVV,something,7.2,reset"))
    note = watch.note()
    assert note is not None and note.ok and note.text == "something 7.2"


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        (f"{FIRMWARE},0.9.0,reset", f"{FIRMWARE} 0.9.0 instead of {FIRMWARE} {VERSION}: flash it (docs/anemometer.md)"),
        (f"rain_gauge,{VERSION},reset", f"rain_gauge {VERSION} instead of {FIRMWARE} {VERSION}: flash it"),
        (f"{FIRMWARE},{VERSION},watchdog", f"{FIRMWARE} {VERSION}, restarted by its watchdog"),
    ],
)
def test_what_is_not_as_it_should_be_is_told(fields: str, text: str) -> None:
    watch = FirmwareWatch("anemometer", FIRMWARE)
    feed(watch, sentence(f"PASVV,{fields}"))
    feed(watch, sentence(f"PASVV,{fields.rpartition(',')[0]},request"))  # which says nothing of the start
    note = watch.note()
    assert note is not None and not note.ok and note.text.startswith(text) and "\n" not in note.text


@pytest.mark.parametrize(
    "data",
    [
        BOOT.replace(b"3B", b"3A"),
        BOOT.replace(b"*3B", b""),
        sentence("PASVV,a,1"),
        sentence("PASVV,a,1,b,c"),
        sentence("PASVV,,1,b"),
        sentence("PASVV,[/red],1,b"),  # it would be shown on a terminal
        sentence("PASVV," + "a" * 41 + ",1,b"),
    ],
)
def test_a_sentence_that_is_none_is_left_alone(data: bytes) -> None:
    watch = FirmwareWatch("anemometer", FIRMWARE)
    feed(watch, data)
    assert watch.note() is None


def test_hostile_bytes_neither_raise_nor_pile_up() -> None:
    noise, watch = random.Random(3), FirmwareWatch("anemometer", FIRMWARE)
    for _ in range(100):
        feed(watch, noise.randbytes(4096))
        assert watch._framer.held <= 256
    feed(watch, b"x" * 100_000)
    feed(watch, b"\n" + BOOT)
    assert watch.note() is not None


def test_the_backseat_asks_and_tells_the_operator_and_the_log() -> None:
    settings = load_config("sitl", ("controller.name=loiter", "links.anemometer.firmware=arduino_anemometer"))
    backseat = build_backseat(settings)

    def step(t_ns: int, data: bytes):  # type: ignore[no-untyped-def]
        return backseat.step(Inputs(t_ns=t_ns, frames=(Frame(t_ns=t_ns, port="anemometer", data=data),)))

    first = step(0, b"$WIMWV,22.5,R,0.00,M,A*25\r\n")
    assert [frame.data for frame in first.frames if frame.port == "anemometer"] == [QUERY]
    old = step(10**8, sentence(f"PASVV,{FIRMWARE},0.9.0,request"))
    (note,) = old.health.notes
    assert not note.ok and note.subject == "anemometer firmware" and "0.9.0 instead of" in note.text
    told = [decode(data) for f in old.frames if f.port == "operator" for data in FrameSplitter().receive(f.data)]
    assert any(m.get_type() == "STATUSTEXT" and "0.9.0" in m.text for m in told)
    again = step(2 * 10**8, b"")
    assert again.health.notes == old.health.notes
    assert not any(b"0.9.0" in f.data for f in again.frames)


def test_by_default_nobody_is_asked() -> None:
    backseat = build_backseat(load_config("sitl", ("controller.name=loiter",)))
    outputs = backseat.step(Inputs(t_ns=0, frames=(Frame(t_ns=0, port="anemometer", data=b"$WIMWV,22.5,R,0*00\r\n"),)))
    assert not any(frame.port == "anemometer" for frame in outputs.frames) and outputs.health.notes == ()


def test_an_unknown_firmware_in_the_config_is_one_line() -> None:
    with pytest.raises(ConfigError, match=r"links\.anemometer\.firmware"):
        load_config("sitl", ("links.anemometer.firmware=rain_gauge",))
