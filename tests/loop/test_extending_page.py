"""docs/extending.md does what it says: its files are written as they stand there, and its commands run."""

import dataclasses
import functools
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from asvhil.backseat.build import build_link
from asvhil.config import load_config
from asvhil.config.plugins import unload_all
from asvhil.config.ports import AUTOPILOT
from asvhil.config.registry import REGISTRIES
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.reader import LogFile
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.types import Phase
from tests.support.command_line import call
from tests.support.paths import ROOT

PAGE = (ROOT / "docs" / "extending.md").read_text()
SECTIONS = dict(part.split("\n", 1) for part in PAGE.split("\n## ")[1:])
FILE = re.compile(r"^`([\w.-]+)`:\n\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXAMPLES = ["A controller", "A sensor", "A state estimator", "An autopilot", "A way to the motors"]


def written(section: str, folder: Path) -> list[list[str]]:
    """The files of a section, written; its commands, as words."""
    for name, text in FILE.findall(SECTIONS[section]):
        (folder / name).write_text(text)
    return [line.split() for block in COMMANDS.findall(SECTIONS[section]) for line in block.splitlines()]


def start(words: list[str], folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "asvhil", *words[1:]] if words[0] == "asvhil" else [sys.executable, *words[1:]]
    return subprocess.Popen(command, cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run(words: list[str], folder: Path) -> str:
    """A command that must succeed, with no plug-in loaded before; what it says."""
    unload_all()
    said = call(*words[1:], cwd=folder)
    unload_all()
    assert words[0] == "asvhil" and (said.status, said.err) == (0, "")
    return said.out


@dataclasses.dataclass
class Example:
    """A section that was done as it says: its folder, the log, and what the two commands said."""

    folder: Path
    log: Path
    sitl: str
    replay: str


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Example]:
    """Does a section, once."""

    @functools.cache
    def do(section: str) -> Example:
        folder = tmp_path_factory.mktemp("example")
        sitl, replay = written(section, folder)
        return Example(folder, folder / sitl[sitl.index("--log") + 1], run(sitl, folder), run(replay, folder))

    return do


@pytest.mark.parametrize("section", EXAMPLES)
def test_an_example_drives_the_simulated_boat_and_its_log_replays(section: str, done: Callable[[str], Example]) -> None:
    example = done(section)
    phases = [decode_outputs(data).phase for _, data in LogFile(example.log).ticks() if data is not None]
    assert f"{len(phases)} ticks bit-exact" in example.replay
    assert phases.count(Phase.HOLD) > len(phases) - 100 > 300  # from the hold to the end
    config = load_config(example.folder / "my-boat.yaml")
    (plugin,) = config.plugins
    used = [name for registry, name in config.chosen() if registry.origin(name).file == plugin.file]
    assert len(used) == 1


def test_the_controller_brings_the_boat_to_the_station(done: Callable[[str], Example]) -> None:
    summary = summarise(read_run(done("A controller").log))
    assert summary["truth"]["distance_m"]["mean"] < 3.0  # it starts 14 m off


def test_the_sensor_measures_the_wind(done: Callable[[str], Example]) -> None:
    summary = summarise(read_run(done("A sensor").log))
    assert summary["wind"]["estimated"]["speed_mps"]["mean"] == pytest.approx(5.0, abs=0.5)
    assert summary["wind"]["estimated"]["toward_deg"]["mean"] == pytest.approx(90.0, abs=10.0)
    assert summary["counters"]["mast.lines"] > 100 and summary["counters"]["mast.bad"] == 0


def test_the_summary_says_whether_the_sensor_is_used(done: Callable[[str], Example]) -> None:
    example = done("A sensor")
    assert "wind mast.WIND\n" in example.sitl and "dropped" not in example.sitl
    text = (example.folder / "my_wind.py").read_text()
    broken = example.folder / "broken"
    broken.mkdir()
    (broken / "my_wind.py").write_text(text.replace('letter == b"W"', 'letter == b"V"'))
    (broken / "my-boat.yaml").write_text((example.folder / "my-boat.yaml").read_text())
    command = ["asvhil", "sitl", "my-boat.yaml", "--lockstep", "--duration", "10", "--no-picture", "--log", "log.mcap"]
    said = run(command, broken)
    assert "wind not heard\n" in said and re.search(r"^dropped, mast: \d+ bad$", said, re.MULTILINE)
    assert "wind, estimated" not in said
    assert not (broken / "runs").exists()  # the log is elsewhere, and there is nothing else to keep


def test_the_autopilot_tells_its_battery(done: Callable[[str], Example]) -> None:
    assert "battery: low: 12.6 V" in done("An autopilot").sitl


def test_the_autopilot_loses_nothing_that_its_base_reads_of_the_same_message(done: Callable[[str], Example]) -> None:
    example = done("An autopilot")
    link = build_link(load_config(example.folder / "my-boat.yaml"))
    for inputs, _ in LogFile(example.log).ticks():
        for frame in inputs.frames:
            if frame.port == AUTOPILOT:
                link.receive(frame)
    assert link.arming_checks.ok  # None where no SYS_STATUS was read


@pytest.mark.real_time
def test_the_link_carries_the_wind(tmp_path: Path) -> None:
    daemon, sender, replay = written("A kind of link", tmp_path)
    with start(daemon, tmp_path) as process:
        for _ in range(200):
            if (tmp_path / "wind.sock").exists():
                break
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.1)
        with start(sender, tmp_path) as sending:
            assert sending.wait(60) == 0
        assert process.wait(60) == 0
    log = LogFile(tmp_path / "link.mcap")
    assert len(list(log.frames("anemometer", "in"))) == 25
    sources = [dict(decode_outputs(data).health.sources) for _, data in log.ticks() if data is not None]
    assert any(source["wind"] == "anemometer.MWV" for source in sources)
    assert "bit-exact" in run(replay, tmp_path)


def test_the_project_file_names_entry_points_that_are_looked_for() -> None:
    section = SECTIONS["How a plug-in is found, and what a log keeps of it"]
    ((name, text),) = FILE.findall(section)
    project = tomllib.loads(text)["project"]
    groups = {registry.group for registry in REGISTRIES}
    assert name == "pyproject.toml" and set(project["entry-points"]) < groups
    # Of solvers there is no example: no text about them, no promise.
    assert {word for word in re.findall(r"`(asvhil\.\w+)`", PAGE) if word in groups} == groups - {"asvhil.solvers"}


def test_every_record_of_the_table_is_there() -> None:
    for registry in REGISTRIES:
        assert registry.what == "solver" or f"`{registry.kind.__name__}`" in PAGE
