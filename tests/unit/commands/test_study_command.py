"""The one way from a study's checked options to what it leaves, with studies that are made up."""

import inspect
import json
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

from asvhil.commands.study_command import OutOption, Study, study_command
from asvhil.errors import AsvhilError
from asvhil.study.runner import StudyProgress, Tell


def command_of(study: Study, runs: list[str]) -> typer.Typer:
    """A program whose one command is the study; `runs` notes that its options were checked."""
    app = typer.Typer(pretty_exceptions_enable=False)

    @study_command
    def tides(
        output: OutOption = Path("out"),
        height: Annotated[float, typer.Option(min=0.0, help="Of the tide (m).")] = 2.0,
    ) -> Study:
        """How high the water is."""
        runs.append(f"checked {height:g}")
        return study

    app.command()(tides)
    return app


def study_of(**changes: Any) -> Study:
    def figures(tell: Tell) -> dict[str, Any]:
        for done in (0, 1, 2):
            tell(StudyProgress(done=done, total=2))
        return {"height_m": 2.0}

    given = {"title": "tides", "stem": "tides", "figures": figures, "text": lambda found: f"| {found['height_m']} |\n"}
    given |= {"made_of": None}
    return Study(**(given | changes))


def test_options_are_those_of_the_study_and_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runs: list[str] = []
    app = command_of(study_of(notes=("neap tide",)), runs)
    done = CliRunner().invoke(app, ["--height", "3", "--json", "figures.json"])
    assert (done.exit_code, runs) == (0, ["checked 3"])
    lines = done.output.splitlines()
    assert lines[0] == "neap tide" and "tides: 1 of 2" in lines and "| 2.0 |" in lines
    assert json.loads(Path("figures.json").read_text()) == json.loads(Path("out/tides.json").read_text())
    assert Path("out/tides.md").read_text().endswith("| 2.0 |\n") and not Path("out/tides.png").exists()
    shown = CliRunner().invoke(app, ["--help"]).output
    assert "How high the water is." in shown and "--height" in shown and "--json" in shown
    assert CliRunner().invoke(app, ["--height", "-1"]).exit_code == 2


def test_a_page_says_what_it_was_made_of_and_how_many_runs_were_made_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def resumed(tell: Tell) -> dict[str, Any]:
        tell(StudyProgress(done=2, total=3, outdated=2))
        tell(StudyProgress(done=3, total=3))
        return {"height_m": 2.0}

    page = Path("out/tides.md")
    for figures, others in ((resumed, 2), (study_of().figures, 0)):
        done = CliRunner().invoke(command_of(study_of(figures=figures, made_of={"config": "abc"}), []), [])
        assert done.exit_code == 0 and f'made of {{"runs_of_other_code": {others}, "again": 0' in page.read_text()
        assert ("2 of its runs are of other code" in page.read_text()) == bool(others)


def test_a_page_and_the_terminal_say_what_came_of_runs_that_were_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def confirming(tell: Tell) -> dict[str, Any]:
        tell(StudyProgress(done=2, total=30, outdated=5))
        tell(StudyProgress(done=30, total=30, again=25, changed=1))
        return {"height_m": 2.0}

    done = CliRunner().invoke(command_of(study_of(figures=confirming, made_of={"config": "abc"}), []), [])
    assert "25 runs of older code were run again: 1 came out otherwise" in done.output
    text = Path("out/tides.md").read_text()
    assert '"runs_of_other_code": 5, "again": 25, "changed": 1' in text
    assert (
        "25 that were of other code, drawn at random, were run again by this one: 1 of them came out otherwise" in text
    )


def test_nothing_begins_where_its_files_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("out/tides.md").mkdir(parents=True)

    def never(tell: Tell) -> dict[str, Any]:
        raise AssertionError("it was to be refused before it begins")

    done = CliRunner().invoke(command_of(study_of(figures=never), []), [])
    assert isinstance(done.exception, AsvhilError) and "out/tides.md: cannot be written" in str(done.exception)


def test_a_part_that_failed_ends_it_after_all_else_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    failure = AsvhilError("the gauge was dry")
    done = CliRunner().invoke(command_of(study_of(failure=lambda figures: failure), []), [])
    assert done.exception is failure and Path("out/tides.json").exists() and "| 2.0 |" in done.output


@pytest.mark.parametrize("resumes", [True, False])
def test_an_interrupt_says_how_to_go_on_where_that_is_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, resumes: bool
) -> None:
    monkeypatch.chdir(tmp_path)

    def interrupted(tell: Tell) -> dict[str, Any]:
        raise KeyboardInterrupt

    app = command_of(study_of(figures=interrupted, resumes=resumes), [])
    done = CliRunner().invoke(app, [])
    assert done.exit_code == 130  # which is the shell's word for it, and docs/operation.md's
    said = "interrupted; the same command goes on where it was"
    assert (said in done.output) == resumes


def test_the_parts_of_a_study_give_no_line_each_on_a_pipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def parts(tell: Tell) -> dict[str, Any]:
        for done in (1, 2):
            tell(StudyProgress(done=done, total=2, part="ebb"))
        return {"height_m": 1.0}

    done = CliRunner().invoke(command_of(study_of(figures=parts), []), [])
    assert done.exit_code == 0 and "1 of 2" not in done.output


def test_every_study_has_the_same_options_for_the_same_things() -> None:
    from asvhil.commands.study import app

    found = {command.callback.__name__: inspect.signature(command.callback) for command in app.registered_commands}
    assert list(found) == [
        *("models", "bound", "six_tests", "solvers", "approach"),
        *(
            "robustness",
            "learned_loop",
            "boat_models",
            "changed_boats",
            "waves",
            "estimator",
            "safety",
            "field_tests",
            "soak",
            "pages",
        ),
    ]
    del found["pages"]  # no study, but about what they left
    for signature in found.values():
        assert {"output", "json_"} <= set(signature.parameters)
