"""The wiring of a boat: its laws by hand, and against the simulated autopilot, which has laws of its own."""

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from asvhil.autopilot import ardurover_wiring, px4_wiring
from asvhil.autopilot.ardurover_parameters import requirements
from asvhil.autopilot.requirements import judge
from asvhil.autopilot.wiring import Motor, Travel, wiring_of_config
from asvhil.config import AutopilotLinkConfig, FrontseatConfig, PwmConfig
from asvhil.simplant.ardurover.rover import Rover

LINK = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0")
PX4 = AutopilotLinkConfig(endpoint="udpin:127.0.0.1:0", profile="px4")
PWM = PwmConfig()
PULSES = (1100, 1237, 1495, 1500, 1502, 1700, 1900)
BLUEBOAT: dict[str, float] = {
    **{"SERVO1_FUNCTION": 74, "SERVO1_MIN": 1100, "SERVO1_TRIM": 1510, "SERVO1_MAX": 1900, "SERVO1_REVERSED": 0},
    **{"SERVO3_FUNCTION": 73, "SERVO3_MIN": 1100, "SERVO3_TRIM": 1510, "SERVO3_MAX": 1900, "SERVO3_REVERSED": 1},
    **{f"RC{n}_{part}": us for n in (1, 3) for part, us in (("MIN", 1100), ("TRIM", 1500), ("MAX", 1900))},
}


def test_a_plain_boat_gets_and_reports_the_pulses_themselves() -> None:
    for wiring in (
        wiring_of_config(PWM),
        ardurover_wiring.wiring_of(LINK, PWM, {}),
        px4_wiring.wiring_of(PX4, PWM, {}),
    ):
        assert wiring.outputs == wiring.channels == (1, 3)
        for us in PULSES:
            assert wiring.to_outputs((us, 1500)) == wiring.to_sticks((us, 1500)) == (us, 1500)
            assert wiring.of_outputs((us, 7, 1500)) == wiring.of_sticks((us, 7, 1500)) == (us, 1500)
    assert wiring.of_outputs((1500, 1500)) is None and wiring.of_outputs((0, 0, 1900)) == (0, 1900)


def test_a_blueboat_by_hand() -> None:
    wiring = ardurover_wiring.wiring_of(LINK, PWM, BLUEBOAT)
    assert wiring.outputs == (3, 1) and wiring.channels == (1, 3)
    assert wiring.to_outputs((1500, 1500)) == (1510, 1510)
    assert wiring.to_outputs((1900, 1900)) == (1100, 1900)  # the port motor goes ahead by short pulses
    assert wiring.to_outputs((1100, 1100)) == (1900, 1100)
    assert wiring.to_outputs((1700, 1700)) == (1305, 1705)  # half of the way from 1510 to 1100, and to 1900
    assert wiring.to_sticks((1700, 1300)) == (1700, 1300)  # the autopilot itself turns the port motor round
    assert wiring.of_outputs((1705, 0, 1305)) == (1700, 1700)
    assert [motor.motor.reversed for motor in wiring.motors] == [True, False]


def test_a_px4_reverses_by_a_bit_and_spreads_over_its_range() -> None:
    values = {"PWM_MAIN_FUNC4": 301.0, "PWM_MAIN_FUNC2": 302.0, "PWM_MAIN_REV": 8.0}
    values |= {"PWM_MAIN_MIN4": 1000.0, "PWM_MAIN_MAX4": 2000.0}
    wiring = px4_wiring.wiring_of(PX4, PWM, values)
    assert wiring.outputs == (4, 2)
    assert [wiring.throttle(0, us) for us in (1900, 1500, 1100)] == [0.8, 0.0, -0.8]
    assert [wiring.throttle(1, us) for us in (1900, 1500, 1100)] == [1.0, 0.0, -1.0]
    assert wiring.to_outputs((1900, 1900)) == (1100, 1900)


