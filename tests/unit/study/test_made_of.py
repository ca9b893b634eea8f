"""What pages of results say they were made of, what is found to have changed since, and what README may quote."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from asvhil.commands.cli import app
from asvhil.errors import AsvhilError
from asvhil.study import code_version, made_of
from asvhil.study.code_version import DECISIVE, digest_of, effective
from asvhil.study.made_of import mark_of, run_files, state_of
from asvhil.study.page import MARKER, write_page
from tests.support.paths import ROOT

RESULTS = ROOT / "docs" / "results"
COMMANDS = code_version.PACKAGE / "commands"
SOURCE = '''"""What it is."""
# A remark.
TEXT = """first

# third
"""


class Half:
    """Half of it."""

    # Another remark.
    share = 0.5  # of it


def one_line(): "no docstring on a line of its own"
'''


def test_comments_and_docstrings_decide_nothing_and_all_else_does(tmp_path: Path) -> None:
    kept = effective(SOURCE).split("\n")
    assert kept[:4] == ['TEXT = """first', "", "# third", '"""']
    assert kept[4:] == ["class Half:", "    share = 0.5  # of it", SOURCE.strip().split("\n")[-1]]
    file = tmp_path / "half.py"
    file.write_text(SOURCE)
    first = digest_of(file)
    file.write_text(SOURCE.replace("What it is.", "Something else.\n").replace("Another remark", "None"))
    assert digest_of(file) == first
    for old, new in (("0.5", "0.6"), ("# third", "# fourth")):
        file.write_text(SOURCE.replace(old, new))
        assert digest_of(file) != first


def test_a_study_is_of_what_it_imports_and_a_run_of_all_that_decides_it() -> None:
    loop = set(made_of.made_of(("study/six_tests.py",)))
    assert {part for part in DECISIVE if part != "study/trials"} <= loop
    assert {"study/trials/trial.py", "study/rows.py", "study/statistics.py", "study/six_tests.py"} <= loop
    assert not loop & {"study/soak.py", "study/field_tests.py", "study/runner.py", "dashboard", "commands", "train"}
    named = {name for file in COMMANDS.glob("*.py") for name in re.findall(r'"(study/\w+\.py)"', file.read_text())}
    assert len(named) >= 15 and all((code_version.PACKAGE / name).is_file() for name in named)
    alone = set(made_of.made_of(("study/bound.py",)))
    assert alone == {"config", "dynamics", "files.py", "geo.py", "study/bound.py", "types.py"}


def test_runs_read_their_config_those_below_it_and_the_model_of_each_controller() -> None:
    names = [file.name for file in run_files("sitl", ("controller.name=lagnet-mpc",), ("controller.name=sd-mpc",))]
    assert names == ["sitl.yaml", "wamv16.yaml", "wamv16-lagnet.npz"]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project of two packages and a model, with a page of one study."""
    package = tmp_path / "asvhil"
    for name in ("config", "controller"):
        (package / name).mkdir(parents=True)
        (package / name / "__init__.py").write_text("x = 1\n")
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "boat.npz").write_bytes(b"weights")
    for module in (made_of, code_version):
        monkeypatch.setattr(module, "PACKAGE", package)
    monkeypatch.setattr(made_of, "ROOT", tmp_path)
    model = tmp_path / "config" / "boat.npz"
    parts = {name: digest_of(package / name) for name in ("config", "controller")}
    parts["config/boat.npz"] = made_of.made_of((), [model])["config/boat.npz"]
    page = tmp_path / "tides.md"
    page.write_text(f"By people.\n\n{MARKER}\n")
    write_page(page, "| 2.0 |\n", mark_of(parts))
    return tmp_path


def test_a_page_is_fresh_until_a_part_changes_and_says_which(checkout: Path) -> None:
    page = checkout / "tides.md"
    assert page.read_text().startswith("By people.") and "Made by code `" in page.read_text()
    fresh = state_of(page, "tides.md")
    assert (fresh.state, fresh.changed) == ("fresh", ()) and fresh.code in page.read_text()
    (checkout / "asvhil" / "config" / "__init__.py").write_text("# the same\nx = 1\n")
    assert state_of(page, "tides.md").state == "fresh"
    (checkout / "asvhil" / "controller" / "__init__.py").write_text("x = 2\n")
    (checkout / "config" / "boat.npz").unlink()
    older = state_of(page, "tides.md")
    assert (older.state, older.changed) == ("older", ("controller", "config/boat.npz")) and older.code == fresh.code


