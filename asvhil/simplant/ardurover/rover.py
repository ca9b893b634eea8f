"""The vehicle inside the simulated autopilot: modes, arming rules, radio fail-safe and motor outputs of ArduRover."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.simplant.ardurover.arming import RudderWatch, failing_checks, sticks_out
from asvhil.simplant.ardurover.parameters import PORT_MOTOR, STARBOARD_MOTOR, Parameters
from asvhil.simplant.vehicle.powered import PoweredVehicle
from asvhil.simplant.vehicle.rc import CHANNELS, IGNORE

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
DISARM = -1
MODE_RTL, MODE_SMART_RTL = 11, 12
# FS_ACTION: modes to be entered, the first that is possible; 0 does nothing.
FAILSAFE_ACTIONS: dict[int, tuple[int, ...]] = {
    1: (MODE_RTL, MODE_HOLD),
    2: (MODE_HOLD,),
    3: (MODE_SMART_RTL, MODE_RTL, MODE_HOLD),
    4: (MODE_SMART_RTL, MODE_HOLD),
    5: (DISARM,),
}
INFO, WARNING, CRITICAL = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_WARNING, dialect.MAV_SEVERITY_CRITICAL


class Rover(PoweredVehicle):
    """State and rules, without bytes.

    Modes other than MANUAL are entered and reported, but leave the motors neutral: navigation is not simulated.
    """

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig, t_ns: int) -> None:
        self._port, self._starboard = pwm.port_channel - 1, pwm.starboard_channel - 1
        self._neutral_ns = round(1e9 * config.neutral_timeout_s)
        self._setup_ns = round(1e9 * config.setup_s)
        self._failsafe_ns = round(1e9 * config.failsafe_timeout_s)
        self.parameters = Parameters(config, pwm)
        super().__init__(config, t_ns)

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is forgotten."""
        super().restart(t_ns)
        self.mode = MODE_INITIALISING
        self.radio_failsafe = False
        self.gcs_failsafe = False
        self.gcs_heard_ns: int | None = None
        self.mapped = int(self.parameters["RCMAP_ROLL"]), int(self.parameters["RCMAP_THROTTLE"])
        self.safety_on = self.parameters["BRD_SAFETY_DEFLT"] != 0.0
        if self._setup_ns:
            self.parameters.begin_setup()
        self._throttle = 0.0
        self._position_used = False
        self.radio_silent = self.parameters["FS_THR_ENABLE"] != 0.0 and not self.rc.receiver
        self.checks_pass = False
        self._checked_ns = self._told_ns = self.boot_ns
        self._rudder = RudderWatch()

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor; 0: no signal, as before boot or the safety switch."""
        return (0, 0) if self.safety_on else (self.servo_us[self._port], self.servo_us[self._starboard])

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
        if sender_system == self.parameters[self.parameters.mygcs_name]:
            self.gcs_heard_ns = self.t_ns

    def override(self, sender_system: int, values: list[int]) -> None:
        """Channel overrides (18 raw values); those of other stations than ours are dropped without a word."""
        if not self._overrides_ignored() and sender_system == self.parameters[self.parameters.mygcs_name]:
            self.rc.override(self.t_ns, values, self._neutral_ns)

    def manual_control(self, sender_system: int, y: int, z: int) -> None:
        """MANUAL_CONTROL: y moves the port channel, z the starboard one; -1000..1000 over the stick's travel.

        32767 (no value) gives the channel back: ArduPilot overrides it with 0 then.
        """
        values = [IGNORE] * CHANNELS
        for index, axis in ((self._port, y), (self._starboard, z)):
            values[index] = 0
            if axis != 32767:
                stick = self.parameters.stick(index + 1)
                share = (max(-1000, min(1000, axis)) + 1000) / 2000
                values[index] = int(stick.low_us + (stick.high_us - stick.low_us) * share)
        self.override(sender_system, values)

    def _overrides_ignored(self) -> bool:
        options = int(self.parameters["RC_OPTIONS"])
        return bool(options & OVERRIDES_IGNORED) or self.parameters["RC_OVERRIDE_TIME"] == 0.0

    def _radio_lost(self, timeout_ns: int) -> bool:
        return self.parameters["FS_THR_ENABLE"] != 0.0 and not self.rc.alive(self.t_ns, timeout_ns)

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
        """DO_SET_SERVO: refused on motor outputs; any other holds its value until power-off."""
        if not 1 <= channel <= 16 or not 0 <= pulse_us <= 2500 or self._function(channel - 1) != 0:
            return False
        self.servo_us[channel - 1] = pulse_us
        return True

    def _function(self, index: int) -> int:
        """SERVOn_FUNCTION of an output (index from 0); beyond the eighth none is listed."""
        name = f"SERVO{index + 1}_FUNCTION"
        return int(self.parameters[name]) if name in self.parameters.names else 0

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
            if throttle < 0.0 and steer_type != STEERING_NOT_FLIPPED:
                steering = -steering
        slew = self.parameters["MOT_SLEWRATE"]
        if slew > 0.0:  # percent per second, of the throttle alone
            step = 0.01 * slew / self._config.loop_hz
            throttle = max(self._throttle - step, min(self._throttle + step, throttle))
        self._throttle = throttle
        port, starboard = throttle + steering, throttle - steering
        largest = max(1.0, abs(port), abs(starboard))
        self._put_out(self._thrust_curve(port / largest), self._thrust_curve(starboard / largest))

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
        """Throttles in [-1, 1] to the outputs that have their functions; an output without one keeps its pulse."""
        for index in (self._port, self._starboard):
            throttle = {PORT_MOTOR: port, STARBOARD_MOTOR: starboard}.get(self._function(index))
            if throttle is not None:
                self.servo_us[index] = self._pulse_us(index, throttle)

    def _pulse_us(self, index: int, throttle: float) -> int:
        """Pulse width of an output, cut to whole microseconds as ArduPilot does."""
        servo, parameters = f"SERVO{index + 1}", self.parameters
        if parameters[f"{servo}_REVERSED"]:
            throttle = -throttle
        trim_us = parameters[f"{servo}_TRIM"]
        end_us = parameters[f"{servo}_MAX" if throttle > 0.0 else f"{servo}_MIN"]
        return int(trim_us + abs(end_us - trim_us) * throttle + 1e-6)

    def sticks(self) -> tuple[float, float]:
        """The two that drive, from the channels that they were mapped to at boot."""
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
        if "ARMING_CHECK" in self.parameters.names:
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
