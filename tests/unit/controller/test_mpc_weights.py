"""Which weights the MPC chooses, how they change, and the trim against a lasting heading error."""

import numpy as np
import pytest

from asvhil.config import MpcConfig, MpcWeights, load_config
from asvhil.config.registry import CONTROLLERS
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.solvers.sqp import Sqp
from asvhil.controller.station_mpc import StationMpc
from asvhil.operator.tunables import Tunables
from asvhil.types import Station
from tests.support.mpc_bench import HEAVY, LIGHT, MODEL, ORIGIN, air, estimate


def test_weight_sets_change_with_hysteresis():
    """The same boat at 7 m is judged by the far weights on its way in, and by the near ones after being near."""
    seven = estimate((-7.0, 0.0, 0.3, 0, 0, 0, 0, 0))
    outbound = StationMpc(MODEL, MpcConfig(), 0.2)
    outbound.step(estimate((-3.0, 0.0, 0.3, 0, 0, 0, 0, 0)), None, ORIGIN)
    inbound = StationMpc(MODEL, MpcConfig(), 0.2)
    near_cost, far_cost = (c.step(seven, None, ORIGIN).cost for c in (outbound, inbound))
    assert near_cost > 1.2 * far_cost
    outbound.step(estimate((-11.0, 0.0, 0.3, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert outbound.step(seven, None, ORIGIN).cost == pytest.approx(far_cost, rel=0.02)


def test_a_new_station_forgets_that_the_old_one_was_near():
    moved = Station(n_m=7.0, e_m=0.0, psi_rad=0.0)
    at = estimate((0.0, 0.0, 0.3, 0, 0, 0, 0, 0))
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    controller.step(at, None, ORIGIN)
    controller.new_station()
    near_first = controller.step(at, None, moved)
    fresh = StationMpc(MODEL, MpcConfig(), 0.2).step(at, None, moved)
    assert near_first.cost == pytest.approx(fresh.cost, rel=0.02)


def test_the_trim_counters_a_lasting_heading_error_only_when_near_and_is_bounded():
    """Seen through the cost at a boat that is held 0.2 rad off: it grows as the reference moves away, then stops."""
    frozen = {"trim_time_s": 1e9}
    held = estimate((0.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    with_trim = StationMpc(MODEL, MpcConfig(trim_time_s=4.0), 0.2)
    without = StationMpc(MODEL, MpcConfig(**frozen), 0.2)
    ratio = [with_trim.step(held, None, ORIGIN).cost / without.step(held, None, ORIGIN).cost for _ in range(40)]
    waits = 10  # ticks: half of the trim's time
    assert ratio[waits - 1] == 1.0  # the headings of the way in are no lasting error
    assert ratio[waits + 5] > 1.05
    assert ratio[waits + 9] > ratio[waits + 2]
    assert ratio[-1] == pytest.approx(ratio[-5], rel=1e-3)  # 0.1 rad is reached after 10 ticks more
    away = estimate((-20.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    far_trim, far_plain = (StationMpc(MODEL, MpcConfig(**k), 0.2) for k in ({"trim_time_s": 4.0}, frozen))
    for _ in range(5):
        assert far_trim.step(away, None, ORIGIN).cost == far_plain.step(away, None, ORIGIN).cost


def test_the_trim_waits_anew_after_each_time_far_off():
    held, away = estimate((0.0, 0.0, 0.2, 0, 0, 0, 0, 0)), estimate((-20.0, 0.0, 0.2, 0, 0, 0, 0, 0))
    left, stayed = (StationMpc(MODEL, MpcConfig(trim_time_s=4.0), 0.2) for _ in range(2))
    for tick in range(12):
        left.step(away if tick == 6 else held, None, ORIGIN)
        stayed.step(held, None, ORIGIN)
    assert left.trim_rad == 0.0 > stayed.trim_rad


class NotedWeights:
    """A solver that notes the weights of the states after the first stage, and then solves."""

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []

    def __call__(self, problem: StationProblem) -> "NotedWeights":
        self._problem, self._solver = problem, Sqp(problem)
        return self

    def solve(self, parameters, start, iterations):
        self.seen.append(self._problem.unpack_cost(parameters)[0][0])
        return self._solver.solve(parameters, start, iterations)


@pytest.mark.parametrize(
    ("wind", "disturbance", "heading"),
    [
        (air(6.0, 0.0), (0.0, 0.0, 0.0), 1500.0),  # along the boat: nothing to carry sideways
        (air(0.0, 6.0), (0.0, 0.0, 0.0), 200.0),
        (air(-6.0, 0.0), (0.0, 0.05, 0.0), 200.0),  # an unseen push sideways counts as the wind does
        (None, (0.2, 0.0, 0.0), 1500.0),
        (None, (0.0, -0.01, 0.0), 850.0),  # half-way between the two limits
    ],
)
def test_heading_weighs_more_where_there_is_no_side_load_to_carry(wind, disturbance, heading):
    config = MpcConfig(near=LIGHT, along=HEAVY, side_load_mps2=(0.005, 0.015))
    noted = NotedWeights()
    controller = StationMpc(MODEL, config, 0.2, noted)
    assert controller.step(estimate(np.zeros(8), disturbance), wind, ORIGIN).ok
    assert noted.seen[0][2] == pytest.approx(0.2 * heading, rel=1e-6)


def test_a_heading_of_the_weather_has_weights_of_its_own_near_the_station_and_no_trim():
    ours = MpcWeights(heading=30.0)
    of_weather = Station(n_m=0.0, e_m=0.0, psi_rad=0.0, of_weather=True)
    noted = NotedWeights()
    controller = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY, weather=ours, trim_time_s=4.0), 0.2, noted)
    off = estimate((0.0, 0.5, 0.2, 0, 0, 0, 0, 0))
    for _ in range(40):
        controller.step(off, air(0.0, 6.0), of_weather)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 30.0)
    assert controller.trim_rad == 0.0
    for _ in range(40):
        controller.step(off, air(0.0, 6.0), ORIGIN)  # fixed from now on
    assert noted.seen[-1][2] == pytest.approx(0.2 * 200.0)
    assert controller.trim_rad < 0.0
    controller.step(estimate((-20.0, 0.0, 0.2, 0, 0, 0, 0, 0)), None, of_weather)
    assert noted.seen[-1][2] == pytest.approx(0.2 * MpcConfig().far.heading)
    without = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY, weather=None), 0.2, noted)
    without.step(off, air(0.0, 6.0), of_weather)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 200.0)


def test_a_gust_from_abeam_does_not_flip_the_weights():
    noted = NotedWeights()
    controller = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY), 0.2, noted)
    for ve_mps in (0.0, 6.0, 0.0):
        controller.step(estimate(np.zeros(8)), air(3.0, ve_mps), ORIGIN)
    assert all(row[2] > 0.2 * 1450.0 for row in noted.seen)
    for _ in range(200):
        controller.step(estimate(np.zeros(8)), air(3.0, 6.0), ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 200.0)


