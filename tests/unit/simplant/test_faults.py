"""The fault schedule, and what each fault does to the boat in loopback."""

from __future__ import annotations

import itertools
import math

import pytest

from asvhil.config import FaultConfig, load_config
from asvhil.config.fault_spans import SOUND, Faults
from asvhil.errors import ConfigError
from asvhil.geo import wrap_rad
from asvhil.simplant.boat.faults import STUCK_US, all_faults, motor_signals_us
from tests.support.simplant_boat import Boat, of

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


@pytest.mark.parametrize(
    ("faults", "signals_us"),
    [
        ((), (1600, 1750)),
        (("port-motor", "vane"), (0, 1750)),
        (("starboard-motor",), (1600, 0)),
        (("port-motor-reversed",), (1400, 1750)),
        (("starboard-motor-reversed",), (1600, 1250)),
        (("port-motor-reversed", "starboard-motor-reversed"), (1400, 1250)),
        (("motors-swapped",), (1750, 1600)),
        (("motors-swapped", "port-motor-reversed"), (1250, 1600)),  # the port motor, on the starboard output
        (("motors-swapped", "port-motor"), (0, 1600)),
        (("port-motor-weak",), (1600, 1750)),
        (("starboard-motor-stuck",), (1600, STUCK_US)),
        (("port-motor-stuck", "port-motor"), (0, 1750)),
    ],
)
def test_what_reaches_the_motors(faults: tuple[str, ...], signals_us: tuple[int, int]) -> None:
    assert motor_signals_us((1600, 1750), frozenset(faults), 1500) == signals_us


def test_no_signal_stays_none_at_a_reversed_motor() -> None:
    assert motor_signals_us((0, 0), frozenset({"port-motor-reversed", "motors-swapped"}), 1500) == (0, 0)


def test_a_weak_motor_has_a_share_of_its_thrust() -> None:
    weak = "plant.faults=[{kind: port-motor-weak, size: 0.25}, {kind: starboard-motor-weak, from_s: 9}]"
    sound, boat = Boat().armed(), Boat(weak).armed()
    for each in (sound, boat):
        each.hold(1700, 1700, 1.0)
    port_n, starboard_n = boat.plant.truth.thrust_n
    assert port_n == pytest.approx(0.25 * sound.plant.truth.thrust_n[0]) and port_n > 1.0
    assert starboard_n == sound.plant.truth.thrust_n[1]


def test_a_turned_compass_shows_at_once_and_on_every_device() -> None:
    """A jump is held off by an autopilot's filter; this one was mounted so."""
    boat = Boat("plant.faults=[{kind: compass-turned, size: 120}]", "plant.sensors.heading.white_deg=0")
    boat.run(1.0)
    assert math.degrees(boat.plant.navigation.psi_rad - boat.plant.truth.psi_rad) == pytest.approx(120.0)
    assert math.degrees(boat.plant.navigation.compass_error_rad) == pytest.approx(120.0)


