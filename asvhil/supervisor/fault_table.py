"""What breaks and what then happens: the table of docs/safety.md, and the promises that the tests break things against.

`python -m asvhil.supervisor.fault_table` prints the table. Thresholds are those of the config, reasons and remedies
those that operators read; so neither can differ from what runs.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable

from asvhil.config import EstimatorConfig, SupervisorConfig
from asvhil.supervisor.reasons import WORDS, Reason
from asvhil.types import record

MATRIX = "tests/loop/test_fault_matrix.py"
RUNAWAYS = "tests/loop/test_runaways.py"
GUARDIAN = "tests/loop/test_guardian_in_the_loop.py"
DISPLAYS = "tests/loop/test_displays.py"
HOST = "tests/loop/test_harsh_host.py"


class Reaction(enum.StrEnum):
    """What becomes of a hold."""

    KEEP = "keep"  # the hold goes on, and the boat stays
    NEUTRAL = "neutral"  # the controller has the motors no longer, and they stand still
    RELEASE = "release"  # in the tick of the news the motors are the pilot's
    REFUSE = "refuse"  # no hold begins


LEFT = {
    Reaction.KEEP: "hold goes on",
    Reaction.NEUTRAL: "neutral",
    Reaction.RELEASE: "released",
    Reaction.REFUSE: "no hold",
}
SHOWN = 5  # reasons in a cell, at most


@record
class FaultRow:
    """A fault, how it is noticed, and what is promised: `reaction` within a time, for one of the reasons.

    `noticed` names thresholds as `{supervisor.heartbeat_timeout_s}`; `told` is what the operator sees beside a reason,
    `todo` what to do where no reason's remedy says it. `proof` is the test that breaks it in.
    """

    name: str
    noticed: str
    reaction: Reaction = Reaction.KEEP
    within_s: float = 0.0
    reasons: tuple[Reason, ...] = ()
    told: str = ""
    todo: str = ""
    proof: str = MATRIX


KEEP, NEUTRAL, RELEASE, REFUSE = Reaction.KEEP, Reaction.NEUTRAL, Reaction.RELEASE, Reaction.REFUSE
_STALE = (Reason.ESTIMATE_STALE,)
_LINK = (Reason.HEARTBEAT_LOST, Reason.ESTIMATE_STALE, Reason.MODE_UNKNOWN)
_STOPPED = (Reason.OUTPUT_STUCK, Reason.OUTPUTS_UNCHANGED, Reason.OUTPUTS_DIFFER, Reason.DISARMED)
_WIRING = (
    *(Reason.AUTOPILOT_PARAMETER, Reason.OUTPUT_REVERSED, Reason.OUTPUTS_SWAPPED, Reason.OUTPUT_STUCK),
    *(Reason.OUTPUTS_DIFFER, Reason.WIRING_UNREAD, Reason.OVERRIDE_NOT_FOLLOWED, Reason.COMMANDS_MIXED),
    *(Reason.OVERRIDES_IGNORED, Reason.OUTPUTS_UNCHANGED),
)
_CARRIED = (Reason.DRIFTED_OFF, Reason.BEYOND_MOTORS)
_SILENT = "no reading for {estimator.ekf.stale_after_s:g} s"
_FROZEN = "the same reading for {estimator.trust.frozen_after_s:g} s"
_GATE = "the estimator's gate on the innovation"
_NO_LINK = "no message of it for {supervisor.heartbeat_timeout_s:g} s"
_READBACK = "reported outputs and parameters against the commands, {supervisor.readback.lag_s:g} s later"
_SENSE = (
    "motion against the commands: evidence of {supervisor.motion.evidence:g} in the first "
    "{supervisor.motion.sense_s:g} s, later with {supervisor.motion.confirm_m:g} m farther off too"
)
_NOTE = "note of the sensor"
_NOTHING = "nothing"


def _row(
    name: str,
    noticed: str,
    reaction: Reaction = KEEP,
    within_s: float = 0.0,
    reasons: tuple[Reason, ...] = (),
    told: str = "",
    todo: str = "",
    proof: str = MATRIX,
) -> FaultRow:
    return FaultRow(
        name=name,
        noticed=noticed,
        reaction=reaction,
        within_s=within_s,
        reasons=reasons,
        told=told,
        todo=todo,
        proof=proof,
    )


def _moves_wrong(name: str, reason: Reason) -> FaultRow:
    return _row(name, _SENSE, NEUTRAL, 15.0, (reason,), "time is that of thrust", proof=RUNAWAYS)


SECTIONS: dict[str, tuple[FaultRow, ...]] = {
    "Sensors": (
        _row("GNSS silent for 5 s", _SILENT, told=_NOTE, todo="Nothing: dead reckoning bridges it."),
        _row(
            "GNSS lost for good",
            "dead reckoning longer than {estimator.trust.dead_reckoning_s:g} s, or an uncertainty of "
            "{estimator.trust.position_std_max_m:g} m",
            *(NEUTRAL, 40.0, _STALE),
        ),
        _row("GNSS jumps by 20 m for 5 s", _GATE, told=_NOTE),
        _row("GNSS jumps by 3 m for 3 s", _GATE, told=_NOTE),
        _row("GNSS frozen for 5 s", _FROZEN, told=_NOTE),
        _row("heading silent for 5 s", _SILENT, told=_NOTE, todo="Nothing: the gyro bridges it."),
        _row("heading of the INS lost", _SILENT, told="another source in `sources`"),
        _row(
            "the only heading lost",
            "dead reckoning longer than {estimator.trust.dead_reckoning_s:g} s, or an uncertainty of "
            "{estimator.trust.heading_std_max_deg:g}°",
            *(NEUTRAL, 40.0, _STALE),
        ),
        _row("heading jumps by 60 degrees for 4 s", _GATE, told=_NOTE),
        _row(
            "heading slowly wrong, by 2 degrees a second",
            "motion against the commands",
            *(NEUTRAL, 90.0, (Reason.HEADING_OFF, *_CARRIED, *_STALE)),
            told="note `motion` once it is 45° off",
        ),
        _row("GNSS and heading lost", _SILENT, NEUTRAL, 4.0, _STALE),
        _row("gyro and accelerometer silent", _SILENT, told=_NOTE),
        _row("anemometer silent", "no sample for {estimator.wind.stale_after_s:g} s", told="note `wind`"),
        _row("anemometer stuck", "the same reading for {estimator.wind.stuck_after_s:g} s", told="note `wind`"),
        _row("vane stuck", "the same direction for {estimator.wind.stuck_after_s:g} s", told="note `wind`"),
        _row("cups stuck", "the same speed for {estimator.wind.stuck_after_s:g} s", told="note `wind`"),
        _row("bytes of noise on the anemometer's line", "checksums", told="counters of the link"),
        _row("time runs back by a second", "times of the autopilot and of the receiver", told=_NOTHING),
    ),
    "Motors, compass and water": (
        _moves_wrong("both motors reversed", Reason.MOTORS_REVERSED),
        _moves_wrong("one motor reversed", Reason.MOTOR_REVERSED),
        _moves_wrong("motors swapped", Reason.MOTORS_SWAPPED),
        _moves_wrong("one motor dead, fouled, or without its propeller", Reason.MOTOR_DEAD),
        _moves_wrong("no thrust at all: aground, moored, no power", Reason.NO_THRUST),
        _moves_wrong("compass off by 45 degrees or more", Reason.HEADING_OFF),
        _row(
            "a motor stuck at its thrust",
            "two and a half turns one way on the station, or {supervisor.motion.farther_m:g} m farther off",
            *(NEUTRAL, 25.0, (Reason.TURNS_ROUND, Reason.MOTOR_REVERSED, Reason.MOTORS_REVERSED, *_CARRIED, *_STALE)),
            proof=RUNAWAYS,
        ),
        _row(
            "current or wind beyond the motors, or any other cause",
            "{supervisor.motion.farther_m:g} m farther off than since the hold began",
            *(NEUTRAL, 15.0, _CARRIED),
            proof=RUNAWAYS,
        ),
        _row(
            "the boat leaves the geofence",
            "position against `supervisor.geofence`",
            *(NEUTRAL, 0.1, (Reason.OUTSIDE_FENCE,)),
            proof="tests/loop/test_geofence.py",
        ),
        _row(
            "station outside the geofence, or farther than is meant",
            "`supervisor.geofence`; `supervisor.max_distance_m`, {supervisor.max_distance_m:g} m",
            REFUSE,
            told="`outside-fence`, `station-unconfirmed`, `station-too-far`",
            todo="Check latitude and longitude; `asvhil hold --within METRES` says that it is meant.",
            proof="tests/unit/supervisor/test_geofence.py",
        ),
        _row(
            "the boat does not move as its model says",
            "errors of the prediction beyond `estimator.monitor` for {estimator.monitor.mismatch_s:g} s",
            told="note `model`; `estimator.monitor.on_mismatch: release` ends the hold",
            todo=WORDS[Reason.MODEL_MISMATCH].remedy,
            proof="tests/loop/test_model_mismatch.py",
        ),
        _row(
            "model file of another boat",
            "name, and hull by a factor of 1.5, before anything moves",
            REFUSE,
            told="an error in one line, exit status 2; or `controller.on_other_hull`",
            todo="Train a model on this boat (docs/models.md).",
            proof="tests/unit/backseat/test_other_hull.py",
        ),
    ),
    "Link to the autopilot": (
        _row("link down both ways", _NO_LINK, NEUTRAL, 4.0, _LINK),
        _row("nothing comes from the autopilot", _NO_LINK, NEUTRAL, 4.0, _LINK),
        _row("nothing reaches the autopilot", _READBACK, NEUTRAL, 5.0, tuple(dict.fromkeys(_WIRING + _STOPPED))),
        _row("link down for 1 s", "shorter than {supervisor.heartbeat_timeout_s:g} s", told=_NOTHING),
        _row("20 % of the frames lost each way", "sequence numbers", told="counters of the link"),
        _row("frames reordered", "times of the measurements", told="counters of the link"),
        _row("frames doubled", "sequence numbers", told=_NOTHING),
        _row("frames 0.3 s late", "times of the measurements", told=_NOTHING),
        _row("frames 6 s late", _NO_LINK, NEUTRAL, 5.0, _LINK),
        _row("a tenth of the frames damaged", "checksums", told="counters of the link"),
        _row("frames cut anywhere", "checksums", told="counters of the link"),
        _row("noise on the autopilot's link", "checksums", told="counters of the link"),
        _row("a camera on the autopilot's system", "component and type in its heartbeat", told=_NOTHING),
        _row("a second ground station", "its heartbeat", told=_NOTHING),
        _row(
            "the autopilot becomes a copter",
            "type in its heartbeat",
            *(NEUTRAL, 3.0, (Reason.NOT_A_BOAT, Reason.TWO_VEHICLES, Reason.DISARMED)),
        ),
        _row("acknowledgements that nobody asked for", "nothing waits for them", told=_NOTHING),
    ),
    "Autopilot": (
        _row(
            "autopilot reboots",
            "its heartbeat and the time since its boot",
            *(NEUTRAL, 3.0, (*_LINK, Reason.DISARMED, Reason.AUTOPILOT_REBOOTED)),
        ),
        _row(
            "its fail-safe disarms",
            "what it says of it, as where our commands do not get through",
            *(NEUTRAL, 3.0, (Reason.AUTOPILOT_DISARMED,)),
            told="EMERGENCY in our heartbeat",
            proof="tests/loop/test_disarmed_by_itself.py",
        ),
        _row("its fail-safe changes the mode", "mode in its heartbeat", RELEASE, 0.3, (Reason.MODE_CHANGED,)),
        _row(
            "battery low",
            "charge below {supervisor.battery.low_percent:g} %, voltage below `supervisor.battery.low_v`, or state and "
            "faults in BATTERY_STATUS, for {supervisor.battery.lasts_s:g} s",
            told="note `battery`; `supervisor.battery.on_low: release` ends the hold",
            todo=WORDS[Reason.BATTERY_LOW].remedy,
        ),
        _row(
            "battery low, where that ends a hold",
            "the same, with `supervisor.battery.on_low: release`",
            *(NEUTRAL, 12.0, (Reason.BATTERY_LOW, Reason.BATTERY_COMPLAINT)),
        ),
        _row("emergency stop of the motors", _READBACK, NEUTRAL, 3.0, _STOPPED),
        _row("an output loses its function", _READBACK, NEUTRAL, 6.0, _WIRING),
        _row("outputs swapped", _READBACK, NEUTRAL, 4.0, _WIRING),
        _row("an output reversed", _READBACK, NEUTRAL, 4.0, _WIRING),
        _row("sticks mixed as steering and throttle", _READBACK, NEUTRAL, 4.0, _WIRING),
        _row("overrides switched off", _READBACK, NEUTRAL, 5.0, _WIRING),
        _row("another system id is obeyed", _READBACK, NEUTRAL, 5.0, _WIRING),
    ),
    "Pilot and operator": (
        _row("pilot changes the mode", "mode in the heartbeat", RELEASE, 0.3, (Reason.MODE_CHANGED,)),
        _row(
            "pilot moves a stick",
            "{supervisor.stick_threshold_us} us on a channel of supervisor.stick_channels",
            *(RELEASE, 0.3, (Reason.STICK_MOVED,)),
        ),
        _row(
            "the autopilot stops telling the pilot's sticks",
            "no RC_CHANNELS for 3 s",
            *(NEUTRAL, 3.3, (Reason.STICKS_UNSEEN,)),
        ),
        _row("pilot disarms", "heartbeat", RELEASE, 0.3, (Reason.DISARMED,)),
        _row("pilot's ground station moves a stick", "its MANUAL_CONTROL", RELEASE, 0.3, (Reason.STATION_STICK,)),
        _row("pilot's transmitter lost, no signal strength", "cannot be noticed: overrides hide it", told=_NOTHING),
        _row(
            "pilot's transmitter lost, signal strength told",
            "RSSI of the receiver",
            *(NEUTRAL, 3.0, (Reason.TRANSMITTER_LOST,)),
        ),
        _row("operator releases", "his command", RELEASE, 0.1, (Reason.RELEASED,)),
        _row(
            "operator's link silent",
            "no watch: a hold needs nobody",
            told="his heartbeat from here ends; our own heartbeat stands for a ground station's at the autopilot",
        ),
        _row("a hold 120 km away", "distance to the station", told="the distance, as the refusal of the request"),
        _row("set-points that are no numbers", "each request is checked", told="the refusal"),
        _row("commands with a wrong checksum", "checksums", told="counters of the link"),
        _row("noise on the operator's link", "checksums", told="counters of the link"),
    ),
    "Controller": (
        _row("controller finds no solution", "its own status", NEUTRAL, 1.0, (Reason.NO_SOLUTION,)),
        _row("controller gives no numbers", "the last check before the wire", NEUTRAL, 1.0, (Reason.NO_SOLUTION,)),
        _row(
            "controller asks for ten times full thrust",
            "clamp and slew limit before the wire, then the distance",
            *(NEUTRAL, 24.0, _CARRIED),
        ),
    ),
    "Program and computer": (
        _row(
            "the step raises",
            "the daemon, in the same tick",
            NEUTRAL,
            told="stderr and log; the end with status 2",
            todo="Keep the log, which replays it, and report it.",
            proof="tests/loop/test_daemon.py",
        ),
        _row(
            "daemon killed, crashed, or out of memory",
            "its guardian, by the pipe between them",
            *(NEUTRAL, 0.2),
            told="silence of its heartbeat",
            todo="Start it again; `journalctl` and the log tell why.",
            proof=GUARDIAN,
        ),
        _row(
            "daemon hangs",
            "systemd's watchdog, 2 s, which kills it; else the autopilot's time-out",
            *(NEUTRAL, 2.5),
            told="journal",
            todo="Look at the journal: systemd starts it again.",
            proof="tests/unit/daemon/test_systemd.py",
        ),
        _row(
            "guardian dead, or silent for 2 s",
            "the daemon, in the same tick",
            told="status and note; `daemon.guardian_lost: release` ends the hold",
            todo="Nothing: another one is started.",
            proof=GUARDIAN,
        ),
        _row(
            "computer, power or cable gone",
            "the autopilot's own time-outs (docs/autopilots.md)",
            *(NEUTRAL, 3.0),
            told="silence of its heartbeat",
            todo="Take over: the autopilot has the boat.",
            proof="tests/loop/test_realtime.py",
        ),
        _row(
            "terminal closed (SIGHUP)",
            "the signal",
            told="note; `daemon.terminal_lost: release` ends the hold",
            proof=DISPLAYS,
        ),
        _row("display broken, slow, or on a full disk", "no write for 2 s", told="note `display`", proof=DISPLAYS),
        _row("Ctrl-Z, SIGTTIN, SIGTTOU", "ignored", told=_NOTHING, proof=DISPLAYS),
        _row("SIGINT, SIGTERM", "the signal", RELEASE, told="the end with status 0", proof=DISPLAYS),
        _row(
            "log stopped, its disk slow or full",
            "the recorder, in the same tick; slow after 2 s",
            told="note; status 2 at the end",
            todo="Make room: what is written stays readable.",
            proof=HOST,
        ),
        _row("clock stepped by an hour", "ticks go by the monotonic clock", told=_NOTHING, proof=HOST),
        _row("both cores taken", "ticks that are late", told="overruns in log and status", proof=HOST),
        _row(
            "power cut in mid write",
            "at the next reading of the log",
            NEUTRAL,
            told="at most the last 0.5 s of the log are lost",
            todo="`asvhil log recover`.",
            proof="tests/loop/test_power_cut.py",
        ),
    ),
}
ROWS: dict[str, FaultRow] = {row.name: row for rows in SECTIONS.values() for row in rows}
HEAD = "| fault | noticed by | what happens, within | the operator reads | what to do |"


def table() -> str:
    """All sections as Markdown tables."""
    return "\n".join(_section(name, rows) for name, rows in SECTIONS.items())


def _section(name: str, rows: Iterable[FaultRow]) -> str:
    lines = [f"### {name}", "", HEAD, "|" + " --- |" * 5]
    lines += [f"| {' | '.join(_cells(row))} |" for row in rows]
    return "\n".join([*lines, ""])


def _cells(row: FaultRow) -> tuple[str, str, str, str, str]:
    within = f", {row.within_s:g} s" if row.within_s else ""
    codes = [f"`{reason.value}`" for reason in row.reasons]
    if len(codes) > SHOWN:
        codes[SHOWN - 1 :] = [f"{len(codes) - SHOWN + 1} others of this kind"]
    read = ", ".join(codes)
    told = "; ".join(part for part in (read, row.told) if part)
    todo = row.todo or (WORDS[row.reasons[0]].remedy if row.reasons else "Nothing.")
    return row.name, _thresholds(row.noticed), LEFT[row.reaction] + within, told, todo


def _thresholds(text: str) -> str:
    """The text with the values of the config's keys at their defaults."""
    return text.format(supervisor=SupervisorConfig(), estimator=EstimatorConfig())


if __name__ == "__main__":
    print(table(), end="")
