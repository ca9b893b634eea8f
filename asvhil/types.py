"""Every record that crosses a stage: frozen, slotted, keyword-only. SI units and radians; units are name suffixes."""

from __future__ import annotations

import dataclasses
import enum
import math
from typing import Any, NamedTuple, Protocol, TypeVar, dataclass_transform

import msgspec

Record = TypeVar("Record")


@dataclass_transform(frozen_default=True, kw_only_default=True)
def record(cls: type[Any]) -> Any:
    """Class decorator: a frozen, slotted, keyword-only dataclass, which msgspec makes in a tenth of the time.

    A tick makes some fifty records. `dataclasses.fields`, `asdict` and `replace` take it for a dataclass; `changed` is
    the quick `replace`. A record has no base class.
    """
    members = {name: value for name, value in vars(cls).items() if name not in ("__dict__", "__weakref__")}
    if any(isinstance(value, dataclasses.Field) for value in members.values()):
        raise TypeError(f"{cls.__name__}: a record has no dataclasses.field, which would be the value itself")
    plain: Any = dataclasses.dataclass(frozen=True, kw_only=True)(type(cls.__name__, (), members.copy()))
    # No record is part of a cycle, so that the garbage collector need not look at them.
    struct: Any = type(msgspec.Struct)
    made = struct(cls.__name__, (msgspec.Struct,), members, frozen=True, kw_only=True, gc=False)
    made.__dataclass_fields__ = plain.__dataclass_fields__
    return made


class _Changed(Protocol):
    def __call__(self, of: Record, /, **values: Any) -> Record: ...


# A copy of a record with other values in some fields. It is called some 150 times a second, so nothing is around it.
changed: _Changed = msgspec.structs.replace  # type: ignore[assignment]


@record
class Frame:
    """Bytes that crossed the boundary, either way: a datagram, or a chunk of a stream.

    `t_ns` is stamped once, at the boundary. `port` is the link's name in the config (autopilot, anemometer,
    operator). `peer` is the remote address on links that have many, so that one peer's garbage never mixes
    with another's stream and answers go back to the asker; empty elsewhere. `via` is the link that carried the frame
    where that is not the port's own, as for an operator behind a ground station's link; empty elsewhere.
    """

    t_ns: int
    port: str
    data: bytes
    peer: str = ""
    via: str = ""

    @property
    def address(self) -> Address:
        """Where the frame came from, or goes to, within its port."""
        return Address(self.via, self.peer)


class Address(NamedTuple):
    """An end of a port: the link in the place of its own, and the remote address on that link, both as in `Frame`."""

    via: str = ""
    peer: str = ""


EVERYONE = Address()


@record
class Inputs:
    """All that the backseat is given for one tick: the time of the cut and the frames received since the last."""

    t_ns: int
    frames: tuple[Frame, ...]


# --- measurements: what codecs make of frames, one quantity each ------------------------------------------
#
# `t_ns` is the time at which the value holds. `arm_m` is where the sensor is: forward and to starboard of the boat's
# origin.


@record
class Position:
    """Latitude and longitude of the antenna. `h_acc_m` is the receiver's own estimate of its error; 0 or NaN: none."""

    t_ns: int
    lat_deg: float
    lon_deg: float
    h_acc_m: float = math.nan
    arm_m: tuple[float, float] = (0.0, 0.0)


@record
class GroundVelocity:
    """Velocity of the antenna over ground, NED.

    `fused`: from a filter that has fused it with position, and whose error therefore stays the same for minutes, or of
    a time that is in doubt; a receiver's own velocity (Doppler) is independent of its position. `age_ns`: how old it
    was at `t_ns`, by the date that it came with. The filter takes it as of `t_ns`; training takes the age away.
    """

    t_ns: int
    vn_mps: float
    ve_mps: float
    arm_m: tuple[float, float] = (0.0, 0.0)
    fused: bool = False
    age_ns: int = 0


@record
class Heading:
    """True heading, clockwise from north."""

    t_ns: int
    psi_rad: float


@record
class YawRate:
    """Yaw rate, clockwise from above."""

    t_ns: int
    r_radps: float


@record
class SpecificForce:
    """Specific force (acceleration less gravity) at the sensor, along body x and y."""

    t_ns: int
    ax_mps2: float
    ay_mps2: float
    arm_m: tuple[float, float] = (0.0, 0.0)


