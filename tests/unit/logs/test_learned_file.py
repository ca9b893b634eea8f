"""The file of what was learned: written whole at the end, offered in words, refused where it is not of this boat."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from asvhil.commands.learned import with_learned
from asvhil.config import Config, load_config
from asvhil.daemon.status import render, status_of
from asvhil.errors import AsvhilError, ConfigError
from asvhil.logs.learned_file import LearnedKeeper, learned_path, offer, read_learned, taken
from asvhil.preflight.computer import computer_checks
from asvhil.preflight.table import Result
from asvhil.simplant.lockstep import EPOCH_NS
from asvhil.types import Health, Learned, Outputs, Phase, changed

FACTORS = (0.7123, 1.0, 1.0, 0.98, 1.05)
NAMES = ("port", "starboard", "surge", "sway", "yaw")
HEALTH = Health(reason="", link_ok=True, estimate_ok=True, wind_ok=True, control_ok=True, model_ok=True, counters=())


def config_in(folder: Path, *keys: str, base: str = "sitl") -> Config:
    return load_config(base, (f"recorder.directory={folder}", "learning.enabled=true", *keys))


def outputs(learned: Learned | None) -> Outputs:
    return Outputs(
        t_ns=EPOCH_NS, phase=Phase.HOLD, frames=(), estimate=None, wind=None, station=None, control=None,
        pwm_us=None, health=HEALTH, learned=learned,
    )  # fmt: skip


def kept(config: Config, learned_s: float = 90.0) -> Path | None:
    keeper = LearnedKeeper(config)
    keeper.see(outputs(Learned(factors=FACTORS, std=(0.02,) * 5, learned_s=learned_s)))
    return keeper.save()


def test_what_was_learned_is_offered_and_taken(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path == learned_path(config) == tmp_path / "learned-wamv16.json"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    offered = offer(load_config("sitl", (f"recorder.directory={tmp_path}",)))
    assert offered is not None and offered.usable
    words = "port motor gives 71 % of the model's thrust, yaw answers by 105 % (2 min, ended 2023-11-14 22:13 UTC)"
    assert offered.text.startswith(words)
    assert offered.text.endswith(f"take it by --learned {path}")
    again = config_in(tmp_path, *taken(path, config))
    assert again.learning.start == (0.712, 1.0, 1.0, 0.98, 1.05) and offer(again) is None


def test_a_file_of_its_own_name(tmp_path: Path) -> None:
    assert kept(config_in(tmp_path, f"learning.file={tmp_path / 'a' / 'mine.json'}")) == tmp_path / "a" / "mine.json"


def test_little_or_nothing_learned_leaves_no_file(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    assert kept(config, learned_s=59.0) is None and offer(config) is None
    assert LearnedKeeper(config).save() is None
    unknown = LearnedKeeper(config)
    unknown.see(outputs(Learned(factors=FACTORS, std=(0.09,) * 5, learned_s=90.0)))
    assert unknown.save() is None
    assert kept(config_in(tmp_path, "learning.adapt=false")) is None
    assert not list(tmp_path.iterdir())


def test_where_it_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(AsvhilError, match=r"file/x\.json: what was learned cannot be written"):
        kept(config_in(tmp_path, f"learning.file={tmp_path / 'file' / 'x.json'}"))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"boat": "bream"}, "learned on the boat 'bream', and this is 'wamv16'"),
        ({"model_sha256": "0" * 64}, "learned with another model than the one in use"),
        ({"simulated": False}, "learned on the boat itself, which this start is not of"),
        ({"hull_sha256": "0" * 64}, "hull_sha256: learned with another hull than vehicle.vessel is now"),
        ({"format": True}, "not a file of what was learned on station, format 1"),
        ({"format": 1.0}, "not a file of what was learned on station, format 1"),
        ({"learned_s": 0}, "damaged: learned_s is 0, a number from 60 to 1e.09 is needed"),
        ({"std": dict.fromkeys(NAMES, 3.0)}, "std: nothing is known yet, 0.08 or less of a factor is needed"),
        ({"std": dict.fromkeys(NAMES, 0)}, "damaged: std.port is 0, a number from 0.001 to 3 is needed"),
        ({"ended": "9999-11-29 07:30 UTC"}, "damaged: ended is '9999-11-29 07:30 UTC', a date as 2026"),
        ({"ended": "2026-11-29\n07:30 UTC"}, r"damaged: ended is '2026-11-29\\n07:30 UTC', a date as 2026"),
        ({"ended": "2026-11-29 7:30 UTC"}, "damaged: ended is '2026-11-29 7:30 UTC', a date as 2026"),
        ({"format": 2}, "not a file of what was learned on station, format 1"),
        ({"factors": {"port": 1.0}}, "damaged: factors must have port, starboard, surge, sway, yaw"),
        ({"std": {"port": 0.1, "starboard": -0.1, "surge": 0, "sway": 0, "yaw": 0}}, "damaged: std.starboard is -0.1"),
        ({"learned_s": "long"}, "damaged: learned_s is 'long', a number from 60 to 1e.09 is needed"),
        ({"learned_s": 10**400}, "damaged: learned_s is 1000"),
        ({"ended": "now\nasvhil: all well"}, r"damaged: ended is 'now\\nasvhil: all well', a date as 2026"),
        (
            {"factors": {"port": 0.25, "starboard": 1, "surge": 1, "sway": 1, "yaw": 1}},
            "factors.port is 0.25, a number from 0.5 to 1.5 is needed",
        ),
    ],
)  # fmt: skip
def test_a_file_that_is_not_of_this_boat_is_refused_in_one_line(
    tmp_path: Path, change: dict[str, object], error: str
) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path is not None
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ConfigError, match=error) as raised:
        taken(path, config)
    assert str(raised.value).startswith(f"{path}: ") and "\n" not in str(raised.value)
    offered = offer(config)
    assert offered is not None and not offered.usable and offered.text == str(raised.value)


def test_another_model_of_the_same_boat_is_another_one(tmp_path: Path) -> None:
    path = kept(config_in(tmp_path))
    assert path is not None
    for keys in (("controller.name=nnsem-mpc",), ("controller.name=sd-mpc",)):
        with pytest.raises(ConfigError, match="another model"):
            read_learned(path, config_in(tmp_path, *keys))


def test_another_hull_under_the_same_name_is_another_boat(tmp_path: Path) -> None:
    path = kept(config_in(tmp_path))
    assert path is not None
    with pytest.raises(ConfigError, match=r"hull_sha256: learned with another hull") as raised:
        read_learned(path, config_in(tmp_path, "vehicle.vessel.mass_kg=300"))
    assert str(path) in str(raised.value)


@pytest.mark.parametrize(("keys", "is_taken"), [((), False), (("controller.name=sd-mpc",), True)])
def test_a_file_of_an_older_version_without_the_hull_is_named_as_that(
    tmp_path: Path, keys: tuple[str, ...], is_taken: bool
) -> None:
    """Where the model is the physics, its hash is the hull's."""
    config = config_in(tmp_path, *keys)
    path = kept(config)
    assert path is not None
    tree = json.loads(path.read_text())
    del tree["hull_sha256"]
    path.write_text(json.dumps(tree))
    if is_taken:
        assert read_learned(path, config).learned.factors == FACTORS
        return
    with pytest.raises(ConfigError, match=r"json: of an older version, without hull_sha256: .*; learn anew") as raised:
        read_learned(path, config)
    assert "another hull" not in str(raised.value)


