"""What the studies show and leave: progress with the time to go, tables, figures as JSON, and the bounds they use."""

from __future__ import annotations

import errno
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asvhil.commands.views import progress, write_json
from asvhil.errors import AsvhilError
from asvhil.study.page import head_of, write_page

if TYPE_CHECKING:
    from asvhil.study.runner import Progress

BOUNDS = Path(__file__).resolve().parents[2] / "docs" / "results" / "bound.json"


@contextmanager
def watching(console: Any, what: str) -> Iterator[Callable[[Progress], None]]:
    """A progress bar with the time to go; on a pipe a line at each tenth. The expected total is said once it is known.

    Ctrl-C ends in one line that says how to go on.
    """
    said = {"expected": False, "tenth": 0}

    def minutes(seconds: float) -> str:
        return f"{seconds / 60.0:.1f} min"

    with progress(console) as bar:
        task = bar.add_task(what, total=None)

        def tell(now: Progress) -> None:
            if now.note:
                say(bar.console, f"{what}: {now.note}")
            to_go = "" if now.remaining_s is None else f", {minutes(now.remaining_s)} to go"
            bar.update(task, completed=now.done, total=now.total, description=f"{what}{to_go}")
            if now.total_s is not None and not said["expected"]:
                said["expected"] = True
                say(bar.console, f"{what}: {now.total} runs, {minutes(now.total_s)} in all{to_go}")
            tenth = 10 * now.done // max(now.total, 1)
            if tenth > said["tenth"] and not console.is_terminal:
                said["tenth"] = tenth
                say(bar.console, f"{what}: {now.done} of {now.total}{to_go}")

        try:
            yield tell
        except KeyboardInterrupt:
            raise AsvhilError(f"{what}: interrupted; the same command goes on where it was") from None


def check_output(output: Path | None, stem: str, json_: Path | None) -> None:
    """Before hours of work: makes the folder. AsvhilError where it, a file of it or the --json file is out of reach.

    Also where the page in the folder would be overwritten (`page.head_of`).
    """
    if output is not None:
        folder(output)
        for ending in ("json", "md", "png"):
            _check_writable(output / f"{stem}.{ending}", "")
        head_of(output / f"{stem}.md")
    if json_ is not None:
        _check_writable(json_, "--json ")


def finish(
    console: Any,
    output: Path | None,
    stem: str,
    figures: dict[str, Any],
    text_of: Callable[[dict[str, Any]], str],
    json_: Path | None,
    draw: Callable[[Path], None] | None = None,
) -> None:
    """Figures as JSON and Markdown into the folder, the Markdown on the console, and last the picture by `draw`."""
    text = text_of(figures)
    if output is not None:
        folder(output)
        with _writing(output / f"{stem}.json") as file:
            file.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
        with _writing(output / f"{stem}.md") as file:
            write_page(file, text)
    write_json(json_, figures)
    say(console, text)
    if output is not None and draw is not None:  # after the tables: a picture that fails takes nothing with it
        with _writing(output / f"{stem}.png") as file:
            draw(file)


def folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise AsvhilError(f"-o {path}: cannot be made ({error.strerror})") from None
    return path


def stem_of(study: str, quick: bool) -> str:
    """The name of its files: quick runs stand apart, so that they never take the place of full tables."""
    return f"{study}-quick" if quick else study


@contextmanager
def _writing(file: Path, option: str = "") -> Iterator[Path]:
    try:
        yield file
    except OSError as error:
        raise AsvhilError(f"{option}{file}: cannot be written ({error.strerror or error})") from None


def _check_writable(file: Path, option: str) -> None:
    with _writing(file, option):
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if file.exists():  # not opened: it may be a pipe
            if not os.access(file, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        else:
            tempfile.TemporaryFile(dir=file.parent).close()


def bounds_at_hand(console: Any, file: Path | None, config: str, overrides: tuple[str, ...]) -> dict[str, float]:
    """The bounds to hold scores against; without them a line that says what to do."""
    from asvhil.config import load_config
    from asvhil.study.bound import read_bounds

    settings = load_config(config, overrides)
    whose = settings.vehicle.name, settings.plant_vessel
    if file is not None:
        return read_bounds(file, *whose)
    try:
        return read_bounds(BOUNDS, *whose)
    except AsvhilError as error:
        say(console, f"no regret in the tables: {error}; `asvhil study bound -o DIR`, then --bounds DIR/bound.json")
        return {}


def say(console: Any, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)