@record
class ApparentWind:
    """Wind as the moving boat feels it: speed, and the direction it comes FROM, clockwise from the bow."""

    t_ns: int
    speed_mps: float
    from_rad: float


@record
class BowWind:
    """True wind told from the bow: its speed over ground, and the direction it comes FROM, clockwise from the bow."""

    t_ns: int
    speed_mps: float
    from_rad: float


@record
class TrueWind:
    """True wind told from north: the velocity of the air over ground, NED."""

    t_ns: int
    vn_mps: float
    ve_mps: float


class Radio(enum.StrEnum):
    """What the autopilot tells of the pilot's transmitter."""

    UNKNOWN = "unknown"
    ABSENT = "absent"  # no receiver has been heard since the autopilot's start
    HEARD = "heard"
    LOST = "lost"  # it has been heard, and is not any more


@record
class BatterySum:
    """The batteries of which the autopilot tells voltage and current, together; at `t_ns` the oldest of them was heard.

    `used_wh`: since the autopilot's start, or a battery's own; None: not all tell it.
    """

    t_ns: int
    number: int
    power_w: float
    used_wh: float | None


@record
class FrontseatStatus:
    """What the autopilot says of itself. Servo and RC values in microseconds, index 0 is channel 1; 0: no value.

    `sticks_us` and `motors_us` are of the two motors (port, starboard), in the pulses of `vehicle.pwm`: what their
    sticks (`motor_channels`) command, and what their outputs do, however the boat is wired; None: not reported.
    `centres_us` is where those sticks rest, as RC values. `receiver_ignored`: a transmitter has no effect, heard or
    not. `keeps_override`: no receiver takes the place of an override that has ended, and its last value stands.
    `rc_ns` and `outputs_ns` are when the values came; 0: never. `disarmed_itself`: why the autopilot has disarmed
    without anybody's doing, empty where it has not, as far as it tells. `arming_fault`: why it would not arm, by the
    autopilot's own words; empty where it would, or is armed, or nothing is known. `battery_percent`: of the charge;
    `battery_a`: the current that is drawn; `battery_ns`: when they came, 0: never; `batteries`: each by itself, summed;
    `battery_complaint`: what is wrong with which of them by the autopilot's judgement, empty where nothing is;
    `fix` (GPS_FIX_TYPE) and `satellites`: of the autopilot's first receiver; None where the autopilot does not tell.
    """

    t_ns: int
    armed: bool
    mode: str
    ready: bool
    rc_us: tuple[int, ...]
    outputs_us: tuple[int, ...]
    motor_channels: tuple[int, int] = (1, 3)
    centres_us: tuple[int, int] = (1500, 1500)
    receiver_ignored: bool = False
    keeps_override: bool = False
    sticks_us: tuple[int, int] | None = None
    motors_us: tuple[int, int] | None = None
    rc_ns: int = 0
    outputs_ns: int = 0
    radio: Radio = Radio.UNKNOWN
    disarmed_itself: str = ""
    arming_fault: str = ""
    battery_v: float | None = None
    battery_percent: float | None = None
    battery_a: float | None = None
    battery_ns: int = 0
    batteries: BatterySum | None = None
    battery_complaint: str = ""
    fix: int | None = None
    satellites: int | None = None

    @property
    def has_transmitter(self) -> bool:
        """Whether the pilot has a transmitter in his hands that has effect."""
        return self.radio is Radio.HEARD and not self.receiver_ignored


@record
class HoldCommand:
    """The operator asks to keep a station, and so to take the motors. A missing field means: as the boat is now.

    `within_m`: how far off he knows the station to be; 0: no farther than the config lets pass without a word.
    `velocity_mps`: that of the station, north and east, where it is the first of a stream of set-points that has one.
    `by_setpoint`: it is such a first one, which may be no more than the end of a gap in the radio link.
    """

    t_ns: int
    lat_deg: float | None = None
    lon_deg: float | None = None
    psi_rad: float | None = None
    within_m: float = 0.0
    velocity_mps: tuple[float, float] | None = None
    by_setpoint: bool = False


