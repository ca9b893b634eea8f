"""Neutral for a disarmed boat without a receiver: while somebody asks for a hold, and never against a pilot."""

from dataclasses import replace

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Reason, explain
from asvhil.supervisor.situation import MotorPulses, StationSticks
from asvhil.supervisor.supervisor import Supervisor
from asvhil.types import Phase, Radio
from tests.support.supervisor_bench import SupervisorBench, status

NEUTRAL = (1500, 1500)
ARM_NOW = explain(Reason.ARM_NOW, seconds=30.0, mode="MANUAL")


class DisarmedBench(SupervisorBench):
    """A disarmed boat without a receiver, in HOLD as it boots; overrides show in its RC_CHANNELS."""

    def __init__(self, config: SupervisorConfig | None = None) -> None:
        super().__init__(config)
        self.status = status(
            armed=False, mode="HOLD", radio=Radio.ABSENT, rc_us=(0,) * 8, arming_fault="Radio failsafe on"
        )

    def change(self, **fields: object) -> None:
        assert self.status is not None
        told = replace(self.status, **fields)  # type: ignore[arg-type]
        self.status = replace(told, sticks_us=(told.rc_us[0], told.rc_us[2]))

    def wait(self, seconds: float) -> Decision:
        for _ in range(round(seconds * 20)):
            decision = self.step()
            if decision.neutral and not decision.release:
                self.sent = MotorPulses(t_ns=self.t_ns, us=NEUTRAL)
                self.change(rc_us=(1500, 0, 1500, 0, 0, 0, 0, 0))
        return decision


def lets_go(decision: Decision, reason: Reason) -> bool:
    return decision.phase is Phase.STANDBY and decision.release and decision.why.reason is reason


def test_a_hold_command_has_neutral_sent_and_says_to_arm_and_a_second_one_holds() -> None:
    bench = DisarmedBench()
    assert bench.hold() == ARM_NOW
    decision = bench.wait(10.0)
    assert decision.phase is Phase.PREPARE and decision.neutral and not decision.drive and not decision.release
    bench.change(mode="MANUAL")
    bench.wait(1.0)
    bench.change(armed=True, arming_fault="")
    decision = bench.wait(5.0)
    assert decision.neutral and not decision.drive, "arming starts no motor"
    assert bench.hold() is None
    assert bench.step().drive


@pytest.mark.parametrize("armed", [False, True])
def test_it_ends_in_neutral_and_release_after_a_while(armed: bool) -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.change(mode="MANUAL", armed=armed)
    assert bench.wait(29.9).neutral
    decision = bench.wait(0.1)
    assert lets_go(decision, Reason.NEUTRAL_ENDED) and decision.neutral
    assert not (last := bench.wait(0.3)).neutral and not last.release


def test_asking_again_prolongs_it() -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.wait(20.0)
    assert bench.hold() == ARM_NOW
    assert bench.wait(29.0).neutral


@pytest.mark.parametrize("radio", [Radio.UNKNOWN, Radio.HEARD, Radio.LOST])
def test_nothing_is_sent_where_a_receiver_is_or_has_been_heard(radio: Radio) -> None:
    bench = DisarmedBench()
    bench.change(radio=radio)
    assert bench.hold() == explain(Reason.NOT_ARMED, hint="Radio failsafe on")
    decision = bench.wait(1.0)
    assert decision.phase is Phase.STANDBY and not decision.neutral and not decision.release


def test_a_transmitter_that_comes_has_its_sticks_at_once() -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.wait(3.0)
    bench.change(radio=Radio.HEARD)
    decision = bench.step()
    assert lets_go(decision, Reason.TRANSMITTER_HEARD) and not decision.neutral


def test_an_autopilot_that_is_restarted_gets_no_more_until_it_has_told_of_its_radio() -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.wait(3.0)
    bench.change(radio=Radio.UNKNOWN)
    assert lets_go(bench.step(), Reason.WAITING_FOR_AUTOPILOT)


def test_other_sticks_and_another_mode_have_the_boat_too() -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.wait(3.0)
    bench.change(rc_us=(1700, 0, 1500, 0, 0, 0, 0, 0))
    assert lets_go(bench.step(), Reason.OVERRIDE_NOT_FOLLOWED)
    bench = DisarmedBench()
    bench.hold()
    bench.wait(3.0)
    bench.change(armed=True, mode="AUTO")
    assert lets_go(bench.step(), Reason.MODE_CHANGED)


def test_a_lost_link_ends_it_and_so_does_a_release() -> None:
    bench = DisarmedBench()
    bench.hold()
    bench.age_s = 3.0
    assert lets_go(bench.step(), Reason.NO_HEARTBEAT)
    bench = DisarmedBench()
    bench.hold()
    assert lets_go(bench.release(), Reason.RELEASED)


def test_it_can_be_switched_off_and_is_nothing_for_outputs_that_hold_their_value() -> None:
    bench = DisarmedBench(SupervisorConfig(arming_neutral_s=0.0))
    assert bench.hold() == explain(Reason.NOT_ARMED, hint="Radio failsafe on")
    bench = DisarmedBench()
    bench.supervisor = Supervisor(SupervisorConfig(), overrides_sticks=False)
    assert bench.hold() == explain(Reason.NOT_ARMED, hint="Radio failsafe on")


@pytest.mark.parametrize("seconds", [0.5, 30.0])
def test_the_reasons_name_how_long_and_which_mode(seconds: float) -> None:
    bench = DisarmedBench(SupervisorConfig(arming_neutral_s=seconds))
    assert bench.hold() == explain(Reason.ARM_NOW, seconds=seconds, mode="MANUAL")
    assert bench.step(round(seconds * 1000)).why == explain(Reason.NEUTRAL_ENDED, seconds=seconds)
    bench = DisarmedBench()
    bench.hold()
    bench.change(armed=True, mode="AUTO")
    assert bench.step().why == explain(Reason.MODE_CHANGED, mode="AUTO")


def test_where_the_sticks_rest_is_what_they_were_when_neutral_was_asked_for_first() -> None:
    def moves(bench: DisarmedBench, us: int) -> Decision:
        sticks = StationSticks(t_ns=bench.t_ns, sender=(255, 190), channels=((2, us),))
        bench.station_sticks = (sticks,)
        return bench.step()

    bench = DisarmedBench()
    bench.change(rc_us=(0, 1600, 0, 0, 0, 0, 0, 0))
    bench.hold()
    assert moves(bench, 1650).neutral
    bench.change(rc_us=(1500, 1700, 1500, 0, 0, 0, 0, 0))
    assert bench.hold() == ARM_NOW
    assert lets_go(moves(bench, 1670), Reason.STATION_STICK)


# --- a transmitter that is lost -----------------------------------------------------------------------------


def test_a_transmitter_that_is_lost_in_a_hold_ends_it_so_that_the_fail_safe_acts() -> None:
    bench = SupervisorBench()
    bench.status = status(radio=Radio.HEARD)
    assert bench.hold() is None
    bench.step()
    bench.status = status(radio=Radio.LOST)
    decision = bench.step()
    assert lets_go(decision, Reason.TRANSMITTER_LOST) and decision.neutral
    bench.step(2000)
    assert bench.hold() == explain(Reason.TRANSMITTER_LOST)


def test_or_the_hold_goes_on_where_the_config_says_so() -> None:
    bench = SupervisorBench(SupervisorConfig(transmitter_lost="hold"))
    bench.status = status(radio=Radio.LOST)
    assert bench.hold() is None
    assert bench.step().drive
