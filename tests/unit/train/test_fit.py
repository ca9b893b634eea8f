"""Training: the rollout and its gradient, what is learned, reproducibility, resumption, and unsuitable data."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import torch

from asvhil.config import load_config
from asvhil.dynamics.arrays import namespace_of
from asvhil.dynamics.fitted_sd import FittedSd
from asvhil.dynamics.lagnet import skip_terms
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.dynamics.weights import save_model
from asvhil.errors import ConfigError, ModelError
from asvhil.train.at_rest import at_rest, rates_at_rest, thrust_dip
from asvhil.train.evaluate import HOLD, Case, evaluate
from asvhil.train.fit import fit, fit_many
from asvhil.train.fit_sd import eased, fit_sd, skip_of_sd, wind_loads
from asvhil.train.models import Batch, LagNetTrainee, NnsemTrainee
from asvhil.train.ode import KnodeTrainee, NodeTrainee
from asvhil.train.openloop import open_loop
from asvhil.train.options import OPTIONS, chosen_options
from asvhil.train.progress import TrainingProgress
from asvhil.train.records import Segment, slice_segment
from asvhil.train.rollout import euler_rollout
from asvhil.train.training import Training, rollout_loss
from asvhil.train.windows import Windows, mirrored, scaling_of
from tests.support.fit_data import DATA
from tests.support.model_data import drive
from tests.support.parts import one_in
from tests.support.paths import ROOT


def plain_rollout(x0, p, q, wx, wh, ws):
    """The rollout's equations as autograd sees them."""
    x, path = x0, []
    for k in range(p.shape[1]):
        push = torch.tanh(x @ wx + p[:, k]) @ wh
        if ws is not None:
            push = push + torch.cat([x, x * x.abs(), x * x.roll(-1, -1)], -1) @ ws
        x = x + q[:, k] + push
        path.append(x)
    return torch.stack(path, 1)


@pytest.mark.parametrize("products", [False, True])
def test_the_rollout_and_its_gradients_are_those_of_autograd(products: bool) -> None:
    torch.manual_seed(1)
    shapes = [(3, 5, 3), (3, 7, 5, 4), (3, 7, 5, 3), (3, 3, 4), (3, 4, 3), (3, 9, 3)]
    given = [0.2 * torch.randn(shape, dtype=torch.float64) for shape in shapes]
    ours = [given[0], *(part.clone().requires_grad_() for part in given[1:])]
    theirs = [given[0], *(part.clone().requires_grad_() for part in given[1:])]
    if not products:
        ours[-1] = theirs[-1] = None
    weight = torch.randn(3, 7, 5, 3, dtype=torch.float64)
    a, b = euler_rollout(*ours), plain_rollout(*theirs)
    (a * weight).sum().backward()
    (b * weight).sum().backward()
    assert (a - b).abs().max() < 1e-12
    for mine, wanted in zip(ours[1:], theirs[1:], strict=True):
        if mine is not None:
            assert (mine.grad - wanted.grad).abs().max() < 1e-11


