"""Two boats with one id on the autopilot's link, and one boat that is heard by two ways."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import pytest

from asvhil.config import Config, load_config
from asvhil.geo import wrap_rad
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Reason
from asvhil.types import Frame, Phase
from tests.support.shared_loop import HOLD_MODE, OTHER_BOAT, S, SharedLoop


def another_boat(config: Config, *overrides: str, boots_after_s: float = 0.0) -> Plant:
    """A boat of the same system id, at the same port."""
    settings = ("supervisor.engage=command", "plant.seed=77", *overrides)
    return Plant(load_config("sitl", settings), SharedLoop().t_ns + round(boots_after_s * S))


@pytest.mark.parametrize(
    ("case", "overrides", "boots_after_s"),
    [
        ("booted later", ("plant.start_n_m=30",), 20.0),
        pytest.param("booted 3 s later, near by", (), 3.0, marks=pytest.mark.thorough),
        # Within 15 m of each other two that booted in one instant are one, by all that they tell.
        ("booted in the same instant", ("plant.start_n_m=6",), 0.0),
        pytest.param(
            "booted in the same instant, far away", ("plant.start_n_m=60",), 0.013, marks=pytest.mark.thorough
        ),
    ],
)
def test_a_second_boat_with_the_same_id_ends_the_hold_in_words(
    case: str, overrides: tuple[str, ...], boots_after_s: float
) -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(2.0)
    second = another_boat(loop.config, *overrides, boots_after_s=boots_after_s)
    while loop.t_ns < second.t_ns + 15 * S:
        loop.held(0.05)
    second.advance(loop.t_ns)
    second.frontseat.set_receiver(True)
    assert second.frontseat.arm(True)
    loop.others.append(second)
    while (ended := loop.tick()[1]).phase is Phase.HOLD:
        assert loop.ticks < 1400
    assert ended.phase is Phase.STANDBY and ended.health.code == Reason.TWO_VEHICLES
    assert ended.health.reason == "two vehicles have system id 1"
    loop.neutral_at_the_end()
    for _ in range(100):
        _, outputs = loop.tick()
        assert outputs.pwm_us is None
    assert loop.ask_to_hold().phase is Phase.STANDBY and loop.tick() and "two vehicles have system id 1" in loop.texts
    # Once the other is gone, 10 s later, ours is ours again.
    loop.others.clear()
    for _ in range(260):
        _, outputs = loop.tick()
    assert [n for n in outputs.health.notes if n.subject == "autopilot"] == []
    assert loop.ask_to_hold().phase is Phase.HOLD


def test_two_boats_from_the_start_are_never_armed_into_a_hold() -> None:
    loop = SharedLoop()
    loop.others.append(another_boat(loop.config, "plant.start_n_m=20", boots_after_s=0.37))
    assert loop.ready().ask_to_hold().phase is Phase.STANDBY
    loop.tick()
    assert "two vehicles have system id 1" in loop.texts


@pytest.mark.parametrize("says", ["disarmed", "another mode"])
def test_a_second_boat_ends_the_hold_by_what_it_says_and_is_named_once_it_is_known(says: str) -> None:
    """A heartbeat that says so may be the pilot's word, and is not waited on."""
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    second = another_boat(loop.config)
    second.advance(loop.t_ns)
    if says == "another mode":
        second.frontseat.set_receiver(True)
        assert second.frontseat.arm(True)
        second.frontseat.set_mode(HOLD_MODE)
    loop.others.append(second)
    codes = [loop.tick()[1].health.code for _ in range(120)]
    assert codes[-1] == Reason.TWO_VEHICLES
    assert set(codes) <= {Reason.HOLDING, Reason.DISARMED, Reason.MODE_CHANGED, Reason.TWO_VEHICLES}
    assert loop.ask_to_hold().phase is Phase.STANDBY and loop.tick() and "two vehicles have system id 1" in loop.texts


def test_a_hold_that_has_ended_long_before_keeps_its_reason() -> None:
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(1.0)
    assert loop.plant.frontseat.arm(False)
    for _ in range(220):
        _, outputs = loop.tick()
    assert outputs.health.code == Reason.DISARMED
    loop.others.append(another_boat(loop.config, boots_after_s=3.0))
    loop.others[0].advance(loop.t_ns)
    for _ in range(120):
        _, outputs = loop.tick()
    assert outputs.health.code == Reason.DISARMED
    assert "autopilot" in {note.subject for note in outputs.health.notes}


