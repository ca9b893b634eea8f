"""Why the motors are held, given back or refused, and why a request is: one enum, and one table of texts for people.

Within the core a reason travels as an `Explanation`: the enum and what belongs to this case (a channel, a mode). It
becomes text only at the boundary, by `describe`: in what operators are sent, in `Health`, and so in logs and status.
"""

from __future__ import annotations

import enum
import string
from collections.abc import Mapping

from asvhil.types import record


class Reason(enum.StrEnum):
    """The values are kept in logs (`health.code`): they are never changed, and none is used for two things."""

    # Why the phase is what it is
    WAITING_FOR_HOLD = "waiting-for-hold"
    WAITING_FOR_AUTOPILOT = "waiting-for-autopilot"
    TAKING_MODE = "taking-mode"
    TAKING_MODE_AND_ARMING = "taking-mode-and-arming"
    SENDING_NEUTRAL = "sending-neutral"
    HOLDING = "holding"
    RELEASED = "released"
    STOPPED = "stopped"
    # What the pilot did
    DISARMED = "disarmed"
    MODE_CHANGED = "mode-changed"
    STICK_MOVED = "stick-moved"
    STATION_STICK = "station-stick"
    OVERRIDE_NOT_FOLLOWED = "override-not-followed"
    TRANSMITTER_HEARD = "transmitter-heard"
    # What failed while a station was held, or on the way to it
    HEARTBEAT_LOST = "heartbeat-lost"
    MODE_UNKNOWN = "mode-unknown"
    STICKS_UNSEEN = "sticks-unseen"
    FAR_FROM_ORIGIN = "far-from-origin"
    NOT_A_BOAT = "not-a-boat"
    TWO_VEHICLES = "two-vehicles"
    ESTIMATE_STALE = "estimate-stale"
    NO_SOLUTION = "no-solution"
    MODE_NOT_ENTERED = "mode-not-entered"
    TRANSMITTER_LOST = "transmitter-lost"
    STATION_LOST = "station-lost"
    NEUTRAL_ENDED = "neutral-ended"
    AUTOPILOT_DISARMED = "autopilot-disarmed"
    AUTOPILOT_REBOOTED = "autopilot-rebooted"
    # Why a hold is refused
    NO_HEARTBEAT = "no-heartbeat"
    NOT_ARMED = "not-armed"
    ARM_NOW = "arm-now"
    WRONG_MODE = "wrong-mode"
    NO_ESTIMATE = "no-estimate"
    STREAM_SLOW = "stream-slow"
    NOTHING_TO_STOP = "nothing-to-stop"
    PILOT_FIRST = "pilot-first"
    NOT_BY_SETPOINT = "not-by-setpoint"
    PILOT_STEERS = "pilot-steers"
    NO_STATION_HELD = "no-station-held"
    STATION_TOO_FAR = "station-too-far"
    STATION_UNCONFIRMED = "station-unconfirmed"
    STATION_TOO_FAST = "station-too-fast"
    HEADING_OF_WEATHER = "heading-of-weather"
    LEADER_JUMPED = "leader-jumped"
    OUTSIDE_FENCE = "outside-fence"
    STICK_HIDDEN = "stick-hidden"
    WIRING_UNREAD = "wiring-unread"
    SCRIPT_SILENT = "script-silent"
    SCRIPT_VERSION = "script-version"
    SCRIPT_STARVED = "script-starved"
    SCRIPT_LET_GO = "script-let-go"
    # What is wrong with the way to the motors
    AUTOPILOT_PARAMETER = "autopilot-parameter"
    UNBOUNDED = "unbounded"
    OVERRIDES_IGNORED = "overrides-ignored"
    COMMANDS_MIXED = "commands-mixed"
    OUTPUTS_SWAPPED = "outputs-swapped"
    OUTPUT_REVERSED = "output-reversed"
    OUTPUT_STUCK = "output-stuck"
    OUTPUTS_UNCHANGED = "outputs-unchanged"
    OUTPUTS_DIFFER = "outputs-differ"
    # How the boat moves other than it is told to
    MOTORS_REVERSED = "motors-reversed"
    MOTOR_REVERSED = "motor-reversed"
    MOTORS_SWAPPED = "motors-swapped"
    MOTOR_DEAD = "motor-dead"
    NO_THRUST = "no-thrust"
    HEADING_OFF = "heading-off"
    BEYOND_MOTORS = "beyond-motors"
    DRIFTED_OFF = "drifted-off"
    TURNS_ROUND = "turns-round"
    MODEL_MISMATCH = "model-mismatch"
    MODEL_OR_CURRENT = "model-or-current"
    BATTERY_LOW = "battery-low"
    BATTERY_COMPLAINT = "battery-complaint"
    # Why a request makes no sense
    GUIDED_ENABLE_VALUE = "guided-enable-value"
    COMMAND_INT_ONLY = "command-int-only"
    FRAME_NOT_GLOBAL = "frame-not-global"
    FRAME_NOT_LOCAL = "frame-not-local"
    SETPOINT_WITHOUT_POSITION = "setpoint-without-position"
    SETPOINT_WITH_RATE = "setpoint-with-rate"
    VELOCITY_IMPOSSIBLE = "velocity-impossible"
    PLACE_IMPOSSIBLE = "place-impossible"
    HEADING_IMPOSSIBLE = "heading-impossible"
    PARAMETER_OUT_OF_RANGE = "parameter-out-of-range"
    PARAMETER_CONFLICT = "parameter-conflict"
    PARAMETER_READ_ONLY = "parameter-read-only"
    REQUEST_LATE = "request-late"