@pytest.mark.parametrize(
    ("kind", "paired"), [("nnsem", False), ("nnsem", True), ("lagnet", False), ("node", False), ("knode", False)]
)
def test_what_is_trained_is_what_is_run(kind: str, paired: bool) -> None:
    # The trainee's prediction of a window, and the exported run-time model over the same rows.
    options = dataclasses.replace(
        OPTIONS[kind], members=2 if kind == "lagnet" else 1, paired=paired, symmetric=paired or OPTIONS[kind].symmetric
    )
    origin = {"vehicle": "wamv16", "dt_s": 0.2, "data_hash": "", "config_hash": ""}
    training = Training(kind, DATA, (1, 2), options, origin, None)
    trainee, windows = training.trainee, training.windows
    rng = np.random.default_rng(3)
    with torch.no_grad():
        for name, value in trainee.parameters.items():  # large skip terms would carry the state out of its range
            value += (0.01 if name == "skip" else 0.1) * torch.from_numpy(rng.normal(size=value.shape))
        if kind == "lagnet":  # members would be averaged in one model: make them equal, to compare one of them
            for value in trainee.parameters.values():
                if len(value) == 4:
                    value[1::2] = value[::2]
    steps, models = windows.steps, 2 * options.members
    rows = np.array([40, 80, 333])[None, :] + np.zeros((models, 1), dtype=int)
    grid = torch.from_numpy(rows)[:, None, :]
    past, ahead = torch.arange(-windows.history, steps)[:, None], torch.arange(steps)[:, None]
    nu, command, wind = (torch.from_numpy(part) for part in (windows.nu, windows.command, windows.wind))
    batch = Batch(x0=nu[rows], command=command[grid + past], wind=wind[grid + ahead], target=nu[grid + ahead + 1])
    predicted = trainee.predict(batch).detach().numpy()
    half, centre = training.scaling.half[:3], training.scaling.centre[:3]
    segment = DATA.segments[0]
    first = [0, len(segment.t_s) * 9 // 10]
    for number, model in enumerate(training.models_now()):
        for j, row in enumerate(rows[0]):
            which = int(row >= first[1])
            start = np.array([row - first[which]])
            path = open_loop(model.dynamics(), DATA.segments[which], start, steps, 0.2)[0, 1:]
            ours = predicted[number * options.members, :, j] * half + centre
            # The map's table in training, and the motor's past, are cut off where nothing can be seen of them.
            np.testing.assert_allclose(ours, path, atol=2e-4 if kind == "lagnet" else 1e-9)


def test_paired_neurons_answer_a_mirrored_boat_with_mirrored_motion() -> None:
    options = chosen_options("nnsem", 0.2, paired=True, iterations=80)
    trained = fit("nnsem", DATA, options=options)
    assert trained.weights["w1"].shape == (12, 7) and trained.weights["w2"].shape == (3, 12)
    model, segment = trained.dynamics(), DATA.segments[0]
    start = np.arange(0, 240, 24)
    straight, turned = (open_loop(model, part, start, 50, 0.2) for part in (segment, mirrored(segment)))
    assert np.abs(straight[:, 1:] - straight[:, :1]).max() > 0.1
    np.testing.assert_allclose(turned, straight * [1.0, -1.0, -1.0], atol=1e-12)


def test_wrong_slopes_are_what_the_trained_network_has_of_them() -> None:
    trainee = NnsemTrainee([np.random.default_rng(seed) for seed in (1, 2)], 12, 0.2)
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.0, 1.0, (5, 7))
    total, step = 0.0, 1e-6
    for number in range(2):
        weights = trainee.export(number)

        def rates(z, weights=weights):
            return weights["w2"] @ np.tanh(weights["w1"] @ z + weights["b1"]) + weights["b2"]

        slopes = []
        for z in points:
            for motor, turn in ((3, 1.0), (4, -1.0)):
                rise = (rates(z + step * np.eye(7)[motor]) - rates(z - step * np.eye(7)[motor])) / (2.0 * step)
                slopes += [rise[0], turn * rise[2]]
        total += float(np.maximum(0.0, -np.array(slopes)).mean())
    state = torch.from_numpy(np.stack([points, points]))
    found = trainee.wrong_slopes(state[..., :3], state[..., 3:5], state[..., 5:])
    assert total > 0.01 and found.item() == pytest.approx(total, rel=1e-6)


@pytest.mark.thorough
def test_a_price_on_wrong_slopes_takes_the_dip_out_of_the_thrust() -> None:
    plain, priced = (
        fit("nnsem", DATA, options=chosen_options("nnsem", 0.2, paired=True, iterations=1500, rate=5e-3, monotone=m))
        for m in (None, 1.0)
    )
    plain_dip, priced_dip = (thrust_dip(model.dynamics(), model.scaling.half[5:]) for model in (plain, priced))
    assert plain_dip > 1e-3 and priced_dip < 0.1 * plain_dip


