"""The ArduPilot parameters that decide whether motor commands reach the motors unbent, and what follows if they stop.

Those that the simulation acts on can be set, within ArduPilot's range; the rest are listed and stand as they are.
"""

from __future__ import annotations

from asvhil.config import FrontseatConfig, MotorOutputConfig, PwmConfig
from asvhil.simplant.ardurover.delivered import delivered_parameters
from asvhil.simplant.vehicle.parameter_table import INT8, INT16, INT32, REAL32, ParameterTable, Row
from asvhil.simplant.vehicle.rc import ChannelCalibration

FIXED = None  # not modelled: the value stands whatever is asked
PULSES = (800.0, 2200.0)
DEAD_ZONE_US = 30.0  # ArduRover's default, of both motors' sticks
FUNCTIONS = (-1.0, 188.0)
PORT_MOTOR, STARBOARD_MOTOR = 73, 74  # SERVOn_FUNCTION: throttle left and right
STICKS = (1, 3)  # RCMAP_ROLL and RCMAP_THROTTLE by default

OUTPUTS = 16  # and as many channels of the transmitter


def _identity(config: FrontseatConfig) -> tuple[Row, ...]:
    """Names that changed with firmware 4.7."""
    old = config.firmware == "4.6"
    new: tuple[Row, ...] = (
        ("MAV_GCS_SYSID_HI", 0, INT16, (0.0, 255.0)),
        ("RC_FS_TIMEOUT", config.neutral_timeout_s, REAL32, (0.1, 10.0)),
        ("MOT_REV_DELAY", 0, REAL32, FIXED),
    )
    return (
        ("SYSID_THISMAV" if old else "MAV_SYSID", config.system_id, INT16, FIXED),
        ("SYSID_MYGCS" if old else "MAV_GCS_SYSID", config.mygcs_system_id, INT16, (1.0, 255.0)),
        *(() if old else new),
        ("ARMING_CHECK", 1, INT32, (0.0, 2.0**20)) if old else ("ARMING_SKIPCHK", 0, INT32, (-1.0, 2.0**20)),
        ("SYSID_ENFORCE", 0, INT8, (0.0, 1.0)) if old else ("MAV_OPTIONS", 0, INT8, (0.0, 1.0)),
    )


def _channel(number: int, dead_zone_us: int) -> tuple[Row, ...]:
    """A channel of the transmitter."""
    rc = f"RC{number}"
    return (
        (f"{rc}_MIN", 1000, INT16, PULSES),
        (f"{rc}_TRIM", 1500, INT16, PULSES),
        (f"{rc}_MAX", 2000, INT16, PULSES),
        (f"{rc}_REVERSED", 0, INT8, (0.0, 1.0)),
        (f"{rc}_DZ", dead_zone_us, INT16, (0.0, 200.0)),
    )


def _output(number: int, function: int, motor: MotorOutputConfig) -> tuple[Row, ...]:
    servo = f"SERVO{number}"
    return (
        (f"{servo}_MIN", 1000, INT16, PULSES),
        (f"{servo}_TRIM", motor.neutral_us or 1500, INT16, PULSES),
        (f"{servo}_MAX", 2000, INT16, PULSES),
        (f"{servo}_REVERSED", int(bool(motor.reversed)), INT8, (0.0, 1.0)),
        (f"{servo}_FUNCTION", function, INT16, FUNCTIONS),
    )


class MotorOutput:
    """An output (from 1) with the function of a motor, and what becomes of a throttle there."""

    PARTS = ("MIN", "TRIM", "MAX", "REVERSED")
    __slots__ = ("_high_us", "_low_us", "_sense", "_trim_us", "function", "number")

    def __init__(
        self, number: int, function: int, low_us: float, trim_us: float, high_us: float, reverse: float
    ) -> None:
        self.number, self.function = number, function
        self._low_us, self._trim_us, self._high_us = low_us, trim_us, high_us
        self._sense = -1.0 if reverse else 1.0

    def pulse_us(self, throttle: float) -> int:
        """Pulse width for a throttle in [-1, 1], cut as ArduPilot does, away from its trim."""
        share = min(1.0, max(-1.0, self._sense * throttle))
        span_us = self._high_us - self._trim_us if share > 0.0 else self._trim_us - self._low_us
        offset_us = int(abs(share) * span_us + 1e-6)
        return int(self._trim_us) + (offset_us if share > 0.0 else -offset_us)


