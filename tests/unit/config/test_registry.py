"""The tables of kinds: their rows can be built, names are checked, and other packages add to them."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from asvhil.config import Section, load_config
from asvhil.config.chosen import Choosing
from asvhil.config.registry import (
    AUTOPILOTS,
    CONTROLLERS,
    REGISTRIES,
    ControllerKind,
    Kind,
    OperatorParameter,
    Origin,
    Registry,
)
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect
from tests.support.plugins import PUSHER, install

ROWS = [(registry, row) for registry in REGISTRIES for row in registry]
ENTRY = "[asvhil.controllers]\nthe-pusher = pusher_package:KIND\n"


@pytest.mark.parametrize(
    ("registry", "row"), ROWS, ids=lambda value: getattr(value, "name", getattr(value, "what", ""))
)
def test_every_row_of_the_tables_can_be_built(registry: Registry[Kind], row: Kind) -> None:
    assert callable(row.builder())
    assert registry.find(row.name) is row and registry.origin(row.name) == Origin()


def test_the_tables_import_nothing_that_they_name() -> None:
    code = (
        "import sys, asvhil.config\n"
        "asvhil.config.load_config('sitl')\n"
        "sys.exit(', '.join(sorted(m for m in sys.modules if m.startswith('asvhil.') and "
        "m.split('.')[1] not in ('config', 'errors', 'files', 'geo', 'types'))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("config", Choosing.__subclasses__())
def test_settings_of_a_row_are_a_key_of_the_section_that_chooses(config: type[Choosing]) -> None:
    for row in config.registry:
        if row.section is not None:
            assert config.model_fields[row.settings_key].annotation is row.section


def test_makes_of_autopilots_are_those_of_mavlink() -> None:
    assert AUTOPILOTS.find("ardurover").mav_autopilot == dialect.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert AUTOPILOTS.find("px4").mav_autopilot == dialect.MAV_AUTOPILOT_PX4


@pytest.mark.parametrize(
    ("override", "words"),
    [
        (
            "controller.name=sliding-mod",
            "key controller.name: unknown controller, did you mean sliding-mode? (known: nn",
        ),
        ("controller.name=[1]", "key controller.name: text is expected, not a list"),
        (
            "controller.solver=sqq",
            "key controller.solver: unknown solver, did you mean sqp? (known: sqp, ipopt, fatrop",
        ),
        ("estimator.kind=kalman", "key estimator.kind: unknown estimator (known: ekf, fir, raw)"),
        ("links.autopilot.profile=px5", "key links.autopilot.profile: unknown autopilot, did you mean px4? (known: ar"),
        ("links.autopilot.output=rc", "key links.autopilot.output: unknown motor output (known: rc_override, manual"),
        ("links.anemometer.endpoint=sereal:/dev/x:1", "would be right: serial:PATH:BAUD"),
        ("links.sensors={mast: {kind: nmae, endpoint: 'pty:x'}}", "unknown sensor, did you mean nmea? (known: nmea"),
        ("links.sensors={gnss: {kind: nmea, endpoint: 'pty:x'}}", "the name is that of a link with a key of its own"),
        ("controller.slidin_mode={}", "key controller.slidin_mode: unknown key, did you mean sliding_mode?"),
        ("estimator.ekv={}", "key estimator.ekv: unknown key, did you mean ekf?"),
    ],
)
def test_a_name_that_there_is_not_is_one_line_with_those_there_are(override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", (override,))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_kind_of_an_installed_package_is_found_by_its_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, "pusher_package", PUSHER, ENTRY)
    monkeypatch.syspath_prepend(tmp_path)
    config = load_config("sitl", ("controller.name=the-pusher", "controller.the_pusher.level=0.3"))
    assert config.controller.settings.level == 0.3
    assert CONTROLLERS.origin("the-pusher") == Origin(package="pusher-package", version="1.2")
    # Its settings may stand in a config that chooses another controller.
    other = load_config("sitl", ("controller.the_pusher.level=0.3",))
    assert other.controller.name == "lagnet-mpc" and '"the_pusher": {"level": 0.3}' in other.canonical_json()


def test_installed_kinds_are_among_the_known_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "pusher_package", PUSHER, ENTRY)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match=r"did you mean the-pusher\? \(known: .*, the-pusher\)"):
        load_config("sitl", ("controller.name=the-pushr",))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import nowhere_at_all", "ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("KIND = 1 / 0", "ZeroDivisionError: division by zero"),
        ("KIND = 7", "a ControllerKind of the name the-pusher is expected there"),
        (PUSHER.replace('"the-pusher"', '"another"'), "a ControllerKind of the name the-pusher is expected there"),
        ("", "AttributeError: module 'pusher_package' has no attribute 'KIND'"),
    ],
)
def test_a_broken_package_is_one_line_that_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, words: str
) -> None:
    install(tmp_path, "pusher_package", text, ENTRY)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pusher_package", raising=False)
    importlib.invalidate_caches()
    with pytest.raises(ConfigError) as caught:
        load_config("sitl", ("controller.name=the-pusher",))
    message = str(caught.value)
    assert message.startswith(
        "the package pusher-package 1.2, entry point the-pusher = pusher_package:KIND of asvhil.con"
    )
    assert message.endswith(words) and "\n" not in message


def test_no_package_takes_the_place_of_a_kind_of_asvhil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, "pusher_package", "raise SystemExit", "[asvhil.controllers]\nloiter = pusher_package:KIND\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert load_config("sitl", ("controller.name=loiter",)).controller.settings.radius_m == 1.258
    row = ControllerKind(name="loiter", build=print)
    with pytest.raises(
        ConfigError, match=r"the package other 2: asvhil has a controller loiter of its own; give yours"
    ):
        CONTROLLERS.add(row, Origin(package="other", version="2"))


def test_a_kind_may_not_have_its_settings_under_a_key_that_is_taken() -> None:
    class Own(Section):
        """Of the test."""

    row = ControllerKind(name="mpc", build=print, section=Own)
    CONTROLLERS.add(row, Origin(package="other", version="2"))
    with pytest.raises(
        ConfigError,
        match=r"key controller: the settings of mpc are under mpc, which is taken: its kind needs another key",
    ):
        load_config("sitl", ("controller.name=mpc",))


def test_parameters_of_operators_are_settings_with_names_that_fit() -> None:
    class Own(Section):
        """Of the test."""

        gain: float = 1.0

    def kind(name: str, *path: str) -> ControllerKind:
        parameter = OperatorParameter(name=name, path=path, least=0.0, most=1.0)
        return ControllerKind(name="own", build=print, section=Own, parameters=(parameter,))

    assert kind("OWN_GAIN_MAXIMUM", "gain").parameters[0].name == "OWN_GAIN_MAXIMUM"
    with pytest.raises(ValueError, match=r"parameter OWN_GAIN_MAXIMUM_: a name has 1 to 16 characters"):
        kind("OWN_GAIN_MAXIMUM_", "gain")
    for path in (("gian",), ("gain", "deeper")):
        with pytest.raises(ValueError, match=rf"parameter OWN: the settings of own have no {'.'.join(path)}"):
            kind("OWN", *path)


def test_settings_without_a_default_are_asked_for_by_their_key() -> None:
    class Own(Section):
        """Of the test."""

        gain: float

    CONTROLLERS.add(ControllerKind(name="own-one", build=print, section=Own), Origin(package="other", version="2"))
    with pytest.raises(ConfigError, match=r"key controller\.own_one\.gain: this key is required"):
        load_config("sitl", ("controller.name=own-one",))
