"""The read-back of outputs, on the recording of a real ArduRover as it is and with its reports bent."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from asvhil.autopilot.ardurover import ArduRoverAutopilot
from asvhil.autopilot.distortions import distortions
from asvhil.autopilot.readback import Fault, Readback
from asvhil.config import ReadbackConfig, load_config
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.logs.tlog import read_tlog
from asvhil.types import Cause, Frame, FrontseatStatus
from tests.support.paths import DATA

TLOG = DATA / "ardurover-4.6.3-json-boat-drive.tlog"
S = 1_000_000_000
LIMIT_S = 3.0
Pair = tuple[int, int]
Event = tuple[int, str, Pair]  # time (ns); sent, rc or outputs; port and starboard


@cache
def recorded() -> list[Event]:
    """What was sent to the real autopilot's motors, and what it reported of its sticks and outputs."""
    config = load_config("field")
    link = ArduRoverAutopilot(config.links.autopilot, config.vehicle.pwm)
    splitter = FrameSplitter(datagrams=True)
    events: list[Event] = []
    for unix_us, data in read_tlog(TLOG):
        t_ns = unix_us * 1000
        for frame in splitter.receive(data):
            message = decode(frame)
            assert message is not None
            if message.get_type() == "RC_CHANNELS_OVERRIDE" and message.chan1_raw:
                events.append((t_ns, "sent", (message.chan1_raw, message.chan3_raw)))
        for _, status in link.receive(Frame(t_ns=t_ns, port="autopilot", data=data)):
            if isinstance(status, FrontseatStatus):
                if status.rc_ns == t_ns and status.sticks_us:
                    events.append((t_ns, "rc", status.sticks_us))
                if status.outputs_ns == t_ns and status.motors_us:
                    events.append((t_ns, "outputs", status.motors_us))
    return events


PLAIN_US = 15


@cache
def taken_ns() -> int:
    """When the motors were taken."""
    return next(t for t, kind, _ in recorded() if kind == "sent")


def first_plain_ns(events: list[Event]) -> int:
    """When, since the motors were taken, what is reported first differs plainly from what the real one reported."""
    pairs = (
        (t, max(abs(a[0] - b[0]), abs(a[1] - b[1]))) for (t, _, a), (_, _, b) in zip(recorded(), events, strict=True)
    )
    return next(t for t, apart_us in pairs if t >= taken_ns() and apart_us > PLAIN_US)


class Player:
    """A watch that is shown events; `fault_ns` is when it spoke."""

    def __init__(self, **config: float) -> None:
        self.watch = Readback(ReadbackConfig.model_validate(config), 1500.0)
        self._status = FrontseatStatus(t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=(), outputs_us=())
        self.fault_ns = 0

    def play(self, events: list[Event]) -> Fault | None:
        for t_ns, kind, (port, starboard) in events:
            if kind == "sent":
                self.watch.note_sent(t_ns, (port, starboard))
            elif kind == "rc":
                self._status = replace(self._status, rc_ns=t_ns, sticks_us=(port, starboard))
                self.watch.on_status(self._status)
            else:
                self._status = replace(self._status, outputs_ns=t_ns, motors_us=(port, starboard))
                self.watch.on_status(self._status)
            if self.watch.judge(t_ns) is not None:
                self.fault_ns = t_ns
                return self.watch.fault
        return None


def bent(kind: str, bend: Callable[[Pair], Pair]) -> list[Event]:
    return [(t, what, bend(us) if what == kind else us) for t, what, us in recorded()]


def test_a_real_autopilot_that_is_set_right_raises_no_fault() -> None:
    player = Player()
    assert player.play(recorded()) is None
    assert player.watch.override_seen and player.watch.follows
    counts = {kind: sum(what == kind for _, what, _ in recorded()) for kind in ("sent", "rc", "outputs")}
    assert counts["sent"] > 900 and counts["rc"] > 250 and counts["outputs"] > 600


