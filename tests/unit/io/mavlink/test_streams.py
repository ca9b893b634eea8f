"""Requests for message rates: answered, lost, refused, or in vain; what comes counts."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.streams import StreamRequester

MS, S = 1_000_000, 1_000_000_000
RATES = {"ATTITUDE": 20.0, "GPS_RAW_INT": 5.0, "RC_CHANNELS": 10.0}
NUMBERS = {name: getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in RATES}
PX4 = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
SENT = {
    "ATTITUDE": dialect.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0),
    "GPS_RAW_INT": dialect.MAVLink_gps_raw_int_message(0, 3, 0, 0, 0, 0, 0, 0, 0, 9),
    "RC_CHANNELS": dialect.MAVLink_rc_channels_message(0, 8, *[1500] * 18, 0),
}


class Exchange:
    """A requester and an autopilot that streams at 1 Hz what it was not asked for; `hears` loses requests."""

    def __init__(self, hears: Callable[[str, int], bool]) -> None:
        self.streams = StreamRequester(RATES, 1)
        self._hears = hears
        self.answered: Callable[[str], bool] = lambda name: True
        self.hz = dict.fromkeys(RATES, 1.0)
        self.due_ns = dict.fromkeys(RATES, 0)
        self.t_ns = 0
        self.asked: list[tuple[float, str]] = []

    def run(self, seconds: float) -> None:
        end_ns = self.t_ns + round(seconds * S)
        while self.t_ns < end_ns:
            self.t_ns += 50 * MS
            for name, due_ns in self.due_ns.items():
                if self.t_ns >= due_ns:
                    self.due_ns[name] = self.t_ns + round(S / self.hz[name])
                    self.streams.receive(SENT[name].get_msgId(), bytes(SENT[name].pack(PX4)))
            for message in self.streams.data_to_send(self.t_ns):
                name = next(name for name, number in NUMBERS.items() if number == message.param1)
                self.asked.append((self.t_ns / S, name))
                if self._hears(name, len([1 for _, other in self.asked if other == name])):
                    self.hz[name] = 1e6 / message.param2
                    if self.answered(name):
                        ack = dialect.MAVLink_command_ack_message(511, 0, 0, 0, 1, 191)
                        self.streams.receive(ack.get_msgId(), bytes(ack.pack(PX4)))

    def times(self, name: str) -> int:
        return len([1 for _, asked in self.asked if asked == name])


def test_what_is_answered_is_asked_for_once() -> None:
    exchange = Exchange(lambda name, count: True)
    exchange.run(30.0)
    assert [name for _, name in exchange.asked] == list(RATES)
    assert exchange.streams.settled and exchange.streams.slow == ()
    assert exchange.streams.still_asked_for(exchange.t_ns, RATES) is None


def test_a_request_that_was_lost_four_times_is_repeated_after_the_others_and_not_given_up() -> None:
    exchange = Exchange(lambda name, count: name != "ATTITUDE" or count > 6)
    exchange.run(2.3)
    assert exchange.times("ATTITUDE") == 5 and {"GPS_RAW_INT", "RC_CHANNELS"} < {name for _, name in exchange.asked}
    exchange.run(1.0)
    assert exchange.times("ATTITUDE") == 7 and exchange.streams.settled
    exchange.run(20.0)
    assert exchange.times("ATTITUDE") == 7 and exchange.streams.slow == ()


def test_what_comes_much_too_slowly_is_known_within_seconds_and_asked_for_again() -> None:
    """All answered, and yet not done: as by a bridge, or another program that has asked for another rate since."""
    exchange = Exchange(lambda name, count: True)
    exchange.run(1.0)
    exchange.hz["ATTITUDE"] = 1.0
    exchange.run(2.5)
    assert exchange.times("ATTITUDE") == 2
    exchange.run(10.0)
    assert exchange.streams.slow == ()


def test_a_stream_that_stays_slow_is_told_and_asked_for_no_more_than_every_15_s() -> None:
    exchange = Exchange(lambda name, count: name != "ATTITUDE")
    exchange.run(12.0)
    assert exchange.streams.slow == (("ATTITUDE", 20.0),)
    assert exchange.streams.still_asked_for(exchange.t_ns, RATES) == ("ATTITUDE", 20.0)
    assert exchange.streams.still_asked_for(exchange.t_ns, {"GPS_RAW_INT"}) is None
    exchange.run(18.0)
    assert exchange.streams.still_asked_for(exchange.t_ns, RATES) is None, "a hold is then granted knowingly"
    assert exchange.streams.slow == (("ATTITUDE", 20.0),)
    asked = exchange.times("ATTITUDE")
    exchange.run(120.0)
    assert exchange.times("ATTITUDE") - asked <= 8 * 16
    exchange.streams.restart()
    assert exchange.streams.slow == ()


def test_a_message_that_never_comes_is_no_slow_one() -> None:
    """RC_CHANNELS of a PX4 without a transmitter: it is known elsewhere, and must not refuse a hold."""
    exchange = Exchange(lambda name, count: True)
    exchange.due_ns["RC_CHANNELS"] = 10**18
    exchange.run(40.0)
    assert exchange.streams.slow == () and exchange.times("RC_CHANNELS") in (2, 3, 4)


@pytest.mark.parametrize("begins_s", [12.0, 13.1, 14.5, 16.9, 21.3])
def test_a_message_that_begins_late_is_no_slow_one(begins_s: float) -> None:
    """The outputs of a PX4 1.16, once it is armed: a hold that is asked for at once must not be refused."""
    exchange = Exchange(lambda name, count: True)
    exchange.due_ns["RC_CHANNELS"] = round(begins_s * S)
    exchange.run(begins_s)
    for _ in range(400):
        exchange.run(0.05)
        assert exchange.streams.slow == ()


def test_what_comes_without_an_answer_is_right() -> None:
    exchange = Exchange(lambda name, count: True)
    exchange.answered = lambda name: name != "GPS_RAW_INT"
    exchange.run(60.0)
    assert exchange.times("GPS_RAW_INT") == 4


@pytest.mark.parametrize("hz", [1.0, 2.0])
def test_of_a_seldom_message_chance_is_no_reason_to_call_it_slow(hz: float) -> None:
    """One of three gets lost: of 5 or 10 in a watch there are now and then very few."""
    chance = random.Random(1)
    streams = StreamRequester({"SYSTEM_TIME": hz}, 1)
    beat = bytes(dialect.MAVLink_system_time_message(1, 1).pack(PX4))
    slow = 0
    for tick in range(20 * 3600):
        streams.data_to_send(tick * 50 * MS)
        if tick % round(20 / hz) == 0 and chance.random() < 0.66:
            streams.receive(dialect.MAVLINK_MSG_ID_SYSTEM_TIME, beat)
        slow += streams.slow != ()
    assert slow < 0.01 * 20 * 3600


def test_what_comes_before_the_first_request_makes_no_stream_slow() -> None:
    exchange = Exchange(lambda name, count: True)
    exchange.t_ns = 1_795_000_000 * S  # since the epoch, as on a boat
    for _ in range(160):
        exchange.run(0.05)
        assert exchange.streams.slow == ()
