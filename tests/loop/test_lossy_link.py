"""A link that loses frames both ways, with every parameter right. `python -m bench.lossy_link` does it at length."""

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Frame, Outputs, Phase, changed
from tests.support.loop import PLAIN_CONTROLLER, GroundStationLoop
from tests.support.lossy_link import check_start, hold_start


@pytest.mark.parametrize(
    ("loss", "seed"),
    [
        *((loss, 1) for loss in (0.02, 0.05, 0.1, 0.2, 0.4)),
        *(
            pytest.param(loss, seed, marks=pytest.mark.thorough)
            for loss in (0.02, 0.05, 0.1, 0.2, 0.4)
            for seed in (2, 3)
        ),
        (0.4, 7),  # in which five fixes get lost one after the other, just before the end
    ],
)
def test_a_check_finds_nothing_wrong_and_has_nothing_to_write(loss: float, seed: int) -> None:
    start = check_start(loss, seed)
    assert start.false == () and start.fixable == ()
    assert start.seconds < 40.0


@pytest.mark.parametrize(("loss", "seed"), [(0.02, 1), (0.1, 2), (0.2, 3), (0.4, 4), (0.4, 5)])
def test_a_hold_begins_and_goes_on(loss: float, seed: int) -> None:
    start = hold_start(loss, seed, hold_s=15.0)
    assert not start.for_a_parameter
    assert start.granted_s is not None and start.granted_s < (1.0 if loss < 0.4 else 20.0)
    if loss < 0.4:
        assert start.held_s >= 14.9 and start.ended == "" and start.neutral_s < 2.0, start
    else:  # the request for a message may be lost four times, and 1 Hz of it is too seldom then: told as what it is
        assert start.ended in ("", "estimate-stale"), start


SLOW = "too slow: ATTITUDE, less than a third of 20 Hz"


class WithoutRequests(GroundStationLoop):
    """Requests for ATTITUDE, which then comes at the autopilot's own 1 Hz, get lost until a time (s)."""

    def __init__(self, until_s: float) -> None:
        super().__init__(load_config("sitl", (PLAIN_CONTROLLER, "supervisor.engage=command")))
        self._until_ns = self.t_ns + round(until_s * 1e9)

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        lost = self.t_ns < self._until_ns
        super().deliver(tuple(frame for frame in frames if not (lost and _asks_for_attitude(frame))))


def _asks_for_attitude(frame: Frame) -> bool:
    m = decode(frame.data) if frame.port == "autopilot" else None
    if m is None or m.get_type() != "COMMAND_LONG":
        return False
    return m.command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and m.param1 == dialect.MAVLINK_MSG_ID_ATTITUDE


def _armed(loop: GroundStationLoop) -> Outputs:
    loop.wait(7.0)
    assert loop.frontseat.arm(True)
    return loop.wait(1.0)


def _notes(outputs: Outputs) -> dict[str, str]:
    return {note.subject: note.text for note in outputs.health.notes}


def test_a_hold_waits_for_a_stream_whose_request_was_lost() -> None:
    loop = WithoutRequests(until_s=9.0)
    assert _notes(_armed(loop))["streams"] == SLOW
    assert loop.ask_to_hold().phase is Phase.STANDBY
    loop.wait(0.2)
    assert any(SLOW in text for text in loop.texts)
    outputs = loop.wait(8.0)
    assert "streams" not in _notes(outputs), "asked for again, and heard"
    assert loop.ask_to_hold().phase is Phase.HOLD
    assert loop.wait(5.0).phase is Phase.HOLD


def test_where_it_cannot_be_had_a_hold_is_not_refused_for_it_for_ever_and_the_note_stays() -> None:
    loop = WithoutRequests(until_s=1e6)
    _armed(loop)
    loop.wait(20.0)
    loop.texts.clear()
    outputs = loop.ask_to_hold()
    assert _notes(outputs)["streams"] == SLOW
    loop.wait(0.2)
    assert not any(SLOW in text for text in loop.texts), "the answer is another one, if any"


class InBursts(Lockstep):
    """A link that delivers all that the autopilot sends at once, every so many seconds."""

    def __init__(self, every_s: float) -> None:
        super().__init__(
            load_config("sitl", ("plant.start_n_m=-4", "plant.start_e_m=0", "plant.sensors.gnss.slow_bias_m=0"))
        )
        self._every_ns = round(every_s * 1e9)
        self._next_ns = 0
        self._waiting: list[Frame] = []

    def receive(self) -> tuple[Frame, ...]:
        self._waiting += super().receive()
        if self.t_ns < self._next_ns:
            return ()
        self._next_ns = self.t_ns + self._every_ns
        frames, self._waiting = self._waiting, []
        return tuple(changed(frame, t_ns=self.t_ns) for frame in frames)


@pytest.mark.parametrize("every_s", [0.6, 0.9])
def test_a_link_that_delivers_in_bursts_ends_no_hold(every_s: float) -> None:
    loop = InBursts(every_s)
    holds = [outputs for _, outputs in (loop.tick() for _ in range(800)) if outputs.phase is Phase.HOLD]
    assert len(holds) > 600 and holds[-1].t_ns == loop.t_ns, loop.tick()[1].health.reason
