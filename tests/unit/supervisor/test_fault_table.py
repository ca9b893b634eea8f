"""The table of faults: its page is that of the definitions, and each row is broken in by a test."""

import re

import pytest

from asvhil.supervisor.fault_table import MATRIX, ROWS, SECTIONS, FaultRow, Reaction, table
from tests.support import fault_matrix
from tests.support.paths import ROOT

PAGE = ROOT / "docs" / "safety.md"
MARK = "<!-- table: everything below is written by the command -->\n\n"


def test_the_page_has_the_table_of_the_present_definitions() -> None:
    assert PAGE.read_text().partition(MARK)[2] == table(), "python -m asvhil.supervisor.fault_table"


def test_no_two_rows_have_one_name() -> None:
    assert len(ROWS) == sum(len(rows) for rows in SECTIONS.values())


def test_the_matrix_breaks_in_each_row_that_names_it_and_no_other() -> None:
    assert {fault.name for fault in fault_matrix.ROWS} == {row.name for row in ROWS.values() if row.proof == MATRIX}


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.name)
def test_a_row_is_whole(row: FaultRow) -> None:
    assert (ROOT / row.proof).is_file()
    assert row.noticed and (row.reasons or row.told)
    assert not re.search(r"[{}|\n]", "".join((row.name, row.told, row.todo)))
    if row.reaction is Reaction.KEEP:
        assert not row.reasons, "a hold that goes on ends for no reason"


def test_thresholds_and_remedies_are_those_that_run() -> None:
    page = table()
    assert "| link down both ways | no message of it for 2.5 s | neutral, 4 s | `heartbeat-lost`" in page
    assert "60 us on a channel" in page and "Get its link back" not in page
    assert "{" not in page
