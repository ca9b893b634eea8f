"""The plant as a whole: time, determinism, the anemometer's sentences, and hostile bytes."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter

import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import given, settings
from hypothesis import strategies as st
from pynmeagps import NMEAReader

from asvhil.config import Config, load_config
from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.lockstep import Lockstep
from asvhil.simplant.plant import Plant
from asvhil.types import Frame
from tests.support.simplant_boat import CALM, Boat, of

SECOND = 1_000_000_000


def config(*overrides: str) -> Config:
    return load_config("sitl", overrides)


def drive(plant: Plant, chunk_ns: int, seconds: int = 8) -> list[Frame]:
    """The same companion at the same instants, with time handed on in chunks of any size."""
    link = mav.MAVLink(None, srcSystem=1, srcComponent=191)
    inputs = {
        4 * SECOND: mav.MAVLink_command_long_message(1, 1, 511, 0, 30, 50_000, 0, 0, 0, 0, 0),
        4 * SECOND + 1: mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
    }
    for k in range(20):
        t_ns = 5 * SECOND + k * 100_000_000
        inputs[t_ns] = mav.MAVLink_rc_channels_override_message(1, 1, 1700, 65535, 1600, *[65535] * 5)
    for t_ns, message in inputs.items():
        plant.receive(Frame(t_ns=t_ns, port="autopilot", data=message.pack(link), peer="companion"))
    sent = []
    for t_ns in range(chunk_ns, seconds * SECOND + 1, chunk_ns):
        sent += plant.advance(t_ns)
    return sent


def test_same_config_and_inputs_give_the_same_bytes() -> None:
    first, second = (drive(Plant(config(), 0), 50_000_000) for _ in range(2))
    assert first == second
    assert len(first) > 150 and {frame.port for frame in first} == {"autopilot", "anemometer"}


def test_the_size_of_the_steps_in_time_changes_nothing() -> None:
    assert drive(Plant(config(), 0), 10_000_000) == drive(Plant(config(), 0), SECOND)


def test_another_seed_gives_other_bytes_but_as_many() -> None:
    first, second = drive(Plant(config(), 0), SECOND), drive(Plant(config("plant.seed=2"), 0), SECOND)
    assert len(first) == len(second)
    assert first != second


def test_power_on_at_another_time_shifts_everything() -> None:
    epoch = 1_700_000_000_000_000_123
    here, there = Plant(config(), 0).advance(5 * SECOND), Plant(config(), epoch).advance(epoch + 5 * SECOND)
    assert [(f.t_ns, f.data) for f in here] == [(f.t_ns - epoch, f.data) for f in there]


def test_what_is_asked_of_the_link_does_not_change_the_sea() -> None:
    quiet, chatty = Plant(config(), 0), Plant(config(), 0)
    message = mav.MAVLink_command_long_message(1, 1, 511, 0, 24, 50_000, 0, 0, 0, 0, 0)
    data = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=191))
    chatty.receive(Frame(t_ns=2 * SECOND, port="autopilot", data=data))
    sentences = [[f for f in plant.advance(20 * SECOND) if f.port == "anemometer"] for plant in (quiet, chatty)]
    assert quiet.truth == chatty.truth
    assert sentences[0] == sentences[1]


def test_time_never_runs_beyond_what_is_asked_and_frames_are_in_order() -> None:
    plant = Plant(config(), 0)
    t_ns = 0
    for add_ns in itertools.islice(itertools.cycle((3_000_000, 17_999_999, 41, 250_000_000)), 100):
        t_ns += add_ns
        frames = plant.advance(t_ns)
        assert t_ns - 10_000_000 < plant.truth.t_ns <= t_ns
        assert all(frame.t_ns <= t_ns for frame in frames)
        assert [frame.t_ns for frame in frames] == sorted(frame.t_ns for frame in frames)
    assert plant.advance(t_ns - SECOND) == []  # time does not run back
    assert plant.truth.t_ns > t_ns - 10_000_000


def test_a_frame_is_not_acted_upon_before_its_time() -> None:
    boat = Boat().ready()
    boat.t_ns += SECOND
    boat.send(mav.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0))
    boat.t_ns -= SECOND
    acks = [t for t, m in boat.run(2.0) if m.get_type() == "COMMAND_ACK"]
    assert acks == [4.5]


def test_truth_at_power_on_is_the_configured_start() -> None:
    truth = Plant(config("plant.start_heading_deg=30"), 77).truth
    assert (truth.t_ns, truth.n_m, truth.e_m, truth.outputs_us) == (77, -14.0, -3.0, (0, 0))
    assert truth.psi_rad == pytest.approx(math.radians(30.0))
    assert (truth.u_mps, truth.v_mps, truth.r_radps, truth.thrust_n) == (0.0, 0.0, 0.0, (0.0, 0.0))


def test_truth_velocity_is_over_ground() -> None:
    boat = Boat("plant.weather.current={speed_mps: 0.4, toward_deg: 90}", "plant.start_heading_deg=90")
    boat.run(1.0)
    assert boat.plant.truth.u_mps == pytest.approx(0.4, abs=0.01)
    assert boat.plant.truth.e_m == pytest.approx(0.4, abs=0.01)


def test_the_plant_may_have_other_physics_than_the_vehicle_that_the_model_believes_in() -> None:
    heavier = config(*CALM).vehicle.vessel.model_dump() | {"mass_kg": 1000.0}
    tree = config(*CALM).model_dump()
    tree["plant"]["vessel"] = heavier
    plain, heavy = Boat().armed(), Boat()
    heavy.plant = Plant(Config.model_validate(tree), 0)
    heavy.armed()
    for boat in (plain, heavy):
        boat.hold(1800, 1800, 2.0)
    assert 0.0 < heavy.plant.truth.u_mps < 0.5 * plain.plant.truth.u_mps


def test_other_motor_outputs_move_with_the_config() -> None:
    boat = Boat("vehicle.pwm.port.output=3", "vehicle.pwm.starboard.output=1").armed()
    boat.hold(1700, 1500, 3.0)  # the stick of channel 1 is the port motor's, which now hangs on output 3
    assert boat.plant.truth.outputs_us == (1700, 1500)
    assert boat.plant.truth.r_radps > 0.0


def test_the_anemometer_speaks_from_power_on_at_its_rate() -> None:
    boat = Boat("plant.weather.wind={speed_mps: 5, toward_deg: 180, gust_along: 0, gust_across: 0}")
    frames = [frame for frame in boat.plant.advance(10 * SECOND) if frame.port == "anemometer"]
    assert [frame.t_ns for frame in frames] == [k * SECOND // 5 for k in range(1, 51)]
    assert frames[0].data == b"$WIMWV,0.0,R,4.99,M,A*14\r\n"  # the boat has begun to drift
    assert all(NMEAReader.parse(frame.data).msgID == "MWV" for frame in frames)


@pytest.mark.parametrize(("rate_hz", "expected"), [(1.0, 10), (3.0, 30), (7.5, 75), (20.0, 200), (300.0, 1000)])
def test_anemometer_rates_do_not_drift_and_end_at_the_step(rate_hz: float, expected: int) -> None:
    plant = Plant(config(f"plant.sensors.anemometer.rate_hz={rate_hz}"), 0)
    assert Counter(f.port for f in plant.advance(10 * SECOND))["anemometer"] == expected


def test_bytes_for_another_port_are_ignored() -> None:
    boat = Boat().ready()
    message = mav.MAVLink_command_long_message(1, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0)
    data = message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=191))
    boat.plant.receive(Frame(t_ns=boat.t_ns, port="anemometer", data=data))
    assert of(boat.run(0.1), "COMMAND_ACK") == []


def test_a_flood_is_dropped_and_counted() -> None:
    boat = Boat().ready()
    for _ in range(1500):
        boat.plant.receive(Frame(t_ns=boat.t_ns, port="autopilot", data=b"x", peer="flood"))
    boat.run(0.02)
    assert boat.seat.dropped == 500


HANDLED = (11, 21, 20, 23, 66, 69, 70, 75, 76, 111)
FUZZED = Plant(load_config("sitl"), 0)
FUZZED.advance(4 * SECOND)


def raw_frame(msg_id: int, payload: bytes, system: int, component: int) -> bytes:
    """A frame whose checksum holds, whatever its payload says."""
    header = bytes([len(payload), 0, 0, 0, system, component]) + msg_id.to_bytes(3, "little")
    crc = mcrf4xx(header + payload + bytes([mav.mavlink_map[msg_id].crc_extra]))
    return b"\xfd" + header + payload + crc.to_bytes(2, "little")


def step_the_fuzzed(data: bytes) -> None:
    t_ns = FUZZED.truth.t_ns
    FUZZED.receive(Frame(t_ns=t_ns, port="autopilot", data=data, peer="fuzz"))
    FUZZED.advance(t_ns + 20_000_000)
    assert all(1000 <= us <= 2000 for us in FUZZED.frontseat.outputs_us) or FUZZED.frontseat.outputs_us == (0, 0)


@given(st.binary(max_size=300))
def test_random_bytes_never_raise(data: bytes) -> None:
    step_the_fuzzed(data)


@settings(max_examples=400)
@given(
    st.sampled_from(HANDLED),
    st.binary(min_size=1, max_size=60),
    st.sampled_from((b"", b"\x01", b"\x01\x01")),
    st.integers(0, 255),
)
def test_well_formed_frames_with_random_contents_never_raise(
    msg_id: int, payload: bytes, ending: bytes, component: int
) -> None:
    step_the_fuzzed(raw_frame(msg_id, payload + ending, 1, component))


@settings(max_examples=400)
@given(
    st.lists(st.floats(width=32), min_size=7, max_size=7),
    st.sampled_from((511, 510, 512, 520, 176, 400, 183, 246)) | st.integers(0, 65535),
)
def test_commands_with_any_numbers_never_raise(params: list[float], command: int) -> None:
    message = mav.MAVLink_command_long_message(1, 1, command, 0, *params)
    step_the_fuzzed(message.pack(mav.MAVLink(None, srcSystem=1, srcComponent=191)))


@pytest.mark.parametrize("port", ["anemometer", "gnss", "ins"])
def test_the_boat_has_no_sensor_that_nobody_reads(port: str) -> None:
    """A config that takes a link from its base leaves the boat's end of the line there."""
    lines = {name: f"pty:{name}" for name in ("anemometer", "gnss", "ins")}
    read = [f"links.{name}.endpoint=pty:x" for name in lines if name != port]
    lockstep = Lockstep(config(f"plant.links={json.dumps(lines)}", f"links.{port}=null", *read))
    ports = {frame.port for _ in range(60) for frame in lockstep.tick()[0].frames}
    assert ports == {"autopilot", *lines} - {port}
