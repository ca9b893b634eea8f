"""Plug-in files: loaded by path, once for each content, and their mistakes are one line."""

import subprocess
import sys
from pathlib import Path

import pytest

from asvhil.backseat.build import build_backseat, build_controller, build_model
from asvhil.config import Config, config_from_json, load_config
from asvhil.config.registry import CONTROLLERS
from asvhil.errors import ConfigError
from asvhil.operator.tunables import Tunables
from asvhil.simplant.lockstep import Lockstep
from asvhil.study.search_spaces import spaces
from asvhil.study.six_tests import available, labelled
from tests.support.plugins import PUSHER, write_pusher


def test_a_controller_of_a_file_drives(tmp_path: Path) -> None:
    loop = Lockstep(load_config(write_pusher(tmp_path, level=0.25)))
    commands = {outputs.control.command for _, outputs in (loop.tick() for _ in range(200)) if outputs.control}
    assert commands == {(0.25, 0.25)}


def test_its_settings_are_in_the_config_with_their_defaults(tmp_path: Path) -> None:
    config = load_config(write_pusher(tmp_path))
    assert config.controller.settings.level == 0.1
    assert '"the_pusher": {"level": 0.1}' in config.canonical_json()
    again = config_from_json(config.canonical_json(), "memory")
    assert again == config and again.content_hash() == config.content_hash()
    assert load_config(tmp_path / "boat.yaml", ("controller.the_pusher.level=0.2",)).controller.settings.level == 0.2


def test_configs_without_plugins_have_the_hash_that_they_always_had() -> None:
    tree = load_config("sitl").model_dump()
    assert "plugins" not in tree and "sensors" not in tree["links"] and "sensors" not in tree["plant"]["links"]


def test_the_hash_counts_what_is_in_the_file_and_not_where_it_is(tmp_path: Path) -> None:
    here, there = (load_config(write_pusher(tmp_path / name)) for name in ("here", "there"))
    assert here.content_hash() == there.content_hash()
    edited = load_config(write_pusher(tmp_path / "here", text=PUSHER + "\n# edited\n"))
    assert edited.content_hash() != here.content_hash()


def test_a_path_is_from_the_folder_of_the_file_that_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_pusher(tmp_path / "base")
    (tmp_path / "top.yaml").write_text("base: base/boat.yaml\n")
    file = str(tmp_path / "base" / "pusher.py")
    assert [plugin.file for plugin in load_config(tmp_path / "top.yaml").plugins] == [file]
    monkeypatch.chdir(tmp_path / "base")
    config = load_config("sitl", ("plugins=[pusher.py]", "controller.name=the-pusher"))
    assert [plugin.file for plugin in config.plugins] == [file]


