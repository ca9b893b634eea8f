"""Tables of the vehicle profiles: mode numbers, ways to the motors, and the message rates to request."""

from __future__ import annotations

from typing import Literal

Profile = Literal["ardurover", "px4"]
MotorOutput = Literal["rc_override", "manual_control", "set_servo", "set_actuator"]


def px4_custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode of a PX4 mode: the main mode in bits 16 to 23, the sub mode in bits 24 to 31."""
    return main << 16 | sub << 24


# Mode name to HEARTBEAT.custom_mode; the names of PX4's modes are those of MAVROS.
MODES: dict[Profile, dict[str, int]] = {
    "ardurover": {
        "MANUAL": 0,
        "ACRO": 1,
        "STEERING": 3,
        "HOLD": 4,
        "LOITER": 5,
        "FOLLOW": 6,
        "SIMPLE": 7,
        "DOCK": 8,
        "CIRCLE": 9,
        "AUTO": 10,
        "RTL": 11,
        "SMART_RTL": 12,
        "GUIDED": 15,
        "INITIALISING": 16,
    },
    "px4": {
        "MANUAL": px4_custom_mode(1),
        "ALTCTL": px4_custom_mode(2),
        "POSCTL": px4_custom_mode(3),
        "POSCTL.ORBIT": px4_custom_mode(3, 1),
        "POSCTL.SLOW": px4_custom_mode(3, 2),
        "AUTO.READY": px4_custom_mode(4, 1),
        "AUTO.TAKEOFF": px4_custom_mode(4, 2),
        "AUTO.LOITER": px4_custom_mode(4, 3),
        "AUTO.MISSION": px4_custom_mode(4, 4),
        "AUTO.RTL": px4_custom_mode(4, 5),
        "AUTO.LAND": px4_custom_mode(4, 6),
        "AUTO.RTGS": px4_custom_mode(4, 7),
        "AUTO.FOLLOW_TARGET": px4_custom_mode(4, 8),
        "AUTO.PRECLAND": px4_custom_mode(4, 9),
        "ACRO": px4_custom_mode(5),
        "OFFBOARD": px4_custom_mode(6),
        "STABILIZED": px4_custom_mode(7),
        "RATTITUDE": px4_custom_mode(8),
        "TERMINATION": px4_custom_mode(10),
    },
}
CONTROL_MODE: dict[Profile, str] = {"ardurover": "MANUAL", "px4": "OFFBOARD"}

# Ways to the motors, the default first; and why each of the others cannot work.
OUTPUTS: dict[Profile, tuple[MotorOutput, ...]] = {
    "ardurover": ("rc_override", "manual_control", "set_servo"),
    "px4": ("set_actuator",),
}
WHY_NOT: dict[tuple[Profile, MotorOutput], str] = {
    ("ardurover", "set_actuator"): "ArduPilot has no MAV_CMD_DO_SET_ACTUATOR",
    ("px4", "rc_override"): "PX4 mixes sticks by its own rover module, so that no channel is a motor",
    ("px4", "manual_control"): "PX4 mixes sticks by its own rover module, so that no axis is a motor",
    ("px4", "set_servo"): "PX4 has no MAV_CMD_DO_SET_SERVO on the link",
}

_COMMON_STREAMS_HZ = {
    "ATTITUDE": 20.0,
    "GLOBAL_POSITION_INT": 10.0,
    "RC_CHANNELS": 10.0,
    "GPS_RAW_INT": 1.0,
    "SYSTEM_TIME": 1.0,
}
STREAMS_HZ: dict[Profile, dict[str, float]] = {
    "ardurover": {**_COMMON_STREAMS_HZ, "HEARTBEAT": 5.0, "SERVO_OUTPUT_RAW": 10.0, "EKF_STATUS_REPORT": 2.0},
    # PX4's heartbeat has a fixed rate of 1 Hz.
    "px4": {**_COMMON_STREAMS_HZ, "ACTUATOR_OUTPUT_STATUS": 10.0, "ESTIMATOR_STATUS": 2.0},
}
IMU_MESSAGE: dict[Profile, str] = {"ardurover": "RAW_IMU", "px4": "HIGHRES_IMU"}
