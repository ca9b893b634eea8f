"""Plug-ins in a log: recorded, asked for by a replay, and never run because a log says so."""

import json
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.config.plugins import unload_all
from asvhil.errors import ConfigError, LogError
from asvhil.logs.plugins import load_plugins
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import config_of, replay
from asvhil.logs.run import read_run
from asvhil.sitl import run_lockstep
from tests.support.command_line import Said, call
from tests.support.plugins import PUSHER, install, write_pusher


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Of a run whose plug-in is at `boat/pusher.py`, and not loaded any more."""
    path = tmp_path / "log.mcap"
    run_lockstep(load_config(write_pusher(tmp_path / "boat", level=0.3)), path, 8.0)
    unload_all()
    return path


def refusal(path: Path) -> str:
    with pytest.raises(LogError) as caught:
        replay(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_path_hash_and_text_of_a_file_are_recorded(log: Path) -> None:
    record = LogFile(log).metadata["plugin.0"]
    assert record["file"] == str(log.parent / "boat" / "pusher.py") and record["source"] == PUSHER
    assert record["gives"] == "controller the-pusher"
    assert json.loads(LogFile(log).metadata["config"]["json"])["plugins"][0]["sha256"] == record["sha256"]


def test_a_replay_asks_for_the_file_and_takes_no_other(log: Path, tmp_path: Path) -> None:
    said = refusal(log)
    assert said.startswith(f"{log}: the run had the controller the-pusher of the plug-in pusher.py (SHA-256 ")
    assert (
        f"give that file with --plugin {tmp_path}/boat/pusher.py, or run the copy in the log with --allow-rec" in said
    )
    edited = tmp_path / "pusher.py"
    edited.write_text(PUSHER + "\n# edited\n")
    load_plugins([log], [edited])
    assert f"and {edited} is not the same (SHA-256 " in refusal(log)
    load_plugins([log], [tmp_path / "boat" / "pusher.py"])
    assert replay(log).mismatch is None


def test_without_the_file_the_place_is_not_told(log: Path, tmp_path: Path) -> None:
    (tmp_path / "boat" / "pusher.py").write_text(PUSHER + "\n# edited\n")
    assert "give that file with --plugin, or run the copy" in refusal(log)
    (tmp_path / "boat" / "pusher.py").unlink()
    assert "give that file with --plugin, or run the copy" in refusal(log)


def test_the_copy_in_the_log_is_run_where_that_is_allowed(log: Path) -> None:
    load_plugins([log], allow_recorded=True)
    assert replay(log).mismatch is None


def test_a_copy_that_is_damaged_is_not_run(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = log.parent / "ran"
    whole = LogFile.__init__

    def damaged(self: LogFile, path: Path) -> None:
        whole(self, path)
        self.metadata["plugin.0"]["source"] = f"open({str(ran)!r}, 'w')\n{PUSHER}"

    monkeypatch.setattr(LogFile, "__init__", damaged)
    with pytest.raises(LogError, match=r"the record of the plug-in .*pusher\.py is damaged"):
        load_plugins([log], allow_recorded=True)
    assert not ran.exists()


def test_a_log_is_read_without_its_plugins(log: Path) -> None:
    run = read_run(log)
    assert run.config.controller.name == "the-pusher" and run.ticks == 163
    assert config_of(LogFile(log), log, known_only=True) == run.config
    with pytest.raises(ConfigError, match=r"unknown controller \(known:"):
        _ = run.config.controller.settings


def test_no_command_runs_what_stands_in_a_log(log: Path, tmp_path: Path) -> None:
    """Not the text in it, and not the file at the path that it names."""
    ran = tmp_path / "ran"
    boat = write_pusher(tmp_path / "boat", text=f"open({str(ran)!r}, 'w').close()\n{PUSHER}")
    log = tmp_path / "second.mcap"
    run_lockstep(load_config(boat), log, 4.0)
    ran.unlink()

    def asvhil(*arguments: str) -> Said:
        unload_all()
        return call(*arguments, cwd=tmp_path)

    assert asvhil("report", str(log)).status == 0
    assert "--allow-recorded-plugins if you trust it" in asvhil("replay", str(log)).err
    assert "--allow-recorded-plugins if you trust it" in asvhil("calibrate", str(log)).err
    assert not ran.exists()
    assert "bit-exact" in asvhil("replay", str(log), "--plugin", str(tmp_path / "boat" / "pusher.py")).out
    assert ran.exists()
    ran.unlink()
    assert "bit-exact" in asvhil("replay", str(log), "--allow-recorded-plugins").out
    assert ran.exists()


def test_an_installed_package_is_recorded_and_its_absence_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    site.mkdir()
    install(site, "pusher_package", PUSHER, "[asvhil.controllers]\nthe-pusher = pusher_package:KIND\n")
    path = tmp_path / "log.mcap"
    with monkeypatch.context() as installed:
        installed.syspath_prepend(site)
        run_lockstep(load_config("sitl", ("controller.name=the-pusher",)), path, 8.0)
        unload_all()
        assert replay(path).mismatch is None
    log = LogFile(path)
    assert log.metadata["plugin.0"] == {
        "package": "pusher-package",
        "version": "1.2",
        "gives": "controller the-pusher",
    }
    assert log.metadata["versions"]["pusher-package"] == "1.2"
    unload_all()
    words = "the run had the controller the-pusher of the package pusher-package 1.2, which is not installed here"
    assert refusal(path) == f"{path}: {words}"
    assert read_run(path).config.controller.name == "the-pusher"


def test_a_replay_that_differs_tells_that_a_package_is_of_another_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry = "[asvhil.controllers]\nthe-pusher = {}:KIND\n"
    path = tmp_path / "log.mcap"
    for name, version, text in (("one", "1.2", PUSHER), ("two", "1.3", PUSHER.replace("level, self", "level, -self"))):
        (tmp_path / name).mkdir()
        install(tmp_path / name, f"pusher_{name}", text, entry.format(f"pusher_{name}"), version)
        with monkeypatch.context() as installed:
            installed.syspath_prepend(tmp_path / name)
            if name == "one":
                run_lockstep(load_config("sitl", ("controller.name=the-pusher",)), path, 8.0)
                assert replay(path).changed_packages == ()
            else:
                result = replay(path)
                assert result.mismatch is not None
                assert result.changed_packages == ("pusher-one 1.2 then, pusher-two 1.3 now",)
            unload_all()