@pytest.mark.parametrize(("offset_m", "heading"), [(0.1, 1500.0), (0.4, 850.0), (0.7, 200.0)])
def test_off_the_station_heading_gives_way(offset_m, heading):
    noted = NotedWeights()
    controller = StationMpc(MODEL, MpcConfig(near=LIGHT, along=HEAVY, offset_m=(0.2, 0.6)), 0.2, noted)
    controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[0][2] == pytest.approx(0.2 * heading, rel=1e-6)


LASTING = MpcConfig(near=LIGHT, along=HEAVY, offset_m=(0.4, 0.6), lasting_offset_m=(0.1, 0.3))


@pytest.mark.parametrize(("offset_m", "heading"), [(-0.05, 1500.0), (0.2, 850.0), (-0.2, 850.0), (0.35, 200.0)])
def test_heading_gives_way_to_an_offset_that_lasts(offset_m, heading):
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[0][2] == pytest.approx(0.2 * 1500.0, rel=0.03)  # not at once
    for _ in range(200):
        controller.step(estimate((0.0, offset_m, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * heading, rel=0.01)


@pytest.mark.parametrize(
    "offsets",
    [
        lambda k: (0.0, 0.3 * (-1) ** k),  # noise of the position
        lambda k: (0.3, 0.0),  # along the heading, where the motors push
        lambda k: (0.0, 0.35 if k < 5 else 0.0),  # a second of it
    ],
)
def test_heading_is_kept_where_no_offset_across_it_lasts(offsets):
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    for k in range(60):
        controller.step(estimate((*offsets(k), 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert all(row[2] > 0.2 * 1490.0 for row in noted.seen)


def test_another_station_has_no_offset_yet():
    noted = NotedWeights()
    controller = StationMpc(MODEL, LASTING, 0.2, noted)
    for _ in range(100):
        controller.step(estimate((0.0, 0.35, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    controller.new_station()
    controller.step(estimate((0.0, -0.35, 0, 0, 0, 0, 0, 0)), None, ORIGIN)
    assert noted.seen[-1][2] == pytest.approx(0.2 * 1500.0, rel=0.03)


@pytest.mark.parametrize("name", ["side_load_mps2", "offset_m", "lasting_offset_m"])
def test_limits_must_rise(name):
    with pytest.raises(ValueError, match=f"{name} needs two rising"):
        MpcConfig(**{name: (0.9, 0.01)})


@pytest.mark.parametrize("row", CONTROLLERS.find("lagnet-mpc").parameters, ids=lambda row: row.name)
def test_what_an_operator_sets_is_what_the_running_controller_uses(row):
    controller = StationMpc(MODEL, MpcConfig(), 0.2)
    tunables = Tunables(load_config("sitl").controller, controller)
    before = controller.config
    wanted = 0.9 * tunables.value(row.name) or 2.0
    if row.choices:
        wanted = row.least
    assert tunables.set(row.name, wanted) is None
    at = controller.config
    for key in row.path:
        at = getattr(at, key)
    assert controller.config != before and row.on_link(at) == pytest.approx(wanted)


def test_a_station_that_moves_across_its_heading_lets_the_boat_swing():
    """As a lighter heading weight of `near` would, where it moves so; else nothing changes."""
    at = estimate((0.2, -0.5, 0.15, 0, 0, 0, 0, 0))
    near = MpcConfig().near
    as_before = MpcConfig(sideways_heading=None)
    light = MpcConfig(sideways_heading=None, near=near.model_copy(update={"heading": 120.0}))

    def cost(config, vn_mps, ve_mps):
        station = Station(n_m=0.0, e_m=0.0, psi_rad=0.0, vn_mps=vn_mps, ve_mps=ve_mps)
        return StationMpc(MODEL, config, 0.2).step(at, None, station).cost

    assert cost(MpcConfig(), 0.0, 0.3) == cost(light, 0.0, 0.3) < cost(as_before, 0.0, 0.3)
    assert cost(MpcConfig(), 0.3, 0.04) == cost(as_before, 0.3, 0.04)
    assert cost(light, 0.0, -0.1) < cost(MpcConfig(), 0.0, -0.1) < cost(as_before, 0.0, -0.1)
