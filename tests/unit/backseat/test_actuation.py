"""From decisions to the motors: what the controller is told, when it solves, and what the next decision gets."""

import math
from dataclasses import replace

import pytest

from asvhil.backseat.actuation import Actuation
from asvhil.backseat.build import build_cadence, build_link, build_motor_check
from asvhil.config import load_config
from asvhil.controller.pwm import PulseLimiter
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Reason, explain
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.types import Control, Estimate, Frame, Phase, Station, Wind
from tests.support.supervisor_bench import status

MS = 1_000_000
CONFIG = load_config("sitl")  # four ticks for each control
HERE, THERE = Station(n_m=0.0, e_m=0.0, psi_rad=0.0), Station(n_m=5.0, e_m=0.0, psi_rad=0.0)
ESTIMATE = Estimate(
    t_ns=0, n_m=1.0, e_m=2.0, psi_rad=0.5, u_mps=0.0, v_mps=0.0, r_radps=0.0,
    motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
)  # fmt: skip
WIND = Wind(t_ns=0, vn_mps=3.0, ve_mps=-1.0, std_mps=0.0, valid=True)


def held(station: Station = HERE, *, changed: bool = False, begun: bool = False) -> Decision:
    return Decision(
        phase=Phase.HOLD,
        why=explain(Reason.HOLDING),
        station=station,
        station_changed=changed,
        begun=begun,
        drive=True,
    )


FREE = Decision(phase=Phase.STANDBY, why=explain(Reason.RELEASED), station=None)


class Noting:
    """A controller that notes its calls."""

    def __init__(self) -> None:
        self.calls: list[str | Station] = []
        self.given: tuple[Estimate, Wind | None] | None = None
        self.ok = True
        self.command = (0.5, -0.5)

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        self.calls.append(station)
        self.given = estimate, wind
        return Control(command=self.command, ok=self.ok, iterations=0, cost=0.0)

    def new_station(self) -> None:
        self.calls.append("new station")

    def reset(self) -> None:
        self.calls.append("reset")


class Bench:
    def __init__(self) -> None:
        self.controller = Noting()
        self.autopilot = autopilot = build_link(CONFIG)
        self.check = build_motor_check(CONFIG, autopilot)
        self.cadence = build_cadence(CONFIG)
        self.actuation = Actuation(
            autopilot=autopilot,
            check=self.check,
            cadence=self.cadence,
            controller=self.controller,
            limiter=PulseLimiter(CONFIG.vehicle.pwm),
            neutral_us=CONFIG.vehicle.pwm.neutral_us,
            control_mode="MANUAL",
        )
        self.t_ns = 0
        self.estimate: Estimate | None = ESTIMATE
        self.control: Control | None = None

    def tick(self, decision: Decision) -> list[Frame]:
        self.t_ns += 50 * MS
        self.actuation.inspect(self.t_ns)
        self.control = self.actuation.solve(self.t_ns, decision, self.estimate, WIND, fresh=True)
        return self.actuation.drive(self.t_ns, decision)

    def settle(self) -> tuple[int, int] | None:
        """The pulses of a hold that has gone on for so long that the slew rate counts no more."""
        self.tick(held(begun=True, changed=True))
        for _ in range(40):
            self.tick(held())
        return self.actuation.pulses_us


Payload = tuple[int, str, bytes]


def payloads(frames: list[Frame]) -> list[Payload]:
    """Time, port, message and its values, without sequence number and checksum."""
    return [(frame.t_ns, frame.port, frame.data[7:-2]) for frame in frames]


def test_the_controller_hears_of_a_new_station_at_once_and_of_a_loss_by_a_reset() -> None:
    bench = Bench()
    bench.tick(FREE)
    bench.tick(held(changed=True, begun=True))
    assert bench.controller.calls == ["new station", HERE]
    bench.tick(held(THERE, changed=True))  # moved between two solutions
    bench.tick(held(THERE))
    assert bench.controller.calls == ["new station", HERE, "new station"]
    for _ in range(4):
        bench.tick(held(THERE))
    assert bench.controller.calls[3:] == [THERE]
    bench.tick(replace(FREE, station_changed=True, release=True))
    assert bench.controller.calls[4:] == ["reset"]
    bench.tick(FREE)
    assert bench.controller.calls[4:] == ["reset"]


