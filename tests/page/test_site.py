"""The documentation as a site: it builds without a complaint, has every page, and asks nobody for anything."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.support.browser import chromium, shown
from tests.support.paths import ROOT

PAGES = {str(path.relative_to(ROOT / "docs")) for path in (ROOT / "docs").rglob("*.md")}
LOADED = re.compile(r"""<(?:script|img|iframe|source)[^>]*?src="([^"]+)"|<link[^>]*?href="([^"]+)"[^>]*>""")


def entries(nav: object) -> list[str]:
    """The pages of a navigation, in its order."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    return [page for part in parts for page in entries(part)]  # type: ignore[attr-defined]


def test_the_navigation_has_every_page_once() -> None:
    found = entries(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"])
    assert len(found) == len(set(found))
    assert set(found) == PAGES


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built in a folder of its own, with `said.txt` beside it."""
    folder = tmp_path_factory.mktemp("site")
    shutil.copytree(ROOT / "docs", folder / "docs")
    shutil.copy(ROOT / "mkdocs.yml", folder)
    program = Path(sys.executable).parent / "zensical"
    done = subprocess.run(
        [str(program), "build"],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
        timeout=200,
        env={**os.environ, "NO_COLOR": "1"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (folder / "said.txt").write_text(done.stdout + done.stderr)
    return folder / "build" / "site"


def test_it_builds_without_a_complaint(site: Path) -> None:
    assert "No issues found" in (site.parents[1] / "said.txt").read_text()
    made = {str(path.relative_to(site)) for path in site.rglob("*.html")}
    assert {re.sub(r"README$", "index", page.removesuffix(".md")) + ".html" for page in PAGES} <= made


def test_nothing_is_loaded_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        for found in LOADED.findall(page.read_text()):
            address = "".join(found)
            assert not re.match(r"(https?:)?//", address), (page.name, address)


def test_a_browser_shows_it_and_asks_nobody(site: Path, tmp_path: Path) -> None:
    if chromium() is None:
        assert "CI" not in os.environ, "chromium is missing"
        pytest.skip("chromium is not installed")
    picture, elsewhere = shown(site / "theory.html", tmp_path, (1100, 1400))
    assert elsewhere == []
    assert picture.std() > 0.05, "an empty page"
    kept = os.environ.get("ASVHIL_SCREENSHOTS")
    if kept:
        shutil.copy(tmp_path / "shot.png", Path(kept) / "site.png")
