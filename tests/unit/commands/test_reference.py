"""The page of all commands is made from the program, and every command and option says what it is."""

import re

from asvhil.commands.reference import reference
from tests.support.paths import ROOT


def test_the_page_is_that_of_the_present_commands() -> None:
    assert (ROOT / "docs" / "cli.md").read_text() == reference(), "python -m asvhil.commands.reference > docs/cli.md"


def test_every_row_has_a_meaning() -> None:
    rows = [line for line in reference().splitlines() if line.startswith("| `")]
    assert len(rows) > 150
    assert [row for row in rows if not re.search(r"\| [^|]+[.)] \|$", row)] == []


def test_sections_and_rows_of_each_kind() -> None:
    page = reference()
    for words in (
        "## `asvhil config show`\n\nShow a config",
        "| `CONFIG` | text | required | A YAML config file",
        "| `-o`, `--output` | path | required | The model file (npz) to write. |",
        "| `--smoothing`, `--no-smoothing` |  | on | Smooth the training data over time. |",
        "| `--tries` | integer 1 to 50 | `1` |",
        "| `--force` |  |  | Overwrite a model file that is there. |",
    ):
        assert words in page, words
