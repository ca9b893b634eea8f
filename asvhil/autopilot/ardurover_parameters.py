"""What an ArduRover's parameters must be for two motors to follow our pulses, and why. Pure."""

from __future__ import annotations

from dataclasses import replace

from asvhil.autopilot.requirements import Requirement, exactly, within
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.types import Cause

PORT_MOTOR, STARBOARD_MOTOR = 73, 74  # SERVOn_FUNCTION: throttle left and right
OVERRIDES_IGNORED = 2  # bit of RC_OPTIONS
TRAVEL_SLACK_US = 10.0  # between the ends of a stick's travel and its output's: bends a command by 2 % at most
TRIM_SLACK_US = 5.0
BELOW_US = 10  # of FS_THR_VALUE, where it is too high

# Names that exist in some firmware only, whose absence means nothing.
OPTIONAL = frozenset({"ARMING_CHECK", "ARMING_SKIPCHK", "BRD_SAFETY_DEFLT", "SYSID_ENFORCE", "MAV_OPTIONS"})

# What several rows say.
IGNORED = "overrides are ignored"
BENT = "commands are bent"
NO_PULSES = "no pulse widths"
UNCHECKED = "arms unchecked", "leaves out checks before arming"


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig) -> tuple[Requirement, ...]:
    """What the way to the motors, `links.autopilot.output`, needs."""
    motors = (
        ("port", pwm.port_channel, PORT_MOTOR, "RCMAP_ROLL"),
        ("starboard", pwm.starboard_channel, STARBOARD_MOTOR, "RCMAP_THROTTLE"),
    )
    if link.output == "set_servo":
        return tuple(replace(_free_output(channel), motor=side) for side, channel, _, _ in motors)
    # MANUAL_CONTROL is scaled to the stick's travel, which our codec takes for 1000 to 2000 us.
    ends_us = (1000, 2000) if link.output == "manual_control" else None
    sticks_and_outputs = (
        replace(row, motor=side)
        for side, channel, function, stick in motors
        for row in (*_output(side, channel, function, pwm, ends_us), *_stick(side, channel, stick))
    )
    return (*_command_path(link.override_system_id), *_bends(), *sticks_and_outputs, *_fail_safes(pwm.astern_us))


def _free_output(channel: int) -> Requirement:
    why = "DO_SET_SERVO is refused on an output that has a function"
    return replace(exactly(f"SERVO{channel}_FUNCTION", 0, "no set_servo", why, Cause.STUCK), wiring=True)


def _command_path(gcs_id: int) -> tuple[Requirement, ...]:
    """Who may override, and what the autopilot does to any command."""
    others, bit = "overrides of other systems are dropped without a word", "with its bit 1 all overrides are ignored"
    time_out = "0 ignores overrides; below 0 the motors run on for ever if this computer dies"
    mixes = "any other mixes the two commands as steering and throttle"
    slew = "limits how fast the throttle may change, unknown to the controller"
    return (
        exactly("SYSID_MYGCS MAV_GCS_SYSID", gcs_id, IGNORED, others, Cause.IGNORED),
        within("RC_OPTIONS", (0, 2**31), 0, IGNORED, bit, Cause.IGNORED, clear=OVERRIDES_IGNORED),
        within("RC_OVERRIDE_TIME", (0.5, 3), 1, "wrong time-out", time_out, Cause.IGNORED),
        exactly("PILOT_STEER_TYPE", 1, "sticks are mixed", mixes, Cause.MIXED),
        exactly("MOT_SLEWRATE", 0, "outputs lag behind", slew, Cause.SLEW),
    )


def _bends() -> tuple[Requirement, ...]:
    """What makes another command of a command on its way to the motors; the model of the boat has its own curve."""
    asymmetry = "above 1 it raises thrust astern and limits steering"
    return (
        exactly("MOT_THR_MIN", 0, BENT, "raises small commands", Cause.SCALED),
        exactly("MOT_THR_MAX", 100, BENT, "cuts off large commands", Cause.SCALED),
        exactly("MOT_THST_EXPO", 0, BENT, "bends commands by a thrust curve", Cause.SCALED),
        within("MOT_THST_ASYM", (0, 1), 1, BENT, asymmetry, Cause.SCALED),
        exactly("MANUAL_STR_EXPO", 0, BENT, "lessens small differences between the motors", Cause.SCALED),
        within(
            "MANUAL_OPTIONS", (0, 2**31), 0, BENT, "with its bit 0 steering lessens with speed", Cause.SCALED, clear=1
        ),
        replace(within("MOT_PWM_TYPE", (0, 2), None, NO_PULSES, "outputs must be pulses", Cause.SCALED), wiring=True),
    )


