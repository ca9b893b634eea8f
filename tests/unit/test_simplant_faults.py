"""The fault schedule, and what each fault does to the boat in loopback."""

from __future__ import annotations

import pytest
from simplant_boat import Boat, of

from asvhil.config import FaultConfig, load_config
from asvhil.errors import ConfigError
from asvhil.simplant.faults import Faults, motor_signals_us

SECOND = 1_000_000_000


def test_spans_begin_with_their_start_and_end_before_their_end() -> None:
    faults = Faults(
        [
            FaultConfig(kind="gnss", from_s=2.0, until_s=4.0),
            FaultConfig(kind="vane", from_s=3.0),
            FaultConfig(kind="gnss", from_s=4.0, until_s=5.0),
        ],
        100,
    )
    seen = [faults.at(100 + round(t_s * SECOND)) for t_s in (0.0, 1.999, 2.0, 3.0, 4.0, 4.999, 5.0, 9e9)]
    none, gnss, vane = set[str](), {"gnss"}, {"vane"}
    assert seen == [none, none, gnss, gnss | vane, gnss | vane, gnss | vane, vane, vane]


def test_the_first_look_may_be_late() -> None:
    assert Faults([FaultConfig(kind="vane", from_s=1.0, until_s=2.0)], 0).at(round(1.5 * SECOND)) == {"vane"}


def test_a_dead_motor_gets_no_signal() -> None:
    assert motor_signals_us((1600, 1700), frozenset()) == (1600, 1700)
    assert motor_signals_us((1600, 1700), frozenset({"port-motor", "vane"})) == (0, 1700)
    assert motor_signals_us((1600, 1700), frozenset({"starboard-motor"})) == (1600, 0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[{kind: keel}]", "plant.faults.0.kind"),
        ("[{kind: vane, from_s: 3, until_s: 3}]", "from_s < until_s must hold"),
        ("[{kind: vane, from_s: -1}]", "plant.faults.0.from_s"),
    ],
)
def test_bad_spans_are_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config("sitl", (f"plant.faults={text}",))


def test_without_faults_nothing_changes() -> None:
    plain, faulty = Boat().armed(), Boat("plant.faults=[{kind: port-motor, from_s: 1000}]").armed()
    for boat in (plain, faulty):
        boat.hold(1700, 1600, 3.0)
    assert plain.plant.truth == faulty.plant.truth


def test_the_port_motor_dies_and_comes_back() -> None:
    boat = Boat("plant.faults=[{kind: port-motor, from_s: 6, until_s: 9}]").armed()
    boat.hold(1700, 1700, 2.0)
    assert boat.plant.truth.outputs_us == (1700, 1700)
    boat.hold(1700, 1700, 2.5)
    assert boat.plant.truth.outputs_us == (0, 1700)
    assert boat.plant.truth.r_radps < -0.05
    boat.hold(1700, 1700, 2.5)
    assert boat.plant.truth.outputs_us == (1700, 1700)


def test_no_fix_leaves_position_and_velocity_as_they_were() -> None:
    boat = Boat("plant.faults=[{kind: gnss, from_s: 6, until_s: 9}]").armed()
    boat.interval(33, 100_000)
    boat.hold(1700, 1700, 2.5)
    frozen = of(boat.run(1.0), "GLOBAL_POSITION_INT")
    assert len(frozen) == 10
    assert len({(message.lat, message.lon, message.vx, message.vy) for message in frozen}) == 1
    boat.hold(1700, 1700, 3.0)
    moving = of(boat.run(1.0), "GLOBAL_POSITION_INT")
    assert len({(message.lat, message.lon) for message in moving}) > 5
    truth = boat.plant.truth
    n_m, _ = boat.plant.origin.to_ned(moving[-1].lat * 1e-7, moving[-1].lon * 1e-7)
    assert n_m == pytest.approx(truth.n_m, abs=0.2)


def test_a_silent_anemometer_and_a_stuck_vane() -> None:
    silent = Boat("plant.faults=[{kind: anemometer, from_s: 1, until_s: 2}]").plant
    times = [frame.t_ns / SECOND for frame in silent.advance(3 * SECOND) if frame.port == "anemometer"]
    assert times == [0.2, 0.4, 0.6, 0.8, 2.0, 2.2, 2.4, 2.6, 2.8, 3.0]

    overrides = ("plant.weather.wind={speed_mps: 5, toward_deg: 180}", "plant.sensors.anemometer.directions=360")
    stuck = Boat("plant.faults=[{kind: vane, from_s: 5}]", *overrides).armed()
    stuck.hold(1900, 1500, 3.0)
    directions = set()
    for _ in range(20):
        stuck.override(1900, 1500)
        stuck.t_ns += SECOND // 10
        directions |= {f.data.split(b",")[1] for f in stuck.plant.advance(stuck.t_ns) if f.port == "anemometer"}
    assert len(directions) == 1
