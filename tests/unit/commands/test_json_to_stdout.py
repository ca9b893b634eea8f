"""`--json -`: the figures alone on standard output, and no file of that name."""

import json
import sys
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.sitl import run_lockstep
from tests.support.command_line import call


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stdout") / "log.mcap"
    run_lockstep(load_config("sitl", ("controller.name=nnsem-mpc",)), path, 8.0)
    return path


@pytest.mark.parametrize(
    ("arguments", "key", "said_too"),
    [
        (("log", "info", "log.mcap"), "ticks", "log.mcap: "),
        (("log", "recover", "log.mcap", "-o", "new.mcap"), "recovered", "read again and compared"),
        (("report", "log.mcap"), "energy_wh", "log     log.mcap"),
        (("report", "log.mcap", "--compare", "log.mcap"), "compared", "log     log.mcap"),
        (("config", "show", "sitl"), "vehicle", "tick_hz"),
        (("config", "check", "sitl"), "checks", "sitl: right"),
        (("sitl", "--lockstep", "--duration", "2", "--no-picture", "--log", "x.mcap"), "ticks", "log     x.mcap"),
    ],
)
def test_figures_are_alone_on_standard_output(arguments: tuple[str, ...], key: str, said_too: str, log: Path) -> None:
    said = call(*arguments, "--json", "-", cwd=log.parent)
    assert said.status == 0, said
    assert key in json.loads(said.out)
    assert said_too in said.err and not (log.parent / "-").exists()
    before = sys.stdout
    assert call("log", "info", "log.mcap", cwd=log.parent).out.startswith("log.mcap: ")  # the next one as ever
    assert sys.stdout is before


def test_of_an_error_there_are_no_figures(log: Path) -> None:
    said = call("log", "info", "none.mcap", "--json", "-", cwd=log.parent)
    assert (said.status, said.out) == (2, "") and said.err.startswith("asvhil: none.mcap: ")
