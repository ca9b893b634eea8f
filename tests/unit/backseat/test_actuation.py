"""From decisions to the motors: what the controller is told, when it solves, and what the next decision gets."""

from dataclasses import replace

from asvhil.backseat.actuation import Actuation
from asvhil.backseat.build import build_cadence, build_link, build_motor_check
from asvhil.config import load_config
from asvhil.controller.pwm import PulseLimiter
from asvhil.supervisor.reasons import Reason, explain
from asvhil.supervisor.situation import MotorPulses
from asvhil.supervisor.supervisor import Decision
from asvhil.types import Control, Estimate, Frame, Phase, Station, Wind

MS = 1_000_000
CONFIG = load_config("sitl")  # four ticks for each control
HERE, THERE = Station(n_m=0.0, e_m=0.0, psi_rad=0.0), Station(n_m=5.0, e_m=0.0, psi_rad=0.0)
ESTIMATE = Estimate(
    t_ns=0, n_m=1.0, e_m=2.0, psi_rad=0.5, u_mps=0.0, v_mps=0.0, r_radps=0.0,
    motor=(0.0, 0.0), std=(0.1,) * 6, disturbance=(0.0, 0.0, 0.0), valid=True,
)  # fmt: skip


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
        self.ok = True

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        self.calls.append(station)
        return Control(command=(0.5, -0.5), ok=self.ok, iterations=0, cost=0.0)

    def new_station(self) -> None:
        self.calls.append("new station")

    def reset(self) -> None:
        self.calls.append("reset")


class Bench:
    def __init__(self) -> None:
        self.controller = Noting()
        autopilot = build_link(CONFIG)
        self.actuation = Actuation(
            autopilot=autopilot,
            check=build_motor_check(CONFIG, autopilot),
            cadence=build_cadence(CONFIG),
            controller=self.controller,
            limiter=PulseLimiter(CONFIG.vehicle.pwm),
            neutral_us=CONFIG.vehicle.pwm.neutral_us,
            control_mode="MANUAL",
        )
        self.t_ns = 0

    def tick(self, decision: Decision) -> list[Frame]:
        self.t_ns += 50 * MS
        self.actuation.inspect(self.t_ns)
        self.actuation.solve(self.t_ns, decision, ESTIMATE, None, fresh=True)
        return self.actuation.drive(self.t_ns, decision)


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


def test_a_shell_that_cannot_step_any_more_sends_neutral_and_release() -> None:
    bench = Bench()
    bench.tick(held(begun=True, changed=True))
    autopilot = build_link(CONFIG)
    expected = [*autopilot.drive(1, 1500, 1500), *autopilot.release(1)]
    sent = bench.actuation.release_to_pilot(1)
    assert [(frame.port, frame.data[10:-2]) for frame in sent] == [(f.port, f.data[10:-2]) for f in expected]