def test_a_hold_that_begins_is_solved_for_in_its_tick() -> None:
    bench = Bench()
    bench.tick(held(begun=True, changed=True))
    bench.tick(held())
    assert len(bench.controller.calls) == 2
    bench.tick(held(begun=True))  # the same station again
    assert bench.controller.calls[2:] == [HERE]


def test_the_next_decision_hears_what_was_sent_and_whether_the_solution_can_be_used() -> None:
    bench = Bench()
    bench.tick(FREE)
    assert bench.actuation.sent is None and bench.actuation.control_ok is None
    bench.tick(held(begun=True, changed=True))
    assert bench.actuation.pulses_us is not None
    pulses_us = bench.actuation.pulses_us  # of plain sticks too
    assert bench.actuation.sent == MotorPulses(t_ns=bench.t_ns, us=pulses_us, sticks_us=pulses_us)
    assert bench.actuation.control_ok is True
    bench.tick(held())
    assert bench.actuation.control_ok is None  # none was made
    bench.controller.ok = False
    for _ in range(3):
        bench.tick(held())
    assert bench.actuation.control_ok is False and bench.actuation.pulses_us == (1500, 1500)
    bench.tick(replace(FREE, station_changed=True, neutral=True, release=True))
    assert bench.actuation.sent is not None and bench.actuation.pulses_us is None  # neutral, and then let go