def test_nor_without_its_sticks_with_few_reports_or_with_half_of_the_overrides_lost() -> None:
    assert Player().play([e for e in recorded() if e[1] != "rc"]) is None
    few = [e for i, e in enumerate(recorded()) if e[1] != "outputs" or i % 5 == 0]
    assert Player().play(few) is None


def about_neutral(factor: float) -> Callable[[int], int]:
    return lambda us: int(1500 + factor * (us - 1500))


def dead(us: int, zone_us: int = 30) -> int:
    beyond = max(abs(us - 1500) - zone_us, 0) * 500 / (500 - zone_us)
    return int(1500 + (beyond if us > 1500 else -beyond))


def mixed(us: Pair) -> Pair:
    steering, throttle = us[0] - 1500, us[1] - 1500
    steering = -steering if throttle < 0 else steering
    left, right = throttle + steering, throttle - steering
    largest = max(1.0, abs(left) / 500, abs(right) / 500)
    return int(1500 + left / largest), int(1500 + right / largest)


CASES: dict[str, tuple[Callable[[Pair], Pair], Cause, str]] = {
    "swapped": (lambda us: (us[1], us[0]), Cause.SWAPPED, ""),
    "port reversed": (lambda us: (3000 - us[0], us[1]), Cause.REVERSED, "port"),
    "starboard reversed": (lambda us: (us[0], 3000 - us[1]), Cause.REVERSED, "starboard"),
    "mixed": (mixed, Cause.MIXED, ""),
    "dead zones": (lambda us: (dead(us[0]), dead(us[1])), Cause.UNEXPLAINED, ""),
    "starboard dead zone": (lambda us: (us[0], dead(us[1], 60)), Cause.UNEXPLAINED, ""),
    "scaled": (lambda us: (about_neutral(0.6)(us[0]), about_neutral(0.6)(us[1])), Cause.UNEXPLAINED, ""),
    "other neutral": (lambda us: (us[0] + 25, us[1]), Cause.UNEXPLAINED, ""),
    "no signal": (lambda us: (0, 0), Cause.STUCK, ""),
    "neutral": (lambda us: (1500, 1500), Cause.STUCK, ""),
    "starboard stuck": (lambda us: (us[0], 1500), Cause.STUCK, "starboard"),
}


@pytest.mark.parametrize("case", CASES)
def test_bent_reports_are_explained_within_3_s_of_the_first_plain_difference(case: str) -> None:
    bend, cause, motor = CASES[case]
    player = Player()
    events = bent("outputs", bend)
    fault = player.play(events)
    assert fault is not None and (fault.cause, fault.motor) == (cause, motor)
    assert 0 < player.fault_ns - first_plain_ns(events) <= LIMIT_S * S


def test_sticks_that_never_show_an_override_mean_that_it_is_ignored() -> None:
    ignored = [(t, what, (1500, 1500) if what in ("rc", "outputs") else us) for t, what, us in recorded()]
    player = Player()
    fault = player.play(ignored)
    assert fault is not None and fault.cause is Cause.IGNORED
    assert player.fault_ns - first_plain_ns(ignored) <= LIMIT_S * S
    blind = Player().play([event for event in ignored if event[1] != "rc"])
    assert blind is not None and blind.cause is Cause.STUCK and blind.blind


def slewed(t_s: np.ndarray, throttle_us: np.ndarray, rate_us_per_s: float, start_us: float) -> list[float]:
    """What a limit on the rate of the throttle makes of it, by each time at which it was sent."""
    found = [start_us]
    for wanted_us, elapsed_s in zip(throttle_us[:-1], np.diff(t_s), strict=True):
        reach_us = rate_us_per_s * elapsed_s
        found.append(found[-1] + min(max(wanted_us - found[-1], -reach_us), reach_us))
    return found


