"""Numbers on the command line: places as people write them; NaN and the like refused for every option."""

import inspect

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st

from asvhil.commands.cli import app, main
from asvhil.commands.numbers import lat_lon
from asvhil.errors import ConfigError


@pytest.mark.parametrize(
    "text",
    [
        "40.4,-86.9",
        " 40.4 , -86.9 ",
        "+40.4,-86.9",
        "40.4°,-86.9°",
        "40.4º, -86.9º",
        "40.4N,86.9W",
        "40.4 n, 86.9 w",
        "N40.4, W 86.9",
        "40.4° N, 86.9° W",
        "40.4 deg,-86.9 deg",
    ],
)
def test_places_as_people_write_them(text: str) -> None:
    assert lat_lon("--at", text) == pytest.approx((40.4, -86.9))


@pytest.mark.parametrize(
    "text",
    [
        *("", ",", "40.4", "40.4,", "40.4;-86.9", "40.4 -86.9", "40.4,-86.9,0", "40,4,-86,9", "nan,0", "0,inf"),
        *("4_0,1", "0x10,1", "1e1,2", "\u0664,1", "40.4E,86.9N", "-40.4S,1", "N40N,1"),
        *("40d24m,86d54m", "40°24',-86°54'", "here", "40.4,-86.9\n1,2", "1" * 400 + ",2"),
    ],
)
def test_what_is_no_place_is_one_line(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        lat_lon("--at", text)
    assert str(caught.value).startswith("--at ") and "LAT,LON in degrees is expected" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *(
            ("91,0", "latitude of -90 to 90"),
            ("-90.1,0", "latitude of -90 to 90"),
            ("91N, 0E", "latitude of -90 to 90"),
        ),
        *(
            ("0,181", "longitude of -180 to 180"),
            ("40.4, 286W", "longitude of -180 to 180 degrees is expected, not -286"),
        ),
    ],
)
def test_a_place_off_the_globe_is_told_by_its_part(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        lat_lon("--at", text)


@given(st.floats(-90.0, 90.0).map(lambda v: round(v, 7)), st.floats(-180.0, 180.0).map(lambda v: round(v, 7)))
def test_every_place_is_read_as_it_is_printed(lat_deg: float, lon_deg: float) -> None:
    assert lat_lon("--at", f"{lat_deg:.7f},{lon_deg:.7f}") == (lat_deg, lon_deg)


def floats(app_: typer.Typer) -> list[tuple[list[str], str]]:
    """The path of each command with each option that takes a float."""
    found = []
    for group in app_.registered_groups:
        assert group.typer_instance is not None and isinstance(group.name, str)
        found += [([group.name, *path], option) for path, option in floats(group.typer_instance)]
    for command in app_.registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__.replace("_", "-")
        for parameter in inspect.signature(command.callback, eval_str=True).parameters.values():
            if "float" in str(parameter.annotation) and "str" not in str(parameter.annotation).split(",")[0]:
                found.append(([name], f"--{parameter.name.strip('_').replace('_', '-')}"))
    return found


@pytest.mark.parametrize(
    "value",
    ["nan", "inf", "1e999", "", *(pytest.param(one, marks=pytest.mark.thorough) for one in ("-inf", "0x10", "1,5"))],
)
@pytest.mark.parametrize(("path", "option"), floats(app), ids=str)
def test_every_option_refuses_what_is_no_number(
    path: list[str], option: str, value: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["asvhil", *path, option, value, *NEEDED.get(path[-1], ())])
    with pytest.raises(SystemExit) as caught:
        main()
    shown = capsys.readouterr().err
    assert caught.value.code == 2 and "Traceback" not in shown and option in shown


NEEDED = {
    "evaluate": ("a", "--data", "b"),
    "train": ("sd", "a", "-o", "b"),
    "run": ("sitl",),
    "check": ("sitl",),
    "learn": ("sitl",),
}


def test_there_are_such_options() -> None:
    assert {("hold", "--heading"), ("check", "--timeout"), ("sitl", "--duration")} <= {
        (path[-1], option) for path, option in floats(app)
    }