def test_a_computer_without_a_clock_writes_what_it_reads(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    keeper = LearnedKeeper(config)
    learned = Learned(factors=FACTORS, std=(0.02,) * 5, learned_s=90.0)
    keeper.see(changed(outputs(learned), t_ns=95_000_000_000))
    path = keeper.save()
    assert path is not None and read_learned(path, config).ended == "1970-01-01 00:01 UTC"


def test_a_key_that_stands_there_twice_is_named(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path is not None
    path.write_text(path.read_text().replace('"port": 0.7123,', '"port": 0.7123, "port": 1.2,'))
    with pytest.raises(ConfigError, match=r"json: damaged: 'port' stands there twice; once is right"):
        read_learned(path, config)


def test_a_byte_order_mark_before_it_does_no_harm(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path is not None
    before = read_learned(path, config)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_learned(path, config) == before


def test_what_is_not_known_is_neither_offered_nor_taken(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path is not None
    tree = json.loads(path.read_text())
    tree["std"]["yaw"] = 0.081
    path.write_text(json.dumps(tree))
    offered = offer(load_config("sitl", (f"recorder.directory={tmp_path}",)))
    assert offered is not None and "yaw" not in offered.text and "port motor gives 71 %" in offered.text
    assert config_in(tmp_path, *taken(path, config)).learning.start == (0.712, 1.0, 1.0, 0.98, 1.0)


def test_damaged_and_missing_files(tmp_path: Path) -> None:
    config, path = config_in(tmp_path), tmp_path / "x.json"
    with pytest.raises(ConfigError, match=r"x\.json: cannot be read \(No such file or directory\)"):
        read_learned(path, config)
    path.write_bytes(b"\xff{")
    with pytest.raises(ConfigError, match=r"x\.json: damaged: not JSON"):
        read_learned(path, config)


def test_a_check_offers_it_and_warns_of_one_that_is_not_of_this_boat(tmp_path: Path) -> None:
    config = load_config("sitl", (f"recorder.directory={tmp_path}",))
    assert not [check for check in computer_checks(config) if check.item == "learned on station"]
    path = kept(config_in(tmp_path))
    assert path is not None
    (found,) = (check for check in computer_checks(config) if check.item == "learned on station")
    assert found.result is Result.PASS and "--learned" in found.found
    path.write_text("{")
    (found,) = (check for check in computer_checks(config) if check.item == "learned on station")
    assert found.result is Result.WARN and "damaged" in found.found and found.todo


def test_a_start_says_what_it_could_take_and_takes_it_only_when_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = (f"recorder.directory={tmp_path}",)
    path, config = kept(config_in(tmp_path)), load_config("sitl", keys)
    assert with_learned(config, "sitl", keys, None) == config
    assert "asvhil: learned on station: port motor gives 71 %" in capsys.readouterr().err
    started = with_learned(config, "sitl", keys, path)
    assert started.learning.enabled and started.learning.start[0] == 0.712
    assert not capsys.readouterr().err


def test_the_status_has_the_factors_and_why_nothing_is_learned() -> None:
    learned = Learned(factors=FACTORS, std=(0.02,) * 5, learned_s=90.0, frozen="rough water")
    status = status_of(outputs(learned), {}, EPOCH_NS, 0)
    assert status["learned"]["factors"]["port"] == 0.7123
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(render({**status, "station": None}, "boat"))
    assert "thrust, yaw answers by 105 %; frozen: rough water" in console.export_text()
    assert status_of(outputs(None), {}, EPOCH_NS, 0)["learned"] is None


def test_a_file_nested_without_end_and_a_name_too_long_are_told(tmp_path: Path) -> None:
    config = config_in(tmp_path)
    path = kept(config)
    assert path is not None
    path.write_text("[" * 200_000)
    offered = offer(config)
    assert offered is not None and not offered.usable and "damaged: not JSON" in offered.text
    offered = offer(load_config("sitl", (f"learning.file={'x' * 300}",)))
    assert offered is not None and not offered.usable and "learning.file" in offered.text


@pytest.mark.parametrize(
    ("keys", "error"),
    [
        (("least=1.4", "most=0.6"), "least < most must hold"),
        (("start=[0.4,1,1,1,1]",), "each of start must lie within least and most, 0.5 to 1.5"),
        (("prior_std=1e200",), "learning.prior_std"),
        (("walk=1e160",), "learning.walk"),
    ],
)
def test_bounds_that_mean_nothing_are_refused(keys: tuple[str, ...], error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        load_config("sitl", tuple(f"learning.{key}" for key in keys))
