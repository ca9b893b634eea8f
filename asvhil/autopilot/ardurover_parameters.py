"""What an ArduRover's parameters must be for two motors to follow our pulses, and why. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from asvhil.autopilot.ardurover_wiring import (
    CHANNEL_MAP,
    FUNCTIONS,
    MOST_ASYMMETRY,
    MOST_CHANNELS,
    MOST_EXPO,
    MOTORS,
    stick_channels,
    wiring_of,
)
from asvhil.autopilot.ground_stations import FIRST_NAMES, LAST_NAME, station_systems
from asvhil.autopilot.requirements import Requirement, exactly, within
from asvhil.autopilot.wiring import LEAST_SPAN_US, NEUTRAL_SLACK_US, MotorWiring
from asvhil.autopilot.wiring_requirements import function_row, travel_rows
from asvhil.config import AutopilotLinkConfig, MotorOutputConfig, PwmConfig
from asvhil.types import Cause, changed

THROTTLE = {
    "port": "one output must be throttle left (SERVOn_FUNCTION 73)",
    "starboard": "one output must be throttle right (SERVOn_FUNCTION 74)",
}
OVERRIDES_IGNORED = 2  # bit of RC_OPTIONS
MOST_OVERRIDE_S = 3  # of RC_OVERRIDE_TIME: for longer the motors must not run on when this computer dies
BELOW_US = 10  # of FS_THR_VALUE, where it is too high

# Names that exist in some firmware only, whose absence means nothing.
FENCE_ACTION = "FENCE_ACTION"  # some boards' firmware has no fence
# Roll and pitch (rad) that are taken off the board's attitude before it is told. Its accelerometer is told as it is.
TRIM = ("AHRS_TRIM_X", "AHRS_TRIM_Y")
OPTIONAL = frozenset(
    {"ARMING_CHECK", "ARMING_SKIPCHK", "BRD_SAFETY_DEFLT", "SYSID_ENFORCE", "MAV_OPTIONS"}
    | {LAST_NAME, FENCE_ACTION, *TRIM}
)

# What several rows say.
IGNORED = "overrides are ignored"
BENT = "commands are bent"
NO_PULSES = "no pulse widths"
UNCHECKED = "arms unchecked", "leaves out checks before arming"


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig, values: Mapping[str, float]) -> tuple[Requirement, ...]:
    """What the way to the motors, `links.autopilot.output`, needs of a boat with these parameters.

    How the boat is wired is followed: only what contradicts the config, or leads nowhere, will not do.
    """
    if link.output == "set_servo":
        sides = zip(("port", "starboard"), pwm.outputs, strict=True)
        return tuple(changed(_free_output(output), motor=side) for side, output in sides)
    wiring = wiring_of(link, pwm, values)
    channels = stick_channels(values)
    motors = zip(("port", "starboard"), (pwm.port, pwm.starboard), MOTORS, wiring.motors, channels, strict=True)
    wired = tuple(
        changed(row, motor=side, wiring=True)
        for side, config, function, motor, channel in motors
        for row in (
            function_row(side, config, function, motor.output, FUNCTIONS, values, THROTTLE[side]),
            *_output(side, config, pwm, motor),
            *(() if link.output == "script" else _stick(channel, values)),
        )
    )
    if link.output == "script":
        return (*_script(), *wired)
    dead_zones = tuple(
        changed(_dead_zone(channel), motor=side) for side, channel in zip(("port", "starboard"), channels, strict=True)
    )
    # As if nothing bent it, which would only keep it nearer to its centre.
    least_us = min(round(wiring.sticks[1].pulse_us(wiring.throttle(1, us))) for us in (pwm.astern_us, pwm.ahead_us))
    path = (_station(link.override_system_id, values), *_command_path(values), *_bends())
    newer = _since_4_7() if FIRST_NAMES[1] in values else ()
    return (*path, *_channel_map(values), *wired, *dead_zones, *_fail_safes(least_us), *newer)


def _since_4_7() -> tuple[Requirement, ...]:
    """Of parameters that older firmware does not have, whose silence would say nothing there."""
    pause = "a pause at neutral when a motor is reversed"
    late = "seconds for which the motors run on without a transmitter if this computer dies"
    return (
        exactly("MOT_REV_DELAY", 0, "outputs lag behind", pause, Cause.SLEW),
        within("RC_FS_TIMEOUT", (0.1, MOST_OVERRIDE_S), 1, "radio fail-safe is late", late, Cause.UNBOUNDED),
    )


def _script() -> tuple[Requirement, ...]:
    """The script goes past sticks, mixer and fail-safes: there is little else that it needs."""
    enable = "the autopilot runs scripts where this is 1 at its start: set it by hand, and restart"
    switch = "the motors are dead until the safety switch is pressed, after each start"
    pulses = "outputs must be pulses"
    return (
        within("SCR_ENABLE", (1, 1), None, "scripts are off", enable, Cause.STUCK),
        changed(within("MOT_PWM_TYPE", (0, 2), None, NO_PULSES, pulses, Cause.SCALED), wiring=True),
        within("BRD_SAFETY_DEFLT BRD_SAFETYENABLE", (0, 0), None, "press the safety switch", switch, must=False),
    )


def _free_output(channel: int) -> Requirement:
    why = "DO_SET_SERVO is refused on an output that has a function"
    return changed(exactly(f"SERVO{channel}_FUNCTION", 0, "no set_servo", why, Cause.STUCK), wiring=True)


def _station(gcs_id: int, values: Mapping[str, float]) -> Requirement:
    """Who may override: one system, or from 4.7 on a range of them, which leaves room for the pilot's station."""
    others = "overrides of other systems are dropped without a word"
    first, last = station_systems(values)
    right = float(first if first <= gcs_id <= last else gcs_id)
    return within(" ".join(FIRST_NAMES), (right, right), gcs_id, IGNORED, others, Cause.IGNORED)


