"""What the pages show is taken: every line with `asvhil` parses, and every block of YAML is a config or a campaign."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

from asvhil.commands.cli import app
from asvhil.config import load_config
from asvhil.study.campaigns.design import check
from asvhil.study.campaigns.spec import read_spec
from asvhil.train.columns import load_columns
from tests.support.paths import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"^```(?:sh|sh tested)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
YAML = re.compile(r"^```yaml\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = get_command(app)
GENERATED = {"cli.md", "configuration.md"}
RUN_ELSEWHERE = {"extending.md"}  # with its files, by tests/loop/test_extending_page.py


def shown_commands(page: Path) -> list[str]:
    """What begins with `asvhil` in a page's fences, also behind `&&`, without what is the shell's."""
    lines = [line for fence in FENCE.findall(page.read_text()) for line in fence.replace("\\\n", " ").splitlines()]
    parts = [part.strip() for line in lines for part in re.split(r"&&|;| \| | > | & *$", line)]
    return [part for part in parts if part.startswith("asvhil ")]


COMMANDS = [
    pytest.param(line, id=f"{page.name}: {line[:60]}")
    for page in PAGES
    if page.name not in GENERATED
    for line in dict.fromkeys(shown_commands(page))
]


def test_many_are_found() -> None:
    assert len(COMMANDS) > 100


@pytest.mark.parametrize("line", COMMANDS)
def test_a_shown_command_is_taken(line: str) -> None:
    words = shlex.split(line, comments=True)[1:]
    if "..." in words:
        words.remove("...")
    command, name = COMMAND, "asvhil"
    while True:
        context = command.make_context(name, list(words))
        if not hasattr(command, "resolve_command"):
            return
        name, command, words = command.resolve_command(context, [*context._protected_args, *context.args])


BLOCKS = {page.name: YAML.findall(page.read_text()) for page in PAGES if page.name not in GENERATED | RUN_ELSEWHERE}


def take_campaign(block: str, folder: Path) -> None:
    """A campaign, or parameters of one."""
    text = block if "design:" in block else f"config: sitl\ndesign: {{kind: sobol, points: 8}}\nparameters:\n{block}"
    (folder / "shown.yaml").write_text(text)
    check(*read_spec(folder / "shown.yaml"))


def test_the_campaigns_that_a_page_shows_are_some(tmp_path: Path) -> None:
    blocks = YAML.findall((ROOT / "docs" / "campaigns.md").read_text())
    assert len(blocks) >= 2
    for block in blocks:
        take_campaign(block, tmp_path)


@pytest.mark.parametrize("page", [page for page, blocks in BLOCKS.items() if blocks and page != "campaigns.md"])
def test_what_a_page_shows_is_a_config(page: str, tmp_path: Path) -> None:
    """The blocks of a page follow one another: each adds to those before it."""
    base = "field.yaml"
    for number, block in enumerate(BLOCKS[page]):
        shown = tmp_path / f"shown{number}.yaml"
        if block.startswith("time:"):
            shown.write_text(block)
            load_columns(shown)
            continue
        shown.write_text(block if block.startswith("base:") else f"base: {base}\n{block}")
        load_config(shown)
        base = shown.name
