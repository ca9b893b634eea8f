"""Signing: our bytes are those of the standard, and no attacker changes anything for the rightful peer."""

from __future__ import annotations

import hashlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect, message_number
from asvhil.io.mavlink.signing import (
    CLOCK_UNSET_BEFORE,
    EPOCH_2015_NS,
    FIRST_START,
    MAX_STREAMS,
    Signer,
    SigningClock,
    SigningState,
    Verdict,
    Verifier,
    derive_key,
    is_signed,
    sign,
    timestamp_of,
)

KEY = bytes(range(32))
NOW_NS = 1_795_000_000_000_000_000  # November 2026
NOW = timestamp_of(NOW_NS)
SECOND = 100_000
HOUR = 3600 * SECOND


def heartbeat(system_id: int = 1, component_id: int = 1, seq: int = 0) -> bytes:
    sender = dialect.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    sender.seq = seq
    return bytes(dialect.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3).pack(sender))


def signed_by_pymavlink(timestamp: int, link_id: int = 0, key: bytes = KEY) -> bytes:
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    sender.signing.secret_key, sender.signing.sign_outgoing = key, True
    sender.signing.link_id, sender.signing.timestamp = link_id, timestamp
    return bytes(dialect.MAVLink_heartbeat_message(11, 3, 81, 0, 4, 3).pack(sender))


def verifier(state: SigningState = FIRST_START, **options) -> Verifier:  # type: ignore[no-untyped-def]
    options.setdefault("accept_unsigned", {message_number("RADIO_STATUS")})
    return Verifier(KEY, SigningClock(), state=state, start_ns=NOW_NS, **options)


def check(guard: Verifier, frame: bytes, at_ns: int = NOW_NS) -> Verdict:
    return guard.check(frame, at_ns, at_ns)


def flipped(frame: bytes, bit: int) -> bytes:
    damaged = bytearray(frame)
    damaged[bit // 8] ^= 1 << bit % 8
    return bytes(damaged)


# --- bytes -----------------------------------------------------------------------------------------------------


def test_the_bytes_are_those_of_pymavlink() -> None:
    for timestamp, link_id in ((0, 0), (1, 7), (NOW, 255), ((1 << 48) - 1, 3)):
        assert sign(heartbeat(), KEY, link_id, timestamp) == signed_by_pymavlink(timestamp, link_id)


def test_the_bytes_are_those_of_the_standard() -> None:
    frame = sign(heartbeat(), KEY, 7, 0x0102030405)
    assert frame[:10].hex() == "fd0901000001010000" + "00" and frame[2] == 1
    assert frame[-13:-6].hex() == "07" + "050403020100"
    assert frame[-6:] == hashlib.sha256(KEY + frame[:-6]).digest()[:6]
    assert FrameSplitter().receive(frame) == [frame] and is_signed(frame)
    assert decode(frame).type == 11  # a receiver without a key reads a signed frame


def test_frames_that_cannot_be_signed_stay_as_they_are() -> None:
    v1 = bytes(dialect.MAVLink_heartbeat_message(11, 3, 0, 0, 4, 3).pack(dialect.MAVLink(None, 1, 1), True))
    once = sign(heartbeat(), KEY, 0, NOW)
    assert sign(v1, KEY, 0, NOW) == v1 and not is_signed(v1)
    assert sign(once, KEY, 1, NOW + 1) == once


def test_timestamps_count_10_us_since_2015() -> None:
    assert timestamp_of(EPOCH_2015_NS) == 0 and timestamp_of(EPOCH_2015_NS + 10_000) == 1
    assert timestamp_of(0) == 0
    assert timestamp_of(1_767_225_600_000_000_000) == CLOCK_UNSET_BEFORE == (11 * 365 + 3) * 86400 * SECOND


def test_outgoing_timestamps_rise_even_when_the_clock_is_set_back() -> None:
    clock = SigningClock()
    first = clock.next(NOW_NS)
    assert first == NOW
    assert [clock.next(NOW_NS), clock.next(NOW_NS - 10**12), clock.next(0)] == [NOW + 1, NOW + 2, NOW + 3]
    clock.learn(NOW + 500)
    assert clock.next(NOW_NS) == NOW + 501
    assert clock.next(NOW_NS + 10**9) == NOW + SECOND


def test_keys() -> None:
    assert derive_key("00" * 31 + "ff\n") == bytes(31) + b"\xff"
    assert derive_key(" open sesame\n") == hashlib.sha256(b"open sesame").digest()
    assert derive_key("z" * 64) == hashlib.sha256(b"z" * 64).digest()
    with pytest.raises(ConfigError, match="empty"):
        derive_key(" \n")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ab" * 31 + "a", "63 hexadecimal digits"),  # one was lost in copying
        ("ab" * 33, "66 hexadecimal digits"),
        (":".join(["ab"] * 32), "64 hexadecimal digits; 64, without blanks or signs, are a key"),
        (" ".join(["ab"] * 32), "64 hexadecimal digits"),
        ("0x" + "ab" * 32, "64 hexadecimal digits"),
        ("ab" * 16 + "\n" + "cd" * 16, "more than one line"),
        ("open\nsesame", "more than one line"),
        ("open\x00sesame", "more than one line"),
    ],
)
def test_what_is_nearly_a_key_is_no_passphrase(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        derive_key(text)
    assert "abab" not in str(caught.value) and "sesame" not in str(caught.value)


# --- verdicts --------------------------------------------------------------------------------------------------


def test_each_attack_has_its_verdict() -> None:
    guard = verifier()
    good = sign(heartbeat(), KEY, 0, NOW)
    radio = bytes(dialect.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1).pack(dialect.MAVLink(None, 51, 68)))
    assert check(guard, heartbeat()) is Verdict.UNSIGNED
    assert check(guard, sign(heartbeat(), bytes(32), 0, NOW)) is Verdict.BAD_SIGNATURE
    assert check(guard, sign(heartbeat(), KEY, 0, NOW + 61 * SECOND)) is Verdict.FUTURE
    assert check(guard, sign(heartbeat(), KEY, 0, NOW + HOUR)) is Verdict.FUTURE
    assert check(guard, sign(heartbeat(), KEY, 0, NOW - 61 * SECOND)) is Verdict.TOO_OLD
    assert check(guard, radio) is Verdict.ACCEPTED
    assert check(guard, sign(radio, bytes(32), 0, NOW)) is Verdict.BAD_SIGNATURE
    assert check(verifier(accept_unsigned=()), radio) is Verdict.UNSIGNED
    assert check(guard, good) is Verdict.ACCEPTED
    assert check(guard, good) is Verdict.REPLAYED
    assert guard.counts == {
        Verdict.ACCEPTED: 2,
        Verdict.UNSIGNED: 1,
        Verdict.BAD_SIGNATURE: 2,
        Verdict.FUTURE: 2,
        Verdict.TOO_OLD: 1,
        Verdict.REPLAYED: 1,
    }