@record
class Explanation:
    """A reason with its details: (name, value) for each field of its text, sorted by name.

    A detail `hint`, which any reason may have, names what to look at; it follows the text in brackets.
    """

    reason: Reason
    detail: tuple[tuple[str, float | int | str], ...] = ()


@record
class Words:
    """What people read of a reason, with its details as fields in braces, and what to do about it."""

    text: str
    remedy: str


_WAIT = "Nothing: this passes by itself."
_PILOT = "Nothing, if you meant it. To hold again, send a hold command."

WORDS: Mapping[Reason, Words] = {
    Reason.WAITING_FOR_HOLD: Words(
        text="waiting for a hold command",
        remedy="Send one: `asvhil hold`, or a goto from a ground station to the daemon's component.",
    ),
    Reason.WAITING_FOR_AUTOPILOT: Words(
        text="waiting for the autopilot to be ready",
        remedy="Wait until it has a position; if it takes longer than a minute, look at its GNSS and its messages.",
    ),
    Reason.TAKING_MODE: Words(text="asking for {mode}", remedy=_WAIT),
    Reason.TAKING_MODE_AND_ARMING: Words(
        text="asking for {mode} and arming",
        remedy="If it does not pass, the autopilot refuses to arm: its messages say which check fails.",
    ),
    Reason.SENDING_NEUTRAL: Words(
        text="sending neutral, so that the boat can be armed",
        remedy="Choose the control mode, arm, and send the hold command again.",
    ),
    Reason.HOLDING: Words(text="holding", remedy="Nothing: the station is kept."),
    Reason.RELEASED: Words(text="released by the operator", remedy="Nothing. To hold again, send a hold command."),
    Reason.STOPPED: Words(
        text="neutral, by the operator: the boat drifts",
        remedy="Hold or release: neutral is sent until then, or until the pilot takes the boat.",
    ),
    Reason.DISARMED: Words(text="disarmed", remedy="Arm the vehicle and send a hold command, if you want to go on."),
    Reason.MODE_CHANGED: Words(text="mode changed to {mode}", remedy=_PILOT),
    Reason.STICK_MOVED: Words(
        text="stick of channel {channel} moved",
        remedy="Nothing, if you meant it. If not: supervisor.stick_threshold_us is below the noise of the stick.",
    ),
    Reason.STATION_STICK: Words(
        text="{station}: stick of channel {channel} off centre",
        remedy="Nothing, if the pilot meant it. If not: let that station's joystick rest, or switch it off.",
    ),
    Reason.OVERRIDE_NOT_FOLLOWED: Words(
        text="channel {channel} does not follow the override",
        remedy="Somebody else drives the motors: the pilot by his override switch, or another ground station.",
    ),
    Reason.TRANSMITTER_HEARD: Words(
        text="a transmitter is heard: the sticks are the pilot's",
        remedy="Arm with the transmitter, and send a hold command.",
    ),
    Reason.HEARTBEAT_LOST: Words(
        text="autopilot heartbeat lost",
        remedy="Look at the cable, baud rate and power of the autopilot link; then send a hold command.",
    ),
    Reason.AUTOPILOT_DISARMED: Words(
        text="autopilot disarmed by itself: {why}",
        remedy="After a fail-safe look at the link to the autopilot: it hears us no more, or its pilot; else at that "
        "battery, or where the boat is. Then arm the vehicle and send a hold command.",
    ),
    Reason.AUTOPILOT_REBOOTED: Words(
        text="autopilot rebooted: it is disarmed",
        remedy="Look at its power supply. Once it is ready, arm the vehicle and send a hold command.",
    ),
    Reason.MODE_UNKNOWN: Words(
        text="mode and arming are not told",
        remedy="The link loses the autopilot's heartbeats though other messages come: look at its quality and rates.",
    ),
    Reason.NOT_A_BOAT: Words(
        text="this vehicle is no boat: {kind}",
        remedy="Look at links.autopilot.endpoint, and that no other vehicle has this one's system id.",
    ),
    Reason.TWO_VEHICLES: Words(
        text="two vehicles have system id {system}",
        remedy="Give each boat an id of its own (SYSID_THISMAV, MAV_SYSID) and name it in "
        "links.autopilot.autopilot_system_id; a second way to the same boat must not be seconds late.",
    ),
    Reason.ESTIMATE_STALE: Words(
        text="position or heading is stale",
        remedy="A source that is silent: look at its cable and power (`sources` in the status). One that is heard and "
        "rejected: is the compass right (mounting, iron, the motors' current), and the receiver? Then send a hold "
        "command.",
    ),
    Reason.NO_SOLUTION: Words(
        text="the controller found no solution",
        remedy="Send a hold command; if it happens again, keep the log and try another controller or solver.",
    ),
    Reason.MODE_NOT_ENTERED: Words(
        text="the autopilot does not enter {mode}",
        remedy="The autopilot's messages say why it refuses; a mode switch of the transmitter may hold another mode.",
    ),
    Reason.TRANSMITTER_LOST: Words(
        text="the pilot's transmitter is lost",
        remedy="Switch it on or come nearer. To hold without it: supervisor.transmitter_lost: hold.",
    ),
    Reason.STATION_LOST: Words(
        text="the pilot's ground station is lost: silent for {seconds:g} s",
        remedy="Get its link back, and send a hold command. To hold without it: "
        "supervisor.ground_station_timeout_s: null.",
    ),
    Reason.FAR_FROM_ORIGIN: Words(
        text="the boat is {distance_km:.0f} km from the first position that was heard: distances are not right there",
        remedy="Start the daemon again: the first fix was wrong, or the boat has come a long way since.",
    ),
    Reason.STICKS_UNSEEN: Words(
        text="the autopilot does not tell where the pilot's sticks are (RC_CHANNELS)",
        remedy="It is asked for them: if another station sets the rate of RC_CHANNELS, have it leave that alone. "
        "Then send a hold command.",
    ),
    Reason.NEUTRAL_ENDED: Words(
        text="neutral is no longer sent: no hold within {seconds:g} s",
        remedy="Send a hold command: it sends neutral again for as long (supervisor.arming_neutral_s).",
    ),
    Reason.NO_HEARTBEAT: Words(
        text="no heartbeat from the autopilot",
        remedy="Look at the autopilot link: endpoint, baud rate, and links.autopilot.autopilot_system_id.",
    ),
    Reason.NOT_ARMED: Words(text="vehicle is not armed", remedy="Arm it and send the hold command again."),
    Reason.ARM_NOW: Words(
        text="not armed: neutral is sent for {seconds:g} s, arm it in {mode} and hold again",
        remedy="Choose the mode, arm, and send the hold command again: without a receiver it arms only meanwhile.",
    ),
    Reason.WRONG_MODE: Words(
        text="mode is {mode}, {needed} is needed",
        remedy="Change the mode, or let the daemon do it (supervisor.take_mode: true).",
    ),
    Reason.NO_ESTIMATE: Words(
        text="no valid position and heading yet",
        remedy="Wait for the sensors; `sources` in the status names what is heard of each quantity.",
    ),
    Reason.STREAM_SLOW: Words(
        text="too slow: {message}, less than a third of {wanted} Hz",
        remedy="It is asked for again: send the hold command in some seconds. If that does not help, a hold is granted "
        "after 15 s, and the note stays: look at the link's rate and losses (`asvhil check`).",
    ),
    Reason.NOTHING_TO_STOP: Words(
        text="the motors are not ours: nothing to stop",
        remedy="Whoever has them stops them: the pilot by the sticks, or by disarming.",
    ),
    Reason.PILOT_FIRST: Words(
        text="the pilot has just taken over", remedy="Send the hold command again, if the pilot wants you to."
    ),
    Reason.NOT_BY_SETPOINT: Words(
        text="set-points take no boat back: send a hold command",
        remedy="Once a hold has ended or a set-point was refused, only a command takes the motors: `asvhil hold`, "
        "DO_REPOSITION. A stream that was silent for a while may have lost its radio link, no more.",
    ),
    Reason.PILOT_STEERS: Words(
        text="stick of channel {channel} off centre: set-points take no boat that is steered",
        remedy="A hold command takes it: `asvhil hold`, DO_REPOSITION. Else let the stick rest, and hold by command.",
    ),
    Reason.NO_STATION_HELD: Words(
        text="no station is held: send a hold command first",
        remedy="Hold first. Of a stream of set-points only the first takes a station, once.",
    ),
    Reason.STATION_TOO_FAR: Words(
        text="station is {distance_km:.1f} km away, {limits}",
        remedy="Check latitude and longitude, or drive the boat nearer first.",
    ),
    Reason.STATION_UNCONFIRMED: Words(
        text="station is {metres:.0f} m away, at most {limit}",
        remedy="Check latitude and longitude. If it is meant: `asvhil hold --within METRES`, param3 of DO_REPOSITION "
        "in metres, or supervisor.max_distance_m.",
    ),
    Reason.STATION_TOO_FAST: Words(
        text="a station at {speed:.2f} m/s, {most:.2f} m/s at most",
        remedy="A slower course; supervisor.moving.max_speed_mps, up to what half of the boat's thrust keeps up with.",
    ),
    Reason.HEADING_OF_WEATHER: Words(
        text="the heading follows the weather ({policy}): choose the policy fixed first",
        remedy="`asvhil hold --policy fixed --heading DEG`, ST_POLICY 0, or the page's choice of headings.",
    ),
    Reason.LEADER_JUMPED: Words(
        text="the leader is {metres:.0f} m from where the last message that was followed had it, {most:.0f} m at most",
        remedy="Look at the leader's position. To follow it from where it is now: set ST_FOLLOW again.",
    ),
    Reason.OUTSIDE_FENCE: Words(
        text="the {what} is {metres:.0f} m outside the geofence",
        remedy="Bring the boat back into supervisor.geofence, or choose a station in it.",
    ),
    Reason.STICK_HIDDEN: Words(
        text="channel {channel} moves a motor and is to end a hold",
        remedy="Our commands hide that stick: name others in supervisor.stick_channels.",
    ),
    Reason.WIRING_UNREAD: Words(
        text="reading how the motors are wired ({name})",
        remedy="Nothing: it passes in seconds, or is given up and the config's wiring taken.",
    ),
    Reason.SCRIPT_SILENT: Words(
        text="the script on the autopilot gives no sign of life",
        remedy="`asvhil script status` tells why, `asvhil script install` puts it there.",
    ),
    Reason.SCRIPT_VERSION: Words(
        text="the script's version is {found}, not {needed}",
        remedy="`asvhil script install` puts the version of this program there.",
    ),
    Reason.SCRIPT_STARVED: Words(
        text="orders do not reach the script",
        remedy="Another script may empty the queue that all share, or a router holds TUNNEL back: "
        "`asvhil script status`.",
    ),
    Reason.SCRIPT_LET_GO: Words(
        text="script: {why}",
        remedy="Nothing, if the pilot meant it. To hold again, send a hold command.",
    ),
    Reason.AUTOPILOT_PARAMETER: Words(
        text="{finding}",
        remedy="Set the parameter: `asvhil check --fix` does, unless it is the boat's wiring. A cause that is meant to "
        "be so: supervisor.readback.tolerate.",
    ),
    Reason.UNBOUNDED: Words(
        text="nothing would stop the motors if this program died: {why}",
        remedy="Let the autopilot stop them (docs/autopilots.md), or take the hazard on yourself: "
        "supervisor.readback.tolerate: [unbounded].",
    ),
    Reason.OVERRIDES_IGNORED: Words(
        text="overrides are ignored",
        remedy="It obeys one system id only (SYSID_MYGCS), and may have overrides switched off (RC_OPTIONS).",
    ),
    Reason.COMMANDS_MIXED: Words(
        text="commands are mixed",
        remedy="The autopilot takes the two channels as steering and throttle: each motor needs a channel of its own.",
    ),
    Reason.OUTPUTS_SWAPPED: Words(
        text="outputs are swapped",
        remedy="An output has got another function, or a stick another channel, since the hold began.",
    ),
    Reason.OUTPUT_REVERSED: Words(
        text="reversed output: {motor}", remedy="Its stick or its output has been reversed since the hold began."
    ),
    Reason.OUTPUT_STUCK: Words(
        text="stuck output: {motor}", remedy="Give the output its motor function, and let it be armed."
    ),
    Reason.OUTPUTS_UNCHANGED: Words(
        text="no output moves",
        remedy="No sticks are reported either: overrides are ignored, or the outputs have no motor function.",
    ),
    Reason.OUTPUTS_DIFFER: Words(
        text="outputs do not follow the commands",
        remedy="Run `asvhil check`: a dead zone, a scale or a slew limit of the autopilot bends the commands. A slow "
        "link delivers commands or reports too late: raise supervisor.readback.lag_s, or ask less of the link.",
    ),
    Reason.MOTORS_REVERSED: Words(
        text="the boat goes astern for ahead: both motors are reversed",
        remedy="Exchange two phases of each motor, or reverse both outputs (SERVOn_REVERSED); try it tied up first.",
    ),
    Reason.MOTOR_REVERSED: Words(
        text="the boat turns and runs against its commands: the {motor} motor is reversed",
        remedy="Exchange two phases of that motor, or reverse its output (SERVOn_REVERSED); try it tied up first.",
    ),
    Reason.MOTORS_SWAPPED: Words(
        text="the boat turns against its commands: port and starboard motor are swapped",
        remedy="Exchange the motors' plugs, or the functions of their outputs; try it tied up first.",
    ),
    Reason.MOTOR_DEAD: Words(
        text="the boat moves as if the {motor} motor gave no thrust",
        remedy="Look at that motor's propeller, fuse, cable and speed controller.",
    ),
    Reason.NO_THRUST: Words(
        text="the boat does not move by its motors",
        remedy="Motors without power, fouled, or the boat is aground or moored.",
    ),
    Reason.HEADING_OFF: Words(
        text="the boat does not move where it heads: the heading is off by about {degrees} degrees{side}",
        remedy="Look at how the compass is mounted (AHRS_ORIENTATION, COMPASS_ORIENT), at iron near it, and at its "
        "calibration (`asvhil calibrate`).",
    ),
    Reason.BEYOND_MOTORS: Words(
        text="a motor at its limit, and {metres:.0f} m farther off the station",
        remedy="Current or wind is stronger than the motors, or they have lost thrust, or one is stuck: take the "
        "boat home. If weights (W_*) were set in the hold: set them back.",
    ),
    Reason.DRIFTED_OFF: Words(
        text="{metres:.0f} m farther off the station than it has been",
        remedy="Look at the motors (one may be stuck), at the compass and at the current; supervisor.motion "
        "sets how far is too far.",
    ),
    Reason.TURNS_ROUND: Words(
        text="the boat turns round and round on its station, {turns:.1f} times",
        remedy="A motor is stuck at its thrust, fouled or reversed: look at its speed controller, cable and propeller.",
    ),
    Reason.MODEL_MISMATCH: Words(
        text="the boat does not move as the model says: {what} is off by {error} within {horizon_s:g} s",
        remedy="Train a model on this boat as it is (docs/models.md); look at vehicle.vessel and the wind sensor.",
    ),
    Reason.MODEL_OR_CURRENT: Words(
        text=(
            "the boat does not move as the model says, or a strong current is why: {what} is off by {error} within "
            "{horizon_s:g} s"
        ),
        remedy="Look again where there is little current. If it stays, train a model on this boat (docs/models.md).",
    ),
    Reason.BATTERY_LOW: Words(
        text="the battery is low: {reading}, less than {limit}",
        remedy="Take the boat home. supervisor.battery sets the limits.",
    ),
    Reason.BATTERY_COMPLAINT: Words(
        text="the autopilot says: {complaint}",
        remedy="Take the boat home and look at that battery. The autopilot's own limits judge it (BATT_*, BAT*).",
    ),
    Reason.GUIDED_ENABLE_VALUE: Words(
        text="param1 must be 0 or 1", remedy="NAV_GUIDED_ENABLE: 1 holds the station here, 0 releases."
    ),
    Reason.COMMAND_INT_ONLY: Words(
        text="DO_REPOSITION comes as COMMAND_INT", remedy="Send it as COMMAND_INT: COMMAND_LONG rounds a position."
    ),
    Reason.FRAME_NOT_GLOBAL: Words(
        text="frame {frame} is not latitude and longitude", remedy="Send the position in a global MAV_FRAME."
    ),
    Reason.FRAME_NOT_LOCAL: Words(
        text="frame {frame} is not MAV_FRAME_LOCAL_NED",
        remedy="A local set-point is in metres north and east of the first position heard.",
    ),
    Reason.SETPOINT_WITHOUT_POSITION: Words(
        text="a set-point without a position", remedy="Clear the bits of x and y in the type mask."
    ),
    Reason.SETPOINT_WITH_RATE: Words(
        text="a set-point with {field}: a station has a velocity at the most", remedy="Mask accelerations and yaw rate."
    ),
    Reason.VELOCITY_IMPOSSIBLE: Words(
        text="a set-point with half of a velocity", remedy="Send vx and vy in m/s, or mask both."
    ),
    Reason.PLACE_IMPOSSIBLE: Words(
        text="no latitude and longitude of a station",
        remedy="Send degrees within 90 and 180, and not both of them 0.",
    ),
    Reason.HEADING_IMPOSSIBLE: Words(
        text="a heading beyond a full turn: are its units right?",
        remedy="DO_REPOSITION and set-points take radians, NAV_LOITER_UNLIM degrees.",
    ),
    Reason.PARAMETER_OUT_OF_RANGE: Words(
        text="{name} must be {range}", remedy="The value in use stands; set one within the range."
    ),
    Reason.PARAMETER_CONFLICT: Words(
        text="{name}: {rule}", remedy="The value in use stands; change the other parameter of the rule first."
    ),
    Reason.PARAMETER_READ_ONLY: Words(
        text="{name} can be read, not set",
        remedy="Nothing has changed. It follows from supervisor.moving.max_speed_mps and the thrust of the boat.",
    ),
    Reason.REQUEST_LATE: Words(
        text="overtaken by a later request",
        remedy="Send it again: the link delivered it after one that was sent later.",
    ),
}


def explain(reason: Reason, **detail: float | int | str) -> Explanation:
    """A reason with the details that its text has fields for, and perhaps a `hint`."""
    return Explanation(reason=reason, detail=tuple(sorted(detail.items())))


def describe(explanation: Explanation) -> str:
    """What people read."""
    detail = dict(explanation.detail)
    text = WORDS[explanation.reason].text.format(**detail)
    return f"{text} ({detail['hint']})" if detail.get("hint") else text


def remedy(code: str) -> str:
    """What to do about the reason of a code, as `Health` has it; empty where this version does not know it."""
    return WORDS[Reason(code)].remedy if code in set(Reason) else ""


def fields_of(reason: Reason) -> frozenset[str]:
    """The details that the text of a reason needs."""
    return frozenset(name for _, name, _, _ in string.Formatter().parse(WORDS[reason].text) if name)
