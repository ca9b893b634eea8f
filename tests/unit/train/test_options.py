"""Which options a kind of model is trained with, and that the command line has all of them from one table."""

from __future__ import annotations

import dataclasses
import inspect

import pytest
from typer.testing import CliRunner

from asvhil.commands.cli import app
from asvhil.commands.train import train
from asvhil.errors import ConfigError, ModelError
from asvhil.train.options import CHOICES, NETWORKS, OPTIONS, FitOptions, chosen_options

LAGNET = OPTIONS["lagnet"]


def test_without_a_choice_a_kind_has_its_own_options() -> None:
    for kind, options in OPTIONS.items():
        assert chosen_options(kind, 0.2) == options
        assert chosen_options(kind, 0.2, **{choice.name: None for choice in CHOICES.values()}) == options


def test_every_choice_reaches_its_field() -> None:
    chosen = {
        "nnsem": {
            "iterations": 7, "horizon": 2.0, "batch": 8, "rate": 0.01, "last_rate": 0.001, "width": 6, "mirror": True,
            "paired": True, "moving_share": 0.5, "resting_share": 0.25, "rest_weight": 0.6, "still": True,
            "grow": "x.npz",
            "weight_decay": 0.1, "monotone": 0.2, "robust": 0.3,
            "validation_share": 0.4,
        },
        "lagnet": {"members": 2, "from_sd": True},
    }  # fmt: skip
    assert {name for part in chosen.values() for name in part} == {choice.name for choice in CHOICES.values()}
    assert chosen_options("nnsem", 0.2, **chosen["nnsem"]) == FitOptions(
        iterations=7, window=10, batch=8, rate=0.01, last_rate=0.001, hidden=6, mirror=True, symmetric=True,
        paired=True, moving_share=0.5, resting_share=0.25, rest_weight=0.6, still=True, grow="x.npz",
        weight_decay=0.1, monotone=0.2, robust=0.3, validation_fraction=0.4,
    )  # fmt: skip
    assert chosen_options("lagnet", 0.2, **chosen["lagnet"]) == dataclasses.replace(LAGNET, members=2, from_sd=True)


def test_a_rate_alone_is_held_to_the_end_and_a_mirror_makes_the_scaling_symmetric() -> None:
    assert chosen_options("lagnet", 0.2, rate=0.01) == dataclasses.replace(LAGNET, rate=0.01, last_rate=0.01)
    assert chosen_options("lagnet", 0.2, last_rate=0.01) == dataclasses.replace(LAGNET, last_rate=0.01)
    assert not chosen_options("nnsem", 0.2, mirror=False).symmetric
    assert chosen_options("nnsem", 0.2, mirror=True).symmetric and chosen_options("nnsem", 0.2, paired=True).symmetric


@pytest.mark.parametrize("kind", OPTIONS)
def test_a_choice_that_does_not_apply_is_refused_unless_it_asks_for_nothing(kind: str) -> None:
    values = {"paired": True, "members": 2, "from_sd": True, "monotone": 1.0, "horizon": 2.0, "mirror": True}
    for choice in CHOICES.values():
        value = values.get(choice.name, 1)
        if kind in choice.kinds:
            needed = {"still": True} if choice.name == "grow" else {}
            chosen_options(kind, 0.2, **{choice.name: value}, **needed)
            continue
        flag = f"--{choice.name.replace('_', '-')}"
        with pytest.raises(ConfigError, match=f"train: {flag} does not apply to model {kind}"):
            chosen_options(kind, 0.2, **{choice.name: value})
        if choice.off is not None:
            assert chosen_options(kind, 0.2, **{choice.name: choice.off}) == OPTIONS[kind]


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ModelError, match="unknown model kind 'oracle'"):
        chosen_options("oracle", 0.2)
    with pytest.raises(ConfigError, match=r"--horizon 0\.2 is less than two steps"):
        chosen_options("nnsem", 0.2, horizon=0.2)
    with pytest.raises(ConfigError, match="--paired needs an even --width, not 5"):
        chosen_options("nnsem", 0.2, paired=True, width=5)
    with pytest.raises(TypeError, match="unknown options: depth"):
        chosen_options("nnsem", 0.2, depth=3)


def test_the_command_line_has_an_option_for_every_choice_with_its_range() -> None:
    parameters = inspect.signature(train).parameters
    helps = {}
    for field, choice in CHOICES.items():
        parameter = parameters[choice.name]
        assert parameter.default is None
        (info,) = parameter.annotation.__metadata__
        flag = f"--{choice.name.replace('_', '-')}"
        assert info.default == (f"{flag}/--no-mirror" if field == "mirror" else flag)
        assert (info.min, info.max) == (choice.low, choice.high)
        helps[field] = info.help
        assert info.help.startswith(choice.help)
    assert helps["iterations"].endswith(" By default 20000; lagnet 10000.")
    assert helps["mirror"].endswith(" By default off; lagnet on.")
    assert helps["paired"].endswith(" For nnsem only. By default off.")
    assert all(set(choice.kinds) <= {"sd", *NETWORKS} for choice in CHOICES.values())


def test_the_help_names_every_choice() -> None:
    shown = CliRunner().invoke(app, ["train", "--help"], env={"COLUMNS": "200"}).output
    assert all(f"--{choice.name.replace('_', '-')} " in shown for choice in CHOICES.values())
