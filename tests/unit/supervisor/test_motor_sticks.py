"""Whether the motors' own sticks show our commands, or somebody else has the boat."""

from __future__ import annotations

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.pilot_watch import PilotWatch
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.types import FrontseatStatus, Radio
from tests.support.supervisor_bench import status

S = 1_000_000_000
MS = S // 1000
T_NS = 1_000 * S  # when the motors are taken
TOLERANCE_US = 4
OURS = (1700, 1300)
Pair = tuple[int, int]


def stick_moved(channel: int) -> Explanation:
    return explain(Reason.STICK_MOVED, channel=channel)


def not_followed(channel: int) -> Explanation:
    return explain(Reason.OVERRIDE_NOT_FOLLOWED, channel=channel)


class Sticks:
    """A watch with an echo of 1 s, whose motors were taken at T_NS while their sticks stood as they are given."""

    def __init__(self, before: Pair = (1500, 1500), *, overrides_sticks: bool = True, **told: object) -> None:
        self.pilot = PilotWatch(SupervisorConfig(override_echo_s=1.0), overrides_sticks=overrides_sticks)
        self._told = told
        self.pilot.begin(T_NS, self.status(T_NS, before))

    def status(self, t_ns: int, us: Pair) -> FrontseatStatus:
        return status(rc_us=(us[0], 1500, us[1], 1500), rc_ns=t_ns, **self._told)

    def sends(self, after_ns: int, us: Pair = OURS, sticks_us: Pair | None = None) -> None:
        self.pilot.note_sent(MotorPulses(t_ns=T_NS + after_ns, us=us, sticks_us=sticks_us))

    def shows(self, after_ns: int, us: Pair) -> Explanation | None:
        """The judgement on a report of the motors' sticks, so long after they were taken."""
        t_ns = T_NS + after_ns
        return self.pilot.sticks_taken(t_ns + 20 * MS, self.status(t_ns, us))

    def hears(self, after_ns: int, *channels: Pair) -> None:
        """Sticks of a ground station, none of them off its rest."""
        heard = StationSticks(t_ns=T_NS + after_ns, sender=(255, 190), channels=channels)
        assert self.pilot.station_stick(status(), [heard]) is None


@pytest.mark.parametrize("motor", [0, 1])
def test_a_report_shows_our_command_within_the_rounding_on_its_way_and_no_farther(motor: int) -> None:
    for off_us in (-TOLERANCE_US - 1, -TOLERANCE_US, TOLERANCE_US, TOLERANCE_US + 1):
        sticks = Sticks()
        sticks.sends(0)
        port, starboard = OURS
        shown = (port + off_us, starboard) if motor == 0 else (port, starboard + off_us)
        expected = None if abs(off_us) <= TOLERANCE_US else not_followed((1, 3)[motor])
        assert sticks.shows(2 * S, shown) == expected


def test_the_command_may_be_shown_as_the_sticks_that_it_was_turned_into() -> None:
    sticks = Sticks()
    sticks.sends(0, (1600, 1500), sticks_us=(1810, 1190))
    assert sticks.shows(2 * S, (1810, 1190)) is None
    assert sticks.shows(2 * S, (1600, 1500)) == not_followed(1)


def test_commands_may_be_shown_for_the_time_of_an_echo_after_they_were_replaced() -> None:
    sticks = Sticks()
    for after_ns, us in ((0, (1600, 1400)), (2 * S, (1700, 1300)), (3 * S, (1800, 1200))):
        sticks.sends(after_ns, us)
    assert sticks.shows(3 * S, (1800, 1200)) is None, "in the very moment that it was sent"
    assert sticks.shows(3 * S - 1, (1800, 1200)) == not_followed(1), "before it was sent"
    assert sticks.shows(3 * S - 1, (1600, 1400)) is None, "it stood when the time of the echo began"
    assert sticks.shows(3 * S, (1600, 1400)) == not_followed(1)
    assert sticks.shows(4 * S - 1, (1700, 1300)) is None
    assert sticks.shows(4 * S, (1700, 1300)) == not_followed(1)


def test_a_hold_that_follows_another_knows_what_that_one_sent_last() -> None:
    """It was taken for a stick that had moved: the echo of the last hold's command, where thrust had just changed."""
    sticks = Sticks()
    for after_ns, us in (
        (8 * S, (1600, 1400)),
        (9 * S + 10 * MS, (1650, 1350)),
        (10 * S - 50 * MS, (1900, 1750)),
        (10 * S, (1900, 1900)),
    ):
        sticks.sends(after_ns, us)
    sticks.pilot.begin(T_NS + 10 * S + 10 * MS, sticks.status(T_NS + 10 * S, (1900, 1750)))
    assert sticks.shows(10 * S + 10 * MS, (1650, 1350)) is None, "as old as an echo may be"
    sticks.sends(10 * S + 50 * MS, (1200, 1880))
    assert sticks.shows(10 * S + 60 * MS, (1900, 1900)) is None
    assert sticks.shows(10 * S + 60 * MS, (1600, 1400)) == stick_moved(1), "sent longer ago than an echo may last"
    assert sticks.shows(12 * S, (1900, 1900)) == not_followed(1)


