"""The vehicle inside the simulated autopilot: modes, arming rules, radio fail-safe and motor outputs of ArduRover."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.simplant.ardurover.arming import RudderWatch, failing_checks, sticks_out
from asvhil.simplant.ardurover.parameters import OUTPUTS, PORT_MOTOR, STARBOARD_MOTOR, Parameters
from asvhil.simplant.vehicle.powered import PoweredVehicle
from asvhil.simplant.vehicle.rc import CHANNELS, IGNORE, RELEASE_HIGH
from asvhil.simplant.vehicle.wiring import WiredMotor

MODE_MANUAL = 0
MODE_HOLD = 4
MODE_INITIALISING = 16
MODES = frozenset({0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15})
POSITION_MODES = frozenset({5, 6, 8, 9, 10, 11, 12, 15})  # refused until the position is used
CHECKS_NS = 1_000_000_000  # between two rounds of the checks before arming
TELL_CHECKS_NS = 30_000_000_000  # between two times that it says what fails
RECEIVER_IGNORED, OVERRIDES_IGNORED = 1, 2  # bits of RC_OPTIONS
TWO_PADDLES = 1  # PILOT_STEER_TYPE: a stick for each motor
STEERING_NOT_FLIPPED = 3  # PILOT_STEER_TYPE: steering keeps its sense when going astern
SPEED_SCALING = 1  # bit of MANUAL_OPTIONS
DISARM = -1
MODE_LOITER, MODE_RTL, MODE_SMART_RTL = 5, 11, 12
# FS_ACTION: modes to be entered, the first that is possible; 0 does nothing.
FAILSAFE_ACTIONS: dict[int, tuple[int, ...]] = {
    1: (MODE_RTL, MODE_HOLD),
    2: (MODE_HOLD,),
    3: (MODE_SMART_RTL, MODE_RTL, MODE_HOLD),
    4: (MODE_SMART_RTL, MODE_HOLD),
    5: (DISARM,),
    6: (MODE_LOITER, MODE_HOLD),
}
INFO, WARNING, CRITICAL = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_WARNING, dialect.MAV_SEVERITY_CRITICAL


class Rover(PoweredVehicle):
    """State and rules, without bytes.

    Modes other than MANUAL are entered and reported, but leave the motors neutral: navigation is not simulated.
    """

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig, t_ns: int) -> None:
        self._setup_ns = round(1e9 * config.setup_s)
        self.parameters = Parameters(config, pwm)
        # The motors hang where the parameters that the boat is built with say, and stay there whatever is set later.
        self._motors = tuple(
            self._wired(pwm, function, usual)
            for function, usual in zip((PORT_MOTOR, STARBOARD_MOTOR), pwm.outputs, strict=True)
        )
        self.speed_mps = 0.0  # ahead, over ground
        self.named_floats: list[tuple[str, float]] = []  # from scripts to the stations
        super().__init__(config, t_ns)

    @property
    def _neutral_ns(self) -> int:
        """Of radio silence, until sticks count as neutral; a parameter since 4.7."""
        return round(1e9 * (self.parameter("RC_FS_TIMEOUT") or self._config.neutral_timeout_s))

    @property
    def _failsafe_ns(self) -> int:
        """Of radio silence, until the fail-safe acts."""
        later_s = self._config.failsafe_timeout_s - self._config.neutral_timeout_s
        return self._neutral_ns + round(1e9 * later_s)

    def _wired(self, pwm: PwmConfig, function: int, usual: int) -> WiredMotor:
        """On the output that has its function, in the sense and with the neutral of that output."""
        functions = self.parameters.functions
        output = functions.index(function) + 1 if function in functions else usual
        neutral_us, turned = (self.parameters[f"SERVO{output}_{part}"] for part in ("TRIM", "REVERSED"))
        return WiredMotor(pwm, output, neutral_us=neutral_us, reversed=turned != 0.0)

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is forgotten."""
        super().restart(t_ns)
        self.mode = MODE_INITIALISING
        self.radio_failsafe = False
        self.gcs_failsafe = False
        self.gcs_heard_ns: int | None = None
        self.safety_on = self.parameters["BRD_SAFETY_DEFLT"] != 0.0
        if self._setup_ns:
            self.parameters.begin_setup()
        self._throttle = 0.0
        self._throttle_low_ns: int | None = None
        self._position_used = False
        self.radio_silent = self.parameters["FS_THR_ENABLE"] != 0.0 and not self.rc.receiver
        self.checks_pass = False
        self._checked_ns = self._told_ns = self.boot_ns
        self._rudder = RudderWatch()
        self.emergency_stop = False
        self.named_floats.clear()
        self._held: dict[int, tuple[int, int]] = {}  # by scripts: index of an output to its pulse, and loops left

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor, as motors on plain outputs would get them (`WiredMotor`).

        0: no signal, as before boot or the safety switch.
        """
        port, starboard = self._motors
        return (0, 0) if self.safety_on else (port.plain_us(self.servo_us), starboard.plain_us(self.servo_us))

    def press_safety_switch(self) -> None:
        """The button on the boat: the outputs come alive."""
        self.safety_on = False

    @property
    def booted(self) -> bool:
        """Whether it is past its set-up."""
        return self.mode != MODE_INITIALISING

    def ready(self, t_ns: int) -> bool:
        """Whether the estimator uses its position."""
        return t_ns >= self.ready_ns

    def has_fix(self, t_ns: int) -> bool:
        """Whether the receiver has one: the estimator uses it at once."""
        return self.ready(t_ns)

    def begin(self, t_ns: int) -> None:
        """The start of a loop, before messages are handled; never before `boot_ns`."""
        self.t_ns = t_ns
        if self.mode == MODE_INITIALISING and t_ns >= self.boot_ns + self._setup_ns:
            self.parameters.end_setup()
            self.rc.last_input_ns = t_ns  # nobody has looked at the radio before
            self.mode = MODE_MANUAL
            self.texts.append((INFO, "ArduPilot Ready"))
        if not self._position_used and self.ready(t_ns):
            self._position_used = True
            self.texts.append((INFO, "EKF3 IMU0 is using GPS"))

    def end(self) -> None:
        """The end of a loop: time-outs, then the motors."""
        self.rc.read()
        self._watch_throttle()
        if self.booted:
            self._watch_radio()
        if self._rudder.asks(self):
            self.arm(by_rudder=True)
        self._watch_gcs()
        self._watch_checks()
        self._drive()

    # --- radio ---------------------------------------------------------------------------------------------

    def heartbeat(self, sender_system: int) -> None:
        """A station's heartbeat; that of ours keeps its fail-safe away."""
        if self.parameters.is_station(sender_system):
            self.gcs_heard_ns = self.t_ns

    def override(self, sender_system: int, values: list[int]) -> None:
        """Channel overrides (16 raw values); those of other stations than ours are dropped without a word.

        They count as a heartbeat of the station.
        """
        if not self.parameters.is_station(sender_system):
            return
        self.gcs_heard_ns = self.t_ns
        if not self._overrides_ignored():
            self.rc.override(self.t_ns, values, self._neutral_ns)

    def manual_control(self, sender_system: int, target: int, y: int, z: int) -> None:
        """MANUAL_CONTROL: y moves the stick of RCMAP_ROLL, z that of RCMAP_THROTTLE; -1000..1000 over its travel.

        32767 (no value) gives the channel back: ArduPilot overrides it with 0 then. One for everybody is for nobody.
        """
        if target != self._config.system_id:
            return
        values = [IGNORE] * CHANNELS
        for channel, axis in zip(self.mapped, (y, z), strict=True):
            values[channel - 1] = 0 if channel <= 8 else RELEASE_HIGH
            if axis != 32767:
                stick = self.parameters.stick(channel)
                share = (axis + 1000) / 2000
                values[channel - 1] = int(stick.low_us + (stick.high_us - stick.low_us) * share)
        self.override(sender_system, values)

    def _overrides_ignored(self) -> bool:
        options = int(self.parameters["RC_OPTIONS"])
        return bool(options & OVERRIDES_IGNORED) or self.parameters["RC_OVERRIDE_TIME"] == 0.0

    def _radio_lost(self, timeout_ns: int) -> bool:
        if self.parameters["FS_THR_ENABLE"] == 0.0:
            return False
        low_ns = self._throttle_low_ns  # counts as lost at once, as a silent radio does after `neutral_ns`
        low = low_ns is not None and self.t_ns - low_ns >= timeout_ns - self._neutral_ns
        return low or not self.rc.alive(self.t_ns, timeout_ns)

    def _watch_throttle(self) -> None:
        """A throttle stick below FS_THR_VALUE, overridden or not, says that the transmitter is lost."""
        throttle_us = self.rc.radio_us[self.mapped[1] - 1]
        if not 0 < throttle_us < self.parameters["FS_THR_VALUE"]:
            self._throttle_low_ns = None
        elif self._throttle_low_ns is None:
            self._throttle_low_ns = self.t_ns

    def _watch_radio(self) -> None:
        hold_s = self.parameters["RC_OVERRIDE_TIME"]
        if self._overrides_ignored():
            self.rc.drop_overrides()
        elif hold_s > 0.0:
            self.rc.expire(self.t_ns, round(1e9 * hold_s))
        self.rc.ignored = bool(int(self.parameters["RC_OPTIONS"]) & RECEIVER_IGNORED)
        self.rc.note_frame(self.t_ns)
        if self.parameters["FS_THR_ENABLE"] != 0.0:  # with 0 nobody looks any more: what was found last stands
            self.radio_silent = self._radio_lost(self._neutral_ns)
        if self.radio_failsafe:
            if not self._radio_lost(self._neutral_ns):
                self.radio_failsafe = False
                self.texts.append((WARNING, "Radio Failsafe Cleared"))
        elif self._radio_lost(self._failsafe_ns):
            self.radio_failsafe = True
            self._fail_safe("Radio")

    def _watch_gcs(self) -> None:
        """Our station's heartbeats stop: as a real one, nothing happens before the first was heard."""
        timeout_ns = round(1e9 * (self.parameters["FS_GCS_TIMEOUT"] + self.parameters["FS_TIMEOUT"]))
        silent = self.gcs_heard_ns is not None and self.t_ns - self.gcs_heard_ns > timeout_ns
        lost = silent and self.parameters["FS_GCS_ENABLE"] != 0.0
        if self.gcs_failsafe and not lost:
            self.gcs_failsafe = False
            self.texts.append((WARNING, "GCS Failsafe Cleared"))
        elif lost and not self.gcs_failsafe:
            self.gcs_failsafe = True
            self._fail_safe("GCS")

    def _fail_safe(self, what: str) -> None:
        self.texts.append((WARNING, f"{what} Failsafe"))
        self.rc.drop_overrides()
        for action in FAILSAFE_ACTIONS.get(int(self.parameters["FS_ACTION"]), ()):
            if self.disarm() if action == DISARM else self.enter_mode(action):
                return

    # --- motors --------------------------------------------------------------------------------------------

    def set_servo(self, channel: int, pulse_us: int) -> bool:
        """DO_SET_SERVO: refused on outputs with a function; any other holds its value until power-off."""
        if not 1 <= channel <= OUTPUTS or not 0 <= pulse_us <= 2500 or self.parameters.functions[channel - 1] != 0:
            return False
        self.servo_us[channel - 1] = pulse_us
        return True

    def _drive(self) -> None:
        if not self.armed or self.mode != MODE_MANUAL or self.radio_silent:
            self._throttle = 0.0
            self._put_out(0.0, 0.0)
            return
        first, second = self.sticks()
        steer_type = self.parameters["PILOT_STEER_TYPE"]
        if steer_type == TWO_PADDLES:
            throttle, steering = 0.5 * (first + second), 0.5 * (first - second)
        else:
            throttle, steering = second, first
            asked = abs(throttle) + abs(steering)
            if asked > 1.0:  # of a boat with two motors, both are lessened alike
                throttle, steering = throttle / asked, steering / asked
            if throttle < 0.0 and steer_type != STEERING_NOT_FLIPPED:
                steering = -steering
        slew = self.parameters["MOT_SLEWRATE"]
        if slew > 0.0:  # percent per second, of the throttle alone
            step = 0.01 * slew / self._config.loop_hz
            throttle = max(self._throttle - step, min(self._throttle + step, throttle))
        self._throttle = throttle
        expo = self.parameters["MANUAL_STR_EXPO"]
        if expo < 0.95:
            steering = (1.0 - expo) * steering / (1.0 - expo * abs(steering))
        largest = 0.01 * self.parameters["MOT_THR_MAX"]
        throttle = max(-largest, min(largest, throttle))
        self._put_out(*(self._thrust_curve(motor) for motor in self._mix(self._scaled_by_speed(steering), throttle)))

    def _scaled_by_speed(self, steering: float) -> float:
        """MANUAL_OPTIONS: steering lessens above MOT_SPD_SCA_BASE, and changes its sense with the boat's way."""
        if not int(self.parameters["MANUAL_OPTIONS"]) & SPEED_SCALING:
            return steering
        base_mps = self.parameters["MOT_SPD_SCA_BASE"]
        if 0.0 < base_mps < abs(self.speed_mps):
            steering *= base_mps / abs(self.speed_mps)
        return -steering if self.speed_mps < 0.0 else steering

    def _mix(self, steering: float, throttle: float) -> tuple[float, float]:
        """The mixer of ArduPilot's AR_Motors for two motors that give less thrust astern, by MOT_THST_ASYM."""
        asymmetry = max(self.parameters["MOT_THST_ASYM"], 1.0)
        least = -1.0 / asymmetry
        best = 0.5 * (1.0 + least)
        reach = max(throttle, 0.0) - least if throttle < best else 1.0 - best
        steering = max(-reach, min(reach, steering))
        throttle = max(least, min(1.0, throttle))
        excess = max(throttle + abs(steering), (throttle - abs(steering)) / least)
        if excess > 1.0:
            fair, mix = 1.0 / excess, self.parameters["MOT_STR_THR_MIX"]
            if mix >= 0.5:
                steering *= fair + (1.0 - fair) * (mix - 0.5) / 0.5
                throttle = 1.0 - abs(steering) if throttle >= best else abs(steering) + least
            else:
                throttle *= fair + (1.0 - fair) * (0.5 - mix) / 0.5
                left = 1.0 - throttle if throttle >= best else throttle - least
                steering = math.copysign(left, steering)
        port, starboard = throttle + steering, throttle - steering
        return (port * asymmetry if port < 0.0 else port), (starboard * asymmetry if starboard < 0.0 else starboard)

    def _thrust_curve(self, fraction: float) -> float:
        """MOT_THR_MIN, then MOT_THST_EXPO, as ArduPilot's AR_Motors scales a throttle."""
        size, least, expo = abs(fraction), 0.01 * self.parameters["MOT_THR_MIN"], self.parameters["MOT_THST_EXPO"]
        if size == 0.0:
            return 0.0
        size = least + size * (1.0 - least)
        if expo != 0.0:
            size = (expo - 1.0 + math.sqrt((1.0 - expo) ** 2 + 4.0 * expo * size)) / (2.0 * expo)
        return math.copysign(size, fraction)

    def _put_out(self, port: float, starboard: float) -> None:
        """Throttles in [-1, 1] to the outputs that have their functions; an output without one keeps its pulse.

        The emergency stop neutralises motors while armed alone: what scripts hold goes out disarmed, whatever is on.
        """
        stopped = self.emergency_stop and self.armed
        for output in self.parameters.motor_outputs:
            throttle = port if output.function == PORT_MOTOR else starboard
            self.servo_us[output.number - 1] = output.pulse_us(0.0 if self.emergency_stop else throttle)
        for index, (pulse_us, loops) in list(self._held.items()):
            motor = self.parameters.functions[index] in (PORT_MOTOR, STARBOARD_MOTOR)
            if not (motor and stopped):
                self.servo_us[index] = pulse_us
            if loops > 1:
                self._held[index] = pulse_us, loops - 1
            else:
                del self._held[index]

    # --- what scripts see and do -----------------------------------------------------------------------------

    def parameter(self, name: str) -> float | None:
        """The value of a parameter; None where there is none of that name."""
        return self.parameters.get(name)

    def stick_us(self, channel: int) -> int | None:
        """A channel of the transmitter, overridden or not; None where there is none, 0 without a signal."""
        return self.rc.radio_us[channel - 1] if 1 <= channel <= CHANNELS else None

    def hold_output(self, index: int, pulse_us: int, timeout_ms: int) -> None:
        """Drive an output (from 0) past everything, for a time that is rounded up to whole loops; 0 lets go."""
        if not 0 <= index < OUTPUTS:
            raise ValueError("argument out of range")
        loops = math.ceil(timeout_ms * 1e-3 * self._config.loop_hz - 1e-9)
        self._held.pop(index, None)
        if loops > 0:
            self._held[index] = pulse_us, loops

    def say(self, severity: int, text: str) -> None:
        """A text to all stations."""
        self.texts.append((severity, text))

    def named_float(self, name: str, value: float) -> None:
        """NAMED_VALUE_FLOAT to all stations."""
        self.named_floats.append((name, value))

    @property
    def mapped(self) -> tuple[int, int]:
        """The channels that drive, which a real one reads anew each second."""
        return int(self.parameters["RCMAP_ROLL"]), int(self.parameters["RCMAP_THROTTLE"])

    def sticks(self) -> tuple[float, float]:
        """The two that drive, in [-1, 1]."""
        first, second = self.mapped
        radio_us = self.rc.radio_us
        return (
            self.parameters.stick(first).fraction(radio_us[first - 1]),
            self.parameters.stick(second).fraction(radio_us[second - 1]),
        )

    # --- modes and arming ----------------------------------------------------------------------------------

    def enter_mode(self, number: int) -> bool:
        """Change the mode; False, with the reason said, where the vehicle refuses."""
        if number not in MODES:
            self.texts.append((CRITICAL, f"No such mode {number}"))
            return False
        if self.mode == MODE_INITIALISING:
            return False
        if number in POSITION_MODES and not self.ready(self.t_ns):
            self.texts.append((WARNING, f"Mode change to {number} failed: requires position"))
            return False
        self.changed |= number != self.mode
        self.mode = number
        return True

    def arm(self, *, force: bool = False, by_rudder: bool = False) -> bool:
        """Arm; False, with the reasons said, where the vehicle refuses."""
        if self.armed:
            return True
        if not force and not self._may_arm(by_rudder):
            return False
        self.armed = self.changed = True
        self.texts.append((INFO, "Throttle armed"))
        return True

    def disarm(self) -> bool:
        """Disarm, always; the motors are neutral from the next loop."""
        if self.armed:
            self.armed = False
            self.changed = True
            self.texts.append((INFO, "Throttle disarmed"))
        return True

    def tell_checks(self) -> bool:
        """MAV_CMD_RUN_PREARM_CHECKS: say what fails; False while armed."""
        if self.armed:
            return False
        self._say("PreArm", failing_checks(self))
        return True

    @property
    def checks_skipped(self) -> bool:
        """Whether it arms without any checks."""
        if "ARMING_CHECK" in self.parameters:
            return self.parameters["ARMING_CHECK"] == 0.0
        return self.parameters["ARMING_SKIPCHK"] == -1.0

    def _watch_checks(self) -> None:
        """Once a second look at what would keep it from arming, and say so twice a minute."""
        if self.t_ns - self._checked_ns < CHECKS_NS:
            return
        self._checked_ns = self.t_ns
        failing = failing_checks(self)
        self.checks_pass = not failing
        if failing and not self.armed and self.t_ns - self._told_ns >= TELL_CHECKS_NS:
            self._told_ns = self.t_ns
            self._say("PreArm", failing)

    def _say(self, when: str, failing: list[str]) -> None:
        """A check's own words for when it was made stand."""
        self.texts += [(CRITICAL, text if text.startswith("PreArm: ") else f"{when}: {text}") for text in failing]

    def _may_arm(self, by_rudder: bool) -> bool:
        """All checks, with the reasons said where one fails."""
        failing = failing_checks(self) or ([] if self.checks_skipped else sticks_out(self, by_rudder))
        self._say("Arm", failing)
        return not failing
