"""Learning on station, on boats that move by a model with known factors: found, bounded, frozen, and still at rest."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from asvhil.config import LearningConfig, find_shipped, load_config
from asvhil.dynamics.corrected import COUNT, CorrectedModel
from asvhil.dynamics.integrate import advance
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import load_model
from asvhil.estimator.learned_words import RAN_OFF
from asvhil.estimator.learning import APPLIED_AFTER_S, Learner
from asvhil.types import Estimate, Learned, Wind

VESSEL = load_config("sitl").vehicle.vessel
WIND = Wind(t_ns=0, vn_mps=2.0, ve_mps=-3.0, std_mps=0.0, valid=True)
PERIOD_S = 0.05
Commands = Callable[[float], tuple[float, float]]


def busy(t_s: float) -> tuple[float, float]:
    return 0.3 + 0.5 * math.sin(0.9 * t_s), 0.3 + 0.5 * math.cos(0.7 * t_s)


def learn(
    boat: tuple[float, ...],
    model: Dynamics | None = None,
    *,
    seconds: float = 60.0,
    commands: Commands = busy,
    push: tuple[float, float, float] = (0.02, -0.01, 0.004),
    config: LearningConfig = LearningConfig(enabled=True, responses=True),  # noqa: B008 - frozen
    doubt: Callable[[float], str] = lambda t_s: "",
    leap_mps: float = 0.0,
) -> tuple[Learned, list[tuple[float, ...]]]:
    """What is learned of a boat with these factors, pushed by a disturbance; and all that the model was told.

    The estimate leaps by `leap_mps` for a second in each 10 s.
    """
    corrected = CorrectedModel(model or SimplifiedDynamics(VESSEL))
    told: list[tuple[float, ...]] = []
    learner = Learner(config, corrected, PERIOD_S, 0.0, told.append)
    own = corrected.n_motor - COUNT
    state = np.array([*[0.0] * (6 + own), *(factor - 1.0 for factor in boat)])
    rng = np.random.default_rng(1)
    for tick in range(round(seconds / PERIOD_S)):
        a = commands(tick * PERIOD_S)
        n, e, psi, *nu = state[:6].tolist()
        u, v, r = (part + 0.01 * noise for part, noise in zip(nu, rng.standard_normal(3).tolist(), strict=True))
        u += leap_mps if tick % 200 > 180 else 0.0
        motor = (*state[6 : 6 + own].tolist(), *learner.applied)
        estimate = Estimate(
            t_ns=round(tick * PERIOD_S * 1e9), n_m=n, e_m=e, psi_rad=psi, u_mps=u, v_mps=v, r_radps=r,
            motor=motor, std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
        )  # fmt: skip
        learned = learner.step(estimate, a, WIND, doubt(tick * PERIOD_S))
        state = advance(corrected, state, np.array(a), np.array([2.0, -3.0]), np.array(push), PERIOD_S, 1)
    return learned, told


@pytest.mark.parametrize("boat", [(1.0, 1.0, 1.0, 1.0, 1.0), (0.7, 1.0, 1.0, 1.0, 1.0), (1.0, 1.0, 0.75, 0.85, 0.85)])
def test_the_factors_of_a_boat_are_found_within_a_minute(boat: tuple[float, ...]) -> None:
    learned, told = learn(boat)
    assert learned.factors[:2] == pytest.approx(boat[:2], abs=0.04)
    assert learned.factors[2] == pytest.approx(boat[2], abs=0.08)
    assert learned.factors[4] == pytest.approx(boat[4], abs=0.08)
    assert all(std < 0.08 for std in learned.std[:2])
    assert told[0] == (0.0,) * COUNT and tuple(1.0 + part for part in told[-1]) == learned.factors
    assert 50.0 < learned.learned_s < 60.0 and learned.frozen == ""


def test_a_network_of_the_command_is_corrected_too() -> None:
    model = load_model(find_shipped("wamv16-nnsem", "models", ".npz", "model"))
    learned, _ = learn((0.7, 1.0, 1.0, 1.0, 1.0), model)
    assert learned.factors[:2] == pytest.approx((0.7, 1.0), abs=0.05)


def test_what_is_far_off_stops_at_the_bounds() -> None:
    learned, told = learn((0.3, 2.0, 1.0, 1.0, 1.0), config=LearningConfig(enabled=True, responses=True, most=1.4))
    assert learned.factors[:2] == (0.5, pytest.approx(1.4))
    assert all(-0.5 <= part <= 0.4 + 1e-12 for factors in told for part in factors)


def test_nothing_corrects_the_model_in_the_first_seconds_of_learning() -> None:
    _, told = learn((0.7, 1.0, 1.0, 1.0, 1.0), seconds=APPLIED_AFTER_S - 1.0)
    assert set(told) == {(0.0,) * COUNT}
    start = (0.8, 1.0, 1.0, 1.0, 1.0)
    _, told = learn((0.7, 1.0, 1.0, 1.0, 1.0), seconds=5.0, config=LearningConfig(enabled=True, start=start))
    assert {round(factors[0], 9) for factors in told} == {-0.2}


@pytest.mark.parametrize("boat", [(1.35, 1.3, 0.2, 1.0, 1.0), (1.2, 1.2, 1.0, 1.0, 2.5)])
def test_responses_that_run_off_stop_it_and_nothing_of_it_is_applied(boat: tuple[float, ...]) -> None:
    """As with a compass that is turned: a boat 20 degrees off was driven off its station within half a minute."""
    learned, told = learn(boat, seconds=40.0)
    assert learn((0.6, 0.6, *boat[2:]), seconds=40.0)[0].frozen == "", "as with another boat's model"
    assert learned.frozen == RAN_OFF and learned.factors == (1.0,) * COUNT and learned.learned_s == 0.0
    assert told[-1] == (0.0,) * COUNT


def test_in_the_next_hold_it_begins_anew() -> None:
    corrected = CorrectedModel(SimplifiedDynamics(VESSEL))
    learner = Learner(LearningConfig(enabled=True), corrected, PERIOD_S, 0.0, lambda factors: None)
    learner._ran_off = True
    assert learner.step(None, (0.0, 0.0), None, "").frozen == RAN_OFF
    learner.rest()
    assert learner.step(None, (0.0, 0.0), None, "").frozen == ""


def test_a_doubt_freezes_it_and_says_why() -> None:
    learned, told = learn((0.7, 1.0, 1.0, 1.0, 1.0), doubt=lambda t_s: "the motors are in doubt", seconds=20.0)
    assert learned.factors == (1.0,) * COUNT and len(told) == 1
    assert learned.frozen == "the motors are in doubt" and learned.learned_s == 0.0


def test_after_a_doubt_it_waits_and_goes_on_from_where_it_was() -> None:
    seen: list[float] = []

    def doubt(t_s: float) -> str:
        seen.append(t_s)
        return "a sensor is in doubt" if 30.0 <= t_s < 40.0 else ""

    whole, _ = learn((0.7, 1.0, 1.0, 1.0, 1.0), seconds=50.0)
    learned, _ = learn((0.7, 1.0, 1.0, 1.0, 1.0), seconds=50.0, doubt=doubt)
    assert whole.learned_s - learned.learned_s == pytest.approx(13.0, abs=1.1)
    assert learned.factors[0] == pytest.approx(0.7, abs=0.04)


def test_at_rest_nothing_wanders() -> None:
    learned, _told = learn((1.0,) * COUNT, commands=lambda t_s: (0.0, 0.0), push=(0.0, 0.0, 0.0), seconds=120.0)
    assert learned.factors[:2] == pytest.approx((1.0, 1.0), abs=0.01)
    assert max(learned.std) <= LearningConfig().prior_std + 1e-12


def test_without_adapting_it_stays_as_it_began() -> None:
    config = LearningConfig(enabled=True, responses=True, adapt=False, start=(0.8, 0.9, 1.0, 1.0, 1.1))
    learned, told = learn((0.7, 1.0, 1.0, 1.0, 1.0), config=config, seconds=10.0)
    assert learned.factors == pytest.approx((0.8, 0.9, 1.0, 1.0, 1.1)) and len(told) == 1


def test_a_leap_of_the_estimate_is_no_lesson() -> None:
    learned, _ = learn((0.8, 1.0, 1.0, 1.0, 1.0), leap_mps=2.0)
    assert learned.factors[:2] == pytest.approx((0.8, 1.0), abs=0.05)


def test_responses_may_be_told_alone() -> None:
    config = LearningConfig(enabled=True)
    learned, told = learn((0.8, 1.0, 0.7, 1.0, 1.0), config=config)
    assert learned.factors[:3] == pytest.approx((0.8, 1.0, 0.7), abs=0.08)
    assert told[-1] == pytest.approx((learned.factors[0] - 1.0, learned.factors[1] - 1.0, 0.0, 0.0, 0.0))
