"""One small model of every kind with random weights, for tests that do not depend on training."""

from __future__ import annotations

import numpy as np

from asvhil.dynamics.nnsem import Scaling
from asvhil.dynamics.weights import KINDS, TrainedModel

CENTRE = np.array([0.3, 0.02, -0.01, 0.05, 0.0, 0.4, -0.2])
HALF = np.array([1.7, 0.6, 0.4, 0.95, 1.0, 6.5, 6.0])


def sample(kind: str, seed: int = 1, hidden: int = 12) -> TrainedModel:
    """A model of a kind with weights drawn as large as training leaves them."""
    rng = np.random.default_rng(seed)

    def network(inputs: int) -> dict[str, np.ndarray]:
        return {
            "w1": rng.normal(size=(hidden, inputs)),
            "b1": rng.normal(size=hidden),
            "w2": 0.3 * rng.normal(size=(3, hidden)),
            "b2": 0.1 * rng.normal(size=3),
        }

    sd = np.array([0.3, 0.15, 1.5, 0.2, 0.2, 0.25, 0.2, 0.6, 0.9, 0.8, 2e-3, 2e-3, 5e-4])
    extra = {
        "sd": {},
        "nnsem": {},
        "node": {},
        "knode": {"prior": sd, "prior_scale": np.array([0.2, 0.1, 0.05])}
        | {f"g_{name}": value for name, value in network(6).items()},
        "lagnet": {
            "skip": 0.2 * rng.normal(size=(3, 16)),
            "map_gain": rng.uniform(0.1, 1.0, 8),
            "map_slope": rng.uniform(2.0, 8.0, 8),
            "map_centre": np.linspace(-0.8, 0.8, 8),
            "lag_s": np.array(0.42),
            "direct": np.array(0.31),
        },
    }[kind]
    lagnet = kind == "lagnet"
    return TrainedModel(
        kind=kind,
        vehicle="wamv16",
        dt_s=0.2,
        scaling=Scaling(centre=np.zeros(7) if lagnet else CENTRE, half=HALF),
        weights={"parameters": sd} if kind == "sd" else network(7) | extra,
        data_hash="d" * 64,
        config_hash="c" * 16,
        seed=seed,
        figures={"best_validation": 0.04, "curve": [[500.0, 0.02, 0.05]]},
    )


def points(kind: str, count: int, seed: int = 2) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, inputs and winds all over the range that a model is meant for, and a little beyond (count, .)."""
    rng = np.random.default_rng(seed)
    model = sample(kind).dynamics()
    x = rng.uniform(-1.5, 1.5, (count, 3 + model.n_motor))
    x[:, :3] *= 2.0 * HALF[:3]
    a = rng.uniform(model.input_lower, model.input_upper, (count, 2))
    wind = rng.uniform(-1.2, 1.2, (count, 2)) * HALF[5:]
    return x, a, wind


__all__ = ["KINDS", "points", "sample"]
