"""Neutral by the operator: at once in every phase that has the motors, in no other, and after the pilot's word."""

from __future__ import annotations

from typing import Any

import pytest

from asvhil.config import SupervisorConfig
from asvhil.supervisor.decision import Decision
from asvhil.supervisor.reasons import Reason, explain
from asvhil.supervisor.situation import StationSticks
from asvhil.supervisor.supervisor import RELEASE_REPEATS
from asvhil.types import FrontseatStatus, NeutralCommand, Phase, ReleaseCommand
from tests.support.supervisor_bench import SupervisorBench, status


def stop(bench: SupervisorBench) -> Decision:
    return bench.step(0, NeutralCommand(t_ns=bench.t_ns))


def stopped(**config: object) -> SupervisorBench:
    """Stopped out of a hold, with the echo of neutral on the motors' sticks."""
    bench = SupervisorBench(SupervisorConfig.model_validate(config))
    assert bench.hold() is None
    bench.drive()
    decision = stop(bench)
    assert decision.answers == (None,) and is_neutral(decision)
    bench.drive(pulses=(1500, 1500))
    return bench


def is_neutral(decision: Decision) -> bool:
    said = (decision.drive, decision.neutral, decision.release, decision.prepare, decision.ask_mode)
    return decision.phase is Phase.PREPARE and said == (False, True, False, False, None) and decision.station is None


def test_neutral_is_said_from_the_tick_of_the_command_on_and_lasts() -> None:
    bench = stopped()
    for _ in range(600):
        bench.step(1000)
    assert is_neutral(bench.step()) and bench.step().why == explain(Reason.STOPPED)


def test_without_the_motors_there_is_nothing_to_stop_and_nothing_is_said() -> None:
    bench = SupervisorBench()
    decision = stop(bench)
    assert decision.answers == (explain(Reason.NOTHING_TO_STOP),)
    assert (decision.phase, decision.neutral, decision.release) == (Phase.STANDBY, False, False)


def test_it_ends_an_engagement_that_would_come_by_itself() -> None:
    station = {"lat_deg": 40.0, "lon_deg": -86.0, "heading_deg": 0.0}
    bench = SupervisorBench(SupervisorConfig.model_validate({"engage": "auto", "station": station}))
    bench.status = status(armed=False)
    assert bench.step().prepare
    stop(bench)
    bench.status = status()
    assert bench.step().phase is not Phase.HOLD and bench.step().phase is not Phase.HOLD


def test_a_hold_takes_the_motors_again_and_a_release_gives_them_back() -> None:
    bench = stopped()
    assert bench.hold() is None and bench.step().drive
    bench = stopped()
    decision = bench.step(0, ReleaseCommand(t_ns=bench.t_ns))
    assert (decision.phase, decision.neutral, decision.release) == (Phase.STANDBY, True, True)
    assert [bench.step().release for _ in range(4)] == [True] * (RELEASE_REPEATS - 1) + [False, False]


def test_it_ends_the_failsafe_too_and_no_recovery_follows() -> None:
    bench = SupervisorBench()
    assert bench.hold() is None
    bench.estimate = None
    assert bench.step().phase is Phase.FAILSAFE
    assert is_neutral(stop(bench)) and is_neutral(bench.step(20_000))


ENDS: dict[str, tuple[dict[str, Any], bool]] = {  # and whether neutral goes before the release: not to a pilot
    "disarmed": ({"status": status(armed=False)}, False),
    "mode": ({"status": status(mode="HOLD")}, False),
    "stick": ({"status": status(rc_us=(1500, 1700, 1500, 1500))}, False),
    "motor's stick": ({"status": status(rc_us=(1500, 1500, 1900, 1500))}, False),
    "station's stick": ({"station_sticks": (StationSticks(t_ns=0, sender=(255, 190), channels=((1, 1700),)),)}, True),
    "heartbeat": ({"age_s": 3.0}, True),
    "mode unknown": ({"age_s": 6.0, "heard_age_s": 0.1}, True),
    "stranger": ({"stranger": explain(Reason.TWO_VEHICLES, system=1)}, True),
    "outputs": ({"fault": explain(Reason.OUTPUTS_DIFFER)}, True),
}


@pytest.mark.parametrize("name", ENDS)
def test_the_pilot_and_a_lost_link_end_it_for_good(name: str) -> None:
    bench = stopped()
    spoil, neutral_first = ENDS[name]
    for key, value in spoil.items():
        setattr(bench, key, value)
    decision = bench.step()
    assert (decision.phase, decision.drive) == (Phase.STANDBY, False)
    assert (decision.neutral, decision.release) == (neutral_first, True)
    assert all(bench.step().phase is Phase.STANDBY for _ in range(5))


def stick_2(us: int) -> FrontseatStatus:
    return status(rc_us=(1500, us, 1500, 1500))


def test_a_stick_counts_from_where_it_was_when_the_motors_were_taken_not_from_the_stop() -> None:
    """It counts once it is more than 60 us off: what is short of that before a stop is not forgiven by it."""
    bench = SupervisorBench()
    assert bench.hold() is None
    for us in (1530, 1560):
        bench.status = stick_2(us)
        assert is_neutral(stop(bench)) and is_neutral(bench.step())
    bench.status = stick_2(1561)
    assert bench.step().why == explain(Reason.STICK_MOVED, channel=2)


def test_where_nothing_held_yet_a_stick_counts_from_where_it_was_at_the_stop() -> None:
    station = {"lat_deg": 40.0, "lon_deg": -86.0, "heading_deg": 0.0}
    bench = SupervisorBench(SupervisorConfig.model_validate({"engage": "auto", "station": station}))
    bench.status = status(armed=False)
    assert bench.step().prepare
    bench.status = stick_2(1900)
    assert is_neutral(stop(bench)) and is_neutral(bench.step())
    bench.status = stick_2(1839)
    assert bench.step().why == explain(Reason.STICK_MOVED, channel=2)


def test_a_mode_that_was_taken_is_not_given_back_after_it() -> None:
    bench = SupervisorBench(SupervisorConfig.model_validate({"take_mode": True}))
    bench.status = status(mode="AUTO")
    assert bench.hold() is None
    bench.status = status()
    assert bench.step().phase is Phase.HOLD
    bench.drive()
    assert is_neutral(stop(bench))
    assert bench.release().ask_mode is None and bench.step().ask_mode is None


def test_while_the_mode_is_being_taken_neutral_ends_in_the_pilots_hands() -> None:
    bench = SupervisorBench(SupervisorConfig.model_validate({"take_mode": True}))
    bench.status = status(mode="AUTO")
    assert bench.hold() is None
    decision = stop(bench)  # another mode stands, in which the motors are the pilot's
    assert (decision.phase, decision.ask_mode, decision.release) == (Phase.STANDBY, None, True)
    bench.status = status()
    assert bench.step().phase is Phase.STANDBY, "the hold is not taken up again"
