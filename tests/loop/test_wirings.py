"""Whatever way a boat is wired: `--fix` leaves that alone, and the motors do what is asked, or no hold goes on."""

import re
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, event, example, given, settings
from hypothesis import Phase as Stage
from hypothesis import strategies as st

from asvhil.autopilot.ardurover_parameters import requirements
from asvhil.autopilot.requirements import judge
from asvhil.config import load_config
from asvhil.simplant.ardurover.rover import Rover
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Reason
from asvhil.types import Outputs, Phase
from tests.support.loop import DEFAULT_CONTROLLER
from tests.support.motor_faults import Trial

WIRING = re.compile(r"SERVO\d+_(FUNCTION|REVERSED|TRIM|MIN|MAX)|RC\d+_(REVERSED|TRIM|MIN|MAX)|RCMAP_\w+|MOT_PWM_TYPE")
PORT, STARBOARD = 73, 74
# Without shrinking, which would take minutes: an example is plain enough as it is.
SETTINGS = settings(
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
    phases=(Stage.explicit, Stage.generate),
)
RARELY = st.sampled_from([0] * 9 + [1])
OUTPUTS = st.sampled_from(["rc_override", "rc_override", "manual_control"])
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
        st.sampled_from([(1, 3)] * 3 + [(3, 1)] * 3)
        | st.permutations(range(1, 17)).map(lambda order: (order[0], order[1]))
    )
    values: dict[str, float] = {f"SERVO{n}_FUNCTION": 0 for n in (1, 3)}
    values |= {f"SERVO{port}_FUNCTION": PORT, f"SERVO{starboard}_FUNCTION": STARBOARD}
    if draw(RARELY):
        values[f"SERVO{draw(st.integers(1, 16))}_FUNCTION"] = draw(st.sampled_from([0, PORT, STARBOARD]))
    for n in {port, starboard}:
        values[f"SERVO{n}_REVERSED"] = draw(st.sampled_from([0, 1]))
        values[f"SERVO{n}_TRIM"] = draw(st.sampled_from([1500, 1500, 1510, 1450, 1580]))
        values[f"SERVO{n}_MIN"] = draw(st.sampled_from([1000, 1000, 1100, 900] + 2 * [1200] * draw(RARELY)))
        values[f"SERVO{n}_MAX"] = draw(st.sampled_from([2000, 2000, 1900, 2100] + 2 * [1800] * draw(RARELY)))
    roll, throttle = draw(st.sampled_from([(1, 3)] * 4 + [(3, 1)]) | st.tuples(st.integers(1, 16), st.integers(1, 16)))
    values["RCMAP_ROLL"], values["RCMAP_THROTTLE"] = roll, throttle
    for n in {roll, throttle}:
        values[f"RC{n}_REVERSED"] = draw(st.sampled_from([0, 1]))
        values[f"RC{n}_TRIM"] = draw(st.sampled_from([1500, 1500, 1520, 1440]))
        values[f"RC{n}_MIN"] = draw(st.sampled_from([1000, 1000, 1100, 982]))
        values[f"RC{n}_MAX"] = draw(st.sampled_from([2000, 2000, 1900, 2006]))
        values[f"RC{n}_DZ"] = draw(st.sampled_from([0, 30]))
    values["PILOT_STEER_TYPE"] = draw(st.sampled_from([0, 1, 3]))
    values["MOT_SLEWRATE"] = draw(st.sampled_from([0, 100]))
    values["MOT_THST_ASYM"] = draw(st.sampled_from([1, 1.6]))
    return values


@st.composite
def px4_wirings(draw: st.DrawFn) -> dict[str, float]:
    """Parameters of a PX4: functions, reversal and travel of its outputs."""
    port, starboard = draw(st.permutations([1, 3, 4, 5, 6, 7, 8]))[:2]
    values: dict[str, float] = {"PWM_MAIN_FUNC1": 0, "PWM_MAIN_FUNC3": 0}
    values |= {f"PWM_MAIN_FUNC{port}": 301, f"PWM_MAIN_FUNC{starboard}": 302}
    if draw(RARELY):
        values[f"PWM_MAIN_FUNC{draw(st.integers(1, 8))}"] = draw(st.sampled_from([0, 301, 302]))
    for n in (port, starboard):
        values[f"PWM_MAIN_MIN{n}"] = draw(st.sampled_from([1100, 1000, 950] + [1200] * draw(RARELY)))
        values[f"PWM_MAIN_MAX{n}"] = draw(st.sampled_from([1900, 2000, 2050] + [1800] * draw(RARELY)))
    values["PWM_MAIN_REV"] = draw(st.integers(0, 255))
    return values


