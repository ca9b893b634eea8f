"""The table of `asvhil evaluate` of a boat at rest: beside a simulated boat, and where there is none."""

import io

import numpy as np
from rich.console import Console

from asvhil.commands.evaluate import _at_rest_table
from asvhil.config import VesselConfig, load_config
from asvhil.dynamics.rigid_body import SimplifiedDynamics
from asvhil.train.at_rest import at_rest

VESSEL = load_config("sitl").vehicle.vessel


def shown(vessel: VesselConfig | None) -> str:
    check = at_rest(SimplifiedDynamics(VESSEL), np.array([10.0, 10.0]), vessel)
    console = Console(file=io.StringIO(), width=200)
    console.print(_at_rest_table("mine", check.figures()))
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


def test_the_simulated_boat_stands_in_brackets() -> None:
    text = shown(VESSEL)
    assert "of the simulated boat in brackets" in text and "error / bound" in text and "0.00" in text


def test_without_a_simulated_boat_nothing_is_said_of_one() -> None:
    text = shown(None)
    assert text.startswith("mine: rates at rest, motors off") and "r' (rad/s2)" in text
    assert "simulated" not in text and "bound" not in text and "(0" not in text
