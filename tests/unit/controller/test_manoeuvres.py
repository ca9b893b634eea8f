"""The programme of data collection: what it drives, its fence, its end, and that it is a pure function of estimates."""

import dataclasses
import math

import numpy as np
import pytest

from asvhil.backseat.build import build_controller, build_model
from asvhil.config import ManoeuvresConfig, load_config
from asvhil.controller.human_operator import LEVEL, HumanOperator
from asvhil.controller.manoeuvres import ZIGZAG_RAD, Block, Manoeuvres, programme
from asvhil.controller.station_mpc import StationMpc
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Control, Estimate, Phase, Station

CONFIG = load_config("sitl", ("controller.name=sd-mpc",))
MODEL = build_model(CONFIG)
STATION = Station(n_m=5.0, e_m=-5.0, psi_rad=0.0)
MPC = StationMpc(MODEL, CONFIG.controller.mpc, 0.2)
KINDS = {"straight", "circle", "zigzag", "steps", "drift", "manual"}


def at(t_s: float, distance_m: float = 0.0, psi_rad: float = 0.0, **speed: float) -> Estimate:
    return Estimate(
        t_ns=round(1e9 * (100.0 + t_s)),
        n_m=STATION.n_m + distance_m,
        e_m=STATION.e_m,
        psi_rad=psi_rad,
        u_mps=speed.get("u_mps", 0.0),
        v_mps=0.0,
        r_radps=speed.get("r_radps", 0.0),
        motor=(0.0, 0.0),
        std=(0.1,) * 6,
        disturbance=(0.0, 0.0, 0.0),
        valid=True,
    )


def manoeuvres(**keys: float) -> Manoeuvres:
    return Manoeuvres(ManoeuvresConfig(**keys), MPC)


def wander(t_s: float) -> Estimate:
    return at(t_s, 4.0 * math.sin(0.2 * t_s), 0.5 * math.sin(0.3 * t_s), u_mps=0.8 * math.cos(0.2 * t_s))


def drive(controller: Manoeuvres, seconds: float, later_s: int = 0) -> list[Control]:
    seen = [wander(0.2 * k) for k in range(round(5 * seconds))]
    later = [dataclasses.replace(estimate, t_ns=estimate.t_ns + later_s * 10**9) for estimate in seen]
    return [controller.step(estimate, None, STATION) for estimate in later]


