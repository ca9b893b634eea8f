"""The vehicle inside the simulated PX4: modes, arming rules, fail-safes and outputs, by PX4's sources (1.14 and on).

Its motors hang on "Peripheral via Actuator Set" functions, so that neither sticks nor PX4's own controllers move them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.config.autopilots import PX4_MODES
from asvhil.simplant.px4.parameters import ACTUATOR_SET_1, Px4Parameters
from asvhil.simplant.vehicle.powered import PoweredVehicle

MANUAL, OFFBOARD, LOITER = PX4_MODES["MANUAL"], PX4_MODES["OFFBOARD"], PX4_MODES["AUTO.LOITER"]
STICK_MODES = frozenset(PX4_MODES[name] for name in ("MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED"))
POSITION_MODES = frozenset(
    PX4_MODES[name] for name in ("POSCTL", "AUTO.LOITER", "AUTO.MISSION", "AUTO.RTL", "AUTO.LAND", "OFFBOARD")
)
ENTERED = STICK_MODES | POSITION_MODES
ACTUATORS = 6
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
INFO, WARNING, CRITICAL = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_WARNING, dialect.MAV_SEVERITY_CRITICAL


class Px4Vehicle(PoweredVehicle):
    """State and rules, without bytes."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig, t_ns: int) -> None:
        self._channels = (pwm.port_channel, pwm.starboard_channel)
        self.parameters = Px4Parameters(config, pwm)
        super().__init__(config, t_ns)

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is forgotten."""
        super().restart(t_ns)
        self.mode = MANUAL
        self.terminated = self.failsafe = False
        self._actuators = [math.nan] * ACTUATORS
        self._offboard_ns: int | None = None
        self._offboard_since_ns = t_ns
        self._rc_lost_at_arming = False
        self._booted = False

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor; 0 before the vehicle has booted."""
        port, starboard = self._channels
        return self.servo_us[port - 1], self.servo_us[starboard - 1]

    def ready(self, t_ns: int) -> bool:
        """Whether the estimator uses its position."""
        return t_ns >= self.ready_ns

    def begin(self, t_ns: int) -> None:
        """The start of a loop, before messages are handled; never before `boot_ns`."""
        self.t_ns = t_ns
        self._booted = True

    def end(self) -> None:
        """The end of a loop: fail-safes, then the outputs."""
        if self.armed:
            self._watch()
        self._put_out()

    # --- what comes over the link --------------------------------------------------------------------------

    def offboard_signal(self) -> None:
        """A set-point that PX4 takes as the sign of life for OFFBOARD."""
        if self._offboard_lost():
            self._offboard_since_ns = self.t_ns
        self._offboard_ns = self.t_ns

    def set_actuators(self, values: Sequence[float]) -> None:
        """DO_SET_ACTUATOR, set 0: all six values; one that is not a number gives its output the disarmed pulse.

        MAVLink's definition reads NaN as "leave it"; PX4's FunctionActuatorSet copies it (as of 1.14).
        """
        self._actuators = list(values)

    def enter_mode(self, number: int) -> bool:
        """Change the mode; False, with the reason said, where the vehicle refuses."""
        reason = self._why_not(number) if number in ENTERED else "no such mode"
        if reason is not None:
            self.texts.append((CRITICAL, f"Mode change rejected: {reason}"))
            return False
        self.changed |= number != self.mode
        self.mode = number
        self.failsafe = False
        return True

    def arm(self, *, force: bool = False) -> bool:
        """Arm; False, with the reason said, where the vehicle refuses."""
        if self.armed:
            return True
        refusal = None if force else self.arming_refusal()
        if refusal is not None:
            self.texts.append((CRITICAL, f"Arming denied: {refusal}"))
            return False
        self.armed = self.changed = True
        self._rc_lost_at_arming = self._rc_lost()
        self.texts.append((INFO, "Armed by external command"))
        return True

    def disarm(self) -> bool:
        """Disarm: the outputs have their disarmed pulses from the next loop."""
        if self.armed:
            self.armed = self.failsafe = False
            self.changed = True
            self.texts.append((INFO, "Disarmed"))
        return True

    def arming_refusal(self) -> str | None:
        """Why the vehicle would not arm now; None where it would."""
        if self.terminated:
            return "flight termination active"
        if not self.ready(self.t_ns):
            return "heading or position estimate not stable"
        return self._why_not(self.mode)

    def _why_not(self, number: int) -> str | None:
        """Why a mode cannot run now."""
        if number in POSITION_MODES and not self.ready(self.t_ns):
            return "no valid local position estimate"
        if number in STICK_MODES and self._rc_lost():
            return "no manual control input"
        if number == OFFBOARD and (self._offboard_lost() or self.t_ns - self._offboard_since_ns < 1_000_000_000):
            return "no offboard signal"
        return None

    # --- fail-safes ----------------------------------------------------------------------------------------

    def _offboard_lost(self) -> bool:
        loss_ns = round(1e9 * self.parameters["COM_OF_LOSS_T"])
        return self._offboard_ns is None or self.t_ns - self._offboard_ns > loss_ns

    def _rc_lost(self) -> bool:
        return not self.rc.alive(self.t_ns, round(1e9 * self.parameters["COM_RC_LOSS_T"]))

    def _watch(self) -> None:
        if self.mode == OFFBOARD and self._offboard_lost():
            self._fail_safe("Offboard signal", OFFBOARD_LOSS[int(self.parameters["COM_OBL_RC_ACT"])])
        if not self._rc_lost():
            self._rc_lost_at_arming = False
            return
        excepted = self.mode == OFFBOARD and int(self.parameters["COM_RCL_EXCEPT"]) & OFFBOARD_EXCEPT
        if not (self._rc_lost_at_arming or excepted or self.failsafe):
            self._fail_safe("Manual control", RC_LOSS.get(int(self.parameters["NAV_RCL_ACT"]), "AUTO.RTL"))

    def _fail_safe(self, what: str, action: str) -> None:
        self.texts.append((CRITICAL, f"{what} lost: {action}"))
        self.failsafe = True
        if action == DISARM:
            self.disarm()
        elif action == TERMINATE:
            self.terminated = self.changed = True
        else:
            self.mode = PX4_MODES[action]
            self.changed = True

    # --- outputs -------------------------------------------------------------------------------------------

    def _put_out(self) -> None:
        for channel in self._channels:
            self.servo_us[channel - 1] = self._pulse_us(channel)

    def _pulse_us(self, channel: int) -> int:
        """As PX4's mixer module: -1..1 over PWM_MAIN_MIN..MAX, no number or disarmed PWM_MAIN_DIS, terminated FAIL."""
        parameters = self.parameters
        disarmed_us = round(parameters[f"PWM_MAIN_DIS{channel}"])
        if self.terminated:
            return round(parameters[f"PWM_MAIN_FAIL{channel}"]) or disarmed_us
        actuator = int(parameters[f"PWM_MAIN_FUNC{channel}"]) - ACTUATOR_SET_1
        if not self.armed or not 0 <= actuator < ACTUATORS or not math.isfinite(self._actuators[actuator]):
            return disarmed_us
        low_us, high_us = parameters[f"PWM_MAIN_MIN{channel}"], parameters[f"PWM_MAIN_MAX{channel}"]
        value = max(-1.0, min(1.0, self._actuators[actuator]))
        return math.floor(low_us + 0.5 * (value + 1.0) * (high_us - low_us) + 0.5)
