"""Links and names of files in the pages lead somewhere."""

import re
from pathlib import Path

import pytest

from tests.support.paths import ROOT

PAGES = sorted(path for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")) if path.is_file())
FOLDERS = ("asvhil/", "bench/", "config/", "docs/", "firmware/", "tests/")
PACKAGES = tuple(f"{path.name}/" for path in (ROOT / "asvhil").iterdir() if path.is_dir())
MADE = ("firmware/arduino_anemometer/build", "tests/firmware/build")  # by make
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
SPAN = re.compile(r"`([^`\n]+)`")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
PATH = re.compile(r"[\w./-]+(\.(py|md|yaml|json|svg|png|npz|h|ino|tlog)|/)")


def text_of(page: Path) -> str:
    return FENCE.sub("", page.read_text())


def anchors_of(page: Path) -> set[str]:
    """The fragments that GitHub makes of a page's headings."""
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in HEADING.findall(text_of(page)))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in plain}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_inside_the_repository_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(text_of(page)):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, fragment = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        assert path.is_relative_to(ROOT), target
        if fragment:
            assert fragment in anchors_of(path), target


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_files_that_a_page_names_exist(page: Path) -> None:
    """In code spans: from the top of the repository, or from a package of asvhil as the architecture page has them."""
    for span in SPAN.findall(text_of(page)):
        if not PATH.fullmatch(span) or span.startswith(MADE) or span in PACKAGES:
            continue
        if span.startswith(FOLDERS):
            assert (ROOT / span).exists() or (ROOT / "asvhil" / span).exists(), span
        elif span.startswith(PACKAGES):
            assert (ROOT / "asvhil" / span).exists(), span


def test_every_page_is_reached_from_the_readme() -> None:
    reached, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in reached or page.suffix != ".md":
            continue
        reached.add(page)
        for target in LINK.findall(text_of(page)):
            file = target.partition("#")[0]
            if file and not re.match(r"[a-z]+:", target):
                path = (page.parent / file).resolve()
                waiting.append(path / "README.md" if path.is_dir() else path)
    assert {page for page in PAGES} <= reached