@record
class MoveCommand:
    """The operator moves the station that is held; the motors are not taken for it. What is None stays as it is.

    `n_m` and `e_m` are in the local NED frame, and hold over latitude and longitude. With a `velocity_mps` (north,
    east) it is where the station is now, and how it moves until the next of these.
    """

    t_ns: int
    lat_deg: float | None = None
    lon_deg: float | None = None
    n_m: float | None = None
    e_m: float | None = None
    psi_rad: float | None = None
    velocity_mps: tuple[float, float] | None = None

    @property
    def turns_alone(self) -> bool:
        """Whether it is of the heading, and of nothing else."""
        places = self.lat_deg, self.lon_deg, self.n_m, self.e_m, self.velocity_mps
        return self.psi_rad is not None and places == (None,) * 5


@record
class CourseCommand:
    """The operator has the station that is held move over ground; what is None stays as it is.

    `way_m`: after which it stays where it is, 0: without an end. `leader`: the system id of the vehicle that it is to
    go after, 0: of none. A speed ends that.
    """

    t_ns: int
    speed_mps: float | None = None
    course_rad: float | None = None
    way_m: float | None = None
    leader: int | None = None


@record
class LeaderMessage:
    """A vehicle says where it is and how fast, north and east, for others to follow."""

    t_ns: int
    system_id: int
    lat_deg: float
    lon_deg: float
    velocity_mps: tuple[float, float]


@record
class HeadingCommand:
    """The operator chooses what heading stations have from now on: a policy of `supervisor.heading`."""

    t_ns: int
    policy: str


@record
class ReleaseCommand:
    """The operator, or the shell at shutdown, asks to let go of the motors."""

    t_ns: int


@record
class NeutralCommand:
    """The operator asks for neutral at once: the station is let go, and the motors stay ours, at rest."""

    t_ns: int


@record
class ParameterChange:
    """The operator sets one of the daemon's own parameters, by its name on the link and in its unit there."""

    t_ns: int
    name: str
    value: float


Measurement = (
    Position | GroundVelocity | Heading | YawRate | SpecificForce | ApparentWind | BowWind | TrueWind | FrontseatStatus
)


# --- what the core computes ------------------------------------------------------------------------------


@record
class Estimate:
    """The vessel's state in the local NED frame; velocities are over ground in body axes (Fossen's eta and nu).

    `motor` is the propagated motor state of the model (port, starboard; unit of the model's input). `std` are the
    standard deviations of (n, e, psi, u, v, r). `disturbance` is the unmodelled acceleration: north, east (m/s^2),
    yaw (rad/s^2).
    """

    t_ns: int
    n_m: float
    e_m: float
    psi_rad: float
    u_mps: float
    v_mps: float
    r_radps: float
    motor: tuple[float, ...]
    std: tuple[float, ...]
    disturbance: tuple[float, float, float]
    valid: bool


@record
class Wind:
    """True wind: the velocity of the air over ground, NED. `std_mps` is its spread about the mean (gusts).

    Of origin "disturbance" it is what would explain the disturbance while no sensor tells one; never valid.
    """

    t_ns: int
    vn_mps: float
    ve_mps: float
    std_mps: float
    valid: bool
    origin: str = "sensor"


@record
class WaveMotion:
    """First-order wave motion that is taken out of the estimate, by a share of 0 to 1 that grows with its size.

    Standard deviations of the boat's velocity along one horizontal axis, and of its yaw rate, about the peak.
    """

    peak_hz: float
    velocity_std_mps: float
    yaw_std_radps: float
    share: float


@record
class Station:
    """The pose to keep, in the local NED frame, at the time of the tick; and its velocity, where it moves.

    `of_weather`: its heading is not one that was asked for, but what the weather is thought to want.
    """

    n_m: float
    e_m: float
    psi_rad: float
    vn_mps: float = 0.0
    ve_mps: float = 0.0
    of_weather: bool = False

    @property
    def moves(self) -> bool:
        """Whether it has a velocity."""
        return self.vn_mps != 0.0 or self.ve_mps != 0.0


@record
class Control:
    """One solution. `command` is (port, starboard) in [-1, 1], the paper's PWM signal.

    `plan` is the predicted path as rows (t_s ahead, n_m, e_m, psi_rad), and `inputs` the model's inputs (port,
    starboard) on the way from each row to the next; empty where a controller predicts nothing, or plans none.
    `stage` is where the station keeping procedure is; empty for a controller that has no stages.
    """

    command: tuple[float, float]
    ok: bool
    iterations: int
    cost: float
    plan: tuple[tuple[float, float, float, float], ...] = ()
    stage: str = ""
    inputs: tuple[tuple[float, float], ...] = ()


