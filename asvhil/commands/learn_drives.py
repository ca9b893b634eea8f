"""The drives of `asvhil learn`: made, or taken up again where some are there, are missing, or were broken off."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from asvhil.commands.collect import drive_with_display, refuse_incomplete
from asvhil.commands.outputs import writing
from asvhil.commands.views import say
from asvhil.errors import AsvhilError, ConfigError, LogError
from asvhil.files import is_folder, is_there

if TYPE_CHECKING:
    from asvhil.collect import Collected
    from asvhil.config import Config
    from asvhil.config.mean_wind import WindSector

GO_ON = "the same command with --resume goes on"
STOPPED = f"stopped; logs that were made are kept: {GO_ON} with them"
TEST_SEED = 500  # added for the drive that is tested on, so that it is another one
TEST_SHARE = 0.4  # of the time of one drive
DRIVE_S = 600.0
WINDS = ("2@0", "4@120", "5@-60", "3@90")
TEST_WIND = "4@45"


@dataclasses.dataclass(frozen=True)
class LearnFiles:
    """What `learn` leaves."""

    folder: Path
    data: Path
    test: Path
    model: Path
    fitted: Path
    picture: Path

    @staticmethod
    def of(folder: Path, name: str, kind: str) -> LearnFiles:
        """Those of a boat by its name, and of a kind of model."""
        return LearnFiles(
            folder=folder,
            data=folder / "drive.mcap",
            test=folder / "test.mcap",
            model=folder / f"{name}-{kind}.npz",
            fitted=folder / f"{name}-sd.npz",
            picture=folder / "fit.png",
        )

    def named(self) -> list[tuple[str, Path]]:
        """Each with what it is."""
        logs = [("a log", self.data), ("a log", self.test)]
        return [*logs, ("the model", self.model), ("the fitted model", self.fitted), ("the picture", self.picture)]

    def there(self) -> list[Path]:
        """Those that are there already."""
        return sorted(self.folder.iterdir()) if is_folder(self.folder) else []


class LearnSteps:
    """Numbers the steps, and stops before each where somebody is to confirm."""

    def __init__(self, console: Any, yes: bool) -> None:
        self.console = console
        self.yes = yes
        self._number = 0

    def begin(self, words: str) -> None:
        """Tell the next step, and ask whether to go on."""
        self._number += 1
        say(self.console, f"{self._number}. {words}")
        if not self.yes and not typer.confirm("   Go on?", default=True):
            raise AsvhilError(STOPPED)


class LearnDrives:
    """The drives to train on, one for each wind of a simulated boat, and the one to test on."""

    def __init__(
        self, settings: Config, files: LearnFiles, duration: float | None, winds: Sequence[str], steps: LearnSteps
    ) -> None:
        """`duration` (s) and `winds`: None and none where the command did not say. ConfigError for wrong winds."""
        from asvhil.collect import log_paths
        from asvhil.config.mean_wind import parse_wind
        from asvhil.train.origin import of_simulation

        self._settings, self._files, self._steps = settings, files, steps
        self._duration, self._told_winds = duration, tuple(winds)
        self._simulated = of_simulation(settings)
        if winds and not self._simulated:
            raise ConfigError("--wind: nobody makes the wind for a real vehicle; go out in more than one")
        self._sectors = [parse_wind(text) for text in winds or WINDS] if self._simulated else []
        self._plan = log_paths(files.data, files.folder, self._sectors or [None])  # of the drives, one a wind
        self._tests = [files.test]
        self._aside: list[Path] = []  # what makes room for drives, once somebody has confirmed them

    def make(self, *, force: bool, resume: bool) -> tuple[list[Path], list[Path]]:
        """The logs to train on, and those to test on. With `resume` those that are there are taken, if they are whole.

        Raises ConfigError where they are other drives than the command asks for, AsvhilError where one does not come
        to its end, or where nobody confirms.
        """
        data, test = self._there() if resume else ([], [])
        if force:
            self._aside = self._logs_there()
        duration = DRIVE_S if self._duration is None else self._duration
        missing = [log for log in self._plan if log not in data]
        if missing:
            self._begin(self._words(missing, duration))
            self._drive_all(missing, duration, skip=data)
            data = sorted((*data, *missing), key=_place)
        missing = [log for log in self._tests if log not in test]
        if missing:
            test_s = max(60.0, TEST_SHARE * duration)
            self._begin(f"a drive of {test_s:.0f} s to test on, which the model never sees in training")
            for log in missing:
                self._drive(_other(self._settings), test_s, self._test_sectors(), log)
            test = sorted((*test, *missing))
        return data, test

    def _begin(self, words: str) -> None:
        """The next step, which makes drives: there is room for them thereafter."""
        self._steps.begin(words)
        with writing(self._files.folder):
            self._files.folder.mkdir(parents=True, exist_ok=True)
            put_aside(self._files.folder, self._aside, self._steps.console)
        self._aside = []

    def _drive_all(self, missing: Sequence[Path], duration: float, skip: Sequence[Path]) -> None:
        """The drives to train on that are missing: of the simulated boat one a wind, of the real one as they come."""
        if self._simulated:
            self._drive(self._settings, duration, self._sectors, self._files.data, skip)
            return
        for log in missing:
            self._drive(self._settings, duration, [], log)

    def _drive(
        self, settings: Config, duration: float, sectors: list[WindSector], output: Path, skip: Sequence[Path] = ()
    ) -> None:
        mode: Any = "lockstep" if self._simulated else "vehicle"
        console, go_on = self._steps.console, f"; {GO_ON}"
        runs = drive_with_display(settings, mode, duration, sectors, output, "", console, skip, go_on)
        refuse_incomplete(runs, console, go_on)

    def _words(self, missing: Sequence[Path], duration: float) -> str:
        radius_m = self._settings.controller.manoeuvres.geofence_radius_m
        real = f"the real boat, full throttle within {radius_m:g} m of where it is held"
        drives = f"{len(missing)} drives" if len(missing) > 1 else "a drive"
        return f"{drives} of {duration:.0f} s of manoeuvres ({'simulated' if self._simulated else real})"

    def _test_sectors(self) -> list[WindSector]:
        from asvhil.config.mean_wind import parse_wind

        return [parse_wind(TEST_WIND)] if self._simulated else []

    def _logs_there(self) -> list[Path]:
        """The logs of earlier drives and tests, with all of their segments."""
        folder = self._files.folder
        return sorted((*folder.glob("drive*.mcap"), *folder.glob("test*.mcap")))

    # --- taking up again ---

    def _there(self) -> tuple[list[Path], list[Path]]:
        """The drives and the tests in the folder that are taken, in the order in which they were made."""
        from asvhil.logs.segments import logs_in

        there = logs_in(self._files.folder)
        drives, tests = (
            [log for log in there if log.stem.startswith(one.stem)] for one in (self._files.data, self._files.test)
        )
        told = self._check_winds(drives, tested=bool(tests))
        data = [log for log in drives if self._is_kept(log, self._drive_in(log, told=told), again=told)]
        test = [log for log in tests if self._is_kept(log, _recorded(log, whole=not self._simulated), again=True)]
        if drives and not (self._simulated and told):
            self._plan = drives  # of a real boat those that are there are enough, once the bad ones are driven again
        self._tests = tests or self._tests
        return sorted(data, key=_place), test

    def _check_winds(self, data: Sequence[Path], *, tested: bool) -> bool:
        """Whether the winds of all drives are known; ConfigError where drives are there that are not asked for.

        The drive to test on comes last: where it is there, so are all others, and their winds need not be told again.
        """
        other = [log for log in data if log not in self._plan]
        if tested and not self._told_winds:
            return set(data) == set(self._plan)
        if not other or not self._simulated:
            return True
        winds = " ".join(f"--wind {text}" for text in self._told_winds or WINDS)
        raise ConfigError(f"learn: --resume: {other[0]} is none of the drives of {winds}: give its --wind options")

    def _is_kept(self, log: Path, run: Collected | None, *, again: bool) -> bool:
        """Whether a log is whole, or is taken as it is; if not, it is to make room. `again`: another can be made.

        Of a real boat somebody may say that it will do: the water is far. A simulated one just drives again.
        """
        from asvhil.logs.segments import segments_behind

        if run is not None and run.complete:
            return True
        words, console = "damaged" if _has_config(log) else "its config cannot be read", self._steps.console
        if run is not None:
            words = f"broken off after {run.held_s:.0f} s of {_config(log).controller.manoeuvres.duration_s:.0f} s"
            if not self._simulated:
                say(console, f"   {log}: {words}")
                if self._steps.yes or not typer.confirm("   Drive it again?", default=True):
                    say(console, "   it is used as it is")
                    return True
        if self._simulated and not again:
            raise ConfigError(f"learn: --resume: {log}: {words}; to drive it again, give the --wind options of before")
        say(console, f"   {log}: {words}: it is driven again")
        self._aside += [log, *segments_behind(log, 0)]
        return False

    def _drive_in(self, log: Path, *, told: bool) -> Collected | None:
        """What a log to train on holds, None where nothing can be read; ConfigError where another drive is asked for.

        Where the command does not say how long the drives are, they are as long as the first one. Those of a real boat
        may be of any length: they are taken as they are.
        """
        from asvhil.collect import with_manoeuvres

        run = _recorded(log, whole=not self._simulated)
        if run is None:
            return None
        manoeuvres = _config(log).controller.manoeuvres
        if self._duration is None:
            self._duration = manoeuvres.duration_s
        elif self._simulated and self._duration != manoeuvres.duration_s:
            words = f"is of {manoeuvres.duration_s:g} s, and not of the {self._duration:g} s that are asked for"
            raise ConfigError(f"learn: --resume: {log} {words}: give its --duration")
        if told and self._simulated and log in self._plan:
            number = self._plan.index(log)
            wanted = with_manoeuvres(self._settings, self._duration, self._sectors[number], "", number)
            is_, asked = (f"{one.note} (seed {one.seed})" for one in (manoeuvres, wanted.controller.manoeuvres))
            if is_ != asked:
                raise ConfigError(
                    f"learn: --resume: {log} is of {is_}, and not of {asked}: give its --wind options, in their order"
                )
        return run


def _recorded(log: Path, *, whole: bool) -> Collected | None:
    """What a log holds of its drive; None where that cannot be told. With `whole` LogError for damage in the middle."""
    from asvhil.collect import recorded

    if not _has_config(log):
        return None
    try:
        return recorded(log)
    except LogError:
        if whole:
            raise
        return None


def _has_config(log: Path) -> bool:
    try:
        _config(log)
    except LogError:
        return False
    return True


def _config(log: Path) -> Config:
    from asvhil.logs.reader import LogFile
    from asvhil.logs.replay import config_of

    return config_of(LogFile(log), log, known_only=True)


def _place(log: Path) -> tuple[int, str]:
    """Sorts drives as they were made, which a training that goes on needs: each has a seed above the last one's."""
    return _config(log).controller.manoeuvres.seed, log.name


def put_aside(folder: Path, files: Sequence[Path], console: Any, what: str = "of earlier drives") -> None:
    """Move what is there into a folder of its own, and say so: none is ever overwritten, or deleted. OSError."""
    if not files:
        return
    aside = next(path for number in itertools.count(1) if not is_there(path := folder / f"before-{number}"))
    aside.mkdir()
    for file in files:
        file.rename(aside / file.name)
    say(console, f"   put into {aside}: {', '.join(file.name for file in files)}, {what}")


def _other(settings: Config) -> Config:
    """The same boat, with other manoeuvres, weather and noise."""
    import json

    from asvhil.config import config_from_json

    tree = settings.model_dump(mode="json")
    tree["controller"]["manoeuvres"]["seed"] += TEST_SEED
    tree["plant"]["seed"] += TEST_SEED
    return config_from_json(json.dumps(tree), "learn")