def fixed(values: dict[str, float], *overrides: str) -> dict[str, float]:
    """The same after `asvhil check --fix`, which writes what of its findings is fixable."""
    config = load_config("sitl", (f"plant.frontseat.parameters={values!r}".replace("'", ""), *overrides))
    parameters = Rover(config.plant.frontseat, config.vehicle.pwm, 0).parameters
    written: dict[str, float] = {}
    for _ in range(3):
        read = {name: parameters[name] for name in parameters.names}
        required = requirements(config.links.autopilot, config.vehicle.pwm, read)
        wanted = {f.name: f.wanted for f in judge(required, read) if f.fixable and f.wanted is not None}
        for name, value in wanted.items():
            parameters.set(name, value)
        written |= wanted
    assert not [name for name in written if WIRING.fullmatch(name)], written
    return {**values, **written}


def turns_as_commanded(plant: Plant, step: Callable[[], Outputs]) -> None:
    """For 8 s each propeller turns ahead when it is commanded ahead, and astern when astern."""
    agreed: list[list[bool]] = [[], []]
    for _ in range(160):
        control = step().control
        if control is None:
            continue
        for side, (command, thrust_n) in enumerate(zip(control.command, plant.truth.thrust_n, strict=True)):
            if abs(command) > CLEAR and abs(thrust_n) > CLEAR_N:
                agreed[side].append(command * thrust_n > 0.0)
    for side, votes in enumerate(agreed):  # a motor lags behind a command that has just changed its sign
        assert len(votes) >= 5 and sum(votes) > 0.7 * len(votes), (side, votes)


def becomes_of(trial: Trial) -> str:
    """What becomes of a hold: it goes on, with motors that turn as they are commanded, or it is refused."""
    let_go_s, outputs = trial.hold(4.0)
    if let_go_s is None:
        turns_as_commanded(trial.plant, trial.step)
        return "holds"
    assert outputs.phase is Phase.STANDBY and outputs.health.reason
    return "refused" if let_go_s == 0.0 else "ended"


def is_held_as_it_is_wired_or_refused(values: dict[str, float], output: str) -> None:
    way = f"links.autopilot.output={output}"
    became = becomes_of(Trial(fixed(values, way), DEFAULT_CONTROLLER, way))
    event(became)
    assert became != "ended", "what can be read is not found out by driving"


@settings(SETTINGS, max_examples=3)
@example(values={"SERVO1_REVERSED": 1, "SERVO3_REVERSED": 1}, output="rc_override")
@given(values=wirings(), output=OUTPUTS)
def test_the_port_command_turns_the_port_propeller_ahead_or_no_hold_goes_on(
    values: dict[str, float], output: str
) -> None:
    is_held_as_it_is_wired_or_refused(values, output)


@pytest.mark.thorough
@settings(SETTINGS, max_examples=40)
@given(values=wirings(), output=OUTPUTS)
def test_so_it_is_of_many_wirings(values: dict[str, float], output: str) -> None:
    is_held_as_it_is_wired_or_refused(values, output)


@pytest.mark.parametrize("output", ["rc_override", "manual_control"])
def test_a_blueboat_is_held_as_it_is_wired(output: str) -> None:
    way = f"links.autopilot.output={output}"
    assert becomes_of(Trial(fixed(BLUEBOAT, way), DEFAULT_CONTROLLER, way)) == "holds"


def is_so_with_a_px4(values: dict[str, float]) -> None:
    wired = f"plant.frontseat.parameters={values!r}".replace("'", "")
    loop = Lockstep(load_config("sitl-px4", (wired,)))
    phases = [loop.tick()[1].phase for _ in range(300)]
    if Phase.HOLD not in phases:
        outputs = loop.tick()[1]
        event("refused")
        assert outputs.health.code == Reason.AUTOPILOT_PARAMETER and not loop.plant.frontseat.vehicle.armed
        return
    event("holds")
    assert phases[-1] is Phase.HOLD
    turns_as_commanded(loop.plant, lambda: loop.tick()[1])


@settings(SETTINGS, max_examples=2)
@given(values=px4_wirings())
def test_so_it_is_with_a_px4(values: dict[str, float]) -> None:
    is_so_with_a_px4(values)


@pytest.mark.thorough
@settings(SETTINGS, max_examples=20)
@given(values=px4_wirings())
def test_so_it_is_with_many_a_px4(values: dict[str, float]) -> None:
    is_so_with_a_px4(values)
