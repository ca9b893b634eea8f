"""Commands of the pages that stand in a fence tagged `sh tested`: each page's are run in their order, in one folder."""

import re
import shlex
from pathlib import Path

import pytest

from tests.support.command_line import call
from tests.support.paths import ROOT

FENCE = re.compile(r"^```sh tested\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = [path for path in sorted((ROOT / "docs").rglob("*.md")) if FENCE.search(path.read_text())]


def commands_of(page: Path) -> list[list[str]]:
    lines = [line for fence in FENCE.findall(page.read_text()) for line in fence.replace("\\\n", " ").splitlines()]
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def test_the_quick_start_is_among_them() -> None:
    (page,) = (page for page in PAGES if page.name == "own-boat.md")
    assert len(commands_of(page)) >= 6


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_commands_of_a_page_work(page: Path, tmp_path: Path) -> None:
    for words in commands_of(page):
        assert words[0] == "asvhil", words
        said = call(*words[1:], cwd=tmp_path)
        assert (said.status, said.err) == (0, ""), (words, said)
