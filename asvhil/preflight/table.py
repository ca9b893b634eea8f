"""The table of a preflight: one line for each check, with its result and what to do."""

from __future__ import annotations

import enum
from typing import Any

from asvhil.types import record

PARAMETERS = "parameters"


class Result(enum.StrEnum):
    """Of one check. `UNVERIFIED`: what it looks at has not answered, which proves nothing."""

    PASS = "pass"
    WARN = "warn"
    UNVERIFIED = "unverified"
    FAIL = "fail"


@record
class Check:
    """One line of the table. `todo` says what to do where the result is no pass."""

    section: str
    item: str
    result: Result
    found: str
    wanted: str = ""
    todo: str = ""


def folded(checks: list[Check]) -> list[Check]:
    """The same with the parameters that are right in one line."""
    parameters = [check for check in checks if check.section == PARAMETERS]
    right = [check for check in parameters if check.result is Result.PASS]
    if not right:
        return checks
    item = f"all {len(right)}" if len(right) == len(parameters) else f"{len(right)} others"
    line = Check(section=PARAMETERS, item=item, result=Result.PASS, found="as they should be")
    end = checks.index(parameters[-1]) + 1
    return [*(check for check in checks[:end] if check not in right), line, *checks[end:]]


def worst(checks: list[Check]) -> Result:
    """The worst result of all."""
    order = list(Result)
    return max((check.result for check in checks), key=order.index, default=Result.PASS)


def as_json(check: Check) -> dict[str, Any]:
    """Plain types."""
    return {
        "section": check.section,
        "item": check.item,
        "result": check.result.value,
        "found": check.found,
        "wanted": check.wanted,
        "todo": check.todo,
    }