def test_every_flipped_bit_is_noticed() -> None:
    good = sign(heartbeat(), KEY, 0, NOW)
    for bit in range(8 * len(good)):
        guard = verifier()
        assert check(guard, flipped(good, bit)) in (Verdict.BAD_SIGNATURE, Verdict.UNSIGNED), bit
        assert guard.state().streams == {}


def test_pymavlink_verifies_ours_and_we_verify_pymavlinks() -> None:
    receiver = dialect.MAVLink(None)
    receiver.signing.secret_key, receiver.signing.timestamp = KEY, NOW
    clock = SigningClock()
    for seq in range(5):
        frame = sign(heartbeat(1, 191, seq), KEY, 2, clock.next(NOW_NS))
        assert receiver.parse_buffer(frame)[0].get_type() == "HEARTBEAT"
    assert check(verifier(), signed_by_pymavlink(NOW)) is Verdict.ACCEPTED


def test_the_streams_of_one_key_are_kept_apart() -> None:
    guard = verifier()
    for system_id, component_id, link_id in ((1, 1, 0), (1, 1, 1), (1, 2, 0), (255, 190, 0)):
        assert check(guard, sign(heartbeat(system_id, component_id), KEY, link_id, NOW)) is Verdict.ACCEPTED
    assert len(guard.state().streams) == 4
    for number in range(4, MAX_STREAMS):
        frame = sign(heartbeat(2 + number // 250, 1 + number % 250), KEY, 9, NOW)
        assert check(guard, frame) is Verdict.ACCEPTED
    assert check(guard, sign(heartbeat(250, 250), KEY, 9, NOW)) is Verdict.TOO_MANY_STREAMS
    assert check(guard, sign(heartbeat(), KEY, 0, NOW + 1)) is Verdict.ACCEPTED


def test_what_was_heard_before_a_restart_is_not_heard_again() -> None:
    first = verifier()
    frames = [sign(heartbeat(), KEY, 0, NOW + number) for number in range(3)]
    assert [check(first, frame) for frame in frames] == [Verdict.ACCEPTED] * 3
    second = verifier(first.state())
    assert [check(second, frame) for frame in frames] == [Verdict.REPLAYED] * 3
    assert check(second, sign(heartbeat(), KEY, 0, NOW + 3)) is Verdict.ACCEPTED


def test_our_timestamps_go_on_after_a_restart_with_the_clock_set_back() -> None:
    clock = SigningClock()
    Verifier(KEY, clock, state=SigningState(last=NOW, streams={}))
    assert clock.next(0) == NOW + 1


def test_a_clock_that_was_never_set_locks_nobody_out() -> None:
    unset_ns = 1_000_000_000
    guard = verifier()
    assert guard.check(sign(heartbeat(), KEY, 0, NOW), NOW_NS, unset_ns) is Verdict.ACCEPTED
    assert guard.check(sign(heartbeat(), KEY, 0, NOW), NOW_NS, unset_ns) is Verdict.REPLAYED
    assert guard.check(sign(heartbeat(), KEY, 0, NOW + 1), NOW_NS, unset_ns) is Verdict.ACCEPTED


def test_a_clock_that_is_set_back_does_not_lock_out_streams_that_go_on() -> None:
    guard = verifier()
    hour_ns = 3600 * 10**9
    assert check(guard, sign(heartbeat(), KEY, 0, NOW)) is Verdict.ACCEPTED
    later, day_before_ns = NOW + HOUR, NOW_NS - 24 * hour_ns
    frame = sign(heartbeat(), KEY, 0, later)
    assert guard.check(frame, NOW_NS + hour_ns, day_before_ns) is Verdict.ACCEPTED
    leap = sign(heartbeat(), KEY, 0, later + HOUR)
    assert guard.check(leap, NOW_NS + hour_ns, day_before_ns) is Verdict.FUTURE


def test_without_a_limit_the_future_is_believed() -> None:
    guard = verifier(max_ahead_s=None)
    assert check(guard, sign(heartbeat(), KEY, 0, NOW + HOUR)) is Verdict.ACCEPTED


# --- the rightful peer is never locked out -------------------------------------------------------------------------

ATTACKS = st.one_of(
    st.just(("unsigned",)),
    st.tuples(st.just("forged"), st.integers(0, (1 << 48) - 1), st.integers(0, 255)),
    st.tuples(st.just("replayed"), st.integers(0, 10_000)),
    st.tuples(st.just("flipped"), st.integers(0, 10_000), st.integers(0, 10_000)),
    st.tuples(st.just("restamped"), st.integers(0, 10_000), st.integers(0, (1 << 48) - 1)),
    # The peer's own clock for a moment an hour or more ahead: signed with the right key.
    st.tuples(st.just("ahead"), st.integers(61 * SECOND, 100 * HOUR)),
)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.one_of(st.tuples(st.just("peer"), st.integers(1, 10 * SECOND)), ATTACKS), max_size=60),
    st.sampled_from([None, 5, 20]),
)
def test_the_rightful_peer_is_never_locked_out(steps: list[tuple], restart_every: int | None) -> None:  # type: ignore[type-arg]
    """However attacks are mixed in, every frame of the peer passes at once and no attack ever does."""
    guard = verifier()
    now = NOW
    sent: list[bytes] = [sign(heartbeat(), KEY, 0, now)]
    assert check(guard, sent[0]) is Verdict.ACCEPTED
    for number, (kind, *values) in enumerate(steps):
        at_ns = EPOCH_2015_NS + 10_000 * now
        if kind == "peer":
            now += values[0]
            at_ns = EPOCH_2015_NS + 10_000 * now
            sent.append(sign(heartbeat(seq=number % 256), KEY, 0, now))
            assert check(guard, sent[-1], at_ns) is Verdict.ACCEPTED
            continue
        before = guard.state()
        if kind == "unsigned":
            frame = heartbeat()
        elif kind == "forged":
            frame = sign(heartbeat(), b"another key".ljust(32), values[1], values[0])
        elif kind == "replayed":
            frame = sent[values[0] % len(sent)]
        elif kind == "flipped":
            victim = sent[values[0] % len(sent)]
            frame = flipped(victim, values[1] % (8 * len(victim)))
        elif kind == "restamped":
            victim = sent[values[0] % len(sent)]
            stamp = values[1].to_bytes(6, "little")
            frame = victim[:-12] + stamp + victim[-6:]
        else:
            frame = sign(heartbeat(), KEY, 0, now + values[0])
        assert check(guard, frame, at_ns) is not Verdict.ACCEPTED, kind
        assert guard.state() == before
        if restart_every is not None and number % restart_every == 0:
            guard = Verifier(KEY, SigningClock(), state=guard.state(), start_ns=at_ns)


