"""The station keeping procedure: stages, their least duration, and the hand-over between them."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.backseat.build import build_controller, build_model
from asvhil.config import MpcConfig, MpcWeights, ProcedureConfig, load_config
from asvhil.controller.procedure import Procedure
from asvhil.controller.solvers.problem import StationProblem
from asvhil.controller.station_mpc import StationMpc
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.errors import ConfigError
from asvhil.geo import wrap_rad
from asvhil.types import Control, Estimate, Station, Wind

VESSEL = load_config("sitl").vehicle.vessel
ORIGIN = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)


class Idle:
    """A keeper that keeps its motors still and counts."""

    def __init__(self) -> None:
        self.steps = self.resets = self.stations = 0
        self.position_only: list[bool] = []

    def step(self, estimate: Estimate, wind: Wind | None, station: Station) -> Control:
        self.steps += 1
        return Control(command=(0.11, 0.22), ok=True, iterations=3, cost=4.0, plan=((0.0, 1.0, 2.0, 3.0),))

    def new_station(self) -> None:
        self.stations += 1

    def reset(self) -> None:
        self.steps, self.resets = 0, self.resets + 1

    def favour_position(self, on: bool) -> None:
        self.position_only.append(on)


def at(distance_m: float, t_s: float, psi_rad: float = 0.0, bearing_rad: float = math.pi, **more) -> Estimate:
    return Estimate(
        t_ns=round(t_s * 1e9),
        n_m=distance_m * math.cos(bearing_rad),
        e_m=distance_m * math.sin(bearing_rad),
        psi_rad=psi_rad,
        **{"u_mps": 0.0, "v_mps": 0.0, "r_radps": 0.0, "disturbance": (0.0, 0.0, 0.0)} | more,
        motor=(0.0, 0.0),
        std=(0.1,) * 6,
        valid=True,
    )


def procedure(**changes) -> tuple[Procedure, Idle]:
    keeper = Idle()
    return Procedure(ProcedureConfig(**changes), VESSEL, keeper, keeper.favour_position), keeper


def stages(subject: Procedure, distances_m, period_s: float = 1.0) -> list[str]:
    return [subject.step(at(distance_m, i * period_s), None, ORIGIN).stage for i, distance_m in enumerate(distances_m)]


# --- stages --------------------------------------------------------------------------------------------------


def test_near_the_station_the_keeper_has_the_motors_at_once():
    subject, keeper = procedure()
    control = subject.step(at(14.9, 0.0), None, ORIGIN)
    assert control == Control(
        command=(0.11, 0.22), ok=True, iterations=3, cost=4.0, plan=((0.0, 1.0, 2.0, 3.0),), stage="keep_heading"
    )
    assert keeper.steps == 1


def test_from_far_it_approaches_and_hands_over_inside_r_s():
    subject, keeper = procedure()
    subject.step(at(60.0, 0.0), None, ORIGIN)
    before = keeper.resets
    assert stages(subject, [60.0] * 20 + [15.1, 14.9, 16.0, 19.9]) == ["approach"] * 21 + ["keep_heading"] * 3
    assert keeper.steps == 3 and keeper.resets == before + 1


def test_beyond_r_d_it_starts_over():
    subject, keeper = procedure()
    assert stages(subject, [5.0] * 11 + [20.1, 19.0, 14.0]) == ["keep_heading"] * 11 + ["recover"] * 3
    # It was entered at 11 s, so nothing changes before 21 s.
    assert [subject.step(at(14.8, t_s), None, ORIGIN).stage for t_s in (20.9, 21.0)] == ["recover", "keep_heading"]
    assert keeper.steps == 1


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.0, 40.0), min_size=1, max_size=60),
    st.sampled_from([0.2, 1.0, 3.0]),
    st.booleans(),
)
def test_whatever_the_distances_no_two_changes_come_within_the_dwell(distances_m, period_s, rule):
    subject, _ = procedure(r_h_rule=rule)
    seen = stages(subject, distances_m, period_s)
    changes = [0.0] + [i * period_s for i in range(1, len(seen)) if seen[i] != seen[i - 1]]
    assert all(b - a >= 10.0 - 1e-6 for a, b in itertools.pairwise(changes))


def test_noise_at_a_border_changes_the_stage_once():
    rng = np.random.default_rng(1)
    subject, _ = procedure(dwell_s=0.0)
    seen = stages(subject, (15.5 + rng.normal(0.0, 0.5, 500)).tolist(), 0.2)
    assert seen[0] == "approach" and seen[-1] == "keep_heading"
    assert sum(a != b for a, b in itertools.pairwise(seen)) == 1


def test_the_r_h_rule_forgets_the_heading_outside_and_has_hysteresis():
    subject, keeper = procedure(r_h_rule=True, r_h_m=4.0, r_h_back=0.5, dwell_s=0.0)
    seen = stages(subject, [30.0, 12.0, 3.0, 1.9, 3.9, 4.1, 2.1, 1.9])
    assert seen == ["approach", *["keep_position"] * 2, *["keep_heading"] * 2, *["keep_position"] * 2, "keep_heading"]
    assert keeper.position_only == [True, False, True, False]


def test_without_the_rule_or_without_a_keeper_that_has_it_heading_always_counts():
    subject, keeper = procedure(r_h_rule=False, dwell_s=0.0)
    assert stages(subject, [14.0, 1.0, 14.0]) == ["keep_heading"] * 3 and keeper.position_only == []
    plain = Procedure(ProcedureConfig(r_h_rule=True), VESSEL, Idle())
    assert stages(plain, [14.0, 1.0, 14.0]) == ["keep_heading"] * 3


def test_a_new_station_or_a_reset_begins_anew():
    subject, _ = procedure()
    assert stages(subject, [1.0, 1.0]) == ["keep_heading"] * 2
    far = Station(n_m=50.0, e_m=0.0, psi_rad=1.0)
    subject.new_station()
    assert subject.step(at(1.0, 2.0), None, far).stage == "approach"
    subject.reset()
    assert subject.stage is None
    assert subject.step(at(1.0, 3.0), None, ORIGIN).stage == "keep_heading"


def test_the_keeper_begins_anew_where_a_new_station_ends_an_approach():
    """Its plan and last input are of a time before the approach, whatever ends that."""
    subject, keeper = procedure()
    stages(subject, [1.0, 1.0])
    before = keeper.resets
    far = Station(n_m=50.0, e_m=0.0, psi_rad=1.0)
    subject.new_station()
    assert subject.step(at(1.0, 2.0), None, far).stage == "approach"
    subject.new_station()
    assert subject.step(at(1.0, 60.0), None, ORIGIN).stage == "keep_heading"
    assert keeper.resets == before + 1
    near = Station(n_m=0.0, e_m=2.0, psi_rad=0.0)
    subject.new_station()
    assert subject.step(at(1.0, 61.0), None, near).stage == "keep_heading"
    assert keeper.resets == before + 1  # it has had the motors all the while
    assert keeper.stations == 3


@pytest.mark.parametrize("change", [{"u_mps": math.nan}, {"disturbance": (0.0, math.inf, 0.0)}, {"psi_rad": math.nan}])
def test_what_is_not_finite_is_refused(change):
    subject, _ = procedure()
    control = subject.step(dataclasses.replace(at(60.0, 0.0), **change), None, ORIGIN)
    assert not control.ok and control.command == (0.0, 0.0)


def test_the_radii_must_be_in_order():
    with pytest.raises(ConfigError, match="r_h_m < r_s_m < r_d_m"):
        load_config("sitl", ("controller.procedure.r_s_m=25",))


# --- the path --------------------------------------------------------------------------------------------------


def test_the_plan_is_the_path_ahead_to_the_station():
    station = Station(n_m=0.0, e_m=0.0, psi_rad=1.0)
    subject, _ = procedure()
    plan = np.array(subject.step(at(60.0, 0.0, psi_rad=0.5), None, station).plan)
    assert plan[0] == pytest.approx([0.0, -60.0, 0.0, 0.5], abs=1e-9)
    assert plan[-1, 1:] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert len(plan) <= 26 and (np.diff(plan[:, 0]) > 0.0).all()


def test_off_the_path_it_plans_anew_but_not_all_the_time():
    subject, _ = procedure()
    first = subject.step(at(60.0, 0.0), None, ORIGIN).plan
    assert first[0][2] == pytest.approx(0.0, abs=1e-6)
    at_60_m_abeam = dataclasses.replace(at(60.0, 1.0), e_m=-7.0)
    soon = subject.step(at_60_m_abeam, None, ORIGIN).plan
    assert soon[0][2] == pytest.approx(0.0, abs=1e-6)  # 7 m off the path, 1 s after it was made: kept
    late = subject.step(dataclasses.replace(at_60_m_abeam, t_ns=5_000_000_000), None, ORIGIN).plan
    assert late[0][1:3] == pytest.approx((-60.0, -7.0))


# --- the MPC as the keeper ---------------------------------------------------------------------------------------


def test_position_only_forgets_the_heading_and_reset_brings_it_back():
    """On the station in still air with the bow off by a radian: nothing to do, or a turn."""
    mpc = StationMpc(SimplifiedDynamics(VESSEL), MpcConfig(stages=10), 0.2)
    turned = at(0.0, 0.0, psi_rad=1.0)
    mpc.favour_position(True)
    calm = mpc.step(turned, None, ORIGIN)
    assert calm.ok and abs(wrap_rad(calm.plan[-1][3] - 1.0)) < 0.05
    mpc.reset()
    back = mpc.step(turned, None, ORIGIN)
    assert back.ok and wrap_rad(back.plan[-1][3]) < 0.8


def test_sideways_is_the_part_of_the_position_weight_across():
    problem = StationProblem(SimplifiedDynamics(VESSEL), MpcConfig(stages=3, last_step_s=0.8))
    packed = problem.pack(
        [0.0] * 8, (0.0, 0.0), (0.0, 0.0, 0.0), 0.0, (0.0, 0.0), MpcWeights(position=2.0, sideways=0.25)
    )
    weights, *_ = problem.unpack_cost(packed)
    assert weights[:, 1] == pytest.approx(0.25 * weights[:, 0])
    assert weights[-1, 0] == pytest.approx(2.0 * 0.8 + 60.0)


@pytest.mark.parametrize("name", ["sd-mpc", "backstepping", "loiter"])
def test_the_constructor_wraps_every_keeper(name):
    config = load_config("sitl", ("controller.procedure.enabled=true", f"controller.name={name}"))
    controller = build_controller(config, build_model(config))
    assert isinstance(controller, Procedure)
    assert controller.step(at(60.0, 0.0), None, ORIGIN).stage == "approach"
    off = load_config("sitl", ("controller.procedure.enabled=false", f"controller.name={name}"))
    assert not isinstance(build_controller(off, build_model(off)), Procedure)
