"""Checks of the sources of each quantity: whether they are fresh, and fast enough for the estimator."""

from __future__ import annotations

from asvhil.config import Quantity
from asvhil.config.ports import AUTOPILOT
from asvhil.estimator.ekf_step import SLOWEST_INERTIAL_S
from asvhil.preflight.link_checks import GOOD_SHARE
from asvhil.preflight.survey import SourceState, Survey
from asvhil.preflight.table import Check, Result

READINGS_PER_LIMIT = 1.5  # in the time after which a sensor is silent, so that jitter alone does not make it so
CHANCE_INTERVALS = 5.0  # a gap at random is longer in one case of 150
# Without these nothing is held; the others are missed less.
NEEDED: frozenset[Quantity] = frozenset({"position", "velocity", "heading"})


def sensor_checks(survey: Survey) -> list[Check]:
    """A row for each source of each quantity, and one for the anemometer's firmware where it was heard."""
    checks: list[Check] = []
    for quantity, states in survey.sources().items():
        fresh = [_fresh(state) for state in states]
        for place, (state, good) in enumerate(zip(states, fresh, strict=True)):
            lost = quantity in NEEDED or (quantity == "wind" and _is_configured(survey, state))
            result = Result.PASS if good else Result.FAIL if lost and not any(fresh) else Result.WARN
            in_use = good and not any(fresh[:place])
            slow = _too_slow(survey, quantity, state) if in_use else ""
            checks.append(_source(survey, quantity, place, state, Result.WARN if slow else result, slow))
    note = survey.firmware
    if note is not None:
        mended = "restarted" in note.text
        result = Result.PASS if note.ok else Result.WARN if mended else Result.FAIL
        todo = "" if note.ok else "look at its supply" if mended else "docs/anemometer.md tells how to flash it"
        checks.append(Check(section="sensors", item=note.subject, result=result, found=note.text, todo=todo))
    return checks


def _fresh(state: SourceState) -> bool:
    """Heard within its time-out, or within the longest gap that chance makes on a link that loses frames."""
    if state.age_s is None:
        return False
    return state.age_s <= max(state.source.timeout_s, CHANCE_INTERVALS / state.rate_hz)


def _is_configured(survey: Survey, state: SourceState) -> bool:
    """Whether somebody meant there to be this source; the anemometer is the default even on a boat without one."""
    link = state.source.link
    return link == AUTOPILOT or link in survey.config.links.sensor_links()


def _too_slow(survey: Survey, quantity: Quantity, state: SourceState) -> str:
    """What to do about a source in use that comes slower than the estimator can use; empty where it does not."""
    estimator = survey.config.estimator
    if quantity == "acceleration":
        uses = estimator.kind == "ekf" and estimator.ekf.accelerometer
        least_hz, why = (1.0 / SLOWEST_INERTIAL_S if uses else 0.0), "the filter leaves a slower one out"
    else:
        key = "wind" if quantity == "wind" else "ekf"
        limit_s = estimator.wind.stale_after_s if quantity == "wind" else estimator.ekf.stale_after_s
        least_hz = READINGS_PER_LIMIT / limit_s
        why = f"it is silent after {limit_s:g} s (estimator.{key}.stale_after_s)"
    if state.rate_hz >= GOOD_SHARE * least_hz:
        return ""
    source = state.source
    where = f"links.autopilot.streams_hz.{source.message}" if source.link == AUTOPILOT else "the sensor's own rate"
    return f"at least {least_hz:g} Hz are needed, {why}: raise {where}"


def _source(
    survey: Survey, quantity: Quantity, place: int, state: SourceState, result: Result, slow: str = ""
) -> Check:
    name = state.source.name
    found = "nothing valid" if state.age_s is None else f"{state.rate_hz:.1f} Hz, last {state.age_s:.2f} s ago"
    todo = slow
    if result is not Result.PASS and not slow:
        if not _is_configured(survey, state):
            todo = f"there is no {survey.config.links.key_of(state.source.link)}"
        elif state.source.link == AUTOPILOT:
            todo = "the autopilot does not send it, or its position is not in use yet"
        else:
            diagnosis = survey.diagnosis(quantity, state.source)
            found, todo = diagnosis.found, diagnosis.todo
    return Check(
        section="sensors",
        item=f"{quantity}{'' if place == 0 else f', {place + 1}. choice'}: {name}",
        result=result,
        found=found,
        wanted=f"every {state.source.timeout_s:g} s",
        todo=todo,
    )