# --- what leaves on a link, and the limits ---------------------------------------------------------------------------


def test_frames_of_one_clock_are_signed_by_their_links_with_rising_times() -> None:
    clock = SigningClock()
    first, second = Signer(KEY, 3, clock), Signer(bytes(32), 4, clock)
    assert first.sign(heartbeat(), NOW_NS) == sign(heartbeat(), KEY, 3, NOW)
    assert second.sign(heartbeat(), NOW_NS) == sign(heartbeat(), bytes(32), 4, NOW + 1)


def test_a_frame_for_later_is_dated_ahead_and_does_not_move_the_clock() -> None:
    clock = SigningClock()
    signer = Signer(KEY, 3, clock)
    assert signer.sign_ahead(heartbeat(), NOW_NS, 500) == sign(heartbeat(), KEY, 3, NOW + 500)
    assert signer.sign(heartbeat(), NOW_NS) == sign(heartbeat(), KEY, 3, NOW)
    clock.learn(NOW + HOUR)  # of what left until now, that counts
    assert signer.sign_ahead(heartbeat(), NOW_NS, 7) == sign(heartbeat(), KEY, 3, NOW + HOUR + 7)


def test_the_flags_of_a_frame_that_is_signed_are_its_own() -> None:
    frame = heartbeat()
    flagged = frame[:2] + b"\x00\x5a" + frame[4:]  # compat flags are no incompat flags
    assert sign(flagged, KEY, 0, NOW)[2:4] == b"\x01\x5a"