class Parameters(ParameterTable):
    """Every type travels as a float, as ArduPilot sends them."""

    def __init__(self, config: FrontseatConfig, pwm: PwmConfig) -> None:
        port, starboard = pwm.outputs
        first, second = STICKS
        dead_zones_us = {first: config.rc1_dz_us, second: config.rc3_dz_us}
        functions = {port: PORT_MOTOR, starboard: STARBOARD_MOTOR}
        motors = {port: pwm.port, starboard: pwm.starboard}
        plain = MotorOutputConfig()
        known: tuple[Row, ...] = (
            *_identity(config),
            ("PILOT_STEER_TYPE", 1, INT8, (0.0, 3.0)),
            *(row for n in range(1, OUTPUTS + 1) for row in _channel(n, dead_zones_us.get(n, 0))),
            *(row for n in range(1, OUTPUTS + 1) for row in _output(n, functions.get(n, 0), motors.get(n, plain))),
            ("RC_OVERRIDE_TIME", config.override_timeout_s, REAL32, (-1.0, 120.0)),
            ("RC_OPTIONS", 32, INT32, (0.0, 32767.0)),
            ("MOT_SLEWRATE", 0, INT16, (0.0, 1000.0)),
            ("MOT_THR_MIN", 0, INT8, (0.0, 20.0)),
            ("MOT_THR_MAX", 100, INT8, (5.0, 100.0)),
            ("MOT_THST_EXPO", 0, REAL32, (-1.0, 1.0)),
            ("MOT_THST_ASYM", 1, REAL32, (1.0, 10.0)),
            ("MOT_STR_THR_MIX", 0.5, REAL32, (0.2, 1.0)),
            ("MOT_SPD_SCA_BASE", 1, REAL32, (0.0, 10.0)),
            ("MOT_PWM_TYPE", 0, INT8, FIXED),
            ("MANUAL_STR_EXPO", 0, REAL32, (-0.5, 0.95)),
            ("MANUAL_OPTIONS", 0, INT32, (0.0, 1.0)),
            ("ARMING_RUDDER", 0, INT8, (0.0, 2.0)),  # ArduRover's default is 2
            ("FS_ACTION", 2, INT8, (0.0, 5.0 if config.firmware == "4.6" else 6.0)),
            ("FS_THR_ENABLE", 1, INT8, (0.0, 2.0)),
            ("FS_THR_VALUE", 910, INT16, (0.0, 2200.0)),
            ("FS_TIMEOUT", 1.5, REAL32, FIXED),
            ("FS_GCS_ENABLE", 0, INT8, (0.0, 2.0)),
            ("FS_GCS_TIMEOUT", 5.0, REAL32, (2.0, 120.0)),
            ("AHRS_TRIM_X", 0, REAL32, FIXED),
            ("AHRS_TRIM_Y", 0, REAL32, FIXED),
            ("FENCE_ACTION", 1, INT8, FIXED),
            ("BRD_SAFETY_DEFLT", 0, INT8, (0.0, 1.0)),
            ("RCMAP_ROLL", first, INT8, (1.0, 16.0)),
            ("RCMAP_THROTTLE", second, INT8, (1.0, 16.0)),
            ("FRAME_CLASS", 2, INT8, FIXED),
            ("INITIAL_MODE", 0, INT8, FIXED),
            ("SCHED_LOOP_RATE", config.loop_hz, INT16, FIXED),
            ("SCR_ENABLE", 0, INT8, (0.0, 1.0)),
            ("SCR_VM_I_COUNT", 10000, INT32, (1000.0, 1e6)),
        )
        delivered = delivered_parameters(config)
        rows = [(name, delivered.pop(name, value), kind, limits) for name, value, kind, limits in known]
        rows += [(name, value, REAL32, FIXED) for name, value in delivered.items()]
        self._dead_zones = (f"RC{first}_DZ", f"RC{second}_DZ")
        self._late: list[str] = []
        self.changes = 0  # counts them, so that who makes something of several parameters does so once for each
        self._mapped: tuple[int, int] | None = None
        self._sticks: dict[int, ChannelCalibration] = {}
        self._functions: tuple[int, ...] | None = None
        self._motor_outputs: tuple[MotorOutput, ...] | None = None
        self.mygcs_name = rows[1][0]
        super().__init__("simulated ArduRover", rows, config.parameters)

    def is_station(self, system_id: int) -> bool:
        """Whether a system is the ground station, or since 4.7 within the range of them."""
        first = self[self.mygcs_name]
        last = self.get("MAV_GCS_SYSID_HI", first)
        return first <= system_id <= max(first, last)

    def stick(self, channel: int) -> ChannelCalibration:
        """How a stick is read."""
        found = self._sticks.get(channel)
        if found is None:
            low_us, trim_us, high_us, dead_zone_us, reverse = (
                self[f"RC{channel}_{part}"] for part in ("MIN", "TRIM", "MAX", "DZ", "REVERSED")
            )
            found = self._sticks[channel] = ChannelCalibration(
                low_us=low_us, trim_us=trim_us, high_us=high_us, dead_zone_us=dead_zone_us, reversed=reverse != 0.0
            )
        return found

    @property
    def mapped(self) -> tuple[int, int]:
        """The channels that drive, which a real one reads anew each second."""
        if self._mapped is None:
            self._mapped = int(self["RCMAP_ROLL"]), int(self["RCMAP_THROTTLE"])
        return self._mapped

    def begin_setup(self) -> None:
        """Power on: a dead zone that is at its default reads 0 until the default is set."""
        self.end_setup()
        self._late = [name for name in self._dead_zones if self[name] == DEAD_ZONE_US]
        for name in self._late:
            self._put(name, 0.0)

    def end_setup(self) -> None:
        """The defaults are set where nothing else was written; a 0 that was written changed nothing, and is lost."""
        for name in self._late:
            if self[name] == 0.0:
                self._put(name, DEAD_ZONE_US)
        self._late = []

    @property
    def functions(self) -> tuple[int, ...]:
        """SERVOn_FUNCTION of every output, from the first."""
        if self._functions is None:
            self._functions = tuple(int(self[f"SERVO{n}_FUNCTION"]) for n in range(1, OUTPUTS + 1))
        return self._functions

    @property
    def motor_outputs(self) -> tuple[MotorOutput, ...]:
        """The outputs that have the function of a motor."""
        if self._motor_outputs is None:
            self._motor_outputs = tuple(
                MotorOutput(number, function, *(self[f"SERVO{number}_{part}"] for part in MotorOutput.PARTS))
                for number, function in enumerate(self.functions, start=1)
                if function in (PORT_MOTOR, STARBOARD_MOTOR)
            )
        return self._motor_outputs

    def _put(self, name: str, value: float) -> None:
        super()._put(name, value)
        self.changes += 1
        self._mapped = None
        self._sticks.clear()
        self._functions = None
        self._motor_outputs = None