class Phase(enum.StrEnum):
    """Where the station keeping procedure is. Only HOLD moves the motors."""

    STANDBY = "standby"  # not asked to hold
    PREPARE = "prepare"  # neutral: on the way to a hold, while mode or arming are waited for, or stopped by an operator
    HOLD = "hold"  # the controller has the motors
    FAILSAFE = "failsafe"  # asked to hold, but an input is stale or the solver fails: neutral, then released


@record
class PredictionError:
    """Root mean square errors of the model in use for (u, v, r), one step and a horizon ahead, over a sliding window.

    `ok` is False once the boat no longer behaves as the model says.
    """

    one_step: tuple[float, float, float]
    horizon: tuple[float, float, float]
    horizon_s: float
    ok: bool


@record
class TimeOffset:
    """The autopilot's clock less ours, by the exchange with the shortest round trip; half of that bounds its error."""

    offset_ns: int
    round_trip_ns: int
    exchanges: int  # good ones so far


class Cause(enum.StrEnum):
    """Why motor outputs do not do what they were told."""

    IGNORED = "ignored"  # the autopilot does not listen to us
    MIXED = "mixed"  # as steering and throttle
    DEAD_ZONE = "dead-zone"
    SLEW = "slew"  # the autopilot limits how fast they change
    SWAPPED = "swapped"
    REVERSED = "reversed"
    SCALED = "scaled"
    STUCK = "stuck"  # no motor function, or an output that does not move
    UNBOUNDED = "unbounded"  # they would do it for ever: nothing stops them if we fall silent
    UNEXPLAINED = "unexplained"


@record
class Note:
    """What is worth a line of words whenever it changes, such as an instrument's firmware; `ok`: as it should be."""

    subject: str
    text: str
    ok: bool


@record
class Health:
    """Diagnostics of one tick. `reason` tells people why the phase is what it is; counters are cumulative.

    `code` is the value of that reason in `supervisor.reasons.Reason`, for programs; empty in logs of before it.
    `sources` names the source in use for each quantity (position, velocity, heading, ...); empty text: none is heard.
    """

    reason: str
    link_ok: bool
    estimate_ok: bool
    wind_ok: bool
    control_ok: bool
    model_ok: bool
    counters: tuple[tuple[str, int], ...]
    sources: tuple[tuple[str, str], ...] = ()
    notes: tuple[Note, ...] = ()
    code: str = ""


@record
class DockingWindow:
    """Whether another vehicle could dock at the boat that keeps a station now (`asvhil/supervisor/docking.py`).

    For how long the window has been open (s), None while it is not; the probabilities that it stays open for another
    30, 60 and 150 s, none while it is not open or too little is known.
    """

    open_s: float | None
    stays: tuple[float, ...] = ()


@record
class EnergyUse:
    """What the boat takes from its battery (`asvhil/supervisor/energy.py`); None where it is not known.

    Energy of the hold so far (Wh), power now, its mean over the last minutes (W), and hours until the battery is empty
    at that mean. `by`: how the power is known, `measured` or `curve`; empty where it is not.
    """

    hold_wh: float | None = None
    power_w: float | None = None
    mean_w: float | None = None
    hours_left: float | None = None
    by: str = ""


@record
class Learned:
    """The factors by which the vessel model is corrected (`dynamics.corrected.FACTORS`) and their standard deviations.

    `learned_s`: for how long they have been learned. `frozen`: why nothing is learned now; empty while it is.
    """

    factors: tuple[float, ...]
    std: tuple[float, ...]
    learned_s: float
    frozen: str = ""


@record
class Outputs:
    """All that one tick produced.

    `pwm_us` is (port, starboard), or None when the motors are released. `origin_deg` is the latitude and longitude of
    the local NED frame, once there is one. `model_error` comes with a control, once the monitor's horizon is filled.
    `autopilot_clock` is None until the autopilot has answered a TIMESYNC. `waves` have been taken out of the estimate.
    """

    t_ns: int
    phase: Phase
    frames: tuple[Frame, ...]
    estimate: Estimate | None
    wind: Wind | None
    station: Station | None
    control: Control | None
    pwm_us: tuple[int, int] | None
    health: Health
    origin_deg: tuple[float, float] | None = None
    model_error: PredictionError | None = None
    autopilot_clock: TimeOffset | None = None
    waves: WaveMotion | None = None
    docking: DockingWindow | None = None
    learned: Learned | None = None
    energy: EnergyUse | None = None