def test_runs_of_other_code_a_missing_mark_and_pages_by_people_are_told_apart(checkout: Path) -> None:
    page = checkout / "tides.md"
    write_page(page, "| 2.0 |\n", mark_of({"config": digest_of(checkout / "asvhil" / "config")}, 3))
    assert state_of(page, "").changed == ("3 runs of other code",)
    config = {"config": digest_of(checkout / "asvhil" / "config")}
    for again, changed, state, why in (
        (19, 0, "older", ("300 runs of other code",)),
        (20, 0, "confirmed", ()),
        (20, 1, "older", ("1 of 20 runs of other code came out otherwise when run again",)),
    ):
        write_page(page, "| 2.0 |\n", mark_of(config, 300, again, changed))
        assert (state_of(page, "").state, state_of(page, "").changed) == (state, why)
    assert "20 that were of other code, drawn at random, were run again by this one: 1 of them" in page.read_text()
    for again, changed in ((3, 0), (90, 40)):  # every run was run again, whatever came of it
        write_page(page, "| 2.0 |\n", mark_of(config, 0, again, changed))
        assert state_of(page, "").state == "fresh"
    write_page(page, "| 2.0 |\n")
    assert state_of(page, "").state == "unmarked"
    write_page(page, "| 2.0 |\n", "<!-- made of nothing -->\n")
    assert state_of(page, "").changed == ("its mark cannot be read",)
    page.write_text("All by people.\n")
    assert state_of(page, "").state == "by people"


def test_the_command_lists_every_page(checkout: Path) -> None:
    (checkout / "asvhil" / "config" / "__init__.py").write_text("x = 3\n")
    figures = checkout / "pages.json"
    done = CliRunner().invoke(app, ["study", "pages", str(checkout), "--json", str(figures)])
    assert done.exit_code == 0 and "1 older: than what decides it" in done.output
    (page,) = json.loads(figures.read_text())["pages"]
    assert (page["page"], page["state"], page["changed"]) == ("tides.md", "older", ["config"])
    done = CliRunner().invoke(app, ["study", "pages", str(checkout / "config")])
    assert isinstance(done.exception, AsvhilError) and "no pages (*.md) in it" in str(done.exception)


# Words by which a text claims what a study has found.
CLAIM = re.compile(
    r"\b(best|lowest|least|fastest|(times|%) (faster|as \w+|less|more|better)|scores? of)\b", re.IGNORECASE
)
HOLDING = ("fresh", "confirmed")
LINK = re.compile(r"\]\(docs/results/([\w./-]+\.md)")


def unbacked(text: str, states: dict[str, str]) -> list[str]:
    """Paragraphs that claim a result without a link to a page, and links to pages that do not hold."""
    wrong = []
    for paragraph in re.split(r"\n\s*\n|\n(?=[-|#] ?)|\n(?=\d+\. )", text):
        pages = [page for page in LINK.findall(paragraph) if page != "README.md"]
        wrong += [f"{page} is {states.get(page, 'missing')}" for page in pages if states.get(page) not in HOLDING]
        if CLAIM.search(paragraph) and not pages:
            wrong.append(paragraph)
    return wrong


def test_readme_states_results_by_links_to_fresh_pages_alone() -> None:
    pages = [(path, path.relative_to(RESULTS).as_posix()) for path in RESULTS.rglob("*.md")]
    states = {name: state_of(path, name).state for path, name in pages}
    assert unbacked((ROOT / "README.md").read_text(), states) == []


def test_a_claim_without_a_page_and_a_page_that_is_older_are_found() -> None:
    states = {"six-tests.md": "older", "soak.md": "fresh"}
    assert unbacked("There is LagNet-MPC (the best scores).\n\nAnd others.", states) != []
    assert unbacked("It has [the best scores](docs/results/six-tests.md#all).", states) == ["six-tests.md is older"]
    assert (
        unbacked("It has [the best scores](docs/results/soak.md).\n\nAll [pages](docs/results/README.md).", states)
        == []
    )