def test_the_one_command_of_a_long_stall_stands_however_old_it_is() -> None:
    sticks = Sticks()
    sticks.sends(0)
    sticks.sends(100 * S, (1500, 1500))
    assert sticks.shows(100 * S + 1, OURS) is None
    assert sticks.shows(200 * S, (1500, 1500)) is None


def test_a_report_that_stands_on_a_lost_link_stays_as_it_was_judged_when_it_came() -> None:
    """On a real ArduRover it became the pilot's 2 s after the last byte: what it had echoed was forgotten by then."""
    sticks = Sticks()
    last = sticks.status(T_NS + 5 * S, OURS)
    for after_ns in range(0, 10 * S, 50 * MS):
        sticks.sends(after_ns, OURS if after_ns < 5 * S else (1500, 1500))
        told = last if after_ns >= 5 * S else sticks.status(T_NS + after_ns, OURS)
        assert sticks.pilot.sticks_taken(T_NS + after_ns + 50 * MS, told) is None, after_ns / S
    assert sticks.shows(10 * S, OURS) == not_followed(1), "the link is back, and somebody else has the boat"


def test_a_report_that_waits_through_a_stall_is_judged_all_the_same() -> None:
    sticks = Sticks()
    sticks.sends(5 * S)
    told = sticks.status(T_NS + 5 * S + 20 * MS, (1500, 1500))
    assert sticks.pilot.sticks_taken(T_NS + 20 * S, told) == not_followed(1)


def test_where_nothing_was_sent_or_is_told_nothing_can_be_taken() -> None:
    sticks = Sticks()
    assert sticks.shows(5 * S, (1800, 1800)) is None, "nothing was sent"
    sticks.sends(0)
    assert sticks.shows(5 * S, (1800, 1800)) is not None
    for unknown in ((0, 1800), (1800, 0)):
        assert sticks.shows(5 * S, unknown) is None
    assert sticks.pilot.sticks_taken(T_NS + 5 * S, None) is None
    assert sticks.pilot.sticks_taken(T_NS + 5 * S, status(rc_us=())) is None
    assert sticks.shows(-1, (1800, 1800)) is None, "a report of before the hold"
    others = Sticks(overrides_sticks=False)
    others.sends(0)
    assert others.shows(5 * S, (1800, 1800)) is None, "the sticks are the pilot's own, and watched as such"


def test_a_report_without_a_time_is_of_now() -> None:
    sticks = Sticks()
    sticks.sends(0)
    told = status(rc_us=(1500, 1500, 1500, 1500), rc_ns=0)
    assert sticks.pilot.sticks_taken(T_NS + S - 1, told) is None
    assert sticks.pilot.sticks_taken(T_NS + S, told) == not_followed(1)


# --- at first, while our commands may still be on their way ---------------------------------------------------------


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("motor", [0, 1])
@pytest.mark.parametrize("before", [(1500, 1500), (0, 0)], ids=["known", "unknown"])
def test_at_first_only_a_stick_beyond_the_threshold_is_the_pilots(sign: int, motor: int, before: Pair) -> None:
    sticks = Sticks(before)
    port, starboard = (sign * 60, 0) if motor == 0 else (0, sign * 60)
    assert sticks.shows(0, (1500 + port, 1500 + starboard)) is None
    port, starboard = (sign * 61, 0) if motor == 0 else (0, sign * 61)
    thrown = (1500 + port, 1500 + starboard)
    assert sticks.shows(0, thrown) == stick_moved(1), "none of them shows anything of ours, as nothing was sent"
    sticks.sends(0, (1500, 1500))
    assert sticks.shows(S - 1, thrown) == stick_moved((1, 3)[motor])