def test_a_clock_that_has_seen_nothing_starts_at_the_first_tick() -> None:
    assert SigningClock().next(0) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "^is empty; 64 hexadecimal digits or a passphrase is expected$"),
        ("a\nb", "^is more than one line of text; 64 hexadecimal digits or a passphrase is expected$"),
        ("a" * 48, "^has 48 hexadecimal digits"),
    ],
)
def test_what_is_no_key_is_told_in_words(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        derive_key(text)


def test_fewer_digits_and_other_letters_are_a_passphrase() -> None:
    for text in ("a" * 47, "X".join(["ab"] * 24)):
        assert derive_key(text) == hashlib.sha256(text.encode()).digest()


@pytest.mark.parametrize(
    ("timestamp", "verdict"),
    [
        (NOW - 60 * SECOND - 1, Verdict.TOO_OLD),
        (NOW - 60 * SECOND, Verdict.ACCEPTED),
        (NOW + 60 * SECOND, Verdict.ACCEPTED),
        (NOW + 60 * SECOND + 1, Verdict.FUTURE),
    ],
)
def test_a_new_stream_may_be_off_by_just_a_minute(timestamp: int, verdict: Verdict) -> None:
    assert check(verifier(), sign(heartbeat(), KEY, 0, timestamp)) is verdict


def test_without_a_clock_time_goes_on_from_what_was_known_at_the_start() -> None:
    for timestamp, verdict in ((NOW + HOUR - 60 * SECOND - 1, Verdict.TOO_OLD), (NOW + HOUR, Verdict.ACCEPTED)):
        guard = verifier(SigningState(last=NOW, streams={}))
        frame = sign(heartbeat(), KEY, 0, timestamp)
        assert guard.check(frame, NOW_NS + 3600 * 10**9, 0) is verdict
    guard = verifier(SigningState(last=NOW, streams={}))
    latest_ns = NOW_NS + 3600 * 10**9 + 9_999  # the last moment of a tick of 10 us
    assert guard.check(sign(heartbeat(), KEY, 0, NOW + HOUR - 60 * SECOND), latest_ns, 0) is Verdict.ACCEPTED
    guard = Verifier(KEY, SigningClock(), state=SigningState(last=NOW, streams={}))
    assert guard.check(sign(heartbeat(), KEY, 0, NOW - 60 * SECOND - 1), 0, 0) is Verdict.TOO_OLD


def test_a_clock_counts_as_set_from_just_2026_on() -> None:
    set_ns = EPOCH_2015_NS + 10_000 * CLOCK_UNSET_BEFORE
    far = sign(heartbeat(), KEY, 0, CLOCK_UNSET_BEFORE + HOUR)
    assert Verifier(KEY, SigningClock()).check(far, 0, set_ns) is Verdict.FUTURE
    assert Verifier(KEY, SigningClock()).check(far, 0, set_ns - 10_000) is Verdict.ACCEPTED


def test_a_stream_that_goes_on_may_be_ahead_of_itself_by_just_a_minute() -> None:
    day_before_ns = NOW_NS - 24 * 3600 * 10**9
    for more, verdict in ((0, Verdict.ACCEPTED), (1, Verdict.FUTURE)):
        guard = verifier()
        assert check(guard, sign(heartbeat(), KEY, 0, NOW)) is Verdict.ACCEPTED
        frame = sign(heartbeat(), KEY, 0, NOW + 10 * SECOND + 60 * SECOND + more)
        assert guard.check(frame, NOW_NS + 10 * 10**9, day_before_ns) is verdict
