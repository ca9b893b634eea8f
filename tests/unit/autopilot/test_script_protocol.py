"""Orders and signs of life of the script on the autopilot, by literal bytes."""

import pytest

from asvhil.autopilot.script_protocol import TEXTS, AliveSign, Order, ScriptReason, ScriptState, encode_order
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.autopilot_script import SCRIPT

GOOD = {"start": 0xBEEF, "count": 0x01020304, "pulses_us": (1611, 1322), "sender": (1, 191), "target": (1, 1)}


def payload(order: Order, **changed: object) -> str:
    message = encode_order(order, **{**GOOD, **changed})  # type: ignore[arg-type]
    return bytes(message.payload).rstrip(b"\0").hex(" ")


def named(name: str, value: float) -> object:
    message = mav.MAVLink_named_value_float_message(1000, name.encode(), value)
    return decode(message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=1)))


def test_an_order_to_drive() -> None:
    assert payload(Order.DRIVE) == "01 01 ef be 04 03 02 01 4b 06 2a 05 b4 e4 96 ea"


def test_an_order_to_release() -> None:
    assert payload(Order.RELEASE, count=7, pulses_us=(1500, 1500)) == "01 00 ef be 07 00 00 00 dc 05 dc 05 ce 8f e0 84"


def test_the_check_is_over_sender_and_target_too() -> None:
    assert payload(Order.DRIVE, sender=(1, 192)) == "01 01 ef be 04 03 02 01 4b 06 2a 05 94 d4 81 d5"
    assert payload(Order.DRIVE, target=(2, 1)) == "01 01 ef be 04 03 02 01 4b 06 2a 05 cd 8e eb fb"


def test_a_whole_frame() -> None:
    message = encode_order(Order.DRIVE, **GOOD)  # type: ignore[arg-type]
    frame = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=191))
    assert (
        frame.hex(" ")
        == "fd 15 00 00 00 01 bf 81 01 00 71 a5 01 01 10 01 01 ef be 04 03 02 01 4b 06 2a 05 b4 e4 96 ea 27 f7"
    )
    assert FrameSplitter().receive(frame) == [frame]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"sender": (1, 190)}, "component id 190: the script listens to 191 to 194 only"),
        ({"sender": (1, 195)}, "component id 195: the script listens to 191 to 194 only"),
        ({"count": 0}, r"count 0 is not from 1 to 2\^31 - 1"),
        ({"count": 2**31}, r"count 2147483648 is not from 1 to 2\^31 - 1"),
        ({"pulses_us": (799, 1500)}, r"pulses \(799, 1500\) us are not from 800 to 2200 us"),
        ({"pulses_us": (1500, 2201)}, r"pulses \(1500, 2201\) us are not from 800 to 2200 us"),
    ],
)
def test_what_the_script_would_drop_is_not_encoded(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        payload(Order.DRIVE, **wrong)


def test_a_start_goes_round() -> None:
    assert payload(Order.DRIVE, start=2**16 + 5) == payload(Order.DRIVE, start=5)


def test_the_sign_of_life_is_whole_when_all_four_have_come() -> None:
    alive = AliveSign()
    for t_ns, (name, value) in enumerate([("ASV_WHY", 106.0), ("ASV_USED", 16777215.0), ("ASV_DROP", 3.0)]):
        assert alive.receive(t_ns, named(name, value))
        assert (alive.state, alive.heard_ns) == (None, t_ns)
    assert alive.receive(9, named("ASV_START", 65535.0))
    assert alive.state == ScriptState(
        version=1, reason=ScriptReason.EMERGENCY_STOP, start=65535, used=16777215, dropped=3
    )
    assert not alive.state.driving
    assert alive.receive(10, named("ASV_WHY", 101.0))
    assert alive.state.driving


def test_a_reason_of_another_version() -> None:
    alive = AliveSign()
    for name, value in (("ASV_WHY", 299.0), ("ASV_USED", 0.0), ("ASV_DROP", 0.0), ("ASV_START", 1.0)):
        alive.receive(0, named(name, value))
    assert alive.state is not None
    assert (alive.state.version, alive.state.reason, alive.state.driving) == (2, None, False)


@pytest.mark.parametrize(
    ("name", "value"),
    [("ASV_WHY", float("nan")), ("ASV_WHY", float("inf")), ("ASV_USED", -1.0), ("ASV_USED", 2.0**25), ("OTHER", 1.0)],
)
def test_what_is_no_sign_of_life(name: str, value: float) -> None:
    alive = AliveSign()
    assert not alive.receive(0, named(name, value))
    assert alive.heard_ns is None


def test_a_restart_is_forgotten() -> None:
    alive = AliveSign()
    alive.receive(0, named("ASV_WHY", 100.0))
    alive.forget()
    assert alive.heard_ns is None
    for name in ("ASV_USED", "ASV_DROP", "ASV_START"):
        alive.receive(1, named(name, 1.0))
    assert alive.state is None


def test_the_reasons_are_those_of_the_script() -> None:
    assert set(TEXTS) == set(ScriptReason)
    names = ["READY", "DRIVING", "SILENT", "RELEASED", "DISARMED", "MODE", "ESTOP", "STICK", "OUTPUTS"]
    assert f"local {', '.join(names)} = 0, 1, 2, 3, 4, 5, 6, 7, 8\n" in SCRIPT
    ours = [reason.name.replace("EMERGENCY_STOP", "ESTOP") for reason in ScriptReason]
    assert ours == names
    assert [int(reason) for reason in ScriptReason] == list(range(9))