def test_at_first_a_stick_that_stays_off_centre_or_returns_to_it_is_not_moved() -> None:
    sticks = Sticks((1650, 1500))
    sticks.sends(0)
    assert sticks.shows(S // 2, (1650, 1500)) is None, "as it was"
    assert sticks.shows(S // 2, (1500, 1500)) is None, "to its centre, where the override has not come yet"
    assert sticks.shows(S // 2, (1780, 1500)) == stick_moved(1)
    assert sticks.shows(S, (1650, 1500)) == not_followed(1), "by now our commands should be there"


def test_at_first_sticks_that_show_two_commands_at_once_were_moved() -> None:
    """Both motors are set by one message: a pair that was never sent is somebody's."""
    sticks = Sticks()
    sticks.sends(0, (1600, 1500))
    sticks.sends(100 * MS, (1500, 1600))
    assert sticks.shows(200 * MS, (1600, 1600)) == stick_moved(1)


# --- a ground station whose resting sticks come in turn with ours ---------------------------------------------------


@pytest.mark.parametrize("told", [{"radio": Radio.ABSENT}, {"keeps_override": True}], ids=["absent", "keeps"])
def test_resting_sticks_are_excused_for_10_s_after_ours_were_seen(told: dict[str, object]) -> None:
    sticks = Sticks(**told)
    sticks.sends(0)
    assert sticks.shows(3 * S, OURS) is None
    for rest in ((1500, 1500), (1560, 1500), (1500, 1440)):
        assert sticks.shows(13 * S, rest) is None
    assert sticks.shows(13 * S, (1561, 1500)) == not_followed(1), "off its rest"
    assert sticks.shows(13 * S + 1, (1500, 1500)) == not_followed(1), "for too long"
    assert sticks.shows(14 * S, OURS) is None
    assert sticks.shows(15 * S, (1500, 1500)) is None


def test_ours_are_seen_through_the_rounding_on_their_way() -> None:
    sticks = Sticks(radio=Radio.ABSENT)
    sticks.sends(0)
    assert sticks.shows(2 * S, (OURS[0] + TOLERANCE_US, OURS[1] - TOLERANCE_US)) is None
    assert sticks.shows(3 * S, (1500, 1500)) is None


def test_resting_sticks_are_not_excused_where_ours_were_never_seen_or_a_pilot_has_a_transmitter() -> None:
    sticks = Sticks(radio=Radio.ABSENT)
    sticks.sends(0)
    assert sticks.shows(2 * S, (1500, 1500)) == not_followed(1)
    for radio in (Radio.HEARD, Radio.LOST, Radio.UNKNOWN):
        sticks = Sticks(radio=radio)
        sticks.sends(0)
        assert sticks.shows(2 * S, OURS) is None
        assert sticks.shows(2 * S + 1, (1500, 1500)) == not_followed(1)


def test_what_was_seen_of_ours_in_an_earlier_hold_excuses_nothing() -> None:
    sticks = Sticks(radio=Radio.ABSENT)
    sticks.sends(0)
    assert sticks.shows(2 * S, OURS) is None
    sticks.pilot.begin(T_NS + 3 * S, sticks.status(T_NS + 3 * S, (1500, 1500)))
    sticks.sends(3 * S)
    assert sticks.shows(4 * S, (1500, 1500)) == not_followed(1)
    sticks.pilot.begin(T_NS + 5 * S, sticks.status(T_NS + 5 * S, (1500, 1500)))
    assert sticks.shows(6 * S, (1500, 1500)) is None, "nor are commands of before expected to show"


def test_sticks_that_a_ground_station_said_itself_are_its_own_for_half_a_second() -> None:
    sticks = Sticks(radio=Radio.HEARD)
    sticks.sends(0)
    sticks.hears(2 * S, (1, 1540), (3, 1520))
    half = 500 * MS
    for shown in ((1540, 1520), (1540 + TOLERANCE_US, 1520 - TOLERANCE_US)):
        assert sticks.shows(2 * S + half - 1, shown) is None
        assert sticks.shows(2 * S + half, shown) == not_followed(1), "its messages have stopped"
    assert sticks.shows(2 * S, (1540 + TOLERANCE_US + 1, 1520)) == not_followed(1), "others than it said"
    assert sticks.shows(2 * S, (1540, 1520 - TOLERANCE_US - 1)) is not None


@pytest.mark.parametrize("motor", [0, 1])
def test_a_ground_station_that_moves_one_motors_stick_leaves_the_other_to_us(motor: int) -> None:
    def pair(theirs: int, ours_off_us: int) -> Pair:
        return (theirs, OURS[1] + ours_off_us) if motor == 0 else (OURS[0] + ours_off_us, theirs)

    sticks = Sticks()
    sticks.sends(0)
    sticks.hears(2 * S, ((1, 3)[motor], 1540))
    for off_us in (-TOLERANCE_US, 0, TOLERANCE_US):
        assert sticks.shows(2 * S, pair(1540, off_us)) is None
    for off_us in (-TOLERANCE_US - 1, TOLERANCE_US + 1):
        assert sticks.shows(2 * S, pair(1540, off_us)) is not None
