"""The PX4 parameters that decide over DO_SET_ACTUATOR, the outputs and the fail-safes that bound them."""

from __future__ import annotations

import math
import struct
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.errors import ConfigError

_INT32 = dialect.MAV_PARAM_TYPE_INT32
_REAL32 = dialect.MAV_PARAM_TYPE_REAL32
NO_INDEX = 65535  # of a PARAM_VALUE that tells of a change
ACTUATOR_SET_1 = 301  # PWM_MAIN_FUNCn: "Peripheral via Actuator Set 1"
FAIL_AS_DISARMED = 0  # PWM_MAIN_FAILn here: PX4's own default, -1, means the same for these functions

Row = tuple[str, float, int, float, float]  # name, value, MAV_PARAM_TYPE, least, greatest


def _output(number: int, function: int, pwm: PwmConfig) -> tuple[Row, ...]:
    main = "PWM_MAIN_"
    return (
        (f"{main}FUNC{number}", function, _INT32, 0.0, 2000.0),
        (f"{main}MIN{number}", pwm.astern_us, _INT32, 800.0, 1600.0),
        (f"{main}MAX{number}", pwm.ahead_us, _INT32, 1400.0, 2200.0),
        (f"{main}DIS{number}", pwm.neutral_us, _INT32, 800.0, 2200.0),
        (f"{main}FAIL{number}", FAIL_AS_DISARMED, _INT32, 0.0, 2200.0),
    )


class Px4Parameters:
    """Values by name. Integers travel as their bytes in the float field, as PX4 sends them.

    Raises ConfigError where the config gives a value to a parameter that does not exist.
    """

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        rows: tuple[Row, ...] = (
            ("MAV_SYS_ID", config.system_id, _INT32, 1.0, 250.0),
            *_output(pwm.port_channel, ACTUATOR_SET_1, pwm),
            *_output(pwm.starboard_channel, ACTUATOR_SET_1 + 1, pwm),
            ("COM_OF_LOSS_T", 1.0, _REAL32, 0.0, 60.0),
            ("COM_OBL_RC_ACT", 7, _INT32, 0.0, 7.0),
            ("COM_RC_LOSS_T", 0.5, _REAL32, 0.0, 35.0),
            ("COM_RCL_EXCEPT", 0, _INT32, 0.0, 31.0),
            ("NAV_RCL_ACT", 6, _INT32, 1.0, 6.0),
        )
        self._rows = {name: (kind, least, greatest) for name, _, kind, least, greatest in rows}
        self._values = {name: float(value) for name, value, _, _, _ in rows}
        self.names = tuple(self._rows)
        for name, value in config.parameters.items():
            if name not in self._rows:
                raise ConfigError(f"key plant.frontseat.parameters: the simulated PX4 has no {name}")
            self._put(name, value)

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def find(self, name: str, index: int) -> str | None:
        """The name of a parameter given by index, or by name where the index is -1; None where there is none."""
        if index == -1:
            return name if name in self._rows else None
        return self.names[index] if 0 <= index < len(self.names) else None

    def set(self, name: str, value: float) -> bool:
        """Set a parameter from the field of a PARAM_SET; False where there is none of that name. Never raises."""
        row = self._rows.get(name)
        if row is None:
            return False
        self._put(name, value if row[0] == _REAL32 else float(_integer_in(value)))
        return True

    def message(self, name: str, *, changed: bool = False) -> Any:
        """PARAM_VALUE; a change comes without its index."""
        kind, _, _ = self._rows[name]
        value = self._values[name]
        field = value if kind == _REAL32 else _float_of(round(value))
        index = NO_INDEX if changed else self.names.index(name)
        return dialect.MAVLink_param_value_message(name.encode(), field, kind, len(self.names), index)

    def _put(self, name: str, value: float) -> None:
        _, least, greatest = self._rows[name]
        if math.isfinite(value):
            self._values[name] = min(greatest, max(least, value))


def _integer_in(field: float) -> int:
    """The integer whose bytes stand in a float field."""
    return int(struct.unpack("<i", struct.pack("<f", field))[0])


def _float_of(value: int) -> float:
    return float(struct.unpack("<f", struct.pack("<i", value))[0])
