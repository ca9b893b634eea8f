"""Parameters of boats as they are delivered with an ArduRover, by firmware version."""

from __future__ import annotations

from asvhil.config import FrontseatConfig

# The BlueBoat: starboard on output 1, port on output 3 and reversed; nobody but a ground station to drive it.
_BLUEBOAT = {
    **{"FRAME_CLASS": 2, "FRAME_TYPE": 0, "SCHED_LOOP_RATE": 50, "BRD_SAFETY_DEFLT": 0, "SCR_ENABLE": 1},
    **{"SERVO1_FUNCTION": 74, "SERVO2_FUNCTION": 0, "SERVO3_FUNCTION": 73, "SERVO4_FUNCTION": 0},
    **{"SERVO1_MIN": 1100, "SERVO1_TRIM": 1510, "SERVO1_MAX": 1900, "SERVO1_REVERSED": 0},
    **{"SERVO3_MIN": 1100, "SERVO3_TRIM": 1510, "SERVO3_MAX": 1900, "SERVO3_REVERSED": 1},
    **{f"RC{n}_MIN": 1100 for n in range(1, 9)},
    **{f"RC{n}_TRIM": 1500 for n in range(1, 9)},
    **{f"RC{n}_MAX": 1901 if n == 1 else 1900 for n in range(1, 9)},
    **{f"RC{n}_DZ": 30 if n in (1, 3, 4) else 0 for n in range(1, 9)},
    **{"RCMAP_ROLL": 1, "RCMAP_THROTTLE": 3, "RC_OPTIONS": 37, "RC_OVERRIDE_TIME": 3, "PILOT_STEER_TYPE": 3},
    **{"MOT_SLEWRATE": 200, "MOT_THST_ASYM": 1.6, "MOT_THST_EXPO": 0, "MOT_STR_THR_MIX": 0.6, "MOT_PWM_TYPE": 0},
    **{"MOT_THR_MIN": 0, "MOT_THR_MAX": 100, "ARMING_REQUIRE": 1, "ARMING_RUDDER": 0},
    **{"FS_THR_ENABLE": 0, "FS_THR_VALUE": 910, "FS_TIMEOUT": 5, "FS_GCS_ENABLE": 2, "FS_GCS_TIMEOUT": 5},
    **{"FS_EKF_ACTION": 0, "FS_CRASH_CHECK": 0, "FENCE_ENABLE": 0, "BATT_FS_LOW_ACT": 0, "BATT_FS_CRT_ACT": 0},
    **{f"MODE{n}": 0 for n in range(1, 7)},
    **{"LOIT_TYPE": 0, "LOIT_RADIUS": 1, "CRUISE_SPEED": 1, "CRUISE_THROTTLE": 16},
    **{"EK3_SRC1_YAW": 1, "GPS1_RATE_MS": 200, "GPS1_POS_X": 0.16, "GPS1_POS_Y": 0.365, "GPS1_POS_Z": -0.22},
    **{"WNDVN_TYPE": 4, "WNDVN_SPEED_TYPE": 4, "WNDVN_TRUE_FILT": 0.05, "SERIAL6_PROTOCOL": 21, "SERIAL7_PROTOCOL": 21},
}
_BY_FIRMWARE = {
    "4.6": {"SYSID_MYGCS": 255, "SYSID_ENFORCE": 0, "FS_ACTION": 4, "ARMING_CHECK": 4124},
    "4.7": {
        **{"MAV_GCS_SYSID": 255, "MAV_GCS_SYSID_HI": 0, "FS_ACTION": 6, "ARMING_SKIPCHK": 1043938},
        **{"MOT_REV_DELAY": 0, "RC_FS_TIMEOUT": 1},
    },
}


def delivered_parameters(config: FrontseatConfig) -> dict[str, float]:
    """Name to value; empty where the boat is none that is delivered as a whole."""
    return {} if config.delivered is None else {**_BLUEBOAT, **_BY_FIRMWARE[config.firmware]}
