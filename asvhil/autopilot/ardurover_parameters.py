"""What an ArduRover's parameters must be for two motors to follow our pulses, and why. Pure."""

from __future__ import annotations

from asvhil.autopilot.requirements import Requirement
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.types import Cause

PORT_MOTOR, STARBOARD_MOTOR = 73, 74  # SERVOn_FUNCTION: throttle left and right
OVERRIDES_IGNORED = 2  # bit of RC_OPTIONS
TRAVEL_SLACK_US = 10.0  # between the ends of a stick's travel and its output's: bends a command by 2 % at most
TRIM_SLACK_US = 5.0

# Names that exist in some firmware only, whose absence means nothing.
OPTIONAL = frozenset({"ARMING_CHECK", "ARMING_SKIPCHK", "BRD_SAFETY_DEFLT"})


def requirements(link: AutopilotLinkConfig, pwm: PwmConfig) -> tuple[Requirement, ...]:
    """What the way to the motors, `links.autopilot.output`, needs."""
    if link.output == "set_servo":
        return _free_outputs(pwm)
    # MANUAL_CONTROL is scaled to the stick's travel, which our codec takes for 1000 to 2000 us.
    ends_us = (1000, 2000) if link.output == "manual_control" else None
    return (*_command_path(link.override_system_id), *_sticks_and_outputs(pwm, ends_us), *_fail_safes())


