"""Checks of the vehicle itself: its make and state, who else is there, and what stops its motors after a crash."""

from __future__ import annotations

from asvhil.autopilot.script_protocol import VERSION as SCRIPT_VERSION
from asvhil.config import AutopilotLinkConfig
from asvhil.config.registry import AUTOPILOTS
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import dialect
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result
from asvhil.supervisor.geofence import Geofence
from asvhil.supervisor.reasons import describe, remedy
from asvhil.types import Cause, FrontseatStatus, Radio

TOLD_LOSS = 0.01
VEHICLES = {dialect.MAV_TYPE_SURFACE_BOAT: "boat", dialect.MAV_TYPE_GROUND_ROVER: "rover"}


def vehicle_checks(survey: Survey) -> list[Check]:
    """The rows of the section `vehicle`."""
    link = survey.config.links.autopilot
    beat = survey.heartbeat
    assert beat is not None
    autopilot = AUTOPILOTS.find(link.profile)
    wanted = autopilot.firmware
    kind = VEHICLES[beat.type]
    known = beat.autopilot == autopilot.mav_autopilot
    found = f"{wanted if known else f'autopilot {beat.autopilot}'}, {kind}"
    todo = "" if known else f"links.autopilot.profile is {link.profile}"
    result = Result.PASS if known else Result.FAIL
    stranger = survey.stranger
    if stranger is not None:
        found, result, todo = describe(stranger), Result.FAIL, remedy(stranger.reason.value)
    checks = [Check(section="vehicle", item="heartbeat", result=result, found=found, wanted=wanted, todo=todo)]
    checks += _neighbours(survey)
    checks.append(_firmware(survey, link))
    status = survey.status
    if status is not None:
        armed = "armed" if status.armed else "disarmed"
        checks.append(
            Check(
                section="vehicle",
                item="state",
                result=Result.WARN if status.armed else Result.PASS,
                found=f"{armed}, {status.mode}",
                wanted="disarmed",
                todo="disarm while checking: parameters are not written to an armed boat" if status.armed else "",
            )
        )
        checks.append(
            Check(
                section="vehicle",
                item="position",
                result=Result.PASS if status.ready else Result.WARN,
                found="in use" if status.ready else "not in use",
                wanted="in use",
                todo="" if status.ready else "wait, under open sky, until the autopilot's estimator uses its position",
            )
        )
        checks += _fence(survey)
        if link.output == "script" and not status.has_transmitter:
            checks.append(_station(survey))
        if link.overrides_sticks and status.radio is not Radio.UNKNOWN:
            checks.append(_transmitter(survey, status.radio))
        checks += _arming(survey, status)
    return [*checks, *_after_silence(survey), *_script(survey)]


def _fence(survey: Survey) -> list[Check]:
    """Whether the boat lies in the geofence: at the dock it may be outside, and a corner that is wrong shows."""
    corners, place = survey.config.supervisor.geofence, survey.place
    if not corners:
        return []
    found, result, todo = "inside", Result.PASS, ""
    if place is None:
        found, result, todo = "no position", Result.UNVERIFIED, "see the row position, and run the check again"
    else:
        frame = LocalFrame(lat_deg=place.lat_deg, lon_deg=place.lon_deg)
        refusal = Geofence(corners).refusal("boat", (0.0, 0.0), frame)
        if refusal is not None:
            found, result, todo = describe(refusal), Result.WARN, "no hold begins there: is supervisor.geofence right?"
    return [Check(section="vehicle", item="fence", result=result, found=found, wanted="inside", todo=todo)]


def _transmitter(survey: Survey, radio: Radio) -> Check:
    told = "" if survey.link.transmitter.tells_signal else ", no signal strength"
    found = {
        Radio.HEARD: f"{survey.rc_channels or 0} channels{told}",
        Radio.LOST: "lost: it has been heard before",
    }.get(radio, "not heard")
    todo = "switch it on: without it the pilot has only a ground station to take over with"
    if radio is Radio.ABSENT:
        todo += "; how to arm such a boat: docs/autopilots.md"
    heard = radio is Radio.HEARD
    return Check(
        section="vehicle",
        item="transmitter",
        result=Result.PASS if heard else Result.WARN,
        found=found,
        wanted="heard",
        todo="" if heard else todo,
    )