@pytest.mark.parametrize(
    ("kind", "chosen"),
    one_in(2, [("nnsem", {"paired": True}), ("nnsem", {}), ("lagnet", {"members": 2}), ("node", {}), ("knode", {})]),
)
def test_a_still_boat_stays_at_rest_in_still_air_and_moves_otherwise(kind: str, chosen: dict[str, bool | int]) -> None:
    iterations = 4 if "node" in kind else 30
    plain, still = (
        fit(kind, DATA, options=chosen_options(kind, 0.2, iterations=iterations, mirror=True, still=still, **chosen))
        for still in (False, True)
    )
    calm, windy = np.zeros(2), np.array([5.0, 5.0])
    assert np.abs(rates_at_rest(plain.dynamics(), calm)).max() > 1e-6
    assert np.abs(rates_at_rest(still.dynamics(), calm)).max() < 1e-12
    assert np.abs(rates_at_rest(still.dynamics(), windy)).max() > 1e-4
    assert {name: value.shape for name, value in still.weights.items()} == {
        name: value.shape for name, value in plain.weights.items()
    }


def test_a_share_of_each_batch_has_the_motors_off() -> None:
    on, off = DATA.segments[0], dataclasses.replace(DATA.segments[1], command=0.0 * DATA.segments[1].command)
    windows = Windows((on, off), scaling_of(DATA, symmetric=True), 20, 10)
    rows = len(on.t_s)
    picks = windows.draw(np.random.default_rng(1), 50, 64, 0.0, 0.25)
    assert (windows.starts[picks[:, 48:]] >= rows).all()
    assert (windows.starts[picks[:, :48]] < rows).any()
    assert (picks != windows.draw(np.random.default_rng(1), 50, 64, 0.0)).any()


def test_skip_terms_from_sd_are_its_rates_in_still_air() -> None:
    sd = fit("sd", DATA)
    scaling = scaling_of(DATA, symmetric=True)
    skip = skip_of_sd(sd.weights["parameters"], scaling).T * scaling.half[:3, None]
    rates = sd.dynamics()
    for seed in range(20):
        nu, thrust = np.split(np.random.default_rng(seed).uniform(-0.9, 0.9, 5) * scaling.half[:5], [3])
        z = np.concatenate([nu, thrust, np.zeros(2)])
        ours = skip @ skip_terms(namespace_of(z), z, scaling.half)
        np.testing.assert_allclose(ours, rates.derivative(nu, thrust, np.zeros(2)), atol=1e-12)


@pytest.mark.thorough
def test_weight_decay_holds_networks_at_nothing_and_skip_terms_where_they_start() -> None:
    def trained(decay: float) -> dict[str, np.ndarray]:
        options = chosen_options("lagnet", 0.2, iterations=120, members=1, from_sd=True, weight_decay=decay)
        return dict(fit("lagnet", DATA, options=dataclasses.replace(options, validation_fraction=0.0)).weights)

    free, held = trained(0.0), trained(1.0)
    start = skip_of_sd(fit_sd(DATA)[0], scaling_of(DATA, symmetric=True)).T
    assert np.abs(held["w2"]).max() < 0.02 < 0.1 < np.abs(free["w2"]).max()
    assert np.abs(held["skip"] - start).max() < 0.02 < 0.1 < np.abs(free["skip"] - start).max()


