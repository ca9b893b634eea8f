"""Tables of the autopilots and of the ways to their motors: mode numbers, and the message rates to request."""

from __future__ import annotations

from asvhil.config.registry import AUTOPILOTS, OUTPUTS, AutopilotKind, OutputKind


def px4_custom_mode(main: int, sub: int = 0) -> int:
    """HEARTBEAT.custom_mode of a PX4 mode: the main mode in bits 16 to 23, the sub mode in bits 24 to 31."""
    return main << 16 | sub << 24


# Mode name to HEARTBEAT.custom_mode; the names of PX4's modes are those of MAVROS.
ARDUROVER_MODES = {
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
}
PX4_MODES = {
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
}

_STREAMS_HZ = {
    "ATTITUDE": 20.0,
    "GLOBAL_POSITION_INT": 10.0,
    "RC_CHANNELS": 10.0,
    "GPS_RAW_INT": 5.0,
    "SYSTEM_TIME": 1.0,
    "SYS_STATUS": 2.0,
}

OUTPUTS.fill(
    (
        OutputKind(name="rc_override", build="asvhil.autopilot.motor_outputs:RcOverride", overrides_sticks=True),
        OutputKind(name="manual_control", build="asvhil.autopilot.motor_outputs:ManualControl", overrides_sticks=True),
        OutputKind(name="script", build="asvhil.autopilot.script_output:ScriptOutput", control_mode="HOLD"),
        OutputKind(name="set_servo", build="asvhil.autopilot.motor_outputs:SetServo"),
        OutputKind(name="set_actuator", build="asvhil.autopilot.motor_outputs:SetActuator"),
    )
)
AUTOPILOTS.fill(
    (
        AutopilotKind(
            name="ardurover",
            build="asvhil.autopilot.ardurover:build",
            modes=ARDUROVER_MODES,
            control_mode="MANUAL",
            outputs=("rc_override", "manual_control", "script", "set_servo"),
            unsuited={"set_actuator": "ArduPilot has no MAV_CMD_DO_SET_ACTUATOR"},
            streams_hz={
                **_STREAMS_HZ,
                "HEARTBEAT": 5.0,
                "SERVO_OUTPUT_RAW": 10.0,
                "EKF_STATUS_REPORT": 2.0,
                "RAW_IMU": 20.0,
            },
            imu_message="RAW_IMU",
            mav_autopilot=3,  # MAV_AUTOPILOT_ARDUPILOTMEGA
            firmware="ArduPilot",
            least_version=(4, 2),
        ),
        AutopilotKind(
            name="px4",
            build="asvhil.autopilot.px4:build",
            modes=PX4_MODES,
            control_mode="OFFBOARD",
            outputs=("set_actuator",),
            unsuited={
                "rc_override": "PX4 mixes sticks by its own rover module, so that no channel is a motor",
                "manual_control": "PX4 mixes sticks by its own rover module, so that no axis is a motor",
                "set_servo": "PX4 has no MAV_CMD_DO_SET_SERVO on the link",
                "script": "PX4 runs no scripts",
            },
            # PX4's heartbeat has a fixed rate of 1 Hz.
            streams_hz={
                **_STREAMS_HZ,
                "ACTUATOR_OUTPUT_STATUS": 10.0,
                "ESTIMATOR_STATUS": 2.0,
                "HIGHRES_IMU": 20.0,
            },
            imu_message="HIGHRES_IMU",
            mav_autopilot=12,  # MAV_AUTOPILOT_PX4
            firmware="PX4",
            least_version=(1, 13),
        ),
    )
)


def outputs_of(autopilot: AutopilotKind) -> tuple[str, ...]:
    """The ways to the motors of an autopilot, the default first."""
    others = (kind.name for kind in OUTPUTS if autopilot.name in kind.profiles)
    return (*autopilot.outputs, *(name for name in others if name not in autopilot.outputs))


def needed_mode(autopilot: AutopilotKind, way: OutputKind) -> str:
    """The only mode in which motors obey a way to them; empty where they do in any.

    What takes the place of the sticks moves a motor each only where the sticks do: other modes steer by them.
    """
    return way.control_mode or (autopilot.control_mode if way.overrides_sticks else "")
