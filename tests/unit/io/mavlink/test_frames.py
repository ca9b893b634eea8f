"""MAVLink framing: every frame of a stream is found however it is cut, and garbage costs nothing but itself."""

import random

import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.errors import LinkError
from asvhil.io.mavlink.frames import FrameSplitter, Parser, decode, dialect, message_id, refuse_ignored_crc, source

# HEARTBEAT of a companion computer 1/191, sequence 0, by hand from the protocol: header, payload, CRC-16/MCRF4XX.
HEARTBEAT = bytes.fromhex("fd09000000 01bf 000000 00000000 12080004 03".replace(" ", ""))
ATTITUDE = bytes(dialect.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6).pack(dialect.MAVLink(None, 1, 1)))
SERVO = bytes(
    dialect.MAVLink_servo_output_raw_message(1, 0, *range(1500, 1508)).pack(
        dialect.MAVLink(None, 1, 1), force_mavlink1=True
    )
)


def heartbeat() -> bytes:
    message = dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    return bytes(message.pack(dialect.MAVLink(None, 1, 191)))


def test_heartbeat_bytes_are_those_of_the_protocol() -> None:
    assert heartbeat()[:-2] == HEARTBEAT
    assert FrameSplitter().receive(heartbeat()) == [heartbeat()]
    assert message_id(heartbeat()) == 0 and source(heartbeat()) == (1, 191)
    assert message_id(SERVO) == 36 and source(SERVO) == (1, 1)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=40))
def test_any_chunking_gives_the_same_frames(cuts: list[int]) -> None:
    frames = [heartbeat(), ATTITUDE, SERVO] * 3
    stream = b"".join(frames)
    splitter = FrameSplitter()
    found, at = [], 0
    for cut in cuts:
        found += splitter.receive(stream[at : at + cut])
        at += cut
    found += splitter.receive(stream[at:])
    assert found == frames and splitter.garbage_bytes == 0


@settings(max_examples=50)
@given(st.binary(max_size=300), st.binary(max_size=300))
def test_garbage_between_frames_loses_no_frame(before: bytes, after: bytes) -> None:
    splitter = FrameSplitter()
    found = splitter.receive(before + ATTITUDE + after + ATTITUDE)
    found += splitter.receive(ATTITUDE * 10)  # enough to end any length that garbage has promised
    assert found.count(ATTITUDE) >= 11


def test_a_flipped_bit_drops_one_frame_only() -> None:
    for bit in range(8 * len(ATTITUDE)):
        damaged = bytearray(ATTITUDE)
        damaged[bit // 8] ^= 1 << bit % 8
        splitter = FrameSplitter()
        found = splitter.receive(bytes(damaged) + heartbeat() * 40)
        assert ATTITUDE not in found and found.count(heartbeat()) == 40, bit


def unknown(number: int, payload: bytes, *, seed: int, signed: bool = False) -> bytes:
    """A MAVLink 2 frame of a message that the dialect does not have, with its CRC_EXTRA."""
    assert number not in dialect.mavlink_map
    body = bytes([0xFD, len(payload), signed, 0, 7, 1, 1]) + number.to_bytes(3, "little") + payload
    return body + int(mcrf4xx(body[1:] + bytes([seed]))).to_bytes(2, "little") + bytes(13 * signed)


# What a PX4 sends at 10 Hz beside the rest, and the dialect does not know: ESC_INFO and ESC_STATUS.
ESC_INFO = unknown(290, bytes(range(200, 246)), seed=251)
ESC_STATUS = unknown(291, bytes(range(57)), seed=10)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=40))
def test_messages_that_are_not_known_are_counted_and_are_not_garbage(cuts: list[int]) -> None:
    stream = (ESC_INFO + ATTITUDE + unknown(436, b"\x01", seed=193, signed=True) + ESC_STATUS + SERVO) * 3
    splitter = FrameSplitter()
    found, at = [], 0
    for cut in cuts:
        found += splitter.receive(stream[at : at + cut])
        at += cut
    found += splitter.receive(stream[at:])
    assert found == [ATTITUDE, SERVO] * 3
    assert (splitter.unknown, splitter.bad_crc, splitter.garbage_bytes) == (9, 0, 0)


def test_the_payload_of_a_message_that_is_not_known_is_not_searched_for_frames() -> None:
    splitter = FrameSplitter(datagrams=True)
    assert splitter.receive(unknown(291, b"\xfd\x05\x00" * 19, seed=10)) == []
    assert (splitter.unknown, splitter.bad_crc, splitter.garbage_bytes) == (1, 0, 0)


def test_a_damaged_message_that_is_not_known_is_garbage() -> None:
    splitter = FrameSplitter(datagrams=True)
    damaged = bytes([*ESC_INFO[:30], ESC_INFO[30] ^ 0x11, *ESC_INFO[31:]])
    assert splitter.receive(damaged + ATTITUDE) == [ATTITUDE]
    assert splitter.unknown == 0 and splitter.garbage_bytes == len(damaged)


def test_a_stray_magic_byte_neither_hides_nor_delays_a_frame() -> None:
    splitter = FrameSplitter()
    stray = b"\xfd\xff\x00\x00\x00\x00\x00\x22\x01\x00"  # promises 255 bytes of message 290
    assert splitter.receive(stray + heartbeat()[:9]) == []
    assert splitter.receive(heartbeat()[9:]) == [heartbeat()]
    assert splitter.unknown == 0 and splitter.garbage_bytes == len(stray)


def test_a_datagram_ends_its_frames() -> None:
    splitter = FrameSplitter(datagrams=True)
    assert splitter.receive(ATTITUDE[:20]) == []
    assert splitter.receive(ATTITUDE) == [ATTITUDE]
    assert splitter.garbage_bytes == 20


