"""The ArduPilot parameters that decide whether motor commands reach the motors unbent, and what follows if they stop.

Those that the simulation acts on can be set, within ArduPilot's range; the rest are listed and stand as they are.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.errors import ConfigError
from asvhil.simplant.rc import Calibration

_INT8 = dialect.MAV_PARAM_TYPE_INT8
_INT16 = dialect.MAV_PARAM_TYPE_INT16
_INT32 = dialect.MAV_PARAM_TYPE_INT32
_REAL32 = dialect.MAV_PARAM_TYPE_REAL32

FIXED = None  # not modelled: the value stands whatever is asked
PULSES = (800.0, 2200.0)
NO_INDEX = 65535  # of a PARAM_VALUE that tells of a change
PORT_MOTOR, STARBOARD_MOTOR = 73, 74  # SERVOn_FUNCTION: throttle left and right

STICK_DEFAULTS = (("MIN", 1000.0), ("TRIM", 1500.0), ("MAX", 2000.0), ("DZ", 0.0), ("REVERSED", 0.0))  # not a motor's

Row = tuple[str, float, int, tuple[float, float] | None]  # name, value, MAV_PARAM_TYPE, range


def _identity(config: FrontseatConfig) -> tuple[Row, ...]:
    """Names that changed with firmware 4.7."""
    old = config.firmware == "4.6"
    return (
        ("SYSID_THISMAV" if old else "MAV_SYSID", config.system_id, _INT16, FIXED),
        ("SYSID_MYGCS" if old else "MAV_GCS_SYSID", config.mygcs_system_id, _INT16, (1.0, 255.0)),
        ("ARMING_CHECK", 1, _INT32, (0.0, 2.0**20)) if old else ("ARMING_SKIPCHK", 0, _INT32, (-1.0, 2.0**20)),
    )


def _channel(number: int, dead_zone_us: int, function: int) -> tuple[Row, ...]:
    """A motor's stick and its output, which have the same travel."""
    rc, servo = f"RC{number}", f"SERVO{number}"
    return (
        (f"{rc}_MIN", 1000, _INT16, PULSES),
        (f"{rc}_TRIM", 1500, _INT16, PULSES),
        (f"{rc}_MAX", 2000, _INT16, PULSES),
        (f"{rc}_REVERSED", 0, _INT8, (0.0, 1.0)),
        (f"{rc}_DZ", dead_zone_us, _INT16, (0.0, 200.0)),
        (f"{servo}_MIN", 1000, _INT16, PULSES),
        (f"{servo}_TRIM", 1500, _INT16, PULSES),
        (f"{servo}_MAX", 2000, _INT16, PULSES),
        (f"{servo}_REVERSED", 0, _INT8, (0.0, 1.0)),
        (f"{servo}_FUNCTION", function, _INT16, (-1.0, 188.0)),
    )


class Parameters:
    """Values by name. Raises ConfigError where the config gives a value to a parameter that does not exist."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        port, starboard = pwm.port_channel, pwm.starboard_channel
        rows: tuple[Row, ...] = (
            *_identity(config),
            ("PILOT_STEER_TYPE", 1, _INT8, (0.0, 3.0)),
            *_channel(port, config.rc1_dz_us, PORT_MOTOR),
            *_channel(starboard, config.rc3_dz_us, STARBOARD_MOTOR),
            ("RC_OVERRIDE_TIME", config.override_timeout_s, _REAL32, (-1.0, 120.0)),
            ("RC_OPTIONS", 32, _INT32, (0.0, 32767.0)),
            ("MOT_SLEWRATE", 0, _INT16, (0.0, 1000.0)),
            ("MOT_THR_MIN", 0, _INT8, (0.0, 20.0)),
            ("MOT_THST_EXPO", 0, _REAL32, (-1.0, 1.0)),
            ("FS_ACTION", 2, _INT8, (0.0, 5.0)),
            ("FS_THR_ENABLE", 1, _INT8, (0.0, 2.0)),
            ("FS_TIMEOUT", 1.5, _REAL32, FIXED),
            ("FS_GCS_ENABLE", 0, _INT8, (0.0, 2.0)),
            ("FS_GCS_TIMEOUT", 5.0, _REAL32, (2.0, 120.0)),
            ("BRD_SAFETY_DEFLT", 0, _INT8, (0.0, 1.0)),
            ("RCMAP_ROLL", port, _INT8, (1.0, 16.0)),
            ("RCMAP_THROTTLE", starboard, _INT8, (1.0, 16.0)),
            ("FRAME_CLASS", 2, _INT8, FIXED),
            ("INITIAL_MODE", 0, _INT8, FIXED),
            ("SCHED_LOOP_RATE", config.loop_hz, _INT16, FIXED),
        )
        self._rows = {name: (kind, limits) for name, _, kind, limits in rows}
        self._values = {name: float(value) for name, value, _, _ in rows}
        self._sticks: dict[int, Calibration] = {}
        self.names = tuple(self._rows)
        self.mygcs_name = rows[1][0]
        for name, value in config.parameters.items():
            if not self.set(name, value):
                raise ConfigError(f"key plant.frontseat.parameters: the simulated ArduRover has no {name}")

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def find(self, name: str, index: int) -> str | None:
        """The name of a parameter given by index, or by name where the index is -1; None where there is none."""
        if index == -1:
            return name if name in self._rows else None
        return self.names[index] if 0 <= index < len(self.names) else None

    def set(self, name: str, value: float) -> bool:
        """Set a parameter that can be set; False where there is none of that name. Never raises."""
        row = self._rows.get(name)
        if row is None:
            return False
        kind, limits = row
        if limits is not None and math.isfinite(value):
            low, high = limits
            inside = min(high, max(low, value))
            self._values[name] = inside if kind == _REAL32 else float(round(inside))
            self._sticks.clear()
        return True

    def stick(self, channel: int) -> Calibration:
        """How a stick is read."""
        found = self._sticks.get(channel)
        if found is None:
            low_us, trim_us, high_us, dead_zone_us, reverse = (
                self._values.get(f"RC{channel}_{part}", default) for part, default in STICK_DEFAULTS
            )
            found = self._sticks[channel] = Calibration(
                low_us=low_us, trim_us=trim_us, high_us=high_us, dead_zone_us=dead_zone_us, reversed=reverse != 0.0
            )
        return found

    def message(self, name: str, *, changed: bool = False) -> Any:
        """PARAM_VALUE; ArduPilot sends every type as a float, and a change without its index."""
        kind, _ = self._rows[name]
        index = NO_INDEX if changed else self.names.index(name)
        return dialect.MAVLink_param_value_message(name.encode(), self._values[name], kind, len(self.names), index)