def _output(
    side: str, channel: int, function: int, pwm: PwmConfig, ends_us: tuple[int, int] | None
) -> tuple[Requirement, ...]:
    """`ends_us`: the exact travel that the output must have; where None it must reach what we send."""
    servo = f"SERVO{channel}"
    low_us, high_us = ends_us or (pwm.astern_us, pwm.ahead_us)
    slack_us = TRAVEL_SLACK_US
    lows_us = (low_us - slack_us, low_us + slack_us) if ends_us else (500, low_us)
    highs_us = (high_us - slack_us, high_us + slack_us) if ends_us else (high_us, 2500)
    throttle = f"output {channel} must be throttle {'left' if side == 'port' else 'right'}"
    turns = "turns the pulses about neutral; reverse a motor at its speed controller instead"
    neutral = "neutral of this output must be vehicle.pwm.neutral_us"
    astern = "the output must reach vehicle.pwm.astern_us (manual_control: 1000)"
    ahead = "the output must reach vehicle.pwm.ahead_us (manual_control: 2000)"
    return tuple(
        replace(row, wiring=True)
        for row in (
            exactly(f"{servo}_FUNCTION", function, f"no {side} motor", throttle, Cause.STUCK),
            exactly(f"{servo}_REVERSED", 0, "output is reversed", turns, Cause.REVERSED),
            exactly(f"{servo}_TRIM", pwm.neutral_us, "another neutral", neutral, Cause.SCALED),
            within(f"{servo}_MIN", lows_us, low_us, "full astern cut off", astern, Cause.SCALED),
            within(f"{servo}_MAX", highs_us, high_us, "full ahead cut off", ahead, Cause.SCALED),
        )
    )


def _stick(side: str, channel: int, mapped_by: str) -> tuple[Requirement, ...]:
    rc, servo = f"RC{channel}", f"SERVO{channel}"
    lost = "commands near neutral are lost, and all others bent"
    place = f"the {side} motor's stick must be channel {channel}"
    travel = "commands are scaled", f"stick and output {channel} must have the same travel", Cause.SCALED
    trim_us, end_us = (-TRIM_SLACK_US, TRIM_SLACK_US), (-TRAVEL_SLACK_US, TRAVEL_SLACK_US)
    wired = (
        exactly(mapped_by, channel, "another channel", place, Cause.SWAPPED),
        exactly(f"{rc}_REVERSED", 0, "stick is reversed", "turns commands about neutral", Cause.REVERSED),
        within(f"{rc}_TRIM", trim_us, None, *travel, like=f"{servo}_TRIM"),
        within(f"{rc}_MIN", end_us, None, *travel, like=f"{servo}_MIN"),
        within(f"{rc}_MAX", end_us, None, *travel, like=f"{servo}_MAX"),
    )
    dead_zone = exactly(f"{rc}_DZ", 0, "dead zone bends commands", lost, Cause.DEAD_ZONE)
    return (dead_zone, *(replace(row, wiring=True) for row in wired))


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
        within("FS_ACTION", (1, 5), 2, "fail-safes do nothing", "what a fail-safe does; 2 is HOLD"),
        exactly("FS_GCS_ENABLE", 0, "stops the pilot too", station, must=False),
        within("FS_GCS_TIMEOUT", (2, 10), 5, "station fail-safe is late", late, must=False),
        exactly("ARMING_CHECK", 1, *UNCHECKED, must=False),
        exactly("ARMING_SKIPCHK", 0, *UNCHECKED, must=False),
        within("BRD_SAFETY_DEFLT BRD_SAFETYENABLE", (0, 0), None, "press the safety switch", switch, must=False),
    )