def test_a_heading_that_drifts_is_off_by_more_and_more_until_it_ends() -> None:
    boat = Boat(
        "plant.faults=[{kind: heading-drift, from_s: 2, until_s: 10, size: -3}]", "plant.sensors.heading.white_deg=0"
    )

    def off_deg() -> float:
        return math.degrees(wrap_rad(boat.plant.navigation.psi_rad - boat.plant.truth.psi_rad))

    boat.run(2.0)
    assert off_deg() == pytest.approx(0.0, abs=0.01)
    boat.run(4.0)
    assert off_deg() == pytest.approx(-12.0, abs=0.5)
    boat.run(3.5)
    assert off_deg() == pytest.approx(-22.5, abs=0.5)
    boat.run(1.0)
    assert off_deg() == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[{kind: keel}]", "plant.faults.0.kind"),
        ("[{kind: vane, from_s: 3, until_s: 3}]", "from_s < until_s must hold"),
        ("[{kind: vane, from_s: -1}]", "plant.faults.0.from_s"),
        ("[{kind: vane, size: 3}]", "only gnss-jump, .* have a size, vane has none"),
        ("[{kind: port-motor-weak, size: 30}]", "a share of the thrust, between 0 and 1"),
        ("[{kind: ins-gnss, device: nmea}]", "a device can be named for .*, not for ins-gnss"),
    ],
)
def test_bad_spans_are_named(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config("sitl", (f"plant.faults={text}",))


def test_faults_of_the_sensors_of_each_device() -> None:
    faults = Faults(
        [
            FaultConfig(kind="gnss-jump", toward_deg=90.0, until_s=10.0),
            FaultConfig(kind="gnss-jump", size=5.0, toward_deg=0.0, device="ins", until_s=10.0),
            FaultConfig(kind="heading-jump", size=-30.0, device="nmea", until_s=10.0),
            FaultConfig(kind="ins-gnss", from_s=5.0, until_s=10.0),
        ],
        0,
    )
    first, later = faults.at(SECOND), faults.at(6 * SECOND)
    assert first.of("autopilot").jump_e_m == pytest.approx(20.0) and first.of("autopilot").turn_rad == 0.0
    assert (first.of("ins").jump_n_m, first.of("ins").jump_e_m) == pytest.approx((5.0, 20.0))
    assert math.degrees(first.of("nmea").turn_rad) == pytest.approx(-30.0)
    assert [later.of(name).gnss_silent for name in ("autopilot", "ins", "nmea")] == [False, True, False]
    assert faults.at(10 * SECOND).of("ins") is SOUND


def glitches(*overrides: str, config: str = "sitl") -> list[FaultConfig]:
    return list(all_faults(load_config(config, ("plant.glitches={}", *overrides)).plant))


def test_glitches_come_from_the_seed_one_after_the_other() -> None:
    found = glitches("plant.faults=[{kind: vane}]")
    assert found[0].kind == "vane" and found[1:] == glitches()
    found = found[1:]
    assert found != glitches("plant.seed=2") and all_faults(load_config("sitl").plant) == ()
    kinds = [fault.kind for fault in found]
    assert sorted(kinds[:8]) == sorted(kinds[8:16]) == sorted(set(kinds))  # each once a round
    assert found[0].from_s > 30.0 and found[-1].to_s <= 3600.0
    gaps = [after.from_s - before.to_s for before, after in itertools.pairwise(found)]
    assert min(gaps) >= 5.0 and 12.0 < sum(gaps) / len(gaps) < 18.0
    jumps = [fault.magnitude for fault in found if fault.kind == "heading-jump"]
    assert set(jumps) == {60.0, -60.0}
    lengths = [fault.to_s - fault.from_s for fault in found if fault.kind == "gnss-frozen"]
    assert min(lengths) >= 2.0 and max(lengths) <= 10.0


def test_glitches_can_be_chosen() -> None:
    one = "plant.glitches={kinds: [{kind: gnss-jump, least_s: 1, most_s: 1, size: 7, device: nmea}], until_s: 100}"
    found = list(all_faults(load_config("sitl-bream", (one,)).plant))
    assert found and {(f.kind, f.size, f.device) for f in found} == {("gnss-jump", 7.0, "nmea")}
    assert all(f.to_s - f.from_s == pytest.approx(1.0) for f in found)
    of_one = glitches("plant.glitches.device=ins", config="sitl-vn300")
    assert {(f.device is None) == f.kind.startswith("anemometer") for f in of_one} == {True}
    with pytest.raises(ConfigError, match=r"plant.glitches.kinds.0: .*least_s <= most_s"):
        load_config("sitl", ("plant.glitches={kinds: [{kind: vane, least_s: 9}]}",))


def test_a_receiver_that_jumps_shows_it_at_once_and_the_autopilots_filter_after_ten_seconds() -> None:
    boat = Boat("plant.faults=[{kind: gnss-jump, from_s: 5, until_s: 17, toward_deg: 0}]").armed()
    boat.interval(24, 200_000)
    boat.interval(33, 100_000)
    north: dict[str, dict[float, float]] = {"GPS_RAW_INT": {}, "GLOBAL_POSITION_INT": {}}
    for t_s, message in boat.run(26.0):
        if message.get_type() in north:
            n_m, _ = boat.plant.origin.to_ned(message.lat * 1e-7, message.lon * 1e-7)
            north[message.get_type()][t_s] = n_m
    raw, fused = north["GPS_RAW_INT"], north["GLOBAL_POSITION_INT"]
    assert {round(n) for t_s, n in raw.items() if 5.4 < t_s < 16.8} == {20}
    assert {round(n) for t_s, n in raw.items() if t_s < 4.9 or t_s > 17.4} == {0}
    assert {round(n) for t_s, n in fused.items() if t_s < 14.9} == {0}
    assert {round(n) for t_s, n in fused.items() if 15.1 < t_s < 26.9} == {20}  # and ten seconds back again
    assert {round(n) for t_s, n in fused.items() if t_s > 27.1} == {0}


def test_the_autopilots_imu_falls_silent() -> None:
    boat = Boat("plant.faults=[{kind: imu-silent, from_s: 6, until_s: 9}]").armed()
    boat.interval(27, 100_000)
    boat.run(6.0 - boat.t_ns / SECOND)
    assert of(boat.run(2.8), "RAW_IMU") == [] and len(of(boat.run(1.2), "RAW_IMU")) == pytest.approx(10, abs=1)


def test_stuck_cups_keep_the_speed_and_a_stuck_anemometer_both() -> None:
    def samples(kind: str) -> list[tuple[bytes, bytes]]:
        wind = "plant.weather.wind={speed_mps: 5, gust_along: 0.5, gust_across: 0.5, gust_time_s: 1}"
        plant = Boat(wind, f"plant.faults=[{{kind: {kind}, from_s: 5}}]").plant
        sent = [f for f in plant.advance(15 * SECOND) if f.port == "anemometer" and f.t_ns >= 5 * SECOND]
        return [(f.data.split(b",")[1], f.data.split(b",")[3]) for f in sent]

    cups, both, sound = samples("cups"), samples("anemometer-stuck"), samples("port-motor")
    assert len({speed for _, speed in cups}) == 1 and len({angle for angle, _ in cups}) > 1
    assert len(set(both)) == 1 and len({speed for _, speed in sound}) > 20


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