def test_a_megabyte_of_noise_is_bounded_and_survived() -> None:
    noise = random.Random(1)
    splitter = FrameSplitter()
    for _ in range(256):
        splitter.receive(noise.randbytes(4096))
    assert len(splitter._buffer) <= FrameSplitter.MAX_BUFFER
    assert splitter.garbage_bytes > 1_000_000
    assert splitter.receive(ATTITUDE * 20)[-1] == ATTITUDE


def test_peers_are_kept_apart_and_bounded() -> None:
    parser = Parser()
    assert parser.receive("", ATTITUDE[:20]) == []
    assert parser.receive("10.0.0.1:5", b"\xfd\xff") == []
    assert parser.receive("", ATTITUDE[20:]) == [ATTITUDE]
    for number in range(100):
        parser.receive(f"10.0.0.1:{number}", ATTITUDE + b"x")
    assert len(parser._splitters) == Parser.MAX_PEERS
    assert parser.totals() == (101, 0, 0, 102)


def test_a_peer_that_sends_frames_is_remembered_before_those_that_send_noise() -> None:
    parser = Parser()
    assert parser.receive("boat:1", ATTITUDE + ATTITUDE[:20]) == [ATTITUDE]
    for number in range(100):
        parser.receive(f"noise:{number}", b"\xfd\xff\x00")
    assert parser.receive("boat:1", ATTITUDE[20:]) == [ATTITUDE]


def stream(system_id: int, seconds: int) -> list[bytes]:
    """Frames of an autopilot: of both versions, known and unknown, each numbered."""
    found = []
    mav = dialect.MAVLink(None, srcSystem=system_id, srcComponent=1)
    for number in range(seconds * 20):
        for message in (
            dialect.MAVLink_attitude_message(50 * number, 0.01 * number, 0.2, 0.3, 0.0, 0.0, -0.1),
            dialect.MAVLink_param_value_message(b"SERVO3_MIN", 1100.0, 4, 900, number % 900),
        ):
            found.append(bytes(message.pack(mav, force_mavlink1=number % 7 == 0)))
            mav.seq = (mav.seq + 1) % 256
    return found


@pytest.mark.parametrize("size", [1, 2, 3, 7, 16, 28, 29, 63, 64, 65, 128, 255, 256, 280, 300])
def test_frames_cut_at_any_size_are_put_together_for_each_peer(size: int) -> None:
    sent = {f"10.0.0.{n}:14550": stream(n, 8) for n in (1, 2, 3)}
    data = {peer: b"".join(frames) for peer, frames in sent.items()}
    cut = {peer: [every[at : at + size] for at in range(0, len(every), size)] for peer, every in data.items()}
    parser = Parser()
    got: dict[str, list[bytes]] = {peer: [] for peer in sent}
    for chunks in zip(*cut.values(), strict=True):  # in turn
        for peer, chunk in zip(cut, chunks, strict=True):
            got[peer] += parser.receive(peer, chunk)
    assert got == sent
    _, bad_crc, _, garbage_bytes = parser.totals()
    assert bad_crc == garbage_bytes == 0
    assert [parser.lost_of((n, 1)) for n in (1, 2, 3)] == [0, 0, 0]


@given(st.lists(st.integers(1, 300), min_size=1, max_size=60), st.integers(0, 2**32))
def test_frames_cut_anywhere_with_datagrams_lost_cost_only_what_they_held(cuts: list[int], seed: int) -> None:
    chance = random.Random(seed)
    frames = stream(1, 3)
    data, at, whole_from = b"".join(frames), 0, 0
    parser, got, kept = Parser(), [], bytearray(len(data))
    for cut in cuts * 20:
        if chance.random() > 0.1:
            got += parser.receive("radio:1", data[at : at + cut])
            kept[at : at + cut] = b"\1" * len(data[at : at + cut])
        at += cut
    got += parser.receive("radio:1", frames[0] * 12)  # what was waiting for its rest is seen not to be whole
    reach = min(at, len(data))
    for frame in frames:
        whole = whole_from + len(frame) <= reach and all(kept[whole_from : whole_from + len(frame)])
        assert not whole or frame in got
        whole_from += len(frame)


def test_a_beginning_without_an_end_delays_nothing_that_comes_after_it() -> None:
    parser = Parser()
    assert parser.receive("radio:1", ATTITUDE[:20]) == []
    assert parser.receive("radio:1", SERVO) == [SERVO]
    assert parser.receive("radio:1", b"\xfd\xff\x00\x00\x00\x01\x01\x1e\x00\x00" + SERVO) == []  # promises 255 bytes
    assert parser.receive("radio:1", ATTITUDE) == [SERVO, ATTITUDE]
    assert parser.totals()[3] == 30


def test_lost_frames_are_counted_by_sender_and_peer() -> None:
    parser, frames = Parser(), stream(1, 4)
    for number, frame in enumerate(frames):
        if number % 10:
            parser.receive("route:1", frame)
        if number % 4:
            parser.receive("route:2", frame)
    assert parser.lost_of((1, 1)) == len(frames) // 10 - 1 + len(frames) // 4 - 1  # the first is not missed
    constant = Parser()
    for _ in range(50):
        constant.receive("", ATTITUDE)  # a sender that does not count
    assert constant.lost_of((1, 1)) == 0


def test_decode_gives_the_fields_or_none() -> None:
    message = decode(ATTITUDE)
    assert message is not None and message.yaw == pytest.approx(0.3)
    assert decode(ATTITUDE[:-1]) is None


def test_ignored_checksums_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAV_IGNORE_CRC", raising=False)
    refuse_ignored_crc()
    monkeypatch.setenv("MAV_IGNORE_CRC", "1")
    with pytest.raises(LinkError, match="MAV_IGNORE_CRC"):
        refuse_ignored_crc()
