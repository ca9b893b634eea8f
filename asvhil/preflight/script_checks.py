"""Rows of the preflight on the script's file and on the other scripts, which MAVFTP tells. Nothing is written."""

from __future__ import annotations

from asvhil.autopilot.script_protocol import VERSION
from asvhil.errors import AsvhilError
from asvhil.preflight.script_tool import ScriptStatus, ScriptTool
from asvhil.preflight.table import Check, Result


async def script_checks(tool: ScriptTool, text: str) -> list[Check]:
    """What `tool` finds, against the `text` that comes with this program; one row where the files cannot be read."""
    try:
        return rows_of(await tool.status(text))
    except AsvhilError as error:
        todo = "the script's file and its rivals are not known; MAVFTP may be held back on the way"
        return [_row("script's file", Result.UNVERIFIED, str(error), "readable", todo)]


def rows_of(status: ScriptStatus) -> list[Check]:
    """The file, whether it is run, the scripts that share its queue, and whether a dead one keeps it from arming."""
    if status.installed is None:
        file = Result.FAIL, "not there", "`asvhil script install` puts it there"
    elif not status.same:
        other = f"version {status.installed}" if status.installed != VERSION else "another text of this version"
        file = Result.FAIL, other, "`asvhil script install` replaces it"
    else:
        file = Result.PASS, f"version {VERSION}, unchanged", ""
    rivals = ", ".join(status.rivals)
    queue = "all scripts share one queue of messages, of which each gets a part: remove them"
    rows = [
        _row("script's file", file[0], file[1], f"version {VERSION}", file[2]),
        _row(
            "scripts that take its messages",
            Result.FAIL if rivals else Result.PASS,
            f"{status.folder}: {rivals}" if rivals else "none",
            "none",
            queue if rivals else "",
        ),
    ]
    if status.problem:
        todo = "`Insufficent memory`: raise SCR_HEAP_SIZE; any other text: install it again, and report it"
        rows.append(_row("scripting says", Result.WARN, status.problem, "", todo))
    if status.checked is not None:
        todo = (
            "set bit 13 (8192) of ARMING_CHECK, or 1 for all; 4.7: clear that bit of ARMING_SKIPCHK; never written here"
        )
        rows.append(
            _row(
                "a dead script",
                Result.PASS if status.checked else Result.WARN,
                "keeps it from arming" if status.checked else "does not keep it from arming",
                "keeps it from arming",
                "" if status.checked else todo,
            )
        )
    return rows


def _row(item: str, result: Result, found: str, wanted: str, todo: str) -> Check:
    return Check(section="vehicle", item=item, result=result, found=found, wanted=wanted, todo=todo)
