"""A run that is refused leaves nothing behind."""

from pathlib import Path

import pytest

from tests.support.command_line import call

OTHERS = "controller.model=bream-lagnet"


@pytest.mark.parametrize(
    "order",
    [
        ("sitl", "sitl", "--lockstep", "--duration", "2", "--set", OTHERS),
        ("sitl", "sitl", "--duration", "2", "--set", OTHERS),
        ("run", "sitl", "--duration", "1", "--set", OTHERS),
        ("run", "sitl", "--duration", "1", "--set", "controller.model=none"),
        ("sitl", "sitl", "--lockstep", "--duration", "2", "--fault", "ins@5"),
        ("collect", "sitl", "--duration", "30", "--wind", "0@0", "--wind", "nonsense"),
    ],
    ids=["lockstep", "real time", "run", "no model", "fault", "collect"],
)
def test_no_folder_is_left(order: tuple[str, ...], tmp_path: Path) -> None:
    done = call(*order, cwd=tmp_path)
    assert done.status == 2, done
    assert list(tmp_path.iterdir()) == []
