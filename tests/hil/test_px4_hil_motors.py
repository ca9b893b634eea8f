"""What a PX4's controls do to the boat in HIL, and bytes that are no message."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect as mav
from tests.support.px4_sitl import ARMED, CALM, FAST, FREE, MS, SECOND, Sitl, of, samples_us

# --- motors -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("port", "starboard", "mode", "pulses_us"),
    [
        (0.0, 0.0, ARMED, (1500, 1500)),
        (1.0, -1.0, ARMED, (1900, 1100)),
        (0.5, -0.25, ARMED, (1700, 1400)),
        (7.0, -9.0, ARMED, (1900, 1100)),
        (math.nan, 0.1, ARMED, (1500, 1540)),
        (-1.8, -1.8, ARMED, (1500, 1500)),  # terminated, as PX4 1.16 says it
        (math.inf, -math.inf, ARMED, (1900, 1100)),
        (1.0, 1.0, 1, (0, 0)),  # disarmed
    ],
)
def test_controls_become_pulse_widths(port: float, starboard: float, mode: int, pulses_us: tuple[int, int]) -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(2, port, starboard, mode)
    sitl.wait(4 * MS)
    assert sitl.hil.plant.truth.outputs_us == pulses_us


def test_any_two_controls_can_be_the_motors() -> None:
    sitl = Sitl(FREE, "plant.hil.px4={port_control: 2, starboard_control: 1}")
    sitl.lockstep(2, 0.5, 0.0)
    assert sitl.hil.outputs_us == (1500, 1700)
    with pytest.raises(ConfigError, match="port_control and starboard_control must differ"):
        load_config("sitl", ("plant.hil.px4.port_control=2",))


def test_moored_until_the_controls_have_been_neutral_for_a_while() -> None:
    sitl = Sitl()
    sitl.lockstep(1000, 0.5, 0.5)
    sitl.lockstep(1000)
    assert sitl.hil.plant.moored
    sitl.lockstep(200, 0.5, 0.5)
    sitl.lockstep(1250)
    assert sitl.hil.plant.moored and sitl.hil.plant.truth.n_m == -14.0
    sitl.lockstep(3)
    assert not sitl.hil.plant.moored


def test_time_without_controls_and_time_disarmed_count_as_neutral() -> None:
    """PX4 1.16 sends none while a rover is disarmed: the boat is free by the time that it is armed and driven."""
    sitl = Sitl()
    sitl.wait(4 * SECOND)
    assert sitl.hil.plant.moored
    sitl.wait(2 * SECOND)
    assert not sitl.hil.plant.moored
    sitl = Sitl()
    sitl.lockstep(50, 0.5, 0.5)
    sitl.wait(3 * SECOND)  # silent
    sitl.lockstep(700, mode=1)
    assert not sitl.hil.plant.moored


def test_the_boat_drives() -> None:
    sitl = Sitl(FREE, CALM)
    sitl.lockstep(1000, 0.6, 0.5)
    truth = sitl.hil.plant.truth
    assert truth.n_m > -12.0 and truth.r_radps > 0.02


def test_the_anemometer_speaks_on_its_own_link_meanwhile() -> None:
    sitl = Sitl()
    sitl.lockstep(250)
    assert sitl.ports.count("anemometer") == 5


# --- hostile bytes ----------------------------------------------------------------------------------------------------


def test_frames_may_come_in_pieces_and_with_garbage_between() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(3)
    (sample,) = of(sitl.poll(), "HIL_SENSOR")
    message = mav.MAVLink_hil_actuator_controls_message(sample.time_usec, [0.5] * 16, ARMED, 1)
    data = b"\xfd\x00garbage" + bytes(message.pack(sitl.mav))
    for byte in data[:-1]:
        sitl.send_bytes(bytes([byte]))
    assert samples_us(sitl.poll()) == []
    sitl.send_bytes(data[-1:])
    assert samples_us(sitl.poll()) == [sample.time_usec + 4000]
    assert sitl.hil.outputs_us == (1700, 1700)
    assert sitl.hil.counters.garbage_bytes > 0


FUZZED = Sitl(FREE)


@given(st.binary(max_size=200))
def test_random_bytes_never_raise(data: bytes) -> None:
    FUZZED.send_bytes(data)
    FUZZED.wait(4 * MS)


@given(
    st.integers(0, 2**64 - 1),
    st.lists(st.floats(width=32), min_size=16, max_size=16),
    st.integers(0, 255),
    st.integers(0, 2**64 - 1),
)
def test_any_controls_never_raise(time_us: int, controls: list[float], mode: int, flags: int) -> None:
    FUZZED.send(mav.MAVLink_hil_actuator_controls_message(time_us, controls, mode, flags))
    FUZZED.wait(4 * MS)
    assert all(us in (0, *range(1100, 1901)) for us in FUZZED.hil.outputs_us)


@given(st.lists(st.floats(width=32), min_size=7, max_size=7), st.sampled_from((511, 400)) | st.integers(0, 65535))
def test_commands_with_any_numbers_never_raise(params: list[float], command: int) -> None:
    FUZZED.send(mav.MAVLink_command_long_message(0, 0, command, 0, *params))
    FUZZED.wait(4 * MS)
