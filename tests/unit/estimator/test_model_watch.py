"""The watch over the model: what lasts is told, and a hold ends for it only where the config says so."""

import pytest

from asvhil.config import MonitorConfig
from asvhil.estimator.model_watch import ModelWatch
from asvhil.supervisor.reasons import Reason
from asvhil.types import Estimate, PredictionError, Wind

PERIOD_NS = 200_000_000


class Errors:
    """A monitor that says what it is told to."""

    def __init__(self) -> None:
        self.error: PredictionError | None = None
        self.push_mps2 = 0.0

    @property
    def unexplained(self) -> tuple[float, float, float]:
        assert self.error is not None
        return self.error.horizon

    def step(self, estimate: Estimate, model_input: tuple[float, float], wind: Wind | None) -> PredictionError | None:
        return self.error


def estimate(t_ns: int) -> Estimate:
    return Estimate(
        t_ns=t_ns, n_m=0.0, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip


class World:
    def __init__(self, *, on_mismatch: str = "tell", replaced: bool = False) -> None:
        self.monitor = Errors()
        config = MonitorConfig.model_validate({"mismatch_s": 4.0, "on_mismatch": on_mismatch})
        self.watch = ModelWatch(config, self.monitor, replaced=replaced)  # type: ignore[arg-type]
        self.t_ns = 0

    def run(self, seconds: float, horizon: tuple[float, float, float] | None, *, held: bool = True) -> None:
        for _ in range(round(seconds * 1e9 / PERIOD_NS)):
            limits = (0.35, 0.25, 0.12)
            self.monitor.error = None
            if horizon is not None:
                ok = all(error <= limit for error, limit in zip(horizon, limits, strict=True))
                self.monitor.error = PredictionError(one_step=horizon, horizon=horizon, horizon_s=4.0, ok=ok)
            self.watch.step(estimate(self.t_ns), (0.0, 0.0), None)
            self.watch.note_held(held=held)
            self.t_ns += PERIOD_NS


GOOD, FAST, TURNING = (0.1, 0.1, 0.05), (0.9, 0.3, 0.05), (0.4, 0.1, 0.5)


@pytest.mark.parametrize(
    ("horizon", "words"), [(FAST, "surge is off by 0.9 m/s"), (TURNING, "yaw rate is off by 0.5 rad/s")]
)
def test_what_lasts_is_told_by_the_worst_and_stands_until_the_hold_ends(
    horizon: tuple[float, float, float], words: str
) -> None:
    world = World()
    world.run(3.8, horizon)
    assert not world.watch.ok and world.watch.notes == ()
    world.run(0.6, horizon)
    (note,) = world.watch.notes
    assert note.subject == "model" and not note.ok and words in note.text and "within 4 s" in note.text
    assert world.watch.fault is None  # told alone
    world.run(30.0, GOOD)
    assert world.watch.ok and world.watch.notes == (note,)
    world.run(0.2, None, held=False)
    assert world.watch.notes == ()


def test_what_passes_is_not_told() -> None:
    world = World()
    for _ in range(5):
        world.run(3.8, FAST)
        world.run(0.2, GOOD)
    assert world.watch.notes == ()
    world.run(3.8, FAST)
    world.run(0.2, None)  # a gap begins anew
    world.run(3.8, FAST)
    assert world.watch.notes == ()


def test_a_hold_ends_for_it_where_the_config_says_so_and_the_next_one_begins_anew() -> None:
    world = World(on_mismatch="release")
    world.run(4.4, FAST)
    assert world.watch.fault is not None and world.watch.fault.reason is Reason.MODEL_MISMATCH
    world.run(0.2, None, held=False)
    assert world.watch.fault is None
    world.run(3.8, FAST)
    assert world.watch.fault is None


def test_what_may_be_a_strong_current_is_told_as_either_and_ends_no_hold() -> None:
    world = World(on_mismatch="release")
    world.monitor.push_mps2 = 0.15
    world.run(4.4, FAST)
    (note,) = world.watch.notes
    assert "or a strong current is why: surge is off by 0.9 m/s" in note.text and world.watch.fault is None
    world.monitor.push_mps2 = 0.05
    world.run(3.8, FAST)
    assert world.watch.notes == (note,) and world.watch.fault is None, "not at once"
    world.run(0.6, FAST)
    assert world.watch.fault is not None and world.watch.fault.reason is Reason.MODEL_MISMATCH
    world.monitor.push_mps2 = 0.15
    world.run(10.0, FAST)
    assert world.watch.fault is not None, "and what is certain stays"


@pytest.mark.parametrize(("current", "std_mps", "ends"), [((0.15, 0.0), 0.1, True), ((0.3, -0.4), 0.1, False)])
def test_a_push_where_no_current_is_seen_is_no_excuse(current: tuple[float, float], std_mps: float, ends: bool) -> None:
    """The disturbance of a boat with a weak motor, in wind from the side, is as large as that of a current."""
    world = World(on_mismatch="release")
    world.monitor.push_mps2 = 0.15
    world.watch.note_current(current, std_mps)
    world.run(4.4, FAST)
    assert (world.watch.fault is not None) is ends


def test_a_model_that_is_replaced_is_told_all_the_time() -> None:
    world = World(replaced=True)
    world.run(1.0, GOOD, held=False)
    (note,) = world.watch.notes
    assert not note.ok and "of another hull" in note.text
