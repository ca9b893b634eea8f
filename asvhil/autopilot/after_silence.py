"""What an autopilot does with the motors once we fall silent, by its parameters and its radio. Pure.

The rules of an ArduRover were measured on a real one: docs/autopilots.md has the table.
"""

from __future__ import annotations

from collections.abc import Mapping

from asvhil.autopilot.ground_stations import station_systems
from asvhil.autopilot.px4_parameters import DISARM, TERMINATE
from asvhil.autopilot.script_protocol import TIMEOUT_S
from asvhil.config import AutopilotLinkConfig
from asvhil.types import Radio, record

RECEIVER_IGNORED = 1  # bit of RC_OPTIONS
FS_TIMEOUT_S = 1.5  # FS_TIMEOUT, by default
RADIO_SILENCE_S = 1.0  # RC_FS_TIMEOUT, by default: without radio input sticks count as neutral; 0.5 in firmware 4.6


@record
class AfterSilence:
    """What becomes of the motors: `text` says it; `within_s` (s) is None where nothing stops them."""

    text: str
    within_s: float | None


def after_silence_of_ardurover(
    link: AutopilotLinkConfig, values: Mapping[str, float], radio: Radio, *, others: bool = False
) -> AfterSilence | None:
    """What happens where this program or the link dies in a hold; None while a parameter for it has not answered.

    `others`: somebody else is heard whom the autopilot takes for its ground station, and who keeps that one's fail-safe
    quiet when we have died.
    """
    if link.output == "set_servo":
        return AfterSilence(text="DO_SET_SERVO has no time-out", within_s=None)
    if link.output == "script":
        return AfterSilence(text=f"the script's orders last {TIMEOUT_S:g} s", within_s=TIMEOUT_S)
    if "FS_THR_ENABLE" not in values or "RC_OVERRIDE_TIME" not in values:
        return None
    hold_s, throttle = values["RC_OVERRIDE_TIME"], values["FS_THR_ENABLE"]
    silence_s = values.get("RC_FS_TIMEOUT", RADIO_SILENCE_S)
    if hold_s == 0.0:
        return AfterSilence(text="they are not ours: RC_OVERRIDE_TIME 0 ignores overrides", within_s=0.0)
    receiver = radio is Radio.HEARD
    if radio in (Radio.HEARD, Radio.LOST) and int(values.get("RC_OPTIONS", 0)) & RECEIVER_IGNORED:
        receiver = False
        stops_s = hold_s + silence_s if hold_s > 0.0 else None  # its frames keep overrides in use until they end
    else:
        stops_s = silence_s
    if receiver and hold_s > 0.0:
        return AfterSilence(text=f"the sticks are back after {hold_s:g} s (RC_OVERRIDE_TIME)", within_s=hold_s)
    if not receiver and throttle != 0.0 and stops_s is not None:
        return AfterSilence(text=f"neutral within {stops_s:g} s (FS_THR_ENABLE)", within_s=stops_s)
    acts = receiver or values.get("FS_ACTION", 0.0) != 0.0  # it drops the overrides, whatever it does besides
    if values.get("FS_GCS_ENABLE", 0.0) != 0.0 and acts and not (others or may_be_others(link, values)):
        late_s = values.get("FS_GCS_TIMEOUT", 5.0) + FS_TIMEOUT_S
        return AfterSilence(text=f"fail-safe of the ground station after {late_s:g} s (FS_GCS_ENABLE)", within_s=late_s)
    if throttle != 0.0 or receiver:
        return AfterSilence(text=f"RC_OVERRIDE_TIME is {hold_s:g}: overrides never end", within_s=None)
    return AfterSilence(text=f"FS_THR_ENABLE is {throttle:g}, and no transmitter is heard", within_s=None)


def may_be_others(link: AutopilotLinkConfig, values: Mapping[str, float]) -> bool:
    """Whether more than our own system counts as the autopilot's ground station, such as the pilot's."""
    return station_systems(values) != (link.system_id, link.system_id)


def after_silence_of_px4(values: Mapping[str, float], *, keeps_offboard: bool) -> AfterSilence | None:
    """What happens where this program or the link dies in a hold; None while a parameter for it has not answered.

    A COM_OBL_RC_ACT that stops nothing is told by the requirement on it.
    """
    if not keeps_offboard:
        return AfterSilence(text="no mode of PX4 but OFFBOARD ends when set-points stop", within_s=None)
    action, late_s = values.get("COM_OBL_RC_ACT"), values.get("COM_OF_LOSS_T")
    if action not in (TERMINATE, DISARM) or late_s is None:
        return None
    word = "disarms" if action == DISARM else "terminates"
    return AfterSilence(text=f"PX4 {word} after {late_s:g} s (COM_OBL_RC_ACT)", within_s=late_s)