def test_two_boats_on_one_line_without_peers() -> None:
    loop = SharedLoop()
    loop.peers = ("", "")
    loop.ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    second = another_boat(loop.config, boots_after_s=-4.0)
    second.advance(loop.t_ns)
    assert second.frontseat.arm(True)
    loop.others.append(second)
    while loop.tick()[1].phase is Phase.HOLD:
        assert loop.ticks < 800
    _, outputs = loop.tick()
    assert outputs.health.code == Reason.TWO_VEHICLES


class SecondWay:
    """The same boat once more: the same frames by another peer, later, some of them lost or the link stalled."""

    def __init__(self, delay_s: float, lost: int = 0, stalls: tuple[tuple[float, float], ...] = ()) -> None:
        self.delay_ns = round(delay_s * S)
        self._lost, self._stalls = lost, stalls
        self._late: list[Frame] = []
        self._count = 0
        self._start_ns: int | None = None

    def keep(self, frame: Frame) -> Iterable[Frame]:
        self._start_ns = frame.t_ns if self._start_ns is None else self._start_ns
        self._count += 1
        if not self._lost or self._count % self._lost:
            self._late.append(frame)
        yield frame

    def __call__(self, tick: int, t_ns: int) -> Iterable[Frame]:
        since_s = 0.0 if self._start_ns is None else (t_ns - self._start_ns) / S
        if any(begin <= since_s < end for begin, end in self._stalls):
            return
        while self._late and self._late[0].t_ns + self.delay_ns <= t_ns:
            yield dataclasses.replace(self._late.pop(0), t_ns=t_ns, peer=OTHER_BOAT)


@pytest.mark.parametrize(
    "way",
    [
        pytest.param(SecondWay(0.0), marks=pytest.mark.thorough),
        pytest.param(SecondWay(0.3), marks=pytest.mark.thorough),
        SecondWay(1.4, lost=5),
        pytest.param(SecondWay(3.0), marks=pytest.mark.thorough),
        SecondWay(0.1, stalls=((12.0, 15.0), (18.0, 24.0))),
    ],
    ids=["at once", "0.3 s", "1.4 s and lossy", "3 s", "stalled"],
)
def test_one_boat_by_two_ways_is_one_boat(way: SecondWay) -> None:
    loop = SharedLoop()
    loop.way, loop.talk = way.keep, way
    loop.ready()
    for _ in range(20):
        _, outputs = loop.tick()
    assert not [n for n in outputs.health.notes if n.subject == "autopilot"]
    assert dict(outputs.health.counters)["autopilot.reboots"] == 0
    assert loop.ask_to_hold().phase is Phase.HOLD
    outputs = loop.held(15.0)
    offs_deg = []
    for _ in range(100):  # what is late is not steered by
        _, outputs = loop.tick()
        assert outputs.phase is Phase.HOLD, outputs.health.reason
        assert outputs.estimate is not None
        offs_deg.append(abs(math.degrees(wrap_rad(outputs.estimate.psi_rad - loop.plant.truth.psi_rad))))
    assert max(offs_deg) < 3.0
    assert not [n for n in outputs.health.notes if n.subject == "autopilot"]
    assert dict(outputs.health.counters)["autopilot.reboots"] == 0


@pytest.mark.parametrize("delay_s", [0.9, pytest.param(3.0, marks=pytest.mark.thorough)])
def test_a_late_way_that_comes_in_while_a_station_is_held_changes_nothing(delay_s: float) -> None:
    """Its headings and outputs of a second ago ended holds as "outputs do not follow the commands"."""
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    loop.held(5.0)
    way = SecondWay(delay_s)
    loop.way, loop.talk = way.keep, way
    outputs = loop.held(10.0)
    assert not [n for n in outputs.health.notes if not n.ok]


def test_one_boat_by_two_ports_of_its_autopilot_is_one_boat() -> None:
    """Each port has streams of its own: other times, other numbers, the same clock."""
    loop = SharedLoop().ready()
    assert loop.ask_to_hold().phase is Phase.HOLD
    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)

    def other_port(frame: Frame) -> Iterable[Frame]:
        yield frame
        message = decode(frame.data)
        if message is None or message.get_type() not in ("ATTITUDE", "GLOBAL_POSITION_INT", "HEARTBEAT"):
            return
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms += 7
        data = bytes(message.pack(mav))
        mav.seq = (mav.seq + 1) % 256
        yield dataclasses.replace(frame, data=data, peer=OTHER_BOAT)

    loop.way = other_port
    outputs = loop.held(15.0)
    assert [n for n in outputs.health.notes if n.subject == "autopilot"] == []