def test_the_robust_loss_is_the_square_of_small_errors_and_lets_go_of_large_ones() -> None:
    error = 0.01 * torch.randn((2, 5, 4, 3), dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    plain = (error * error).mean((1, 2, 3))
    assert (rollout_loss(error, 0.0) == plain).all()
    torch.testing.assert_close(rollout_loss(error, 1.0), plain, rtol=2e-4, atol=0.0)
    error[:, :, 0] += 3.0  # one window of the four has gone wrong
    error.requires_grad_()
    for robust, largest in ((0.0, 100.0), (0.03, 2.0)):
        (pull,) = torch.autograd.grad(rollout_loss(error, robust).sum(), error)
        ratio = (pull[:, :, 0].abs().mean() / pull[:, :, 1:].abs().mean()).item()
        assert (ratio > largest) == (robust == 0.0)
    e = error.detach()[0, :, 1].square().mean()
    alone = rollout_loss(error.detach()[:1, :, 1:2], 0.03)
    assert alone.item() == pytest.approx(0.0009 * np.log(1.0 + e.item() / 0.0009), rel=1e-12)


@pytest.mark.thorough
def test_a_robust_training_is_not_drawn_aside_by_a_span_that_no_model_can_know() -> None:
    # For a fifth of the record the motors did the opposite of what they were told.
    spoilt = []
    for part in DATA.segments:
        command = part.command.copy()
        command[: len(command) // 5] *= -1.0
        spoilt.append(dataclasses.replace(part, command=command))
    data = dataclasses.replace(DATA, segments=tuple(spoilt))
    cases = [Case(name="clean", seen=part, reference=part) for part in DATA.segments]

    def error(robust: float | None) -> float:
        options = chosen_options("lagnet", 0.2, iterations=250, members=1, robust=robust, validation_share=0.0)
        model = fit("lagnet", data, options=options).dynamics()
        return float(evaluate({"m": model}, cases, 0.2, 20.0, 5.0)["m"]["all"]["mae_u"])

    plain, robust = error(None), error(0.03)
    assert robust < 0.7 * plain, (robust, plain)


@pytest.mark.parametrize(
    ("kind", "iterations"), [("sd", 0), pytest.param("nnsem", 1000, marks=pytest.mark.thorough), ("lagnet", 250)]
)
def test_a_little_training_beats_holding_the_initial_value(kind: str, iterations: int) -> None:
    options = dataclasses.replace(OPTIONS[kind], members=1)
    model = fit(kind, DATA, options=options, iterations=iterations, vehicle="wamv16", config_hash="c")
    assert (model.kind, model.vehicle, model.config_hash, model.data_hash) == (kind, "wamv16", "c", "simulated-1")
    seen, truth = drive(77, 100.0, 6.0)
    rows = evaluate({kind: model.dynamics()}, [Case(name="test", seen=seen, reference=truth)], 0.2, horizon_s=20.0)
    ours, hold = rows[kind]["all"], rows[HOLD]["all"]
    assert all(ours[f"mae_{axis}"] < 0.9 * hold[f"mae_{axis}"] for axis in "uvr")


@pytest.mark.parametrize("kind", one_in(2, ["knode", "node"]))
def test_the_adjoint_training_lessens_the_loss(kind: str) -> None:
    options = dataclasses.replace(OPTIONS[kind], iterations=15, block=5, batch=16, rate=5e-3, last_rate=5e-3)
    model = fit(kind, DATA, options=options)
    losses = [row[1] for row in model.figures["curve"]]
    assert losses[-1] < 0.97 * losses[0]


@pytest.mark.parametrize("kind", ["nnsem", "lagnet"])
def test_the_same_seed_gives_the_same_weights(kind: str) -> None:
    first, second, other = (fit(kind, DATA, seed=seed, iterations=20) for seed in (3, 3, 4))
    assert all((first.weights[name] == second.weights[name]).all() for name in first.weights)
    assert (first.weights["w1"] != other.weights["w1"]).all()


class Interrupted(Exception):
    pass


@pytest.mark.parametrize("kind", ["nnsem", "lagnet"])
def test_an_interrupted_training_goes_on_to_the_same_weights(kind: str, tmp_path: Path) -> None:
    options = dataclasses.replace(OPTIONS[kind], iterations=30, block=10, members=1)
    checkpoint = tmp_path / "model.npz.checkpoint"

    def stop(progress: TrainingProgress) -> None:
        if progress.iteration == 20:
            raise Interrupted

    with pytest.raises(Interrupted):
        fit(kind, DATA, seed=5, options=options, checkpoint=checkpoint, progress=stop)
    assert checkpoint.exists()
    seen: list[int] = []
    resumed = fit(
        kind, DATA, seed=5, options=options, checkpoint=checkpoint, progress=lambda p: seen.append(p.iteration)
    )
    whole = fit(kind, DATA, seed=5, options=options)
    assert seen == [30]
    assert checkpoint.exists()  # until the model is saved it is all that there is
    assert all((resumed.weights[name] == whole.weights[name]).all() for name in whole.weights)
    assert resumed.figures == whole.figures


def test_the_checkpoint_of_another_training_is_refused(tmp_path: Path) -> None:
    options = dataclasses.replace(OPTIONS["nnsem"], iterations=10, block=5)
    checkpoint = tmp_path / "checkpoint"

    def stop(progress: TrainingProgress) -> None:
        raise Interrupted

    with pytest.raises(Interrupted):
        fit("nnsem", DATA, seed=5, options=options, checkpoint=checkpoint, progress=stop)
    with pytest.raises(ModelError, match="belongs to a training with other data, options or seed"):
        fit("nnsem", DATA, seed=6, options=options, checkpoint=checkpoint)
    with np.load(checkpoint) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for damaged in ({**arrays, "p.w1": arrays["p.w1"][..., :-1]}, {k: v for k, v in arrays.items() if k != "m.w1"}):
        with checkpoint.open("wb") as file:
            np.savez(file, **damaged)
        with pytest.raises(ModelError, match="damaged: its arrays do not fit; remove it"):
            fit("nnsem", DATA, seed=5, options=options, checkpoint=checkpoint)
    checkpoint.write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(ModelError, match="damaged"):
        fit("nnsem", DATA, seed=5, options=options, checkpoint=checkpoint)


def test_training_stops_early_and_keeps_the_best() -> None:
    # At this rate the network soon gets worse: the best is an early one.
    options = dataclasses.replace(OPTIONS["nnsem"], iterations=2000, block=20, patience=100, rate=0.3, last_rate=0.3)
    model = fit("nnsem", DATA, seed=1, options=options)
    figures = model.figures
    assert figures["iterations_run"] < 2000
    assert figures["iterations_run"] - figures["best_iteration"] >= 100
    assert figures["best_validation"] == min(row[2] for row in figures["curve"])


def test_seeds_side_by_side_are_models_of_their_own() -> None:
    models = fit_many("nnsem", DATA, seeds=(1, 2), iterations=40)
    assert [model.seed for model in models] == [1, 2]
    alone = fit("nnsem", DATA, seed=2, iterations=40)
    for name, value in alone.weights.items():
        np.testing.assert_allclose(models[1].weights[name], value, atol=1e-9)


def test_an_ensemble_is_one_wide_network_of_the_mean() -> None:
    rngs = [np.random.default_rng(i) for i in range(3)]
    three = LagNetTrainee(rngs, 4, 0.2, 10, 3)
    weights = three.export(0)
    assert weights["w1"].shape == (12, 7) and weights["w2"].shape == (3, 12)
    z = np.random.default_rng(9).normal(size=7)
    mean = np.zeros(3)
    for i in range(3):
        w1, b1, w2, b2 = (three.parameters[name][i].detach().numpy() for name in ("w1", "b1", "w2", "b2"))
        mean += (np.tanh(z @ w1 + b1[0]) @ w2 + b2[0]) / 3.0
    wide = weights["w2"] @ np.tanh(weights["w1"] @ z + weights["b1"]) + weights["b2"]
    np.testing.assert_allclose(wide, mean, atol=1e-12)


def test_a_frozen_map_is_straight_and_frozen_skip_terms_are_none() -> None:
    options = dataclasses.replace(OPTIONS["lagnet"], members=1, frozen=("map", "skip"), iterations=30)
    weights = fit("lagnet", DATA, seed=1, options=options).weights
    assert not weights["skip"].any()
    model = fit("lagnet", DATA, seed=1, options=options).dynamics()
    assert model.input_of_command((0.5, -0.5)) == pytest.approx((0.5, -0.5), abs=1e-3)


def test_an_unknown_kind() -> None:
    with pytest.raises(ModelError, match=r"unknown model kind 'oracle' \(known: sd, nnsem, node, knode, lagnet\)"):
        fit("oracle", DATA)


def test_without_a_validation_share_the_last_weights_of_all_iterations_are_kept() -> None:
    # At this rate an early state is the best; held-back data would have kept it and ended the training.
    options = dataclasses.replace(
        OPTIONS["nnsem"], iterations=160, block=20, patience=40, rate=0.3, last_rate=0.3, validation_fraction=0.0
    )
    figures = fit("nnsem", DATA, seed=1, options=options).figures
    assert figures["iterations_run"] == figures["best_iteration"] == 160
    assert figures["best_validation"] == figures["curve"][-1][2] > min(row[2] for row in figures["curve"])


def test_trainees_start_differently_by_seed_and_alike_by_kind() -> None:
    scaling = scaling_of(DATA, symmetric=False)

    def rngs() -> list[np.random.Generator]:
        return [np.random.default_rng([1, 0]), np.random.default_rng([2, 0])]

    nnsem, node = NnsemTrainee(rngs(), 12, 0.2), NodeTrainee(rngs(), 12, 0.2)
    knode = KnodeTrainee(rngs(), 12, 0.2, scaling, np.ones(13), np.ones(3))
    for name, value in nnsem.parameters.items():
        assert (value == node.parameters[name]).all() and (value == knode.parameters[name]).all()
    assert (nnsem.parameters["w1"][0] != nnsem.parameters["w1"][1]).all()


def drifting(wind_mps: float, heading_rad: float) -> Segment:
    """The true boat from rest with its motors off for 30 s, in a wind toward north."""
    boat, psi, nu, rows = SimplifiedDynamics(load_config("sitl").vehicle.vessel), heading_rad, np.zeros(5), []
    for k in range(1501):
        wind = wind_mps * np.array([math.cos(psi), -math.sin(psi)])
        if k % 10 == 0:
            rows.append((0.02 * k, *nu[:3], *wind, psi))
        nu, psi = nu + 0.02 * boat.derivative(nu, np.zeros(2), wind), psi + 0.02 * nu[2]
    t_s, u, v, r, wind_u, wind_v, psi_rad = np.array(rows).T
    return Segment(
        t_s=t_s,
        nu=np.column_stack([u, v, r]),
        command=np.zeros((len(t_s), 2)),
        wind=np.column_stack([wind_u, wind_v]),
        psi=psi_rad,
    )


VESSEL = load_config("sitl").vehicle.vessel
WIND_REACH = np.array([9.0, 9.0])
DRIFTS = tuple(drifting(speed, heading) for speed in (4.0, 9.0) for heading in (0.4, 1.3, 2.2, -1.8))
MANOEUVRES = tuple(slice_segment(part, 0, 300) for part in DATA.segments)
WITH_DRIFTS = dataclasses.replace(DATA, segments=(*MANOEUVRES, *DRIFTS))


@pytest.mark.thorough
def test_sd_takes_its_wind_loads_from_the_spans_with_the_motors_off() -> None:
    checks = [
        at_rest(FittedSd(fit_sd(data)[0].tolist(), 0.2), WIND_REACH, VESSEL).worst.error for data in (DATA, WITH_DRIFTS)
    ]
    assert checks[0] > 1.0 and checks[1] < 0.3  # among manoeuvres they make up for the thrust


def test_what_the_data_cannot_tell_apart_does_not_end_a_fit() -> None:
    """A real boat's records without wind gave two parameters the same column, and 28 good steps in a row."""
    damping, without = 1e-2, 1e-2
    for _ in range(60):
        damping, without = eased(damping), 0.3 * without
    normal = np.full((2, 2), 577.346602)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.solve(normal + without * np.diag(np.diag(normal)), np.ones(2))
    assert np.isfinite(np.linalg.solve(normal + damping * np.diag(np.diag(normal)), np.ones(2))).all()


def test_the_noise_of_a_drifts_first_velocity_is_not_taken_for_drag_and_wind() -> None:
    rng = np.random.default_rng(1)
    noisy = tuple(
        dataclasses.replace(part, nu=part.nu + rng.normal(size=part.nu.shape) * [0.02, 0.02, 0.002]) for part in DRIFTS
    )
    parameters = np.zeros(13)
    parameters[2], parameters[10:] = 1.0, wind_loads(dataclasses.replace(DATA, segments=(*MANOEUVRES, *noisy)))
    assert at_rest(FittedSd(parameters.tolist(), 0.2), WIND_REACH, VESSEL).worst.error < 1.0


@pytest.mark.parametrize(
    ("kind", "iterations"), [("nnsem", 300), pytest.param("lagnet", 100, marks=pytest.mark.thorough)]
)
@pytest.mark.thorough
def test_a_weight_on_the_rates_at_rest_teaches_the_wind_loads_of_the_drifts(kind: str, iterations: int) -> None:
    chosen = {"iterations": iterations, "still": True, "rate": 0.01}
    worst = []
    for weight in (0.0, 1.0):
        trained = fit(kind, WITH_DRIFTS, options=chosen_options(kind, 0.2, rest_weight=weight, **chosen))
        worst.append(at_rest(trained.dynamics(), WIND_REACH, VESSEL).worst.error)
    assert worst[1] < 0.4 * worst[0], worst


@pytest.mark.parametrize("paired", [True, pytest.param(False, marks=pytest.mark.thorough)])
@pytest.mark.thorough
def test_a_grown_network_answers_the_motors_as_before_and_the_wind_anew(paired: bool, tmp_path: Path) -> None:
    base = fit("nnsem", DATA, options=chosen_options("nnsem", 0.2, iterations=100))  # with a scaling of its own
    save_model(tmp_path / "base.npz", base)
    grown = fit(
        "nnsem", WITH_DRIFTS, options=chosen_options(
            "nnsem", 0.2, iterations=300, width=6, paired=paired, still=True, rest_weight=1.0, rate=0.01,
            grow=str(tmp_path / "base.npz"),
        ),
    )  # fmt: skip
    assert grown.weights["w1"].shape == (18, 7)
    old, new = base.dynamics(), grown.dynamics()
    for x, wind in (([0.0, 0.0, 0.0], [0.0, 0.0]), ([0.8, -0.2, 0.1], [-3.0, 2.0])):

        def by_motors(model, x=x, wind=wind):
            at = [model.derivative(np.array(x), np.array(a), np.array(wind)) for a in ([0.7, -0.4], [0.0, 0.1])]
            return at[0] - at[1]

        np.testing.assert_allclose(by_motors(new), by_motors(old), rtol=1e-9)
    checks = [at_rest(model, WIND_REACH, VESSEL) for model in (old, new)]
    assert checks[1].worst.error < 0.85 * checks[0].worst.error  # in 300 iterations
    assert max(map(abs, checks[1].still)) < 1e-12


def test_what_cannot_be_grown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="--grow needs --still"):
        chosen_options("nnsem", 0.2, grow="x.npz")
    sd = ROOT / "config" / "models" / "wamv16-sd.npz"
    with pytest.raises(ModelError, match="--grow takes a model of kind nnsem, not sd"):
        fit("nnsem", DATA, options=chosen_options("nnsem", 0.2, grow=str(sd), still=True))


def test_data_without_drifts_teach_no_rates_at_rest() -> None:
    with pytest.raises(ModelError, match="--rest-weight needs spans of 4 s and more with the motors off"):
        fit("nnsem", DATA, options=chosen_options("nnsem", 0.2, iterations=10, rest_weight=1.0))
