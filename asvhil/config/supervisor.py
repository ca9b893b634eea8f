"""When the motors are taken and given back: engagement, the pilot's precedence, fail-safes, the outputs' readback."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from asvhil.config.base import Degrees, Latitude, Longitude, NonNegative, Positive, Section, is_stored
from asvhil.config.battery import BatteryConfig
from asvhil.config.fence import check_corners
from asvhil.config.heading import HeadingConfig
from asvhil.config.motion import MotionConfig
from asvhil.config.moving import MovingConfig
from asvhil.types import Cause

OfBoat = Annotated[float, Field(ge=-20.0, le=20.0, allow_inf_nan=False)]  # m


class StationConfig(Section):
    """The pose to keep."""

    lat_deg: Latitude = Field(description="Latitude (WGS 84).")
    lon_deg: Longitude = Field(description="Longitude (WGS 84).")
    heading_deg: Degrees = Field(description="True heading, clockwise from north.")
    speed_mps: NonNegative = Field(default=0.0, description="Speed at which the station moves over ground.")
    course_deg: Degrees = Field(default=0.0, description="Course of that, clockwise from north.")


class ReadbackConfig(Section):
    """The comparison of motor outputs, as the autopilot reports them, with the pulses that were sent."""

    tolerance_us: float = Field(
        default=8.0,
        ge=2.0,
        le=50.0,
        description="An output that differs by more than this from what was sent does not follow.",
    )
    lag_s: float = Field(
        default=0.5,
        ge=0.1,
        le=2.0,
        description=(
            "A report is compared with everything sent up to this long before it arrived: command, autopilot and "
            "report together. Raise it for a slow telemetry radio; where reports come several at once, the silence "
            "before them, up to 1 s, is added by itself."
        ),
    )
    tolerate: tuple[Cause, ...] = Field(
        default=(),
        description=(
            "Causes that are reported and neither refuse nor end a hold, such as `[slew]` for a boat that needs "
            "MOT_SLEWRATE. `unbounded` takes it on you that nothing stops the motors if this program dies. One of "
            "`dead-zone`, `scaled` and `slew` whose parameter is wrong, or cannot be read, also tolerates outputs that "
            "do not follow for no other reason."
        ),
    )


class SupervisorConfig(Section):
    """Who has the motors: how a hold begins, what counts as the pilot's intervention, and which failures end it."""

    engage: Literal["command", "auto"] = Field(
        default="command",
        description=(
            "`command`: a hold begins with a hold command. `auto`: at start, with mode and arming requested from the "
            "autopilot, at `station`; for simulation only."
        ),
    )
    take_mode: bool = Field(
        default=False,
        description=(
            "Whether a hold command in another mode asks the autopilot for control_mode. If false, it is refused."
        ),
    )
    take_mode_timeout_s: Positive = Field(
        default=3.0, description="A mode that the autopilot has not entered after this time is given up."
    )
    arming_neutral_s: NonNegative = Field(
        default=30.0,
        le=300.0,
        description=(
            "An ArduRover without an RC receiver arms only while overrides flow. A hold command to such a boat while "
            "it is disarmed, is refused, and neutral is sent for this long: arm it, and send the command again. Never "
            "sent where a transmitter is, or has been, heard. 0: not at all."
        ),
    )
    transmitter_lost: Literal["release", "hold"] = Field(
        default="release",
        description=(
            "What becomes of a hold when the pilot's transmitter, which was heard, is lost. `release`: neutral and "
            "release, so that the autopilot's own fail-safe acts. `hold`: it goes on, with a note."
        ),
    )
    ground_station_timeout_s: Positive | None = Field(
        default=5.0,
        description=(
            "With an ArduRover: where no transmitter is heard, the pilot is at his ground station, and a hold ends in "
            "neutral once neither its heartbeat (of a system that the autopilot takes for its ground station) nor its "
            "sticks have been heard for this long. The autopilot's own fail-safe does not do it: our heartbeats may "
            "count as the station's, and in HOLD it does not stop the script. null: not watched."
        ),
    )
    station: StationConfig | None = Field(default=None, description="The station of `engage: auto`, required there.")
    point_m: tuple[OfBoat, OfBoat] = Field(
        default=(0.0, 0.0),
        description=(
            "The point of the boat that is kept at the station, [forward, to starboard] of its origin: a docking cone "
            "astern, a sensor at the bow. The boat turns about it."
        ),
    )
    max_distance_m: Positive = Field(
        default=100.0,
        le=2000.0,
        description=(
            "A station farther from the boat than this is refused, with its distance, unless the hold command names a "
            "distance that it lies within (`asvhil hold --within`, param3 of DO_REPOSITION). Not for `engage: auto`."
        ),
    )
    geofence: tuple[tuple[Latitude, Longitude], ...] = Field(
        default=(),
        description=(
            "Corners [latitude, longitude] in turn of the water where the boat may be, at least 3. A station outside "
            "is refused, a hold of a boat outside does not begin, and one whose boat gets outside ends, neutral first. "
            "Empty: no fence here; the autopilot may have its own."
        ),
    )
    control_mode: str = Field(
        default="MANUAL",
        description=(
            "The autopilot's mode in which its motors may be commanded; leaving it ends a hold. Default: MANUAL for "
            "ardurover, HOLD with its `script`, OFFBOARD for px4. Another is possible with `set_servo` and "
            "`set_actuator` alone, which motors obey in any mode."
        ),
    )
    stick_channels: tuple[Annotated[int, Field(ge=1, le=18)], ...] = Field(
        default=(2, 4),
        description=(
            "RC channels, other than the motors', whose movement is the pilot's intervention and ends a hold. Where "
            "motor commands do not override sticks, channels 1 to 4 always count."
        ),
    )
    stick_threshold_us: int = Field(
        default=60,
        ge=10,
        le=500,
        description="A stick counts as moved this far from where it was when the hold began.",
    )
    heartbeat_timeout_s: Positive = Field(
        default=2.5, description="Without any message of the autopilot for this long, the link counts as lost."
    )
    mode_timeout_s: Positive = Field(
        default=5.0,
        description=(
            "Without a heartbeat of the autopilot for this long, while other messages come, its mode and arming count "
            "as unknown: as long as a pilot's change of mode may go unseen on a link that loses heartbeats."
        ),
    )
    override_echo_s: Positive = Field(
        default=1.0,
        description=(
            "A motor channel in RC_CHANNELS that matches nothing sent within this time shows that somebody else has "
            "the motors, and ends a hold."
        ),
    )
    failsafe_neutral_s: Positive = Field(
        default=2.0,
        description="After a failure (link, estimate, solver) the motors are neutral for this long, then released.",
    )
    readback: ReadbackConfig = Field(default=ReadbackConfig(), description="Checking that the motor outputs follow.")
    heading: HeadingConfig = Field(
        default=HeadingConfig(), description="Whether the heading of a station is fixed or follows the weather."
    )
    moving: MovingConfig = Field(default=MovingConfig(), description="A station that moves.")
    heading_cost: bool = Field(
        default=True,
        description="Whether a hold tells what the station's heading costs in this weather, where that is on the side.",
    )
    docking: bool = Field(
        default=True,
        description=(
            "Whether a hold tells if its docking window is open, since when, and how likely it stays open for another "
            "30, 60 and 150 s."
        ),
    )
    motion: MotionConfig = Field(default=MotionConfig(), description="Watching that the boat moves as it is told to.")
    battery: BatteryConfig = Field(default=BatteryConfig(), description="Watching the battery.")

    before_it_came = (("heading_cost", False), ("docking", False))

    @field_validator("geofence")
    @classmethod
    def _check_geofence(
        cls, corners: tuple[tuple[float, float], ...], info: ValidationInfo
    ) -> tuple[tuple[float, float], ...]:
        if corners and not is_stored(info):  # a log of before can still be replayed
            check_corners(corners)
        return corners