def _free_outputs(pwm: PwmConfig) -> tuple[Requirement, ...]:
    """DO_SET_SERVO is refused on outputs that have a function."""
    return tuple(
        Requirement(
            names=(f"SERVO{channel}_FUNCTION",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            cause=Cause.STUCK,
            fault="no set_servo",
            why="DO_SET_SERVO is refused on an output that has a function",
        )
        for channel in (pwm.port_channel, pwm.starboard_channel)
    )


def _command_path(override_system_id: int) -> tuple[Requirement, ...]:
    ignored = "overrides are ignored"
    return (
        Requirement(
            names=("SYSID_MYGCS", "MAV_GCS_SYSID"),
            least=override_system_id,
            most=override_system_id,
            wanted=override_system_id,
            cause=Cause.IGNORED,
            fault=ignored,
            why="overrides of other systems are dropped without a word",
        ),
        Requirement(
            names=("RC_OPTIONS",),
            least=0.0,
            most=2.0**31,
            wanted=0.0,
            clear=OVERRIDES_IGNORED,
            cause=Cause.IGNORED,
            fault=ignored,
            why="with its bit 1 all overrides are ignored",
        ),
        Requirement(
            names=("RC_OVERRIDE_TIME",),
            least=0.5,
            most=3.0,
            wanted=3.0,
            cause=Cause.IGNORED,
            fault="wrong time-out",
            why="0 ignores overrides; below 0 the motors run on for ever if this computer dies",
        ),
        Requirement(
            names=("PILOT_STEER_TYPE",),
            least=1.0,
            most=1.0,
            wanted=1.0,
            cause=Cause.MIXED,
            fault="sticks are mixed",
            why="any other mixes the two commands as steering and throttle",
        ),
        Requirement(
            names=("MOT_SLEWRATE",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            cause=Cause.SLEW,
            fault="outputs lag behind",
            why="limits how fast the throttle may change, unknown to the controller",
        ),
        Requirement(
            names=("MOT_THR_MIN",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            cause=Cause.SCALED,
            fault="commands are bent",
            why="raises small commands",
        ),
        Requirement(
            names=("MOT_THST_EXPO",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            cause=Cause.SCALED,
            fault="commands are bent",
            why="bends commands by a thrust curve; the model of the boat has its own",
        ),
    )


def _sticks_and_outputs(pwm: PwmConfig, ends_us: tuple[int, int] | None) -> tuple[Requirement, ...]:
    """`ends_us`: the exact travel that the outputs must have; where None they must reach what we send."""
    found: list[Requirement] = []
    motors = (
        ("port", pwm.port_channel, PORT_MOTOR, "RCMAP_ROLL"),
        ("starboard", pwm.starboard_channel, STARBOARD_MOTOR, "RCMAP_THROTTLE"),
    )
    for side, channel, function, stick in motors:
        rc, servo = f"RC{channel}", f"SERVO{channel}"
        found += (
            Requirement(
                names=(f"{servo}_FUNCTION",),
                least=function,
                most=function,
                wanted=function,
                cause=Cause.STUCK,
                fault=f"no {side} motor",
                why=f"output {channel} must be throttle {'left' if side == 'port' else 'right'}",
            ),
            Requirement(
                names=(f"{servo}_REVERSED",),
                least=0.0,
                most=0.0,
                wanted=0.0,
                cause=Cause.REVERSED,
                fault="output is reversed",
                why="turns the pulses about neutral; reverse a motor at its speed controller instead",
            ),
            Requirement(
                names=(f"{servo}_TRIM",),
                least=pwm.neutral_us,
                most=pwm.neutral_us,
                wanted=pwm.neutral_us,
                cause=Cause.SCALED,
                fault="another neutral",
                why="neutral of this output must be vehicle.pwm.neutral_us",
            ),
            Requirement(
                names=(f"{servo}_MIN",),
                least=ends_us[0] - TRAVEL_SLACK_US if ends_us else 500.0,
                most=ends_us[0] + TRAVEL_SLACK_US if ends_us else pwm.astern_us,
                wanted=ends_us[0] if ends_us else pwm.astern_us,
                cause=Cause.SCALED,
                fault="full astern cut off",
                why="the output must reach vehicle.pwm.astern_us (manual_control: 1000)",
            ),
            Requirement(
                names=(f"{servo}_MAX",),
                least=ends_us[1] - TRAVEL_SLACK_US if ends_us else pwm.ahead_us,
                most=ends_us[1] + TRAVEL_SLACK_US if ends_us else 2500.0,
                wanted=ends_us[1] if ends_us else pwm.ahead_us,
                cause=Cause.SCALED,
                fault="full ahead cut off",
                why="the output must reach vehicle.pwm.ahead_us (manual_control: 2000)",
            ),
            Requirement(
                names=(stick,),
                least=channel,
                most=channel,
                wanted=channel,
                cause=Cause.SWAPPED,
                fault="another channel",
                why=f"the {side} motor's stick must be channel {channel}",
                reboot=True,
            ),
            Requirement(
                names=(f"{rc}_DZ",),
                least=0.0,
                most=0.0,
                wanted=0.0,
                cause=Cause.DEAD_ZONE,
                fault="dead zone bends commands",
                why="commands near neutral are lost, and all others bent",
            ),
            Requirement(
                names=(f"{rc}_REVERSED",),
                least=0.0,
                most=0.0,
                wanted=0.0,
                cause=Cause.REVERSED,
                fault="stick is reversed",
                why="turns commands about neutral",
            ),
        )
        found += (
            Requirement(
                names=(f"{rc}_{end}",),
                least=-slack_us,
                most=slack_us,
                wanted=None,
                like=f"{servo}_{end}",
                cause=Cause.SCALED,
                fault="commands are scaled",
                why=f"stick and output {channel} must have the same travel",
            )
            for end, slack_us in (("TRIM", TRIM_SLACK_US), ("MIN", TRAVEL_SLACK_US), ("MAX", TRAVEL_SLACK_US))
        )
    return tuple(found)


def _fail_safes() -> tuple[Requirement, ...]:
    return (
        Requirement(
            names=("FS_THR_ENABLE",),
            least=1.0,
            most=2.0,
            wanted=1.0,
            fault="no radio fail-safe",
            why="without it, and without a transmitter, the motors run on if this computer dies",
        ),
        Requirement(
            names=("FS_ACTION",),
            least=1.0,
            most=5.0,
            wanted=2.0,
            fault="fail-safes do nothing",
            why="what a fail-safe does; 2 is HOLD",
        ),
        Requirement(
            names=("FS_GCS_ENABLE",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            must=False,
            fault="stops the pilot too",
            why="our heartbeats count as the station's: without them the boat would leave MANUAL in the pilot's hands",
        ),
        Requirement(
            names=("FS_GCS_TIMEOUT",),
            least=2.0,
            most=10.0,
            wanted=5.0,
            must=False,
            fault="station fail-safe is late",
            why="seconds without a station's heartbeat until FS_GCS_ENABLE acts",
        ),
        Requirement(
            names=("ARMING_CHECK",),
            least=1.0,
            most=1.0,
            wanted=1.0,
            must=False,
            fault="arms unchecked",
            why="leaves out checks before arming",
        ),
        Requirement(
            names=("ARMING_SKIPCHK",),
            least=0.0,
            most=0.0,
            wanted=0.0,
            must=False,
            fault="arms unchecked",
            why="leaves out checks before arming",
        ),
        Requirement(
            names=("BRD_SAFETY_DEFLT", "BRD_SAFETYENABLE"),
            least=0.0,
            most=0.0,
            wanted=None,
            must=False,
            fault="press the safety switch",
            why="the motors are dead until the safety switch is pressed, after each start",
        ),
    )


def names_for(cause: Cause, channels: tuple[int, ...], *, blind: bool) -> str:
    """The parameters to look at for a cause seen on the outputs of some motors (channels from 1)."""
    numbers = "/".join(str(channel) for channel in channels)
    match cause:
        case Cause.IGNORED:
            return "SYSID_MYGCS, RC_OPTIONS"
        case Cause.MIXED:
            return "PILOT_STEER_TYPE"
        case Cause.DEAD_ZONE:
            return f"RC{numbers}_DZ"
        case Cause.SLEW:
            return "MOT_SLEWRATE"
        case Cause.SWAPPED:
            return f"SERVO{numbers}_FUNCTION"
        case Cause.REVERSED:
            return f"SERVO{numbers}_REVERSED"
        case Cause.SCALED:
            return f"travel of RC{numbers}, SERVO{numbers}"
        case Cause.STUCK:
            return f"{'SYSID_MYGCS or ' if blind else ''}SERVO{numbers}_FUNCTION"
        case _:
            return ""
