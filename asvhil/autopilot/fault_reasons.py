"""A fault that the readback found as a reason to let go, with the parameters to look at. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import chain, zip_longest

from asvhil.autopilot.readback import Fault
from asvhil.autopilot.requirements import Finding
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain, fields_of
from asvhil.types import Cause

LINE_LENGTH = 50  # of a STATUSTEXT
LATE = "slow link"
REASONS = {
    Cause.IGNORED: Reason.OVERRIDES_IGNORED,
    Cause.MIXED: Reason.COMMANDS_MIXED,
    Cause.SWAPPED: Reason.OUTPUTS_SWAPPED,
    Cause.REVERSED: Reason.OUTPUT_REVERSED,
    Cause.STUCK: Reason.OUTPUT_STUCK,
}
# Swapped outputs have each other's function, which by itself is the cause of a motor that does not answer.
LOOK_AT = {
    Cause.IGNORED: (Cause.IGNORED,),
    Cause.MIXED: (Cause.MIXED,),
    Cause.REVERSED: (Cause.REVERSED,),
    Cause.STUCK: (Cause.STUCK,),
    Cause.SWAPPED: (Cause.STUCK, Cause.SWAPPED),
}
# What the outputs do leaves no other cause: where all of these were read and are right, one has been changed since.
CERTAIN = frozenset({Cause.MIXED, Cause.REVERSED, Cause.SWAPPED})


def explain_fault(fault: Fault, findings: Iterable[Finding]) -> Explanation:
    """The reason, with a hint at the parameters that may be its cause."""
    reason = REASONS.get(fault.cause, Reason.OUTPUTS_DIFFER)
    if reason is Reason.OUTPUT_STUCK and fault.blind:
        reason = Reason.OUTPUTS_UNCHANGED
    detail = {"motor": fault.motor or "both"} if "motor" in fields_of(reason) else {}
    room = LINE_LENGTH - len(describe(explain(reason, **detail))) - len(" ()")
    return explain(reason, **detail, hint=_hint(fault, findings, room))


def _hint(fault: Fault, findings: Iterable[Finding], room: int) -> str:
    """Names of the parameters that may be the cause, as many as have room; empty where none may.

    Those that were read and are wrong, or where there are none those that have not answered: a parameter that was read,
    and is right, is left out. For outputs that do not follow without a known pattern it is the command that looks at
    all of them, but the link where reports come in bursts.
    """
    findings = [finding for finding in findings if finding.requirement.cause is not None]
    suspects = [finding for finding in findings if not finding.ok]
    if fault.cause not in LOOK_AT:
        if fault.late:
            return LATE
        return "asvhil check" if suspects else ""
    causes = (Cause.IGNORED, *LOOK_AT[fault.cause]) if fault.blind else LOOK_AT[fault.cause]
    by_cause: list[list[str]] = []
    for among in ([f for f in suspects if f.wrong], suspects, findings if fault.cause in CERTAIN else []):
        by_cause = [_names(among, cause, fault.motor) for cause in causes]
        if any(by_cause):
            break
    text = ""
    for name in chain.from_iterable(zip_longest(*by_cause)):  # one of each cause before the second of any
        longer = f"{text} or {name}" if text else name
        if name is not None and len(longer) <= room:
            text = longer
    return text


def _names(findings: Iterable[Finding], cause: Cause, motor: str) -> list[str]:
    """Parameters of a cause and a motor; those that differ by their number alone as one: SERVO1/3_FUNCTION."""
    numbers: dict[str, list[str]] = {}
    for finding in findings:
        if finding.requirement.cause is cause and (not motor or finding.requirement.motor in ("", motor)):
            number = re.search(r"\d+", finding.name)
            place = finding.name.replace(number[0], "{}", 1) if number else finding.name
            numbers.setdefault(place, []).append(number[0] if number else "")
    return [place.format("/".join(found)) for place, found in numbers.items()]