def test_the_config_is_stronger_than_what_is_read_and_nonsense_moves_nothing() -> None:
    pwm = PwmConfig.model_validate({"port": {"output": 5, "astern_us": 1900, "neutral_us": 1490, "ahead_us": 1100}})
    wiring = ardurover_wiring.wiring_of(LINK, pwm, BLUEBOAT | {"SERVO5_TRIM": 1600.0})
    assert wiring.outputs == (5, 1) and wiring.motors[0].motor == Motor(astern_us=1900, neutral_us=1490, ahead_us=1100)
    for nonsense in (
        {"SERVO1_TRIM": 1100.0},
        {"SERVO1_TRIM": 0.0, "SERVO1_MIN": 0.0, "SERVO1_MAX": 0.0},
        {"RC1_MIN": 1500.0, "RC1_MAX": 1500.0},
        {"RC1_TRIM": -7.0, "RC1_DZ": 1e9},
        {"RCMAP_ROLL": 0.0, "RCMAP_THROTTLE": 99.0},
        {"RCMAP_ROLL": 3.0, "RCMAP_THROTTLE": 3.0},
    ):
        wiring = ardurover_wiring.wiring_of(LINK, PWM, nonsense)
        assert all(800 <= us <= 2200 for pulse in PULSES for us in wiring.to_sticks((pulse, pulse)))
        assert all(800 <= us <= 2200 for pulse in PULSES for us in wiring.to_outputs((pulse, pulse)))


def test_a_dead_zone_is_stepped_over() -> None:
    stick = Travel(low_us=1000, trim_us=1500, high_us=2000, dead_zone_us=30)
    assert stick.pulse_us(0.0) == 1500 and stick.pulse_us(0.001) > 1530 and stick.pulse_us(-1.0) == 1000
    for fraction in (-1.0, -0.3, 0.0, 0.01, 1.0):
        assert stick.fraction(stick.pulse_us(fraction)) == pytest.approx(fraction)
    assert stick.fraction(1525) == 0.0


@st.composite
def boats(draw: st.DrawFn) -> dict[str, float]:
    outputs, channels = (draw(st.permutations(range(1, 17)))[:2] for _ in range(2))
    values = {"SERVO1_FUNCTION": 0.0, "SERVO3_FUNCTION": 0.0}
    values |= {f"SERVO{n}_FUNCTION": float(function) for n, function in zip(outputs, (73, 74), strict=True)}
    values |= {name: float(n) for name, n in zip(("RCMAP_ROLL", "RCMAP_THROTTLE"), channels, strict=True)}
    for kind, numbers in (("SERVO", outputs), ("RC", channels)):
        for n in numbers:
            trim_us = draw(st.integers(1450, 1550))
            values |= {f"{kind}{n}_TRIM": float(trim_us), f"{kind}{n}_REVERSED": float(draw(st.booleans()))}
            values[f"{kind}{n}_MIN"] = float(draw(st.integers(900, 1100)))
            values[f"{kind}{n}_MAX"] = float(draw(st.integers(1900, 2100)))
    values |= {f"RC{n}_DZ": float(draw(st.sampled_from([0, 0, 30]))) for n in channels}
    return values


@settings(max_examples=300, deadline=None)
@given(values=boats(), port=st.integers(1100, 1900), starboard=st.integers(1100, 1900))
def test_the_motors_of_any_simulated_boat_get_what_was_meant_and_report_it(
    values: dict[str, float], port: int, starboard: int
) -> None:
    rover = Rover(FrontseatConfig(parameters=values), PWM, 0)
    wiring = ardurover_wiring.wiring_of(LINK, PWM, values)
    sticks = wiring.to_sticks((port, starboard))
    rc_us = [1500] * 16
    for channel, stick_us in zip(wiring.channels, sticks, strict=True):
        rc_us[channel - 1] = stick_us
    rover.rc.radio_us[:16] = rc_us
    assert wiring.channels == rover.mapped
    throttles = dict(zip((73, 74), rover.sticks(), strict=True))
    for output in rover.parameters.motor_outputs:
        rover.servo_us[output.number - 1] = output.pulse_us(throttles[output.function])
    # A stick in whole microseconds, over another travel, and an output that ArduPilot cuts toward its trim.
    assert rover.outputs_us == (pytest.approx(port, abs=3), pytest.approx(starboard, abs=3))
    assert wiring.of_outputs(rover.servo_us) == (pytest.approx(port, abs=3), pytest.approx(starboard, abs=3))
    assert wiring.of_sticks(rc_us) == (pytest.approx(port, abs=3), pytest.approx(starboard, abs=3))


