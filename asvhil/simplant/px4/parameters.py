"""The PX4 parameters of DO_SET_ACTUATOR, of the outputs, and of the fail-safes."""

from __future__ import annotations

import struct

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.simplant.vehicle.parameter_table import INT32, REAL32, ParameterTable, Row

ACTUATOR_SET_1 = 301  # PWM_MAIN_FUNCn: "Peripheral via Actuator Set 1"
MOTOR_1, LAST_SERVO = 101, 208  # the functions that a controller serves: motors 101 to 112, servos 201 to 208
FAIL_AS_DISARMED = 0  # PWM_MAIN_FAILn here: PX4's own default, -1, means the same for these functions
OUTPUTS = 8  # of PWM MAIN
MULTICOPTER, ROVER_DIFFERENTIAL = 0, 6  # CA_AIRFRAME


def _output(number: int, function: int, config: FrontseatConfig, pwm: PwmConfig) -> tuple[Row, ...]:
    main = "PWM_MAIN_"
    rows: tuple[Row, ...] = ((f"{main}FUNC{number}", function, INT32, (0.0, 2000.0)),)
    if config.px4_outputs == "sitl":
        return rows
    motor = pwm.starboard if function == ACTUATOR_SET_1 + 1 else pwm.port
    low_us, high_us = sorted((motor.astern_us or pwm.astern_us, motor.ahead_us or pwm.ahead_us))
    return (
        *rows,
        (f"{main}MIN{number}", low_us, INT32, (800.0, 1600.0)),
        (f"{main}MAX{number}", high_us, INT32, (1400.0, 2200.0)),
        (f"{main}DIS{number}", motor.neutral_us or pwm.neutral_us, INT32, (800.0, 2200.0)),
        (f"{main}FAIL{number}", FAIL_AS_DISARMED, INT32, (0.0, 2200.0)),
    )


class Px4Parameters(ParameterTable):
    """Integers travel as their bytes in the float field, as PX4 sends them.

    Outputs and fail-safes are as docs/boats/px4-rover.md has them: a motor function on the first spare output, and an
    EKF2_GPS_CHECK that lets a disarmed boat drift.
    """

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        port, starboard = pwm.outputs
        functions = {port: ACTUATOR_SET_1, starboard: ACTUATOR_SET_1 + 1}
        motors = {port: pwm.port, starboard: pwm.starboard}
        turned = sum(1 << output - 1 for output, motor in motors.items() if motor.reversed)
        spare = next(number for number in (2, 1, 3) if number not in functions)
        functions |= {spare: MOTOR_1}
        functions = {number: 0 for number in range(1, OUTPUTS + 1)} | functions
        self.channels = tuple(sorted(functions))
        rows: tuple[Row, ...] = (
            ("MAV_SYS_ID", config.system_id, INT32, (1.0, 250.0)),
            *(row for number in self.channels for row in _output(number, functions[number], config, pwm)),
            *(() if config.px4_outputs == "sitl" else (("PWM_MAIN_REV", turned, INT32, (0.0, 255.0)),)),
            ("CA_AIRFRAME", ROVER_DIFFERENTIAL, INT32, (0.0, 15.0)),
            ("COM_DISARM_LAND", 2.0, REAL32, (-1.0, 60.0)),
            ("COM_DISARM_PRFLT", 10.0, REAL32, (-1.0, 60.0)),
            ("COM_FAIL_ACT_T", 5.0, REAL32, (0.0, 25.0)),
            ("COM_OF_LOSS_T", 1.0, REAL32, (0.0, 60.0)),
            ("COM_OBL_RC_ACT", 7, INT32, (0.0, 7.0)),
            ("COM_RC_LOSS_T", 0.5, REAL32, (0.0, 35.0)),
            ("COM_RCL_EXCEPT", 0, INT32, (0.0, 31.0)),
            ("EKF2_GPS_CHECK", 21, INT32, (0.0, 1023.0)),
            ("EKF2_REQ_HDRIFT", 0.1, REAL32, (0.1, 1.0)),
            ("NAV_RCL_ACT", 2, INT32, (1.0, 6.0)),
        )
        super().__init__("simulated PX4", rows, config.parameters)

    def output_with(self, function: int) -> int | None:
        """The first output that has a function."""
        return next((n for n in self.channels if self[f"PWM_MAIN_FUNC{n}"] == function), None)

    def turns(self, output: int) -> bool:
        """Whether an output is mirrored, by PWM_MAIN_REV."""
        return "PWM_MAIN_REV" in self and bool(int(self["PWM_MAIN_REV"]) >> (output - 1) & 1)

    @property
    def drives_a_motor(self) -> bool:
        """Whether some output has a function that a controller serves: PX4's simulated outputs speak only then."""
        return any(MOTOR_1 <= self[f"PWM_MAIN_FUNC{number}"] <= LAST_SERVO for number in self.channels)

    def _value_in(self, field: float, kind: int) -> float:
        return field if kind == REAL32 else float(struct.unpack("<i", struct.pack("<f", field))[0])

    def _field_of(self, value: float, kind: int) -> float:
        return value if kind == REAL32 else float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
