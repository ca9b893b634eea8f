"""Checks of the autopilot's link: its clock against ours, and the rates of its messages."""

from __future__ import annotations

from asvhil.config.ports import AUTOPILOT
from asvhil.config.registry import AUTOPILOTS
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result
from asvhil.simplant.boat.devices import UNIX_EPOCH_AT_POWER_ON_US

ROUND_TRIP_MAX_MS = 100.0
CLOCK_OFF_MAX_S = 5.0
DAY_NS = 86_400 * 10**9
SIMULATED_DATE = "a simulated boat, where it is always 1 January 2026"
GOOD_SHARE, LEAST_SHARE = 0.8, 0.5  # of the rate that was asked for
NEEDED_MESSAGES = frozenset(
    {"HEARTBEAT", "EKF_STATUS_REPORT", "ESTIMATOR_STATUS", "SERVO_OUTPUT_RAW", "ACTUATOR_OUTPUT_STATUS", "RC_CHANNELS"}
)


def clock_checks(survey: Survey) -> list[Check]:
    """The rows of the section `time`: the exchange of times with the autopilot, and this computer's clock."""
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
        simulated = 0 <= unix_ns[0] - UNIX_EPOCH_AT_POWER_ON_US * 1000 < DAY_NS
        wrong = abs(off_s) > CLOCK_OFF_MAX_S and not simulated
        checks.append(
            Check(
                section="time",
                item="clock of this computer",
                result=Result.WARN if wrong else Result.PASS,
                found=SIMULATED_DATE if simulated else f"{off_s:+.1f} s from GNSS time",
                wanted=f"within {CLOCK_OFF_MAX_S:g} s",
                todo="set it: logs are named by it, and signatures rest on it" if wrong else "",
            )
        )
    return checks


def rate_checks(survey: Survey) -> list[Check]:
    """A row for each message that is asked for: how often it comes."""
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
