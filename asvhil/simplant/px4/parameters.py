"""The PX4 parameters that decide over DO_SET_ACTUATOR, the outputs and the fail-safes that bound them."""

from __future__ import annotations

import struct

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.simplant.vehicle.parameter_table import INT32, REAL32, ParameterTable, Row

ACTUATOR_SET_1 = 301  # PWM_MAIN_FUNCn: "Peripheral via Actuator Set 1"
FAIL_AS_DISARMED = 0  # PWM_MAIN_FAILn here: PX4's own default, -1, means the same for these functions


def _output(number: int, function: int, pwm: PwmConfig) -> tuple[Row, ...]:
    main = "PWM_MAIN_"
    return (
        (f"{main}FUNC{number}", function, INT32, (0.0, 2000.0)),
        (f"{main}MIN{number}", pwm.astern_us, INT32, (800.0, 1600.0)),
        (f"{main}MAX{number}", pwm.ahead_us, INT32, (1400.0, 2200.0)),
        (f"{main}DIS{number}", pwm.neutral_us, INT32, (800.0, 2200.0)),
        (f"{main}FAIL{number}", FAIL_AS_DISARMED, INT32, (0.0, 2200.0)),
    )


class Px4Parameters(ParameterTable):
    """Integers travel as their bytes in the float field, as PX4 sends them."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        rows: tuple[Row, ...] = (
            ("MAV_SYS_ID", config.system_id, INT32, (1.0, 250.0)),
            *_output(pwm.port_channel, ACTUATOR_SET_1, pwm),
            *_output(pwm.starboard_channel, ACTUATOR_SET_1 + 1, pwm),
            ("COM_OF_LOSS_T", 1.0, REAL32, (0.0, 60.0)),
            ("COM_OBL_RC_ACT", 7, INT32, (0.0, 7.0)),
            ("COM_RC_LOSS_T", 0.5, REAL32, (0.0, 35.0)),
            ("COM_RCL_EXCEPT", 0, INT32, (0.0, 31.0)),
            ("NAV_RCL_ACT", 6, INT32, (1.0, 6.0)),
        )
        super().__init__("simulated PX4", rows, config.parameters)

    def _value_in(self, field: float, kind: int) -> float:
        return field if kind == REAL32 else float(struct.unpack("<i", struct.pack("<f", field))[0])

    def _field_of(self, value: float, kind: int) -> float:
        return value if kind == REAL32 else float(struct.unpack("<f", struct.pack("<i", round(value)))[0])
