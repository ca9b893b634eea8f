"""Mutation tests of what stands between a fault and the motors: `python -m bench.mutants [FILE ...]`. Needs mutmut.

Every mutant of a module is one small change of its code, and should make one of the tests fail that belong to the
module: those of MODULES, and no others. mutmut changes what stands in functions; constants of modules, default values
and functions with decorators stay as they are.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

from bench.ending import end_in_words

ROOT = Path(__file__).resolve().parents[1]
SUPERVISOR = tuple(
    f"tests/unit/supervisor/test_{theme}.py"
    for theme in (
        "supervisor",
        "arming_help",
        "auto_engage",
        "geofence",
        "letting_go",
        "mode_request",
        "motor_sticks",
        "neutral",
        "pilot_first",
        "point_of_the_boat",
        "station_motion",
        "station_steps",
        "stations",
        "watched_sticks",
        "weather_heading",
    )
)
MODULES = {
    "asvhil/estimator/wind.py": ("tests/unit/estimator/test_wind.py",),
    "asvhil/estimator/sensor_health.py": ("tests/unit/estimator/test_sensor_health.py",),
    "asvhil/autopilot/motor_outputs.py": ("tests/unit/autopilot/test_motor_outputs.py",),
    "asvhil/autopilot/script_output.py": ("tests/unit/autopilot/test_script_output.py",),
    "asvhil/autopilot/readback.py": tuple(
        f"tests/unit/autopilot/test_readback{theme}.py" for theme in ("", "_sticks", "_times")
    ),
    "asvhil/autopilot/transmitter.py": ("tests/unit/autopilot/test_transmitter.py",),
    "asvhil/autopilot/ground_stations.py": (
        "tests/unit/autopilot/test_ground_stations.py",
        "tests/unit/autopilot/test_station_sticks.py",
    ),
    "asvhil/backseat/actuation.py": ("tests/unit/backseat/test_actuation.py",),
    "asvhil/controller/pwm.py": ("tests/unit/controller/test_pwm.py",),
    "asvhil/io/mavlink/signing.py": ("tests/unit/io/mavlink/test_signing.py",),
    "asvhil/links/guardian_process.py": ("tests/unit/links/test_guardian_process.py",),
    "asvhil/motion/carried.py": ("tests/unit/motion/test_carried.py",),
    "asvhil/motion/distance.py": ("tests/unit/motion/test_distance.py",),
    "asvhil/motion/evidence.py": ("tests/unit/motion/test_evidence.py",),
    "asvhil/motion/monitor.py": ("tests/unit/motion/test_monitor.py", "tests/unit/motion/test_monitor_steps.py"),
    "asvhil/motion/watch.py": ("tests/unit/motion/test_watch.py", "tests/unit/motion/test_carried.py"),
    "asvhil/supervisor/arming_help.py": SUPERVISOR,
    "asvhil/supervisor/battery_watch.py": ("tests/unit/supervisor/test_battery_watch.py",),
    "asvhil/supervisor/conditions.py": SUPERVISOR,
    "asvhil/supervisor/geofence.py": ("tests/unit/supervisor/test_geofence.py",),
    "asvhil/supervisor/heading_policy.py": ("tests/unit/supervisor/test_heading_policy.py",),
    "asvhil/supervisor/mode_request.py": SUPERVISOR,
    "asvhil/supervisor/pilot_watch.py": SUPERVISOR,
    "asvhil/supervisor/station_motion.py": SUPERVISOR,
    "asvhil/supervisor/stations.py": SUPERVISOR,
    "asvhil/supervisor/supervisor.py": SUPERVISOR,
}
NEEDED = ("asvhil", "tests", "config", "firmware", "docs", "pyproject.toml")
KILLED = {1, 3, 36, -24, 24, 152, 255, -11, -9}  # exit codes: a test failed, mutmut's time-outs, crashes
SURVIVED = {0, 5, 33}  # the last two: no test runs the function
LIST = """\
import sys
from pathlib import Path
from mutmut.mutation.file_mutation import mutate_file_contents
path = Path(sys.argv[1])
prefix = ".".join(path.with_suffix("").parts)
print(*(f"{prefix}.{name}" for name in mutate_file_contents(str(path), path.read_text()).mutant_names), sep="\\n")
"""
SHOW = """\
import sys
from mutmut.mutation.diff_apply import get_diff_for_mutant
for name in sys.stdin.read().split():
    changes = [line for line in get_diff_for_mutant(name).splitlines()[2:] if line[:1] in "+-"]
    print(name.rpartition(".")[2], *changes, sep="\\n")
