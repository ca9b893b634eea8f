"""What stops the motors once we fall silent: an ArduRover's rules as they were measured on a real 4.6.3."""

import pytest

from asvhil.autopilot.after_silence import after_silence_of_ardurover, after_silence_of_px4
from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Radio
from tests.support.after_silence import HEARD, MEASURED

DEFAULTS = {
    "FS_THR_ENABLE": 1.0, "RC_OVERRIDE_TIME": 3.0, "RC_OPTIONS": 32.0, "FS_ACTION": 2.0, "FS_GCS_ENABLE": 0.0,
    "FS_GCS_TIMEOUT": 5.0, "SYSID_MYGCS": 1.0,
}  # fmt: skip


@pytest.mark.parametrize(("radio", "changed", "measured_s"), MEASURED)
@pytest.mark.parametrize("output", ["rc_override", "manual_control"])
def test_as_measured(output: str, radio: Radio, changed: dict[str, float], measured_s: float | None) -> None:
    link = load_config("sitl", (f"links.autopilot.output={output}",)).links.autopilot
    after = after_silence_of_ardurover(link, DEFAULTS | changed, radio)
    assert after is not None
    if measured_s is None or after.within_s is None:
        assert after.within_s is measured_s
    else:
        assert (
            measured_s - 0.2 <= after.within_s <= measured_s + 0.5
        )  # firmware 4.7 takes 0.5 s longer where radio ends


GROUND_STATION_ONLY = {"FS_THR_ENABLE": 0.0, "FS_GCS_ENABLE": 1.0}


@pytest.mark.parametrize(
    ("changed", "others", "bounded"),
    [
        ({}, False, True),
        ({}, True, False),  # another program of the vehicle's system sends heartbeats
        ({"SYSID_MYGCS": 255.0}, False, False),  # the pilot's station keeps it quiet, heard here or not
        ({"MAV_GCS_SYSID": 1.0, "MAV_GCS_SYSID_HI": 255.0}, False, False),
        ({"MAV_GCS_SYSID": 1.0, "MAV_GCS_SYSID_HI": 0.0}, False, True),
    ],
)
@pytest.mark.parametrize("radio", [Radio.ABSENT, Radio.LOST])
def test_the_ground_stations_fail_safe_stops_them_only_where_nobody_else_is_the_station(
    radio: Radio, changed: dict[str, float], others: bool, bounded: bool
) -> None:
    link = load_config("sitl").links.autopilot
    values = {
        name: value for name, value in DEFAULTS.items() if name != "SYSID_MYGCS" or "MAV_GCS_SYSID" not in changed
    }
    after = after_silence_of_ardurover(link, values | GROUND_STATION_ONLY | changed, radio, others=others)
    assert after is not None and (after.within_s is not None) is bounded


def test_the_time_out_of_the_radio_is_a_parameter_since_4_7() -> None:
    link = load_config("sitl").links.autopilot
    after = after_silence_of_ardurover(link, DEFAULTS | {"RC_FS_TIMEOUT": 2.5}, Radio.ABSENT)
    assert after is not None and after.within_s == 2.5


def test_a_blueboat_as_delivered_is_stopped_by_nothing_with_overrides_and_by_the_script() -> None:
    stock = {"RC_OPTIONS": 37.0, "FS_THR_ENABLE": 0.0, "FS_GCS_ENABLE": 2.0, "FS_ACTION": 4.0, "SYSID_MYGCS": 255.0}
    for output, within_s in (("rc_override", None), ("manual_control", None), ("script", 0.3)):
        link = load_config("sitl", (f"links.autopilot.output={output}",)).links.autopilot
        for radio in (Radio.ABSENT, Radio.HEARD, Radio.LOST):
            after = after_silence_of_ardurover(link, DEFAULTS | stock, radio)
            assert after is not None and after.within_s == within_s


def test_servo_commands_stand_for_ever_whatever_the_fail_safes() -> None:
    link = load_config("sitl", ("links.autopilot.output=set_servo",)).links.autopilot
    for radio in Radio:
        after = after_silence_of_ardurover(link, DEFAULTS, radio)
        assert after is not None and after.within_s is None


@pytest.mark.parametrize("missing", ["FS_THR_ENABLE", "RC_OVERRIDE_TIME"])
def test_what_has_not_answered_proves_nothing(missing: str) -> None:
    link = load_config("sitl").links.autopilot
    values = {name: value for name, value in DEFAULTS.items() if name != missing}
    assert after_silence_of_ardurover(link, values, Radio.ABSENT) is None


def test_overrides_that_are_ignored_leave_nothing_behind() -> None:
    after = after_silence_of_ardurover(load_config("sitl").links.autopilot, DEFAULTS | {"RC_OVERRIDE_TIME": 0}, HEARD)
    assert after is not None and after.within_s == 0.0


def test_a_px4_that_no_set_points_keep_in_offboard_is_stopped_by_nothing() -> None:
    right = {"COM_OBL_RC_ACT": 7.0, "COM_OF_LOSS_T": 1.0}
    after = after_silence_of_px4(right, keeps_offboard=False)
    assert after is not None and after.within_s is None
    after = after_silence_of_px4(right, keeps_offboard=True)
    assert after is not None and after.within_s == 1.0 and "disarms" in after.text
    assert after_silence_of_px4({"COM_OF_LOSS_T": 1.0}, keeps_offboard=True) is None
    assert after_silence_of_px4(right | {"COM_OBL_RC_ACT": 0.0}, keeps_offboard=True) is None  # a requirement tells it


def test_a_px4_in_another_control_mode_is_not_held() -> None:
    settings = ("supervisor.engage=command", "supervisor.control_mode=MANUAL")
    loop = Lockstep(load_config("sitl-px4", settings))
    for _ in range(200):
        _, outputs = loop.tick()
    notes = {note.subject: note.text for note in outputs.health.notes}
    assert notes["motors after a crash"].startswith("nothing stops them (no mode of PX4 but OFFBOARD")
