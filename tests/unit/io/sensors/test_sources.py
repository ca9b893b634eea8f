"""The choice among sources: priority, fail-over, return, one never mixed with another; and what the config refuses."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from asvhil.config import Config, SourceConfig, SourcesConfig, config_from_json, load_config
from asvhil.errors import ConfigError
from asvhil.io.sensors.sources import SourceChoice, SourceSelector
from asvhil.types import (
    ApparentWind,
    BowWind,
    FrontseatStatus,
    GroundVelocity,
    Heading,
    Measurement,
    Position,
    SpecificForce,
    TrueWind,
    YawRate,
)

S = 1_000_000_000
MS = 1_000_000
NAN = math.nan


def source(name: str, timeout_s: float = 1.0) -> SourceConfig:
    link, message = name.split(".")
    return SourceConfig(link=link, message=message, timeout_s=timeout_s)  # type: ignore[arg-type]


A, B, C = "ins.BINARY", "autopilot.GPS_RAW_INT", "gnss.RMC"


def choice(*names: str, timeout_s: float = 1.0, return_after_s: float = 5.0) -> SourceChoice:
    return SourceChoice(tuple(source(name, timeout_s) for name in names), return_after_s)


def test_a_source_alone_is_always_the_one() -> None:
    only = choice(A)
    assert all(only.offer(t_s * S, A) for t_s in (0, 1, 50, 3600))
    assert not only.offer(3600 * S, B)


def test_the_first_that_speaks_is_used_until_a_better_one_has_been_heard_for_the_return_time() -> None:
    two = choice(A, B)
    assert two.current(0) == "" and two.offer(0, B)
    for tenth in range(1, 100):
        t_ns = tenth * S // 10
        used_a, used_b = t_ns > S and two.offer(t_ns, A), two.offer(t_ns, B)
        assert used_a != used_b
        assert used_a is (t_ns >= 6 * S + S // 10), t_ns


def test_at_the_start_a_better_one_that_is_heard_within_its_time_out_is_used_at_once() -> None:
    two = choice(A, B)
    assert two.offer(0, B) and two.offer(S // 2, B)
    assert two.offer(S, A) and not two.offer(S, B)


def test_a_silent_source_loses_after_its_time_out_and_wins_back_after_the_return_time() -> None:
    two = choice(A, B, timeout_s=0.5)
    seen = []
    for tick in range(400):  # 20 Hz: A is silent from 2 s to 6 s
        t_ns = tick * 50 * MS
        if not 2 * S <= t_ns < 6 * S:
            two.offer(t_ns, A)
        two.offer(t_ns, B)
        if not seen or seen[-1][1] != two.current(t_ns):
            seen.append((t_ns / S, two.current(t_ns)))
    assert seen == [(0.0, A), (2.5, B), (11.0, A)]  # last heard 1.95, 0.5 s later gone; 6.0 and 5 s


def test_a_break_starts_the_return_time_again() -> None:
    two = choice(A, B, timeout_s=0.3)
    two.offer(0, B)
    for tick in range(1, 300):
        t_ns = tick * 50 * MS
        if t_ns % (4 * S) >= S:  # A fails for a second in every four
            assert not two.offer(t_ns, A)
        two.offer(t_ns, B)


def test_when_all_are_silent_none_is_in_use_and_the_best_that_comes_back_is_taken() -> None:
    three = choice(A, B, C)
    for name in (C, B, A):
        three.offer(0, name)
    assert three.current(2 * S) == ""
    assert three.offer(3 * S, C)  # the first to speak
    assert not three.offer(3 * S, B) and three.current(3 * S) == C


def test_fail_over_goes_to_the_best_of_those_alive() -> None:
    three = choice(A, B, C)
    three.offer(0, A)
    for t_ns in range(0, 2 * S, S // 10):
        three.offer(t_ns, C)
        three.offer(t_ns, B)
    assert three.current(2 * S) == B


events = st.lists(st.tuples(st.integers(1, 2 * S), st.sampled_from([A, B, C])), max_size=80)


@given(events)
def test_whatever_happens_the_one_in_use_is_alive_and_only_it_is_taken(history: list[tuple[int, str]]) -> None:
    three = choice(A, B, C)
    heard: dict[str, int] = {}
    t_ns = 0
    for step_ns, name in history:
        t_ns += step_ns
        taken = three.offer(t_ns, name)
        heard[name] = t_ns
        using = three.current(t_ns)
        assert taken is (using == name)
        assert using and t_ns - heard[using] <= S  # someone was heard just now, so someone is in use


# --- measurements ----------------------------------------------------------------------------------------------


def selector(**lists: list[str]) -> SourceSelector:
    quantities = ("position", "velocity", "heading", "yaw_rate", "acceleration", "wind")
    return SourceSelector(
        {quantity: tuple(source(name) for name in lists.get(quantity, [])) for quantity in quantities},  # type: ignore[misc]
        5.0,
    )


PLACE = Position(t_ns=0, lat_deg=1.0, lon_deg=2.0, h_acc_m=0.5)
VELOCITY = GroundVelocity(t_ns=0, vn_mps=3.0, ve_mps=4.0)
HEADING = Heading(t_ns=0, psi_rad=1.0)
RATE = YawRate(t_ns=0, r_radps=0.1)
FORCE = SpecificForce(t_ns=0, ax_mps2=0.1, ay_mps2=0.2)
ALL: list[Measurement] = [PLACE, VELOCITY, HEADING, RATE, FORCE]


@pytest.mark.parametrize("m", ALL)
def test_what_is_used_passes_as_it_is_and_what_is_not_does_not(m: Measurement) -> None:
    chooser = selector(position=[A], velocity=[A], heading=[A], yaw_rate=[A], acceleration=[A])
    assert chooser.select(A, m) is m
    assert chooser.select(B, m) is None


def test_position_and_velocity_of_two_receivers_are_kept_apart() -> None:
    chooser = selector(position=[A], velocity=[B])
    assert [chooser.select(A, m) for m in (PLACE, VELOCITY)] == [PLACE, None]
    assert [chooser.select(B, m) for m in (PLACE, VELOCITY)] == [None, VELOCITY]


def test_heading_and_yaw_rate_of_two_sensors_are_kept_apart() -> None:
    chooser = selector(heading=["gnss.HDG"], yaw_rate=["autopilot.RAW_IMU"], acceleration=["autopilot.RAW_IMU"])
    assert [chooser.select("gnss.HDG", m) for m in (HEADING, RATE)] == [HEADING, None]
    assert [chooser.select("autopilot.RAW_IMU", m) for m in (HEADING, RATE, FORCE)] == [None, RATE, FORCE]


@pytest.mark.parametrize(
    "m",
    [
        Position(t_ns=9, lat_deg=NAN, lon_deg=2.0, h_acc_m=0.5),
        GroundVelocity(t_ns=9, vn_mps=NAN, ve_mps=4.0),
        Heading(t_ns=9, psi_rad=math.inf),
        YawRate(t_ns=9, r_radps=NAN),
        SpecificForce(t_ns=9, ax_mps2=NAN, ay_mps2=0.0),
        ApparentWind(t_ns=9, speed_mps=1.0, from_rad=NAN),
        BowWind(t_ns=9, speed_mps=math.inf, from_rad=0.0),
        TrueWind(t_ns=9, vn_mps=1.0, ve_mps=NAN),
    ],
)
def test_what_is_not_valid_is_silence(m: Measurement) -> None:
    chooser = selector(position=[A], velocity=[A], heading=[A], yaw_rate=[A], acceleration=[A], wind=[A])
    assert chooser.select(A, m) is None
    assert all(name == "" for _, name in chooser.current(9))


@pytest.mark.parametrize(
    "m",
    [
        ApparentWind(t_ns=0, speed_mps=1.0, from_rad=0.0),
        BowWind(t_ns=0, speed_mps=1.0, from_rad=0.0),
        TrueWind(t_ns=0, vn_mps=1.0, ve_mps=0.0),
    ],
)
def test_every_kind_of_wind_has_its_source(m: Measurement) -> None:
    chooser = selector(wind=["gnss.MWD"])
    assert chooser.select("gnss.MWD", m) == m and chooser.select("anemometer.MWV", m) is None


def test_the_status_of_the_autopilot_passes() -> None:
    status = FrontseatStatus(t_ns=0, armed=True, mode="MANUAL", ready=True, rc_us=(), outputs_us=())
    assert selector().select("autopilot.HEARTBEAT", status) is status


def test_switches_are_told_once_and_only_where_there_is_a_choice() -> None:
    chooser = selector(position=[A, B], velocity=[A])
    for name in (B, A):
        chooser.select(name, VELOCITY)
    chooser.select(B, PLACE)
    assert [(s.quantity, s.before, s.after) for s in chooser.switches(0)] == [("position", "", B)]
    assert chooser.switches(S // 2) == []
    assert [(s.quantity, s.before, s.after) for s in chooser.switches(3 * S)] == [("position", B, "")]


# --- config ----------------------------------------------------------------------------------------------------


def config(*overrides: str) -> Config:
    return load_config("sitl-vn300", overrides)


RAW, FUSED = "autopilot.GPS_RAW_INT", "autopilot.GLOBAL_POSITION_INT"


@pytest.mark.parametrize("name", ["field", "field-px4", "sitl", "sitl-px4"])
@pytest.mark.parametrize(
    ("override", "fixes"),
    [
        ("plant.seed=1", [RAW, FUSED]),
        ("links.autopilot.position_source=GLOBAL_POSITION_INT", [FUSED, RAW]),
        ("links.autopilot.streams_hz.GPS_RAW_INT=1", [FUSED]),  # too slow for any time-out of 1 s
        ("links.autopilot.streams_hz.GPS_RAW_INT=0", [FUSED]),
        ("links.autopilot.streams_hz.GLOBAL_POSITION_INT=null", [RAW]),
    ],
)
def test_the_defaults_are_what_the_links_give(name: str, override: str, fixes: list[str]) -> None:
    plain = load_config(name, (override,))
    names = {q: [s.name for s in list_] for q, list_ in plain.sources.resolved(plain.links).items()}
    assert names["position"] == names["velocity"] == fixes
    assert names["heading"] == names["yaw_rate"] == ["autopilot.ATTITUDE"] and names["wind"] == ["anemometer.MWV"]


@pytest.mark.parametrize(
    ("override", "message", "rate_hz"),
    [
        ("sources.wind=[autopilot.WIND]", "WIND", 5.0),
        ("sources.heading=[autopilot.ATTITUDE_QUATERNION]", "ATTITUDE_QUATERNION", 20.0),
        ("sources.position=[{link: autopilot, message: GPS2_RAW, timeout_s: 0.2}]", "GPS2_RAW", 10.0),
        ("sources.wind=[anemometer.MWV, {link: autopilot, message: WIND, timeout_s: 3}]", "WIND", 5.0),
    ],
)
def test_a_listed_message_is_asked_for(override: str, message: str, rate_hz: float) -> None:
    plain, asked = config().links.autopilot.streams_hz, config(override).links.autopilot.streams_hz
    assert message not in plain
    assert asked == {**plain, message: rate_hz}
    assert list(asked) == sorted(asked)
    given = config(override, f"links.autopilot.streams_hz.{message}=12").links.autopilot.streams_hz
    assert given == {**plain, message: 12.0}


def test_a_config_read_back_from_a_log_asks_for_what_it_asked_for() -> None:
    less = config("links.autopilot.streams_hz.RC_CHANNELS=0", "sources.wind=[autopilot.WIND]")
    assert config_from_json(less.canonical_json(), "log") == less


def test_links_that_two_configs_share_keep_their_rates() -> None:
    links = config().links
    rates = dict(links.autopilot.streams_hz)
    wind = SourcesConfig(wind=(SourceConfig(link="autopilot", message="WIND"),))
    asked = Config(vehicle=config().vehicle, links=links, sources=wind)
    assert "WIND" in asked.links.autopilot.streams_hz
    assert links.autopilot.streams_hz == rates


def test_a_word_and_a_mapping_are_the_same_and_survive_the_log() -> None:
    word, mapping = config("sources.wind=[anemometer.MWV]"), config("sources.wind=[{link: anemometer, message: MWV}]")
    assert word == mapping == config_from_json(word.canonical_json(), "log")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("sources.position=[gnss.RMC]", "sources.position.0: gnss.RMC: there is no links.gnss"),
        ("sources.heading=[ins.GNSS1]", "ins.GNSS1 gives no heading; of links.ins can: BINARY, VNINS"),
        ("sources.wind=[ins.BINARY]", "ins.BINARY gives no wind; of links.ins can: nothing"),
        (
            "sources.position=[{link: autopilot, message: GPS_RAW_INT, timeout_s: 0.2}]",
            "comes at 5 Hz: timeout_s of at least 0.4",
        ),
        ("sources.heading=[ins.BINARY, ins.BINARY]", "sources.heading.1: ins.BINARY stands in the list twice"),
        ("sources.heading=[HDT]", "a source is LINK.MESSAGE"),
        ("sources.heading=[radar.HDT]", "sources.heading.0: radar.HDT: there is no links.sensors.radar (links with"),
        ("sources.heading=[{link: ins, message: VNINS, timeout_s: 0}]", "key sources.heading.0.timeout_s"),
        ("sources.headings=[]", "unknown key, did you mean heading?"),
        ("links.ins.endpoint=serial:x", "key links.ins.endpoint"),
        ("sources.return_after_s=-1", "key sources.return_after_s"),
    ],
)
def test_wrong_sources_are_one_line_that_names_the_key(override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config(override)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_reading_goes_on_with_the_time_and_the_place_at_which_it_holds() -> None:
    late = SourceConfig(link="gnss", message="RMC", delay_s=0.2, arm_m=(1.5, -0.4))
    compass = SourceConfig(link="gnss", message="HDG", delay_s=0.05)
    imu = SourceConfig(link="autopilot", message="RAW_IMU", arm_m=(-1.0, 0.0))
    selector = SourceSelector(
        {"position": (late,), "velocity": (late,), "heading": (compass,), "yaw_rate": (imu,), "acceleration": (imu,)},
        0.0,
    )
    place = selector.select("gnss.RMC", Position(t_ns=S, lat_deg=1.0, lon_deg=2.0))
    assert place == Position(t_ns=800 * MS, lat_deg=1.0, lon_deg=2.0, h_acc_m=NAN, arm_m=(1.5, -0.4))
    velocity = selector.select("gnss.RMC", GroundVelocity(t_ns=S, vn_mps=0.1, ve_mps=0.2))
    assert velocity == GroundVelocity(t_ns=800 * MS, vn_mps=0.1, ve_mps=0.2, arm_m=(1.5, -0.4))
    assert selector.select("gnss.HDG", Heading(t_ns=S, psi_rad=1.0)) == Heading(t_ns=950 * MS, psi_rad=1.0)
    assert selector.select("autopilot.RAW_IMU", YawRate(t_ns=S, r_radps=0.3)) == YawRate(t_ns=S, r_radps=0.3)
    force = selector.select("autopilot.RAW_IMU", SpecificForce(t_ns=S, ax_mps2=0.1, ay_mps2=0.2))
    assert force == SpecificForce(t_ns=S, ax_mps2=0.1, ay_mps2=0.2, arm_m=(-1.0, 0.0))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ("sources.position=[{link: autopilot, message: GLOBAL_POSITION_INT, delay_s: 2}]",),
            "sources.position.0: autopilot.GLOBAL_POSITION_INT: delay_s must not be above estimator.ekf.history_s",
        ),
        (
            (
                "sources.position=[{link: autopilot, message: GLOBAL_POSITION_INT, arm_m: [1, 0]}]",
                "sources.velocity=[autopilot.GLOBAL_POSITION_INT]",
            ),
            "sources.velocity.0: autopilot.GLOBAL_POSITION_INT must have the delay_s and arm_m that it has",
        ),
        (
            (
                "sources.position=[{link: autopilot, message: GLOBAL_POSITION_INT, delay_s: 0.8}]",
                "estimator.ekf.stale_after_s=0.8",
            ),
            "sources.position.0: autopilot.GLOBAL_POSITION_INT: delay_s must be below estimator.ekf.stale_after_s",
        ),
        (
            ("sources.wind=[{link: anemometer, message: MWV, delay_s: 0.1}]",),
            "sources.wind.0: anemometer.MWV: wind is taken as of its arrival; leave delay_s out",
        ),
    ],
)
def test_delays_and_places_that_cannot_be_are_refused(overrides: tuple[str, ...], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_config("sitl", overrides)


@pytest.mark.parametrize("value", [1e6, -1e30, 65534.0, 3.4e38, math.inf, math.nan])
def test_what_no_boat_can_have_is_no_reading(value: float) -> None:
    selector = SourceSelector({"yaw_rate": (source(A),), "velocity": (source(A),), "acceleration": (source(A),)}, 5.0)
    assert selector.select(A, YawRate(t_ns=1, r_radps=value)) is None
    assert selector.select(A, GroundVelocity(t_ns=1, vn_mps=0.1, ve_mps=value)) is None
    assert selector.select(A, SpecificForce(t_ns=1, ax_mps2=value, ay_mps2=0.0)) is None
    assert selector.select(A, YawRate(t_ns=2, r_radps=-2.0)) is not None