def test_a_file_is_run_once_and_again_when_it_has_changed(tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    text = f"{PUSHER}\nwith open({str(marks)!r}, 'a') as file: file.write('x')\n"
    boat = write_pusher(tmp_path, text=text)
    first = load_config(boat)
    load_config(boat)
    assert marks.read_text() == "x"
    write_pusher(tmp_path, text=text.replace("level: float = 0.1", "level: float = 0.7"))
    second = load_config(boat)
    assert marks.read_text() == "xx"
    assert build_controller(second, build_model(second)).settings.level == 0.7  # type: ignore[attr-defined]
    # The older config must not be built from the newer code unnoticed.
    with pytest.raises(ConfigError, match=r"the controller the-pusher is that of the plug-in .*pusher\.py \(SHA-256 "):
        build_backseat(first)
    assert build_backseat(load_config(write_pusher(tmp_path, text=text)))
    assert marks.read_text() == "xx"


def test_a_kind_of_a_file_belongs_to_the_configs_that_name_it(tmp_path: Path) -> None:
    load_config(write_pusher(tmp_path))
    with pytest.raises(ConfigError, match=r"that of the plug-in .*pusher\.py .*, which is not among the plugins"):
        load_config("sitl", ("controller.name=the-pusher",))
    tree = load_config("sitl").model_dump()
    tree["plugins"] = [{"file": "pusher.py", "sha256": "0" * 64}]
    with pytest.raises(ValueError, match=r"the plug-in pusher\.py is not loaded"):
        Config.model_validate(tree)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def f(:\n", "pusher.py, line 1: SyntaxError: invalid syntax"),
        ("import math\n\nmath.sqrt(-1)\n", "pusher.py, line 3: ValueError: math domain error"),
        ("import nowhere_at_all\n", "pusher.py, line 1: ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("x = 1\n", "pusher.py: has none of these at its top level: ControllerKind, EstimatorKind"),
        (PUSHER.replace("the-pusher", "loiter"), "asvhil has a controller loiter of its own; give yours another name"),
        ("\x00", "pusher.py"),
        ("import sys\n\nsys.exit(0)\n", "pusher.py, line 3: it ends the program"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(write_pusher(tmp_path, text=text))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path}/boat.yaml: key plugins: ") and words in message and "\n" not in message


@pytest.mark.parametrize(
    ("plugins", "words"),
    [
        ("[nowhere.py]", "key plugins: plug-in {}/nowhere.py: cannot be read (No such file or directory)"),
        ("[.]", "key plugins: plug-in {}: cannot be read (Is a directory)"),
        ("pusher.py", "key plugins: "),
        ("[1]", "key plugins.0: "),
        ("[{path: pusher.py}]", "key plugins.0.path: unknown key"),
        ("[{file: pusher.py, sha256: abc}]", "key plugins.0.sha256: "),
        ("[{file: pusher.py, sha256: " + 64 * "a" + "}]", "pusher.py: has changed: SHA-256 "),
        ("[pusher.py, copy.py]", "plug-in {0}/copy.py: controller the-pusher is defined in {0}/pusher.py too"),
    ],
)
def test_wrong_plugins_are_one_line(tmp_path: Path, plugins: str, words: str) -> None:
    boat = write_pusher(tmp_path)
    (tmp_path / "copy.py").write_text(PUSHER + "\n")
    boat.write_text(boat.read_text().replace("[pusher.py]", plugins))
    with pytest.raises(ConfigError) as caught:
        load_config(boat)
    assert words.format(tmp_path) in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_are_no_text_are_one_line(tmp_path: Path) -> None:
    boat = write_pusher(tmp_path)
    (tmp_path / "pusher.py").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match=r"pusher\.py: not UTF-8 text"):
        load_config(boat)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("controller.the_pusher.levle=1", "key controller.the_pusher.levle: unknown key, did you mean level?"),
        ("controller.the_pusher.level=x", "key controller.the_pusher.level: a number is expected, not the text 'x'"),
        ("controller.the_pushr={}", "key controller.the_pushr: unknown key, did you mean the_pusher?"),
        ("controller.name=the-pushr", "unknown controller, did you mean the-pusher?"),
    ],
)
def test_wrong_settings_of_a_plugin_name_the_key(tmp_path: Path, override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(write_pusher(tmp_path), (override,))
    assert words in str(caught.value)


def test_operators_change_its_parameters(tmp_path: Path) -> None:
    config = load_config(write_pusher(tmp_path))
    controller = build_controller(config, build_model(config))
    tunables = Tunables(config.controller, controller)
    assert tunables.names == ("PUSH_LEVEL",) and tunables.value("PUSH_LEVEL") == pytest.approx(10.0)
    assert tunables.set("PUSH_LEVEL", 40.0) is None
    assert controller.settings.level == pytest.approx(0.4)  # type: ignore[attr-defined]
    assert tunables.set("PUSH_LEVEL", 101.0) is not None
    # With the procedure around it, its parameters stand beside those of the procedure.
    config = load_config(tmp_path / "boat.yaml", ("controller.procedure.enabled=true",))
    names = Tunables(config.controller, build_controller(config, build_model(config))).names
    assert names[:2] == ("PUSH_LEVEL", "PROC_R_S")


def test_studies_take_it_from_the_table(tmp_path: Path) -> None:
    boat = write_pusher(tmp_path)
    load_config(boat)
    assert labelled()["Pusher"].name == "the-pusher"
    found, left_out = available(["Pusher"], None, str(boat), ())
    assert found == {"Pusher": ("controller.name=the-pusher",)} and not left_out
    assert [parameter.key for parameter in spaces(load_config(boat))["the-pusher"]] == ["controller.the_pusher.level"]


def test_a_tick_looks_nothing_up_and_opens_no_file(tmp_path: Path) -> None:
    """Names are found and files are read at start-up alone: the core stays a function of its frames."""
    boat = write_pusher(tmp_path)
    code = (
        "import sys\n"
        "from asvhil.config import load_config\n"
        "from asvhil.simplant.lockstep import Lockstep\n"
        f"loop = Lockstep(load_config({str(boat)!r}))\n"
        "[loop.tick() for _ in range(200)]\n"
        "seen = []\n"
        "sys.addaudithook(lambda event, args: seen.append(event) if event in ('open', 'import', 'exec') else None)\n"
        "[loop.tick() for _ in range(40)]\n"
        "sys.exit(', '.join(seen) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_row_says_where_it_is_from(tmp_path: Path) -> None:
    config = load_config(write_pusher(tmp_path))
    origin = CONTROLLERS.origin("the-pusher")
    assert (origin.file, origin.sha256) == (config.plugins[0].file, config.plugins[0].sha256)
