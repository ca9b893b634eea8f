"""Checks of what the autopilot's parameters say: the motors' wiring, and values that must be right."""

from __future__ import annotations

from asvhil.autopilot.ardurover_parameters import OPTIONAL
from asvhil.autopilot.requirements import Finding
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import PARAMETERS, Check, Result
from asvhil.preflight.wiring import SIDES, motor_text


def wiring_checks(survey: Survey) -> list[Check]:
    """What the motors' outputs were found to be, which is followed; contradictions are among the parameters."""
    pwm, unread = survey.config.vehicle.pwm, survey.link.unread_wiring
    checks = []
    for side, (name, config) in enumerate(zip(SIDES, (pwm.port, pwm.starboard), strict=True)):
        pinned = config.model_dump(exclude_none=True)
        checks.append(
            Check(
                section="wiring",
                item=f"{name} motor",
                result=Result.UNVERIFIED if unread else Result.PASS,
                found=motor_text(survey, side),
                wanted=f"vehicle.pwm.{name}" if pinned else "whatever it is",
                todo=f"{unread} has not answered: run the check again" if unread else "",
            )
        )
    return checks


def parameter_checks(findings: list[Finding]) -> list[Check]:
    """One for each that belongs to this firmware; those of other generations are silent for good."""
    if findings and all(finding.value is None for finding in findings):
        todo = "the link must carry frames both ways; another station may be reading all parameters just now"
        return [Check(section=PARAMETERS, item="all", result=Result.FAIL, found="none answered", todo=todo)]
    return [_parameter(f) for f in findings if f.value is not None or f.name not in OPTIONAL]


def _parameter(finding: Finding) -> Check:
    requirement = finding.requirement
    bad = Result.FAIL if requirement.must else Result.WARN
    if finding.value is None:
        todo = "no answer, which proves nothing: run the check again, or look it up by hand"
        result, found = Result.UNVERIFIED, "not known"
    else:
        result, found = Result.PASS if finding.ok else bad, f"{finding.value:g}"
        todo = "" if finding.ok else f"{requirement.why}{_remedy(finding)}"
    return Check(
        section=PARAMETERS, item=finding.name, result=result, found=found, wanted=_wanted_text(finding), todo=todo
    )


def _remedy(finding: Finding) -> str:
    """Who puts it right."""
    if finding.requirement.wiring:
        return "; the boat's wiring, never written: change the config, or the boat by hand"
    return "" if finding.wanted is None else "; --fix writes it"


def _wanted_text(finding: Finding) -> str:
    """What will do, in words."""
    requirement = finding.requirement
    if requirement.clear:
        bits = [str(bit) for bit in range(requirement.clear.bit_length()) if requirement.clear >> bit & 1]
        return f"bit{'s' * (len(bits) > 1)} {', '.join(bits)} not set"
    if requirement.least == requirement.most:
        return f"{requirement.least:g}"
    return f"{requirement.least:g} to {requirement.most:g}"