@pytest.mark.parametrize("keeps", [False, True])
def test_a_shell_that_cannot_step_any_more_sends_neutral_and_release(
    keeps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neutral alone, where an autopilot would let the last override stand."""
    bench, twin = Bench(), build_link(CONFIG)
    bench.tick(held(begun=True, changed=True))
    monkeypatch.setattr(type(bench.autopilot), "keeps_override", keeps)
    expected = [*twin.drive(1, 1500, 1500), *([] if keeps else twin.release(1))]
    assert payloads(bench.actuation.release_to_pilot(1)) == payloads(expected) != []


def test_the_motors_get_the_command_until_the_next_one() -> None:
    bench = Bench()
    assert bench.settle() == (1700, 1300)
    assert bench.control is not None and bench.controller.given == (ESTIMATE, WIND)  # the 41st tick is due
    frames = bench.tick(held())
    assert bench.control is None and payloads(frames) == payloads(build_link(CONFIG).drive(bench.t_ns, 1700, 1300))
    bench.controller.command = (0.0, 1.0)
    for _ in range(40):
        bench.tick(held())
    assert bench.actuation.pulses_us == (1500, 1900)


def test_a_solution_that_failed_is_neutral_until_there_is_another_one() -> None:
    bench = Bench()
    bench.settle()
    bench.controller.ok = False
    for _ in range(4):
        bench.tick(held())
    for _ in range(3):  # no solution is due, and the last one had failed
        bench.tick(held())
        assert bench.actuation.pulses_us == (1500, 1500) and bench.actuation.control_ok is None


@pytest.mark.parametrize("command", [(math.nan, 0.2), (0.2, math.inf), (-math.inf, math.nan)])
def test_a_command_that_is_no_number_is_a_solution_that_failed(command: tuple[float, float]) -> None:
    bench = Bench()
    bench.settle()
    bench.controller.command = command
    for _ in range(4):
        bench.tick(held())
    assert bench.control is not None and bench.control.ok is False and bench.control.command == command
    assert bench.actuation.control_ok is False and bench.actuation.pulses_us == (1500, 1500)


@pytest.mark.parametrize("estimate", [None, replace(ESTIMATE, valid=False)], ids=["none", "not valid"])
def test_without_an_estimate_nothing_is_solved_and_the_motors_stop(estimate: Estimate | None) -> None:
    bench = Bench()
    bench.settle()
    bench.tick(held())  # so that the next tick is not due
    bench.estimate = estimate
    calls = len(bench.controller.calls)
    bench.tick(held())
    assert bench.control is None and bench.actuation.control_ok is None
    assert bench.actuation.pulses_us == (1500, 1500) and len(bench.controller.calls) == calls
    bench.estimate = ESTIMATE
    bench.tick(held())
    assert bench.control is not None, "the first tick with an estimate is due"


def test_a_release_forgets_pulses_and_command() -> None:
    bench = Bench()
    bench.settle()
    bench.tick(FREE)
    assert bench.actuation.pulses_us is None and bench.actuation.sent is None
    bench.tick(held(begun=True))
    assert bench.actuation.pulses_us == (1501, 1499), "it starts from neutral, and no time has passed"


def test_at_first_nothing_is_sent_or_known() -> None:
    actuation = Bench().actuation
    assert actuation.pulses_us is None and actuation.sent is None and actuation.control_ok is None


@pytest.mark.parametrize(
    ("decision", "said"),
    [
        (FREE, ()),
        (replace(FREE, neutral=True), ("neutral",)),
        (replace(FREE, neutral=True, release=True), ("neutral", "release")),
        (replace(FREE, release=True), ("release",)),
        (replace(FREE, prepare=True), ("MANUAL", "arming")),
        (replace(FREE, neutral=True, prepare=True), ("neutral", "MANUAL", "arming")),
        (replace(FREE, release=True, ask_mode="HOLD"), ("release", "HOLD")),
    ],
)
def test_what_is_asked_of_the_autopilot_comes_in_the_order_of_its_weight(
    decision: Decision, said: tuple[str, ...]
) -> None:
    bench, t_ns = Bench(), 50 * MS
    every = {
        "neutral": build_link(CONFIG).drive(t_ns, 1500, 1500),
        "release": build_link(CONFIG).release(t_ns),
        "arming": build_link(CONFIG).request_arming(t_ns),
        **{mode: build_link(CONFIG).request_mode(t_ns, mode) for mode in ("MANUAL", "HOLD")},
    }
    assert all(every.values()) and every["MANUAL"] != every["HOLD"]
    frames = payloads(bench.tick(decision))
    assert frames == [payload for name in said for payload in payloads(every[name])]
    assert bench.actuation.pulses_us == ((1500, 1500) if said == ("neutral",) or "MANUAL" in said[1:] else None)


def test_another_process_would_say_what_this_tick_calls_for() -> None:
    bench, twin = Bench(), build_link(CONFIG)

    def words() -> list[list[Payload]]:
        return [payloads(step) for step in bench.actuation.last_words(bench.t_ns)]

    def expected(neutral: bool) -> list[list[Payload]]:
        return [payloads(step) for step in twin.last_words(bench.t_ns, neutral=neutral)]

    assert words() == []
    bench.tick(FREE)
    assert words() == []
    bench.tick(held(begun=True, changed=True))
    assert words() == expected(neutral=True) != []
    bench.tick(replace(FREE, neutral=True, release=True))
    assert words() == expected(neutral=True)
    bench.tick(replace(FREE, release=True))
    assert words() == expected(neutral=False) != expected(neutral=True)
    bench.tick(FREE)
    assert words() == []


@pytest.mark.parametrize("fresh", [False, True])
def test_the_cadence_gets_the_time_and_whether_something_came(fresh: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, asked = Bench(), []
    monkeypatch.setattr(bench.cadence, "advance", lambda *what: asked.append(what) or False)
    assert bench.actuation.solve(7, held(), ESTIMATE, WIND, fresh=fresh) is None
    assert asked == [(7, fresh)]


def test_the_check_gets_what_is_reported_and_what_a_hold_sends(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    got: list[object] = []
    for name in ("on_status", "on_station_sticks", "step", "note_output"):
        monkeypatch.setattr(bench.check, name, lambda *what, name=name: got.append((name, *what)))
    told, sticks = status(), StationSticks(t_ns=1, sender=(255, 190), channels=((1, 1600),))
    bench.actuation.on_status(told)
    bench.actuation.on_station_sticks(sticks)
    bench.tick(replace(FREE, neutral=True))
    bench.tick(replace(held(begun=True, changed=True), phase=Phase.FAILSAFE))
    first_us = bench.actuation.pulses_us
    bench.tick(held())
    assert got == [
        ("on_status", told),
        ("on_station_sticks", sticks),
        ("step", 50 * MS),
        ("note_output", 50 * MS, None),
        ("step", 100 * MS),
        ("note_output", 100 * MS, first_us),
        ("step", 150 * MS),
        ("note_output", 150 * MS, bench.actuation.pulses_us),
    ]
    assert first_us is not None and bench.actuation.pulses_us is not None


def test_what_the_check_finds_is_told() -> None:
    bench = Bench()
    assert bench.actuation.unverified is not None and bench.actuation.unverified == bench.check.unverified
    assert bench.actuation.notes == bench.check.notes
    bench.check.fault = explain(Reason.RELEASED)
    assert bench.actuation.fault is bench.check.fault
