"""Which movements of sticks are the pilot's: on channels beside the motors', and by a ground station's own messages."""

from __future__ import annotations

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.pilot_watch import PilotWatch
from asvhil.supervisor.reasons import Explanation, Reason, explain
from asvhil.supervisor.situation import StationSticks
from tests.support.supervisor_bench import status

THRESHOLD_US = 60
T_NS = 1_000_000_000_000
AT_REST = (1500, 1520, 1500, 1480, 1800, 1100, 1300, 0)


def moved(channel: int, by_us: int, rest: tuple[int, ...] = AT_REST) -> tuple[int, ...]:
    """The sticks with one of them moved, from the centre where it has not been heard yet."""
    return tuple((us or 1500) + by_us if number == channel else us for number, us in enumerate(rest, 1))


def watch(*, overrides_sticks: bool = True, rest: tuple[int, ...] = AT_REST, **config: object) -> PilotWatch:
    found = PilotWatch(SupervisorConfig.model_validate(config), overrides_sticks=overrides_sticks)
    found.begin(T_NS, status(rc_us=rest))
    return found


def from_station(channel: int, us: int, *more: tuple[int, int]) -> StationSticks:
    return StationSticks(t_ns=T_NS, sender=(255, 190), channels=((channel, us), *more))


def station_moved(channel: int) -> Explanation:
    return explain(Reason.STATION_STICK, channel=channel, station="255/190")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(
    ("overrides_sticks", "watched"), [(True, {2, 6, 8}), (False, {1, 2, 3, 4, 6, 8})], ids=["overrides", "none"]
)
def test_a_stick_counts_once_it_is_farther_than_the_threshold_from_where_it_was(
    sign: int, overrides_sticks: bool, watched: set[int]
) -> None:
    """Where the motors are not driven by their sticks, every stick is the pilot's. Channel 8 has not been heard yet."""
    pilot = watch(overrides_sticks=overrides_sticks, stick_channels=(2, 6, 8))
    assert pilot.act(status(rc_us=AT_REST)) is None
    for channel in range(1, 9):
        assert pilot.act(status(rc_us=moved(channel, sign * THRESHOLD_US))) is None
        act = pilot.act(status(rc_us=moved(channel, sign * (THRESHOLD_US + 1))))
        assert act == (explain(Reason.STICK_MOVED, channel=channel) if channel in watched else None)


def test_a_receiver_of_few_channels_moves_none_of_the_others() -> None:
    pilot = watch(rest=AT_REST[:3], stick_channels=(2, 4))
    assert pilot.act(status(rc_us=AT_REST[:3])) is None and pilot.act(status(rc_us=())) is None
    assert pilot.act(status(rc_us=moved(4, 100))) == explain(Reason.STICK_MOVED, channel=4)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_ground_stations_stick_counts_once_it_is_off_its_rest(sign: int) -> None:
    """The motors' sticks rest at their centres, the others where they stood when the hold began."""
    told = status(rc_us=AT_REST, motor_channels=(5, 3), centres_us=(1480, 1530))
    pilot = watch(stick_channels=(2,))
    for channel, rest_us in ((5, 1480), (3, 1530), (2, 1520)):
        assert pilot.act(told, [from_station(channel, rest_us + sign * THRESHOLD_US)]) is None
        off = from_station(channel, rest_us + sign * (THRESHOLD_US + 1))
        assert pilot.act(told, [off]) == pilot.station_stick(told, [off]) == station_moved(channel)
    assert pilot.act(told, [from_station(7, 2000)]) is None  # a channel that is not watched


def test_one_stick_off_its_rest_among_many_that_are_not_is_found() -> None:
    pilot = watch(stick_channels=(2,))
    resting = from_station(1, 1500, (2, 1520), (3, 1500), (8, 1900))
    assert pilot.act(status(), [resting]) is None
    assert pilot.act(status(), [resting, from_station(1, 1500, (8, 1900), (3, 1400))]) == station_moved(3)


def test_before_the_motors_are_taken_a_ground_stations_motor_sticks_count_and_no_others() -> None:
    pilot = PilotWatch(SupervisorConfig(), overrides_sticks=True)
    assert pilot.station_stick(status(), [from_station(2, 1900, (1, 1500))]) is None
    assert pilot.station_stick(status(), [from_station(1, 1900)]) == station_moved(1)


def test_a_watched_channel_that_our_commands_hide_is_named() -> None:
    told = status(motor_channels=(4, 3))
    assert watch(stick_channels=(2, 4)).hidden(told) == 4
    assert watch(stick_channels=(2, 5)).hidden(told) is None
    assert watch(stick_channels=(2, 4), overrides_sticks=False).hidden(told) is None
