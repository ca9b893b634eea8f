"""The few ArduPilot parameters that decide whether overrides reach the motors unbent."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig

_INT8 = dialect.MAV_PARAM_TYPE_INT8
_INT16 = dialect.MAV_PARAM_TYPE_INT16
_REAL32 = dialect.MAV_PARAM_TYPE_REAL32


class Parameters:
    """Values by name. Those that the simulation acts on can be set; the rest keep their value, whatever is asked."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        port, starboard = pwm.port_channel, pwm.starboard_channel
        self._rows: dict[str, tuple[int, bool]] = {}
        self._values: dict[str, float] = {}
        for name, value, kind, settable in (
            ("SYSID_THISMAV", config.system_id, _INT16, False),
            ("SYSID_MYGCS", config.mygcs_system_id, _INT16, True),
            ("PILOT_STEER_TYPE", 1, _INT8, True),
            (f"RC{port}_DZ", config.rc1_dz_us, _INT16, True),
            (f"RC{starboard}_DZ", config.rc3_dz_us, _INT16, True),
            ("RC_OVERRIDE_TIME", config.override_timeout_s, _REAL32, True),
            ("RC_OPTIONS", 32, _INT16, True),
            ("MOT_SLEWRATE", 0, _INT16, True),
            ("FS_THR_ENABLE", 1, _INT8, True),
            ("FS_TIMEOUT", 1.5, _REAL32, False),
            ("RCMAP_ROLL", port, _INT8, False),
            ("RCMAP_THROTTLE", starboard, _INT8, False),
            (f"SERVO{port}_FUNCTION", 73, _INT16, False),
            (f"SERVO{starboard}_FUNCTION", 74, _INT16, False),
            ("FRAME_CLASS", 2, _INT8, False),
            ("INITIAL_MODE", 0, _INT8, False),
            ("SCHED_LOOP_RATE", config.loop_hz, _INT16, False),
        ):
            self._rows[name] = kind, settable
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
        kind, settable = row
        if settable and math.isfinite(value):
            limit = {_INT8: 127.0, _INT16: 32767.0}.get(kind)
            self._values[name] = value if limit is None else float(round(min(limit, max(-limit, value))))
        return True

    def message(self, name: str) -> Any:
        """PARAM_VALUE; ArduPilot sends every type as a float."""
        kind, _ = self._rows[name]
        return dialect.MAVLink_param_value_message(
            name.encode(), self._values[name], kind, len(self.names), self.names.index(name)
        )
