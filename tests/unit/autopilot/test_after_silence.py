"""What stops the motors once we fall silent: an ArduRover's rules as they were measured on a real 4.6.3."""

import pytest

from asvhil.autopilot.after_silence import after_silence_of_ardurover, after_silence_of_px4
from asvhil.config import load_config
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Radio
from tests.support.after_silence import HEARD, MEASURED

DEFAULTS = {
    "FS_THR_ENABLE": 1.0, "RC_OVERRIDE_TIME": 3.0, "RC_OPTIONS": 32.0, "FS_ACTION": 2.0, "FS_GCS_ENABLE": 0.0,
    "FS_GCS_TIMEOUT": 5.0,
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
