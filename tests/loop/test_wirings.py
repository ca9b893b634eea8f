"""Whatever way a boat is wired: `--fix` leaves that alone, and the motors do what is asked, or no hold goes on."""

import re
from typing import Any

from hypothesis import HealthCheck, event, example, given, settings
from hypothesis import strategies as st

from asvhil.autopilot.ardurover_parameters import requirements
from asvhil.autopilot.requirements import judge
from asvhil.config import load_config
from asvhil.simplant.ardurover.rover import Rover
from asvhil.types import Phase
from tests.support.motor_faults import Trial

WIRING = re.compile(r"SERVO\d+_(FUNCTION|REVERSED|TRIM|MIN|MAX)|RC\d+_(REVERSED|TRIM|MIN|MAX)|RCMAP_\w+|MOT_PWM_TYPE")
PORT, STARBOARD = 73, 74
MOSTLY_PLAIN = st.sampled_from([0] * 9 + [1])  # so that some boats are right in everything
CLEAR, CLEAR_N = 0.4, 5.0  # of command, of thrust (N): beyond the dead band
BLUEBOAT = {
    **{"SERVO1_FUNCTION": 74, "SERVO1_MIN": 1100, "SERVO1_TRIM": 1510, "SERVO1_MAX": 1900},
    **{"SERVO3_FUNCTION": 73, "SERVO3_MIN": 1100, "SERVO3_TRIM": 1510, "SERVO3_MAX": 1900, "SERVO3_REVERSED": 1},
    **{"RC1_MIN": 1100, "RC1_MAX": 1901, "RC3_MIN": 1100, "RC3_MAX": 1900, "RC1_DZ": 30, "RC3_DZ": 30},
    **{"PILOT_STEER_TYPE": 3, "MOT_SLEWRATE": 200, "MOT_THST_ASYM": 1.6},
}


@st.composite
def wirings(draw: st.DrawFn) -> dict[str, float]:
    """Parameters of a boat: functions, reversal, trims, travel and channel map, and some that bend commands."""
    port, starboard = draw(
        st.sampled_from([(1, 3)] * 9 + [(3, 1)]) | st.permutations(range(1, 9)).map(lambda order: tuple(order[:2]))
    )
    values: dict[str, float] = {f"SERVO{n}_FUNCTION": 0 for n in (1, 3)}
    values |= {f"SERVO{port}_FUNCTION": PORT, f"SERVO{starboard}_FUNCTION": STARBOARD}
    for n in {1, 3, port, starboard}:
        values[f"SERVO{n}_REVERSED"] = draw(MOSTLY_PLAIN)
        values[f"SERVO{n}_TRIM"] = draw(st.sampled_from([1500] * 9 + [1510, 1450]))
        values[f"SERVO{n}_MIN"] = draw(st.sampled_from([1000] * 9 + [1100, 1200]))
        values[f"SERVO{n}_MAX"] = draw(st.sampled_from([2000] * 9 + [1900, 1800]))
    for n in (1, 3):
        values[f"RC{n}_REVERSED"] = draw(MOSTLY_PLAIN)
        values[f"RC{n}_TRIM"] = draw(st.sampled_from([1500] * 9 + [1520]))
        values[f"RC{n}_MIN"] = draw(st.sampled_from([1000] * 9 + [1100]))
        values[f"RC{n}_MAX"] = draw(st.sampled_from([2000] * 9 + [1900]))
        values[f"RC{n}_DZ"] = draw(st.sampled_from([0, 30]))
    values["RCMAP_ROLL"], values["RCMAP_THROTTLE"] = draw(st.sampled_from([(1, 3)] * 9 + [(3, 1), (1, 2), (4, 3)]))
    values["PILOT_STEER_TYPE"] = draw(st.sampled_from([0, 1, 3]))
    values["MOT_SLEWRATE"] = draw(st.sampled_from([0, 100]))
    values["MOT_THST_ASYM"] = draw(st.sampled_from([1, 1.6]))
    return values


def fixed(values: dict[str, float]) -> dict[str, float]:
    """The same after `asvhil check --fix`, which writes what of its findings is fixable."""
    config = load_config("sitl", (f"plant.frontseat.parameters={values!r}".replace("'", ""),))
    parameters = Rover(config.plant.frontseat, config.vehicle.pwm, 0).parameters
    required = requirements(config.links.autopilot, config.vehicle.pwm)
    names = {name for requirement in required for name in requirement.names}
    written: dict[str, float] = {}
    for _ in range(3):
        read = {name: parameters[name] for name in names & set(parameters.names)}
        wanted = {f.name: f.wanted for f in judge(required, read) if f.fixable and f.wanted is not None}
        for name, value in wanted.items():
            parameters.set(name, value)
        written |= wanted
    assert not [name for name in written if WIRING.fullmatch(name)], written
    return {**values, **written}


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@example(values=BLUEBOAT)
@example(values={})
@example(values={"SERVO1_REVERSED": 1, "SERVO3_REVERSED": 1})
@given(values=wirings())
def test_the_port_command_turns_the_port_propeller_ahead_or_no_hold_goes_on(values: dict[str, float]) -> None:
    trial = Trial(fixed(values))
    let_go_s, outputs = trial.hold(4.0)
    event("refused" if let_go_s == 0.0 else "holds" if let_go_s is None else "ended")
    if let_go_s is not None:
        assert outputs.phase is Phase.STANDBY and outputs.health.reason
        return
    agreed: list[list[bool]] = [[], []]
    for _ in range(160):
        control: Any = trial.tick().control
        if control is None:
            continue
        for side, (command, thrust_n) in enumerate(zip(control.command, trial.loop.plant.truth.thrust_n, strict=True)):
            if abs(command) > CLEAR and abs(thrust_n) > CLEAR_N:
                agreed[side].append(command * thrust_n > 0.0)
    for side, votes in enumerate(agreed):  # a motor lags behind a command that has just changed its sign
        assert len(votes) >= 5 and sum(votes) > 0.7 * len(votes), (side, votes)