def test_a_limit_on_the_throttles_rate_is_found_within_3_s() -> None:
    sent = [(t, us) for t, what, us in recorded() if what == "sent"]
    t_s = np.array([t for t, _ in sent]) / S
    pulses = np.array([us for _, us in sent], dtype=float)
    throttle = slewed(t_s, pulses.mean(axis=1), 120.0, 1500.0)
    events = []
    for t, what, us in recorded():
        if what == "outputs":
            i = max(int(np.searchsorted(t_s, t / S, side="right")) - 1, 0)
            half = (pulses[i, 0] - pulses[i, 1]) / 2.0
            us = (int(throttle[i] + half), int(throttle[i] - half))
        events.append((t, what, us))
    player = Player()
    fault = player.play(events)
    assert fault is not None and fault.cause is Cause.UNEXPLAINED
    assert 0 < player.fault_ns - first_plain_ns(events) <= LIMIT_S * S


def test_outputs_that_follow_nothing_known_are_said_to_do_so() -> None:
    chance = np.random.default_rng(1)
    noise = bent("outputs", lambda us: (int(chance.integers(1100, 1900)), int(chance.integers(1100, 1900))))
    player = Player()
    fault = player.play(noise)
    assert fault is not None and fault.cause is Cause.UNEXPLAINED
    assert player.fault_ns - first_plain_ns(noise) <= LIMIT_S * S


def test_a_report_counts_once_and_nothing_is_said_while_the_motors_are_not_driven() -> None:
    watch = Readback(ReadbackConfig(), 1500.0)
    status = FrontseatStatus(
        t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=(), outputs_us=(), motors_us=(1500, 1500)
    )
    for tick in range(100):
        watch.on_status(replace(status, outputs_ns=tick * S // 10))
        assert watch.judge(tick * S // 10) is None
    for tick in range(100, 200):
        watch.note_sent(tick * S // 10, (1700, 1600))
        watch.on_status(replace(status, outputs_ns=10 * S))  # said before the motors were taken, and again and again
        assert watch.judge(tick * S // 10) is None
    assert watch.unread_ns(20 * S) == 10 * S


def test_commands_that_the_link_loses_for_a_second_are_no_fault() -> None:
    """The outputs stay as they were last told while newer commands are sent, and follow again after."""
    for start_s in np.arange(2.0, 40.0, 4.3):
        gap = (taken_ns() + round(start_s * S), taken_ns() + round((start_s + 1.5) * S))
        player = Player()
        assert player.play(without_uplink(*gap)) is None, start_s


def without_uplink(from_ns: int, until_ns: int) -> list[Event]:
    """The recording as if no command had reached the autopilot for a while: what it reports stays as it was."""
    stood: dict[str, Pair] = {}
    events = []
    for t_ns, what, us in recorded():
        if what == "sent" or not from_ns <= t_ns <= until_ns:
            stood[what] = us
        events.append((t_ns, what, stood.get(what, us) if what != "sent" else us))
    return events


def test_every_distortion_touches_the_motor_that_it_names_and_leaves_neutral_sense() -> None:
    sent = np.array([[1500.0, 1500.0], [1700.0, 1420.0], [1300.0, 1260.0]])
    for distortion in distortions(1500.0):
        expected = distortion.apply(sent)
        assert expected.shape == sent.shape and np.isfinite(expected).all()
        assert expected[0].tolist() == [1500.0, 1500.0]
        changed = (np.abs(expected - sent) > 0.5).any(axis=0).tolist()
        assert changed == {"": [True, True], "port": [True, False], "starboard": [False, True]}[distortion.motor]


@pytest.mark.parametrize("case", ["port reversed", "starboard reversed", "mixed"])
def test_a_distortion_is_named_through_the_dead_zones_that_ardurover_has_by_default(case: str) -> None:
    distort, cause, motor = CASES[case]
    fault = Player().play(bent("outputs", lambda us: distort((dead(us[0]), dead(us[1])))))
    assert fault is not None and (fault.cause, fault.motor) == (cause, motor)