"""


@dataclass
class Result:
    """What became of the mutants of one module. `unreached`: not tried before the time was over."""

    module: str
    mutants: int
    sampled: int
    killed: int
    survived: int
    unreached: int
    survivors: list[str] = field(default_factory=list)


def main() -> int:
    """Exit status 1 where a module falls short of `--least`."""
    parser = argparse.ArgumentParser(prog="python -m bench.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", metavar="FILE", help="modules to mutate; all without")
    parser.add_argument("--sample", type=int, default=0, help="mutants per module, drawn by the seed; 0: all")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--seconds", type=float, default=600.0, help="most for one module")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time")
    parser.add_argument("--least", type=float, default=0.0, help="share that must die, of those tried (0..1)")
    parser.add_argument("--show", action="store_true", help="print what the survivors changed")
    parser.add_argument("--json", type=Path, help="write the figures here")
    options = parser.parse_args()
    unknown = [name for name in options.modules if name not in MODULES]
    if unknown:
        parser.error(f"{unknown[0]} is none of {', '.join(MODULES)}")
    if importlib.util.find_spec("mutmut") is None:
        parser.error("mutmut is not installed: pip install -c constraints.txt -e '.[mutants]'")
    results = []
    for module in options.modules or MODULES:
        result = measure(module, options)
        results.append(result)
        print(
            f"{module:40} {result.killed:4} killed {result.survived:4} survived {result.unreached:4} unreached"
            f" of {result.sampled:4} ({result.mutants} in all)",
            flush=True,
        )
        if options.show:
            print(*result.survivors, sep="\n", flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps([asdict(result) for result in results], indent=1) + "\n")
    short = [r for r in results if r.killed < options.least * (r.killed + r.survived) or r.sampled == r.unreached]
    return 1 if short else 0


def measure(module: str, options: argparse.Namespace) -> Result:
    """The mutants of one module against its tests, in a copy of the project."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        folder = Path(name)
        for needed in NEEDED:
            source = ROOT / needed
            if source.is_dir():
                shutil.copytree(source, folder / needed, ignore=shutil.ignore_patterns("__pycache__", "build"))
            else:
                shutil.copy(source, folder / needed)
        with (folder / "pyproject.toml").open("a") as file:
            file.write(settings(module))
        listed = _python(folder, LIST, module).split()
        chosen = listed
        if 0 < options.sample < len(listed):
            chosen = random.Random(options.seed).sample(listed, options.sample)
        _run(folder, ["run", "--max-children", str(options.jobs), *(chosen if chosen != listed else ())], options)
        codes = json.loads((folder / "mutants" / f"{module}.meta").read_text())["exit_code_by_key"]
        found = Counter(codes.get(mutant) for mutant in chosen)
        survivors = [mutant for mutant in chosen if codes.get(mutant) in SURVIVED]
        return Result(
            module=module,
            mutants=len(listed),
            sampled=len(chosen),
            killed=sum(found[code] for code in KILLED),
            survived=len(survivors),
            unreached=sum(n for code, n in found.items() if code not in KILLED | SURVIVED),
            survivors=_python(folder, SHOW, "", "\n".join(survivors)).splitlines() if survivors else [],
        )


def settings(module: str) -> str:
    """The settings of mutmut for one module, as a part of pyproject.toml."""
    return "\n".join(
        (
            "",
            "[tool.mutmut]",
            'source_paths = ["asvhil"]',
            f"only_mutate = {json.dumps([module])}",
            f"also_copy = {json.dumps([name for name in NEEDED if name not in ('asvhil', 'tests')])}",
            f"pytest_add_cli_args_test_selection = {json.dumps(MODULES[module])}",
            'pytest_add_cli_args = ["-p", "no:cacheprovider", "-p", "no:xdist"]',
            "use_git_change_detection = false",
            "",
        )
    )


def _run(folder: Path, arguments: list[str], options: argparse.Namespace) -> None:
    """mutmut with everything that it starts, ended after the time that it has. What it found until then is on disk."""
    process = subprocess.Popen(
        [sys.executable, "-m", "mutmut", *arguments],
        cwd=folder,
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
    )
    try:
        said, _ = process.communicate(timeout=options.seconds)
        if process.returncode:
            sys.exit(f"mutmut failed:\n{said[-3000:]}")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _python(folder: Path, program: str, argument: str, given: str = "") -> str:
    return subprocess.run(
        [sys.executable, "-c", program, argument],
        cwd=folder,
        env=_environment(),
        input=given,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | {
        "PYTHONDONTWRITEBYTECODE": "1"
    }


if __name__ == "__main__":
    end_in_words(main)
