"""The vehicle inside the simulated PX4: modes, arming rules, fail-safes and outputs, as measured on PX4 1.15 and 1.16.

Its motors have "Peripheral via Actuator Set" functions, so that neither sticks nor PX4's own controllers move them.
docs/simulated-autopilots.md lists the differences to a real one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, MotorOutputConfig, PwmConfig
from asvhil.config.autopilots import PX4_MODES
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import NO_SIGNAL_US
from asvhil.simplant.px4.estimator import AccelerometerBias, RestingEstimator
from asvhil.simplant.px4.parameters import ACTUATOR_SET_1, MULTICOPTER, Px4Parameters
from asvhil.simplant.vehicle.powered import PoweredVehicle
from asvhil.simplant.vehicle.wiring import WiredMotor

MANUAL, OFFBOARD, LOITER = PX4_MODES["MANUAL"], PX4_MODES["OFFBOARD"], PX4_MODES["AUTO.LOITER"]
STICK_MODES = frozenset(PX4_MODES[name] for name in ("MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED"))
POSITION_MODES = frozenset(
    PX4_MODES[name] for name in ("POSCTL", "AUTO.LOITER", "AUTO.MISSION", "AUTO.RTL", "AUTO.LAND")
)
ENTERED = STICK_MODES | POSITION_MODES | {OFFBOARD}
# As PX4 names them in its texts.
TITLES = {
    "MANUAL": "Manual",
    "ALTCTL": "Altitude",
    "POSCTL": "Position",
    "ACRO": "Acro",
    "STABILIZED": "Stabilized",
    "OFFBOARD": "Offboard",
    "AUTO.LOITER": "Hold",
    "AUTO.MISSION": "Mission",
    "AUTO.RTL": "Return",
    "AUTO.LAND": "Land",
}
TITLE_OF = {PX4_MODES[name]: title for name, title in TITLES.items()}
ACTUATORS = 6
SITL_DISARMED_US, SITL_LOW_US, SITL_HIGH_US = 900, 1000, 2000
ATTITUDE_AFTER_NS = 1_000_000_000  # of boot
SIGNAL_NS = 100_000_000  # of set-points before OFFBOARD is accepted
LANDED_AFTER_NS = 15_000_000_000  # armed, on the ground: for a multicopter it has landed
DISARM, TERMINATE = "disarm", "terminate"
# COM_OBL_RC_ACT and NAV_RCL_ACT: a mode, or what else is done; the first are for a pilot with sticks.
OFFBOARD_LOSS: dict[int, str] = {
    0: "POSCTL",
    1: "ALTCTL",
    2: "STABILIZED",
    3: "AUTO.RTL",
    4: "AUTO.LAND",
    5: "AUTO.LOITER",
    6: TERMINATE,
    7: DISARM,
}
RC_LOSS: dict[int, str] = {1: "AUTO.LOITER", 2: "AUTO.RTL", 3: "AUTO.LAND", 5: TERMINATE, 6: DISARM}
OFFBOARD_EXCEPT = 4  # bit of COM_RCL_EXCEPT
INFO, CRITICAL = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_CRITICAL


class Px4Vehicle(PoweredVehicle):
    """State and rules, without bytes."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig, navigation: Navigation, t_ns: int) -> None:
        super().__init__(config, t_ns)
        self._navigation = navigation
        self.parameters = Px4Parameters(config, pwm)
        # The motors hang where the parameters that the boat is built with say, and stay there whatever is set later.
        self._motors = tuple(
            self._wired(pwm, motor, function, usual)
            for motor, function, usual in zip(
                (pwm.port, pwm.starboard), (ACTUATOR_SET_1, ACTUATOR_SET_1 + 1), pwm.outputs, strict=True
            )
        )
        self.on_board = config.px4_outputs == "board"
        self.says_rest = config.px4_version != "1.15"
        self._estimator = RestingEstimator(self.parameters, t_ns)
        self.restart(t_ns)

    def _wired(self, pwm: PwmConfig, motor: MotorOutputConfig, function: int, usual: int) -> WiredMotor:
        """On the output that has its function, in that output's sense."""
        output = self.parameters.output_with(function) or usual
        neutral_us = pwm.neutral_us if motor.neutral_us is None else motor.neutral_us
        return WiredMotor(pwm, output, neutral_us=neutral_us, reversed=self.parameters.turns(output))

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is reset."""
        super().restart(t_ns)
        self.mode = LOITER
        self.terminated = self.failsafe = False
        self._estimator.restart(t_ns)
        self.accelerometer_bias = AccelerometerBias()
        self._drifted = False
        self._actuators = [math.nan] * ACTUATORS
        self._offboard_ns: int | None = None
        self._offboard_since_ns = t_ns
        self._offboard_position = False
        self._rc_lost_at_arming = False
        self._then: tuple[int, str] | None = None  # when a fail-safe's Hold ends, and in which mode
        self._armed_ns = t_ns

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor; 0 (no signal) before boot, and in SITL while disarmed."""
        if not self.on_board and not self.armed:
            return NO_SIGNAL_US, NO_SIGNAL_US
        port, starboard = self._motors
        return port.plain_us(self.servo_us), starboard.plain_us(self.servo_us)

    def _say(self, severity: int, text: str) -> None:
        self.texts.append((severity, f"{text}\t"))  # PX4 marks texts that it sends as events too

    def ready(self, t_ns: int) -> bool:
        """Whether the estimator uses its position."""
        return t_ns >= self.ready_ns and self._estimator.in_use

    def has_fix(self, t_ns: int) -> bool:
        """Whether the receiver has a fix, used or not."""
        return t_ns >= self.ready_ns

    def begin(self, t_ns: int) -> None:
        """The start of a loop, before messages are handled; never before `boot_ns`."""
        self.t_ns = t_ns

    def end(self) -> None:
        """The end of a loop: estimator, fail-safes, then the outputs."""
        self._estimator.step(self._navigation, armed=self.armed)
        if self._estimator.drifts and not self._drifted:
            self._say(CRITICAL, "Preflight: GPS Horizontal Pos Drift too high")
        self._drifted = self._estimator.drifts
        if self.armed and not self.terminated:
            self._watch()
        self._put_out()

    # --- what comes over the link --------------------------------------------------------------------------

    def offboard_signal(self, *, position: bool = False) -> None:
        """A set-point that keeps OFFBOARD alive; one of `position` needs a valid position."""
        if self._offboard_lost():
            self._offboard_since_ns = self.t_ns
        self._offboard_ns = self.t_ns
        self._offboard_position = position

    def set_actuators(self, values: Sequence[float]) -> None:
        """DO_SET_ACTUATOR, set 0: all six values; one that is not a number leaves its actuator alone."""
        for number, value in enumerate(values):
            if math.isfinite(value):
                self._actuators[number] = value

    def enter_mode(self, number: int) -> bool:
        """Change the mode; False, with the reason as a text, where the vehicle refuses."""
        if number not in ENTERED or not self._can_run(number):
            title = TITLE_OF.get(number, "this mode")
            self._say(CRITICAL, f"Switching to {title} is currently not available")
            return False
        self.changed |= number != self.mode
        self.mode = number
        self.failsafe, self._then = False, None
        return True

    def arm(self, *, force: bool = False) -> bool:
        """Arm; False, with the reason as a text, where the vehicle refuses."""
        if self.armed:
            return True
        if self.terminated or not (force or self.checks_pass()):
            self._say(CRITICAL, "Arming denied: Resolve system health failures first")
            return False
        self.armed = self.changed = True
        self._armed_ns = self.t_ns
        self._rc_lost_at_arming = self._rc_lost()
        self._say(INFO, "Armed by external command")
        return True

    def disarm(self, by: str = "external command") -> bool:
        """Disarm: the outputs have their disarmed pulses from the next loop, and actuators keep their values."""
        if self.armed:
            self.armed = self.failsafe = False
            self._then = None
            self.changed = True
            self._say(INFO, f"Disarmed by {by}")
        return True

    def checks_pass(self) -> bool:
        """Whether the vehicle would arm now."""
        return not self.terminated and self._attitude() and self._can_run(self.mode)

    def _can_run(self, number: int) -> bool:
        """Whether a mode can run now."""
        if number in STICK_MODES and self._rc_lost():
            return False
        if number == OFFBOARD:
            signal = not self._offboard_lost() and self.t_ns - self._offboard_since_ns >= SIGNAL_NS
            return signal and self._attitude() and (not self._offboard_position or self.ready(self.t_ns))
        return number not in POSITION_MODES or self.ready(self.t_ns)

    def _attitude(self) -> bool:
        return self.t_ns >= self.boot_ns + ATTITUDE_AFTER_NS

    # --- fail-safes ----------------------------------------------------------------------------------------

    def _offboard_lost(self) -> bool:
        loss_ns = round(1e9 * self.parameters["COM_OF_LOSS_T"])
        return self._offboard_ns is None or self.t_ns - self._offboard_ns > loss_ns

    def _rc_lost(self) -> bool:
        return not self.rc.alive(self.t_ns, round(1e9 * self.parameters["COM_RC_LOSS_T"]))

    def _watch(self) -> None:
        self._watch_frame()
        if self._then is not None and self.t_ns >= self._then[0]:
            self._fail_safe(self._then[1])
        if self.mode == OFFBOARD and self._offboard_lost():
            self._fail_safe(OFFBOARD_LOSS[int(self.parameters["COM_OBL_RC_ACT"])])
        if not self._rc_lost():
            self._rc_lost_at_arming = False
            return
        excepted = self.mode == OFFBOARD and int(self.parameters["COM_RCL_EXCEPT"]) & OFFBOARD_EXCEPT
        if not (self._rc_lost_at_arming or excepted or self.failsafe):
            self._fail_safe(RC_LOSS.get(int(self.parameters["NAV_RCL_ACT"]), "AUTO.RTL"), first_hold=True)

    def _watch_frame(self) -> None:
        """Disarm a multicopter that does not take off; a rover is never disarmed."""
        if int(self.parameters["CA_AIRFRAME"]) != MULTICOPTER:
            return
        preflight_s = self.parameters["COM_DISARM_PRFLT"]
        if preflight_s > 0.0:
            if self.t_ns - self._armed_ns > round(1e9 * preflight_s):
                self.disarm("auto preflight disarming")
        elif self.parameters["COM_DISARM_LAND"] > 0.0 and self.t_ns - self._armed_ns > LANDED_AFTER_NS:
            self.disarm("landing")

    def _fail_safe(self, action: str, *, first_hold: bool = False) -> None:
        """Act as the parameters say. If a pilot may take over, Hold comes first, for COM_FAIL_ACT_T."""
        self._then = None
        if not self.armed:
            return
        hold_s = self.parameters["COM_FAIL_ACT_T"] if first_hold and action not in (DISARM, TERMINATE) else 0.0
        if hold_s > 0.0:
            self._then = (self.t_ns + round(1e9 * hold_s), action)
            self._say(CRITICAL, f"Failsafe activated: entering Hold for {hold_s:.0f} seconds")
            action = "AUTO.LOITER"
        else:
            self._say(CRITICAL, "Failsafe activated")
        self.failsafe = self.changed = True
        if action == DISARM:
            self.disarm("failsafe")
        elif action == TERMINATE:
            self.terminated = True
        else:
            self.mode = PX4_MODES[action]

    # --- outputs -------------------------------------------------------------------------------------------

    @property
    def tells_outputs(self) -> bool:
        """Whether outputs are reported: always on a board."""
        if self.on_board:
            return True
        return self.parameters.drives_a_motor and (self.armed or not self.says_rest)

    def _put_out(self) -> None:
        if self.on_board:
            for motor in self._motors:
                self.servo_us[motor.output - 1] = self._pulse_us(motor.output)
        else:
            for number in range(len(self.servo_us)):
                self.servo_us[number] = SITL_DISARMED_US
            if self.armed and not self.terminated:
                for motor in self._motors:
                    self.servo_us[motor.output - 1] = self._pulse_us(motor.output)

    def _pulse_us(self, channel: int) -> int:
        """As PX4's mixer module: -1..1 over PWM_MAIN_MIN..MAX, unset or disarmed PWM_MAIN_DIS, terminated FAIL."""
        parameters = self.parameters
        actuator = int(parameters[f"PWM_MAIN_FUNC{channel}"]) - ACTUATOR_SET_1
        value = self._actuators[actuator] if 0 <= actuator < ACTUATORS else math.nan
        if not self.on_board:
            return SITL_DISARMED_US if math.isnan(value) else _spread(value, SITL_LOW_US, SITL_HIGH_US)
        disarmed_us = round(parameters[f"PWM_MAIN_DIS{channel}"])
        if self.terminated:
            return round(parameters[f"PWM_MAIN_FAIL{channel}"]) or disarmed_us
        if not self.armed or math.isnan(value):
            return disarmed_us
        value = -value if parameters.turns(channel) else value
        return _spread(value, parameters[f"PWM_MAIN_MIN{channel}"], parameters[f"PWM_MAIN_MAX{channel}"])


def _spread(value: float, low_us: float, high_us: float) -> int:
    inside = max(-1.0, min(1.0, value))
    return math.floor(low_us + 0.5 * (inside + 1.0) * (high_us - low_us) + 0.5)