def test_a_cycle_has_every_manoeuvre_and_a_share_of_manual_station_keeping() -> None:
    blocks = programme(1.0, np.random.default_rng(1))
    spent = {kind: sum(b.duration_s for b in blocks if b.kind == kind) for kind in KINDS}
    assert {b.kind for b in blocks} == KINDS
    assert 400.0 < sum(spent.values()) < 440.0
    assert min(spent.values()) >= 40.0 and spent["manual"] == pytest.approx(108.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_each_cycle_has_all_turns_before_its_drifts(seed: int) -> None:
    kinds = [b.kind for b in programme(1.0, np.random.default_rng(seed))]
    first = kinds.index("drift")
    assert kinds[first:] == ["drift"] * 3 + ["manual"]
    assert kinds[:first].count("circle") == 6 and kinds[:first].count("zigzag") == 3


def test_in_a_drift_the_motors_are_off_after_a_turn_that_is_another_one_each_time() -> None:
    drifts = [block for block in programme(900.0, np.random.default_rng(1)) if block.kind == "drift"]
    assert len(drifts) >= 6
    for block in drifts:
        (_, port, starboard), (off_s, *off) = block.pieces
        assert port == -starboard != 0.0 and off == [0.0, 0.0] and off_s >= 20.0
    turns = {block.pieces[0][0] * math.copysign(1.0, block.pieces[0][1]) for block in drifts}
    assert len(turns) == len(drifts) and min(turns) < -1.0 and max(turns) > 1.0


def test_the_programme_lasts_as_long_as_asked_and_its_order_comes_from_the_seed() -> None:
    def kinds(seed: int) -> list[Block]:
        return list(programme(900.0, np.random.default_rng(seed)))

    assert sum(block.duration_s for block in kinds(1)) >= 900.0
    assert kinds(1) == kinds(1)
    assert [b.kind for b in kinds(1)] != [b.kind for b in kinds(2)]


def test_the_same_estimates_give_the_same_commands_and_reset_begins_anew() -> None:
    one, two = manoeuvres(), manoeuvres()
    first = drive(one, 310.0)
    assert first == drive(two, 310.0)
    one.reset()
    assert drive(one, 310.0, later_s=777) == first  # the time of day does not matter
    assert first != drive(manoeuvres(seed=2), 310.0)


def test_commands_cover_both_motors_both_ways_and_the_dead_band() -> None:
    commands = np.array([control.command for control in drive(manoeuvres(), 600.0)])
    assert np.abs(commands).max() <= 1.0
    for motor in commands.T:
        counts, _ = np.histogram(motor, bins=[-1.0, -0.6, -0.2, 0.1, 0.4, 0.7, 1.0])
        assert (counts > 0.05 * len(motor)).all(), counts
    assert (commands[:, 0] * commands[:, 1] < -0.05).mean() > 0.1


def test_the_command_limit_holds() -> None:
    commands = np.array([control.command for control in drive(manoeuvres(max_command=0.4), 300.0)])
    assert np.abs(commands).max() == pytest.approx(0.4)


def test_the_zigzag_reverses_where_the_heading_is_reached() -> None:
    controller = manoeuvres()
    controller.blocks = (Block(kind="zigzag", duration_s=1000.0, surge=0.5, turn=0.3),)
    psi_rad, sides, headings = 3.1, [], []  # across the wrap
    for k in range(300):
        port, starboard = controller.step(at(0.2 * k, psi_rad=math.remainder(psi_rad, math.tau)), None, STATION).command
        assert port + starboard == pytest.approx(1.0)
        sides.append(math.copysign(1.0, port - starboard))
        psi_rad += sides[-1] * math.radians(2.0)
        headings.append(psi_rad - 3.1)
    assert 10 <= np.count_nonzero(np.diff(sides)) <= 20
    assert max(headings) == pytest.approx(ZIGZAG_RAD, abs=0.08) and min(headings) == pytest.approx(
        -ZIGZAG_RAD, abs=0.08
    )


def test_the_human_operator_reacts_late_and_in_coarse_steps() -> None:
    hand = HumanOperator(np.random.default_rng(4), reaction_s=0.4)
    before, after = at(0.0, 0.0), -25.0  # the boat jumps 25 m south of the station at 20 s
    pushed_s = None
    levels = set()
    for k in range(600):
        t_s = 0.05 * k
        surge, turn = hand.step(at(t_s, after) if t_s >= 20.0 else at(t_s, 0.0), STATION)
        levels |= {surge, turn}
        if t_s >= 20.0 and surge >= 0.9 and pushed_s is None:
            pushed_s = t_s - 20.0
    assert before.valid and pushed_s is not None and 0.39 <= pushed_s <= 2.0
    assert all(level / LEVEL == pytest.approx(round(level / LEVEL)) for level in levels) and len(levels) > 3


def test_beyond_the_fence_the_programme_waits_and_goes_on_where_it_was() -> None:
    controller = manoeuvres(geofence_radius_m=20.0, return_fraction=0.5)
    controller.blocks = tuple(Block(kind="circle", duration_s=10.0, pieces=((10.0, 0.1 * i, 0.0),)) for i in range(9))

    def command(t_s: float, distance_m: float) -> tuple[float, float]:
        control = controller.step(at(t_s, distance_m), None, STATION)
        assert control.ok
        return control.command

    for k in range(120):  # 24 s: 4 s into the third block
        command(0.2 * k, 5.0)
    assert command(24.0, 5.0) == (0.2, 0.0)
    MPC.reset()
    expected = MPC.step(at(24.2, 20.5), None, STATION)
    assert controller.step(at(24.2, 20.5), None, STATION).command == expected.command != (0.2, 0.0)
    assert controller.stage == "return"
    for k in range(80):  # 16 s inside the radius, but not yet near enough
        command(24.4 + 0.2 * k, 11.0)
        assert controller.stage == "return"
    assert command(40.4, 9.5) == (0.2, 0.0)
    for k in range(28):
        command(40.6 + 0.2 * k, 9.5)
    assert command(46.4, 9.5) == pytest.approx((0.3, 0.0))


@pytest.mark.parametrize(("distance_m", "after_s"), [(40.5, 0.0), (25.0, 30.2)])
def test_a_boat_that_does_not_come_back_is_given_up_until_reset(distance_m: float, after_s: float) -> None:
    controller = manoeuvres(geofence_radius_m=20.0, return_timeout_s=30.0)
    assert controller.step(at(0.0), None, STATION).ok
    for t_s in np.arange(0.2, 30.0, 2.0 if after_s else 100.0):
        last = controller.step(at(float(t_s), distance_m), None, STATION)
    assert last.ok is (after_s > 0.0)
    for later_s in (0.2 + after_s, 0.4 + after_s):
        lost = controller.step(at(later_s, distance_m), None, STATION)
        assert not lost.ok and lost.command == (0.0, 0.0)
    assert controller.stage == "out"
    assert not controller.step(at(40.0, 0.0), None, STATION).ok  # drifting back in does not start the motors
    controller.reset()
    assert controller.step(at(41.0), None, STATION).ok


def test_an_estimate_that_is_not_finite_gives_no_command() -> None:
    control = manoeuvres().step(at(0.0, math.nan), None, STATION)
    assert not control.ok and control.command == (0.0, 0.0)


def test_at_the_end_the_station_is_kept() -> None:
    controller = manoeuvres(duration_s=10.0)
    drive(controller, 10.0)
    assert not controller.done
    MPC.reset()
    expected = MPC.step(at(10.0, 3.0), None, STATION).command
    assert controller.step(at(10.0, 3.0), None, STATION).command == expected
    assert controller.done and controller.stage == "done"


def test_in_the_loop_the_geofence_holds_the_boat_and_the_states_are_covered() -> None:
    config = load_config(
        "sitl",
        (
            "controller.name=manoeuvres",
            "controller.manoeuvres.geofence_radius_m=16",
            "controller.manoeuvres.duration_s=160",
            "plant.weather.wind.speed_mps=4",
            "plant.start_n_m=-5",
        ),
    )
    assert isinstance(build_controller(config, MODEL), Manoeuvres)
    loop = Lockstep(config)
    truth, far = [], []
    for tick in range(160 * 20):
        _, outputs = loop.tick()
        if tick > 5 * 20:
            assert outputs.phase is Phase.HOLD, outputs.health.reason
        truth.append((loop.plant.truth.u_mps, loop.plant.truth.v_mps, loop.plant.truth.r_radps))
        far.append(math.hypot(loop.plant.truth.n_m, loop.plant.truth.e_m))
    assert 16.0 < max(far) < 27.0  # it went to the fence, and came back each time
    low, high = np.min(truth, axis=0), np.max(truth, axis=0)
    assert (low < [-0.8, -0.3, -0.25]).all() and (high > [1.2, 0.3, 0.25]).all(), (low, high)