def _station(survey: Survey) -> Check:
    """The pilot's ground station, where he has no transmitter: its loss is to be noticed."""
    heard = survey.link.station_heard_ns is not None
    timeout_s = survey.config.supervisor.ground_station_timeout_s
    todo = "switch it on; an autopilot that does not pass on its heartbeats hides its loss from us"
    if timeout_s is None:
        heard, todo = False, "its loss is not noticed: supervisor.ground_station_timeout_s is null"
    return Check(
        section="vehicle",
        item="ground station",
        result=Result.PASS if heard else Result.WARN,
        found="heard" if heard else "not heard" if timeout_s is not None else "not watched",
        wanted="heard",
        todo="" if heard else todo,
    )


def _arming(survey: Survey, status: FrontseatStatus) -> list[Check]:
    """The autopilot's own checks before arming, where it tells of them."""
    ok = survey.link.arming_checks.ok
    if ok is None or status.armed:
        return []
    found = "its checks pass" if ok else f"refused: {status.arming_fault}"
    todo = "" if ok else "the autopilot will not arm until this is mended"
    result = Result.PASS if ok else Result.WARN
    return [Check(section="vehicle", item="arming", result=result, found=found, wanted="possible", todo=todo)]


def _after_silence(survey: Survey) -> list[Check]:
    """What stops the motors if this computer, or the link, dies in a hold."""
    after = survey.link.after_silence
    if after is None:
        return []
    taken = Cause.UNBOUNDED in survey.config.supervisor.readback.tolerate
    bounded = after.within_s is not None
    result = Result.PASS if bounded else Result.WARN if taken else Result.FAIL
    todo = "a hold is refused unless supervisor.readback.tolerate has unbounded: docs/autopilots.md"
    if taken:
        todo = "taken on by supervisor.readback.tolerate: the motors' supply needs a switch"
    return [
        Check(
            section="vehicle",
            item="motors after a crash",
            result=result,
            found=after.text if bounded else f"run on: {after.text}",
            wanted="stopped",
            todo="" if bounded else todo,
        )
    ]


def _neighbours(survey: Survey) -> list[Check]:
    """Who else is on the link, and what it loses: no fault by itself, and good to know where something is odd."""
    checks = []
    if survey.neighbours:
        found = ", ".join(survey.neighbours)
        checks.append(Check(section="vehicle", item="also on the link", result=Result.PASS, found=found))
    if survey.lost_share >= TOLD_LOSS:
        found = f"{survey.lost_share:.0%} of the autopilot's frames"
        checks.append(Check(section="vehicle", item="lost on the link", result=Result.PASS, found=found))
    checks += [
        Check(section="vehicle", item=note.subject, result=Result.WARN, found=note.text)
        for note in survey.link.notes
        if note.subject == "our own id"
    ]
    return checks


def _firmware(survey: Survey, link: AutopilotLinkConfig) -> Check:
    autopilot = AUTOPILOTS.find(link.profile)
    least = autopilot.least_version
    wanted = f"{autopilot.firmware} {least[0]}.{least[1]} or later"
    if survey.version is None:
        refused = survey.version_refused
        result = Result.WARN if refused else Result.UNVERIFIED
        todo = "AUTOPILOT_VERSION is refused: is this firmware older?" if refused else "no answer: run the check again"
        return Check(section="vehicle", item="firmware", result=result, found="not told", wanted=wanted, todo=todo)
    number = survey.version.flight_sw_version
    major, minor, patch = number >> 24 & 0xFF, number >> 16 & 0xFF, number >> 8 & 0xFF
    old = (major, minor) < least
    return Check(
        section="vehicle",
        item="firmware",
        result=Result.WARN if old else Result.PASS,
        found=f"{major}.{minor}.{patch}",
        wanted=wanted,
        todo="older than anything this was tried with" if old else "",
    )


def _script(survey: Survey) -> list[Check]:
    """The script on the autopilot, where that is the way to the motors."""
    if survey.config.links.autopilot.output != "script":
        return []
    fault = survey.link.way_fault
    return [
        Check(
            section="vehicle",
            item="script",
            result=Result.PASS if fault is None else Result.FAIL,
            found="gives signs of life" if fault is None else describe(fault),
            wanted=f"version {SCRIPT_VERSION}",
            todo="" if fault is None else remedy(fault.reason),
        )
    ]
