"""Checks of what the autopilot's parameters say: the motors' wiring, and values that must be right."""

from __future__ import annotations

from asvhil.autopilot.ardurover_parameters import OPTIONAL
from asvhil.autopilot.ardurover_wiring import CHANNEL_MAP
from asvhil.autopilot.requirements import Finding
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import PARAMETERS, Check, Result
from asvhil.preflight.wiring import SIDES, doubts_of_wiring, motor_text
from asvhil.supervisor.pilot_watch import hidden_sticks


def wiring_checks(survey: Survey) -> list[Check]:
    """What the motors' outputs were found to be, which is followed, and whether the pilot's sticks can be seen."""
    motors = [_motor(survey, side) for side in range(len(SIDES))]
    return [*motors, _stick_channels(survey)] if survey.config.links.autopilot.overrides_sticks else motors


def _motor(survey: Survey, side: int) -> Check:
    """How a motor was found to be wired; what contradicts it is among the parameters."""
    pwm, name = survey.config.vehicle.pwm, SIDES[side]
    pinned = (pwm.port, pwm.starboard)[side].model_dump(exclude_none=True)
    result, todo = _certainty(survey, side)
    return Check(
        section="wiring",
        item=f"{name} motor",
        result=result,
        found=motor_text(survey, side),
        wanted=f"vehicle.pwm.{name}" if pinned else "whatever it is",
        todo=todo,
    )


def _certainty(survey: Survey, side: int) -> tuple[Result, str]:
    """Whether a motor is wired as was found, and what to do where that is not certain."""
    if survey.stranger is not None:
        return Result.FAIL, "of another vehicle than this boat: see the row heartbeat"
    doubts = doubts_of_wiring(survey, side)
    wrong = [finding.name for finding in doubts if finding.wrong]
    if wrong:
        return Result.FAIL, f"does not hold while these are wrong: {', '.join(wrong)}"
    unread = survey.link.unread_wiring or next((finding.name for finding in doubts), "")
    if unread:
        return Result.UNVERIFIED, f"{unread} has not answered: run the check again"
    return Result.PASS, ""


def _stick_channels(survey: Survey) -> Check:
    """Whether a stick that is to end a hold moves a motor: our commands hide it then, and every hold is refused."""
    supervisor, channels = survey.config.supervisor, survey.link.wiring.channels
    told = ", ".join(map(str, supervisor.stick_channels)) or "none"
    found, result, todo = told, Result.PASS, ""
    hidden = hidden_sticks(supervisor, channels)
    if hidden:
        sides = [channels.index(channel) for channel in hidden]
        moved = (f"channel {channels[side]} moves the {SIDES[side]} motor" for side in sides)
        names = " and ".join(CHANNEL_MAP[side] for side in sides)
        found, result = f"{told}: {', '.join(moved)}", Result.FAIL
        todo = f"our commands hide that stick: change {names} on the boat, or name others in supervisor.stick_channels"
    elif survey.link.unread_wiring:
        result, todo = Result.UNVERIFIED, f"{survey.link.unread_wiring} has not answered: run the check again"
    return Check(
        section="wiring", item="stick channels", result=result, found=found, wanted="none that moves a motor", todo=todo
    )


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
