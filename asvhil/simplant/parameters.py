"""The few ArduPilot parameters that decide whether overrides reach the motors unbent."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig

_INT8 = dialect.MAV_PARAM_TYPE_INT8
_INT16 = dialect.MAV_PARAM_TYPE_INT16
_REAL32 = dialect.MAV_PARAM_TYPE_REAL32


FIXED = None  # not modelled: the value stands whatever is asked


class Parameters:
    """Values by name. Those that the simulation acts on can be set, within ArduPilot's range; the rest cannot."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        port, starboard = pwm.port_channel, pwm.starboard_channel
        self._rows: dict[str, tuple[int, tuple[float, float] | None]] = {}
        self._values: dict[str, float] = {}
        for name, value, kind, limits in (
            ("SYSID_THISMAV", config.system_id, _INT16, FIXED),
            ("SYSID_MYGCS", config.mygcs_system_id, _INT16, (1.0, 255.0)),
            ("PILOT_STEER_TYPE", 1, _INT8, (0.0, 3.0)),
            (f"RC{port}_DZ", config.rc1_dz_us, _INT16, (0.0, 200.0)),
            (f"RC{starboard}_DZ", config.rc3_dz_us, _INT16, (0.0, 200.0)),
            ("RC_OVERRIDE_TIME", config.override_timeout_s, _REAL32, (-1.0, 120.0)),
            ("RC_OPTIONS", 32, _INT16, (0.0, 32767.0)),
            ("MOT_SLEWRATE", 0, _INT16, (0.0, 1000.0)),
            ("FS_THR_ENABLE", 1, _INT8, (0.0, 2.0)),
            ("FS_TIMEOUT", 1.5, _REAL32, FIXED),
            ("RCMAP_ROLL", port, _INT8, FIXED),
            ("RCMAP_THROTTLE", starboard, _INT8, FIXED),
            (f"SERVO{port}_FUNCTION", 73, _INT16, FIXED),
            (f"SERVO{starboard}_FUNCTION", 74, _INT16, FIXED),
            ("FRAME_CLASS", 2, _INT8, FIXED),
            ("INITIAL_MODE", 0, _INT8, FIXED),
            ("SCHED_LOOP_RATE", config.loop_hz, _INT16, FIXED),
        ):
            self._rows[name] = kind, limits
            self._values[name] = float(value)
        self.names = tuple(self._rows)
        self._dead_zones = f"RC{port}_DZ", f"RC{starboard}_DZ"

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def dead_zones_us(self) -> tuple[int, int]:
        """Of the port and the starboard channel."""
        return int(self._values[self._dead_zones[0]]), int(self._values[self._dead_zones[1]])

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
        return True

    def message(self, name: str) -> Any:
        """PARAM_VALUE; ArduPilot sends every type as a float."""
        kind, _ = self._rows[name]
        return dialect.MAVLink_param_value_message(
            name.encode(), self._values[name], kind, len(self.names), self.names.index(name)
        )
