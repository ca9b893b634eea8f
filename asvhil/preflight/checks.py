"""What a survey found, judged: pass, warn or fail, with what to do."""

from __future__ import annotations

import enum
from typing import Any

from asvhil.autopilot.ardurover_parameters import OPTIONAL
from asvhil.autopilot.requirements import Finding
from asvhil.autopilot.script_protocol import VERSION as SCRIPT_VERSION
from asvhil.config import AutopilotLinkConfig, Quantity
from asvhil.config.ports import AUTOPILOT
from asvhil.config.registry import AUTOPILOTS
from asvhil.estimator.ekf_step import SLOWEST_INERTIAL_S
from asvhil.io.mavlink.frames import dialect
from asvhil.preflight.survey import SourceState, Survey
from asvhil.preflight.wiring import SIDES, motor_text
from asvhil.supervisor.reasons import describe, remedy
from asvhil.types import Cause, FrontseatStatus, Radio, record

ROUND_TRIP_MAX_MS = 100.0
CLOCK_OFF_MAX_S = 5.0
TOLD_LOSS = 0.01
GOOD_SHARE, LEAST_SHARE = 0.8, 0.5  # of the rate that was asked for
READINGS_PER_LIMIT = 1.5  # in the time after which a sensor is silent, so that jitter alone does not make it so
CHANCE_INTERVALS = 5.0  # a gap at random is longer in one case of 150
VEHICLES = {dialect.MAV_TYPE_SURFACE_BOAT: "boat", dialect.MAV_TYPE_GROUND_ROVER: "rover"}
# Without these nothing is held; the others are missed less.
NEEDED: frozenset[Quantity] = frozenset({"position", "velocity", "heading"})
NEEDED_MESSAGES = frozenset(
    {"HEARTBEAT", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS", "SERVO_OUTPUT_RAW", "ACTUATOR_OUTPUT_STATUS", "RC_CHANNELS"}
)


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


def checks_of(survey: Survey) -> list[Check]:
    """All that the links have told. The survey must be done."""
    return [
        *_vehicle(survey),
        *_script(survey),
        *_clocks(survey),
        *_wiring(survey),
        *_parameters(survey.findings),
        *_rates(survey),
        *_sensors(survey),
    ]


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


def _vehicle(survey: Survey) -> list[Check]:
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
    stranger = survey.link.stranger
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
        if link.output == "script" and not status.has_transmitter:
            checks.append(_station(survey))
        if link.overrides_sticks and status.radio is not Radio.UNKNOWN:
            checks.append(_transmitter(survey, status.radio))
        checks += _arming(survey, status)
    return [*checks, *_after_silence(survey)]


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


def _clocks(survey: Survey) -> list[Check]:
    clock, unix_ns = survey.clock, survey.unix_ns
    if clock is None:
        lossy = bool(survey.link.parameters.values)  # frames come through both ways
        todo = (
            "a link that loses much, or takes more than a second: run the check again"
            if lossy
            else "the link must carry frames both ways: check the wiring of TX, and links.autopilot.senders"
        )
        checks = [
            Check(
                section="time",
                item="TIMESYNC",
                result=Result.UNVERIFIED if lossy else Result.FAIL,
                found="no answer in time" if lossy else "no answer",
                wanted="answered",
                todo=todo,
            )
        ]
    else:
        trip_ms = clock.round_trip_ns * 1e-6
        slow = trip_ms > ROUND_TRIP_MAX_MS
        checks = [
            Check(
                section="time",
                item="TIMESYNC",
                result=Result.WARN if slow else Result.PASS,
                found=f"round trip {trip_ms:.1f} ms, {clock.exchanges} exchanges",
                wanted=f"at most {ROUND_TRIP_MAX_MS:g} ms",
                todo="a slow link: raise supervisor.readback.lag_s and controller.mpc.delay_s" if slow else "",
            )
        ]
    if unix_ns is not None:
        off_s = (unix_ns[1] - unix_ns[0]) * 1e-9
        wrong = abs(off_s) > CLOCK_OFF_MAX_S
        checks.append(
            Check(
                section="time",
                item="clock of this computer",
                result=Result.WARN if wrong else Result.PASS,
                found=f"{off_s:+.1f} s from GNSS time",
                wanted=f"within {CLOCK_OFF_MAX_S:g} s",
                todo="set it: logs are named by it, and signatures rest on it" if wrong else "",
            )
        )
    return checks


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


def _wiring(survey: Survey) -> list[Check]:
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


def _parameters(findings: list[Finding]) -> list[Check]:
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
        section=PARAMETERS, item=finding.name, result=result, found=found, wanted=wanted_text(finding), todo=todo
    )


def _remedy(finding: Finding) -> str:
    """Who puts it right."""
    if finding.requirement.wiring:
        return "; the boat's wiring, never written: change the config, or the boat by hand"
    return "" if finding.wanted is None else "; --fix writes it"


def wanted_text(finding: Finding) -> str:
    """What will do, in words."""
    requirement = finding.requirement
    if requirement.clear:
        bits = [str(bit) for bit in range(requirement.clear.bit_length()) if requirement.clear >> bit & 1]
        return f"bit{'s' * (len(bits) > 1)} {', '.join(bits)} not set"
    if requirement.least == requirement.most:
        return f"{requirement.least:g}"
    return f"{requirement.least:g} to {requirement.most:g}"


def _rates(survey: Survey) -> list[Check]:
    links, needed = survey.config.links, set(NEEDED_MESSAGES)
    imu_message = AUTOPILOTS.find(links.autopilot.profile).imu_message  # the boat can be held without it
    for sources in survey.config.sources.resolved(links).values():
        needed |= {s.message for s in sources[:1] if s.link == AUTOPILOT and s.message != imu_message}
    return [
        _rate(name, survey.rate_hz(name), asked_hz, name in needed, _silence(survey, name))
        for name, asked_hz in sorted(links.autopilot.streams_hz.items())
    ]


def _silence(survey: Survey, name: str) -> tuple[Result, str] | None:
    """What it means if a message does not come at all, where that is known: PX4 sends some only now and then."""
    link, status = survey.config.links.autopilot, survey.status
    if name == "RC_CHANNELS" and not link.overrides_sticks:
        todo = "no transmitter heard: a PX4 sends this only with one; without it no stick can end a hold"
        return Result.WARN, todo
    if name == "ACTUATOR_OUTPUT_STATUS":
        if status is not None and not status.armed:
            return (
                Result.WARN,
                "a rover with PX4 1.16 in simulation tells nothing while disarmed; look again when armed",
            )
        return Result.FAIL, "in PX4's simulation a motor function on a spare output is needed: docs/boats/px4-rover.md"
    return None


def _rate(name: str, found_hz: float, asked_hz: float, needed: bool, silence: tuple[Result, str] | None) -> Check:
    if found_hz == 0.0 and silence is not None:
        result, todo = silence
    elif found_hz >= GOOD_SHARE * asked_hz:
        result, todo = Result.PASS, ""
    elif found_hz >= LEAST_SHARE * asked_hz:
        result, todo = Result.WARN, "a slow link, or another station that asks for another rate"
    else:
        result = Result.FAIL if needed else Result.WARN
        todo = "the autopilot does not send it" if found_hz == 0.0 else "a link too slow, or a rate that is refused"
        todo += f"; see links.autopilot.streams_hz.{name}"
    return Check(
        section="rates", item=name, result=result, found=f"{found_hz:.1f} Hz", wanted=f"{asked_hz:g} Hz", todo=todo
    )


def _sensors(survey: Survey) -> list[Check]:
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