def _command_path(values: Mapping[str, float]) -> tuple[Requirement, ...]:
    """What the autopilot does to any command."""
    endless = not 0.0 <= values.get("RC_OVERRIDE_TIME", 1.0) <= MOST_OVERRIDE_S
    bit = "with its bit 1 all overrides are ignored"
    time_out = "0 ignores overrides; below 0 the motors run on for ever if this computer dies"
    mixes = "any other mixes the two commands as steering and throttle"
    slew = "limits how fast the throttle may change, unknown to the controller"
    return (
        within("RC_OPTIONS", (0, 2**31), 0, IGNORED, bit, Cause.IGNORED, clear=OVERRIDES_IGNORED),
        within(
            "RC_OVERRIDE_TIME",
            (0.5, MOST_OVERRIDE_S),
            1,
            "wrong time-out",
            time_out,
            Cause.UNBOUNDED if endless else Cause.IGNORED,
        ),
        exactly("PILOT_STEER_TYPE", 1, "sticks are mixed", mixes, Cause.MIXED),
        exactly("MOT_SLEWRATE", 0, "outputs lag behind", slew, Cause.SLEW),
    )


def _bends() -> tuple[Requirement, ...]:
    """What makes another command of a command on its way to the motors.

    Asymmetry and thrust curve are undone by the wiring. The rest cannot be: it cuts commands off, or depends on speed
    or time. MOT_STR_THR_MIX does nothing, since two paddles never ask for more than both motors have.
    """
    coarse = "so strong that a stick, in whole microseconds, is too coarse to undo it"
    return (
        exactly("MOT_THR_MIN", 0, BENT, "raises small commands", Cause.SCALED),
        exactly("MOT_THR_MAX", 100, BENT, "cuts off large commands", Cause.SCALED),
        within("MOT_THST_EXPO", (-MOST_EXPO, MOST_EXPO), 0, BENT, coarse, Cause.SCALED),
        within("MOT_THST_ASYM", (0, MOST_ASYMMETRY), 1, BENT, coarse, Cause.SCALED),
        exactly("MANUAL_STR_EXPO", 0, BENT, "lessens small differences between the motors", Cause.SCALED),
        within(
            "MANUAL_OPTIONS", (0, 2**31), 0, BENT, "with its bit 0 steering lessens with speed", Cause.SCALED, clear=1
        ),
        changed(within("MOT_PWM_TYPE", (0, 2), None, NO_PULSES, "outputs must be pulses", Cause.SCALED), wiring=True),
    )


def _channel_map(values: Mapping[str, float]) -> Iterator[Requirement]:
    """Each motor has a stick of its own."""
    for side, name, usual in zip(("port", "starboard"), CHANNEL_MAP, (1, 3), strict=True):
        why = f"the {side} motor's stick, which must be a channel of its own"
        row = within(name, (1, MOST_CHANNELS), usual, "no stick for a motor", why, Cause.SWAPPED)
        if side == "starboard" and values.get(name) == values.get(CHANNEL_MAP[0], 0.0):
            other = 1 if values[name] == usual else usual
            row = exactly(name, other, "both on one stick", why, Cause.SWAPPED)
        yield changed(row, motor=side, wiring=True)


