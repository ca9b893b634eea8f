"""Output of the studies: progress with the time left, tables, figures as JSON, and the bounds they use."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asvhil.commands.outputs import check_figures, check_json, check_writable, write_json, writing
from asvhil.commands.termination import tell_interrupted
from asvhil.commands.views import progress, say
from asvhil.errors import AsvhilError, is_interrupt
from asvhil.files import write_text
from asvhil.study.page import head_of, write_page

if TYPE_CHECKING:
    from asvhil.study.runner import StudyProgress, Tell

BOUNDS = Path(__file__).resolve().parents[2] / "docs" / "results" / "bound.json"


@contextmanager
def watching(console: Any, title: str, *, resumes: bool = True) -> Iterator[Tell]:
    """A progress bar with the time left; on a pipe a line at each tenth. The expected total is printed once known.

    Ctrl-C ends a resumable study with one line that says how to continue.
    """
    said: dict[str, Any] = {"expected": False, "tenth": 0, "part": ""}

    def minutes(seconds: float) -> str:
        return f"{seconds / 60.0:.1f} min"

    with progress(console) as bar:
        task = bar.add_task(title, total=None)

        def tell(now: StudyProgress) -> None:
            if now.note:
                say(bar.console, f"{title}: {now.note}")
            to_go = "" if now.remaining_s is None else f", {minutes(now.remaining_s)} to go"
            what = f"{title}: {now.part}" if now.part else title
            bar.update(task, completed=now.done, total=now.total, description=f"{what}{to_go}")
            if now.total_s is not None and not said["expected"]:
                said["expected"] = True
                say(bar.console, f"{title}: {now.total} runs, {minutes(now.total_s)} in all{to_go}")
            if now.part and now.part != said["part"] and not console.is_terminal:
                said["part"] = now.part
                say(bar.console, f"{what}, {now.total} in all")
            tenth = 10 * now.done // max(now.total, 1)
            if tenth > said["tenth"] and not now.part and not console.is_terminal:
                said["tenth"] = tenth
                say(bar.console, f"{title}: {now.done} of {now.total}{to_go}")

        try:
            yield tell
        except BaseException as error:
            if resumes and is_interrupt(error):
                tell_interrupted(f"{title}: interrupted; the same command goes on where it was")
            raise


def check_output(output: Path | None, stem: str, json_: Path | None, *kept: tuple[str, Path | None]) -> None:
    """Before the work: make the folder. AsvhilError where it, a file in it or the --json file cannot be written.

    Also where the page in the folder would be overwritten (`page.head_of`), or what the study reads or keeps, which is
    `kept`, with what each is.
    """
    written: list[tuple[str, Path | None]] = []
    if output is not None:
        folder(output)
        files = {ending: output / f"{stem}.{ending}" for ending in ("json", "md", "png")}
        for file in files.values():
            check_writable(file)
        check_json(files["json"], "")
        head_of(files["md"])
        written = [
            ("the page of -o", files["md"]),
            ("the picture of -o", files["png"]),
            ("the figures of -o", files["json"]),
        ]
    check_figures(json_, *kept, *written)


def finish(
    console: Any,
    output: Path | None,
    stem: str,
    figures: dict[str, Any],
    text_of: Callable[[dict[str, Any]], str],
    json_: Path | None,
    draw: Callable[[Path], None] | None = None,
    mark: str = "",
) -> None:
    """Write figures as JSON and Markdown to the folder, print the Markdown, then `draw` the picture.

    `mark` says in the page what it was made of (`made_of.mark_of`).
    """
    if output is not None:  # before the text, so that a failure of that loses nothing
        folder(output)
        file = output / f"{stem}.json"
        with writing(file):
            write_text(file, json.dumps(figures, indent=1) + "\n")
    text = text_of(figures)
    if output is not None:
        page = output / f"{stem}.md"
        with writing(page):
            write_page(page, text, mark)
    write_json(json_, figures)
    say(console, text)
    if output is not None and draw is not None:  # last, so that a failure of the picture loses nothing else
        picture = output / f"{stem}.png"
        with writing(picture):
            draw(picture)


def folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise AsvhilError(f"-o {path}: is a file; the name of a folder is expected") from None
    except OSError as error:
        raise AsvhilError(f"-o {path}: cannot be made ({error.strerror})") from None
    return path


def stem_of(study: str, quick: bool) -> str:
    """The name of a study's files. Quick runs have one of their own, so that they never replace full tables."""
    return f"{study}-quick" if quick else study


def bounds_at_hand(file: Path | None, config: str, overrides: tuple[str, ...]) -> tuple[dict[str, float], str]:
    """The bounds to compare scores with; without them a line is printed that says how to get them."""
    from asvhil.config import load_config
    from asvhil.study.bound import read_bounds

    settings = load_config(config, overrides)
    if file is not None:
        return read_bounds(file, settings), ""
    try:
        return read_bounds(BOUNDS, settings), ""
    except AsvhilError as error:
        note = f"no regret in the tables: {error}; `asvhil study bound -o DIR`, then --bounds DIR/bound.json"
        return {}, note