# What bends commands on their way: as it should be, and otherwise; the latter seldom where it is always refused.
BENT: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "PILOT_STEER_TYPE": ((1,) * 20, (0, 2, 3)),
    "MOT_THST_ASYM": ((1, 1.2, 1.6, 2.5, 3.0), (3.4,)),
    "MOT_THST_EXPO": ((0, 0.2, -0.3, 0.5, -0.5), (0.7,)),
    "MANUAL_STR_EXPO": ((0,) * 20, (0.3, -0.4)),
    "MOT_THR_MAX": ((100,) * 20, (60, 90)),
    "MOT_THR_MIN": ((0,) * 20, (5, 20)),
    "MOT_SLEWRATE": ((0,) * 20, (100, 400)),
    "MOT_STR_THR_MIX": ((0.2, 0.35, 0.5, 0.6, 0.75, 0.9, 1.0), ()),
    "MANUAL_OPTIONS": ((0,) * 20, (1,)),
}


@settings(max_examples=600, deadline=None, derandomize=True)
@given(
    boat=boats(),
    bent=st.fixed_dictionaries({name: st.sampled_from(right + wrong) for name, (right, wrong) in BENT.items()}),
    pulses=st.lists(st.tuples(st.integers(1100, 1900), st.integers(1100, 1900)), min_size=2, max_size=4),
    firmware=st.sampled_from(["4.6", "4.7"]),
)
def test_what_bends_commands_is_undone_or_refused_by_name(
    boat: dict[str, float], bent: dict[str, float], pulses: list[tuple[int, int]], firmware: str
) -> None:
    """By the simulated rover's own laws: paddles, mixer, asymmetry, thrust curve, travel of sticks and outputs."""
    values = boat | bent | {"FS_THR_VALUE": 0.0}  # no stick of any travel is a lost transmitter
    rover = Rover(FrontseatConfig(parameters=values, firmware=firmware, boot_s=0.0), PWM, 0, lambda: 2.0)
    read = {name: rover.parameters[name] for name in rover.parameters.names}
    refused = [f for f in judge(requirements(LINK, PWM, read), read) if f.wrong and f.requirement.cause is not None]
    wrong = {name for name, (_, refuses) in BENT.items() if bent[name] in refuses}
    wrong |= {name for name, value in boat.items() if name.endswith("_DZ") and value}
    assert {f.name for f in refused} == wrong
    event("refused" if refused else f"asymmetry {bent['MOT_THST_ASYM']}, expo {bent['MOT_THST_EXPO']}")
    if refused:
        return
    wiring = ardurover_wiring.wiring_of(LINK, PWM, read)
    rover.armed = True
    for t_ns, (port, starboard) in enumerate(pulses, start=1):
        rover.begin(t_ns * 20_000_000)
        sticks = dict(zip(wiring.channels, wiring.to_sticks((port, starboard)), strict=True))
        for channel, stick_us in sticks.items():
            rover.rc.set_stick(channel, stick_us)
        rover.end()
        # A whole microsecond of the stick is that much at the output, at the steepest.
        within_us = 3 + 0.5 * 1.35 * wiring.bend.asymmetry / (1.0 - abs(wiring.bend.expo))
        assert rover.outputs_us == (pytest.approx(port, abs=within_us), pytest.approx(starboard, abs=within_us))
        for reported in (wiring.of_outputs(rover.servo_us), wiring.of_sticks(rover.rc.radio_us)):
            assert reported == (pytest.approx(port, abs=within_us), pytest.approx(starboard, abs=within_us))