def _output(side: str, config: MotorOutputConfig, pwm: PwmConfig, wired: MotorWiring) -> tuple[Requirement, ...]:
    servo, motor, key = f"SERVO{wired.output}", wired.motor, f"vehicle.pwm.{side}"
    sense = (0.0, 1.0) if config.reversed is None else (float(config.reversed), float(config.reversed))
    if config.neutral_us is None:
        trims_us = pwm.neutral_us - NEUTRAL_SLACK_US, pwm.neutral_us + NEUTRAL_SLACK_US
        neutral = f"the motor's neutral; set {key}.neutral_us if it is so far from vehicle.pwm.neutral_us"
    else:
        trims_us = float(config.neutral_us), float(config.neutral_us)
        neutral = f"{key}.neutral_us says otherwise"
    return (
        within(
            f"{servo}_REVERSED", sense, sense[0], "another sense", f"{key} says otherwise by its ends", Cause.REVERSED
        ),
        within(f"{servo}_TRIM", trims_us, motor.neutral_us, "another neutral", neutral, Cause.SCALED),
        *travel_rows(f"{servo}_MIN", f"{servo}_MAX", motor, LEAST_SPAN_US),
    )


def _stick(channel: int, values: Mapping[str, float]) -> tuple[Requirement, ...]:
    """Its travel is followed, and must lead somewhere on both sides."""
    rc = f"RC{channel}"
    trim_us, room_us = values.get(f"{rc}_TRIM", 1500.0), LEAST_SPAN_US + values.get(f"{rc}_DZ", 0.0)
    travel = "no travel", "a stick needs travel on both sides of its trim", Cause.SCALED
    return (
        within(f"{rc}_REVERSED", (0, 1), 0, "no sense", "0 or 1", Cause.REVERSED),
        within(f"{rc}_TRIM", (800, 2200), 1500, *travel),
        within(f"{rc}_MIN", (800, trim_us - room_us), 1000, *travel),
        within(f"{rc}_MAX", (trim_us + room_us, 2200), 2000, *travel),
    )


def _dead_zone(channel: int) -> Requirement:
    lost = "commands near neutral are lost, and all others bent"
    return exactly(f"RC{channel}_DZ", 0, "dead zone bends commands", lost, Cause.DEAD_ZONE)


def _fail_safes(least_us: int) -> tuple[Requirement, ...]:
    """What happens when something else fails, or when a stick is moved; `least_us`: the shortest pulse that we send."""
    radio = "without it, and without a transmitter, the motors run on if this computer dies"
    station = "our heartbeats count as the station's: without them the boat would leave MANUAL in the pilot's hands"
    late = "seconds without a station's heartbeat until FS_GCS_ENABLE acts"
    switch = "the motors are dead until the safety switch is pressed, after each start"
    below = "a starboard stick below it is a lost transmitter: it must be below every pulse that is sent"
    arms = "with a stick for each motor, the port stick held full ahead arms the boat and drives its motor"
    deaf = "ground stations of other system ids are not answered"
    return (
        within("FS_THR_VALUE", (0, least_us), least_us - BELOW_US, "astern is RC loss", below, Cause.STUCK),
        exactly("ARMING_RUDDER", 0, "the port stick arms", arms),
        exactly("SYSID_ENFORCE", 0, "stations are not heard", deaf, must=False),
        within("MAV_OPTIONS", (0, 2**31), 0, "stations are not heard", deaf, must=False, clear=1),
        within("FS_THR_ENABLE", (1, 2), 1, "no radio fail-safe", radio),
        within("FS_ACTION", (1, 6), 2, "fail-safes do nothing", "what a fail-safe does; 2 is HOLD"),
        exactly("FS_GCS_ENABLE", 0, "stops the pilot too", station, must=False),
        within("FS_GCS_TIMEOUT", (2, 10), 5, "station fail-safe is late", late, must=False),
        exactly("ARMING_CHECK", 1, *UNCHECKED, must=False),
        exactly("ARMING_SKIPCHK", 0, *UNCHECKED, must=False),
        within("BRD_SAFETY_DEFLT BRD_SAFETYENABLE", (0, 0), None, "press the safety switch", switch, must=False),
    )
