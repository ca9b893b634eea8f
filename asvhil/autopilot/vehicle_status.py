"""Arming, mode, sticks and outputs of the vehicle, as its messages tell them. Sans-IO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any

from asvhil.autopilot.arming_checks import ArmingChecks
from asvhil.autopilot.batteries import FORGOTTEN_NS, Batteries, charge
from asvhil.autopilot.bursts import time_of_its_own
from asvhil.autopilot.disarming import Disarming
from asvhil.autopilot.motor_outputs import IGNORE_CHANNEL
from asvhil.autopilot.parameter_watch import ParameterWatch
from asvhil.autopilot.transmitter import Transmitter
from asvhil.autopilot.wiring import Pulses
from asvhil.io.mavlink.frames import dialect
from asvhil.types import FrontseatStatus, Radio

NO_VOLTAGE = 0xFFFF  # mV in SYS_STATUS, as 0 of a monitor that is not set up
UNKNOWN_SATELLITES = 255
SILENT_NS = 10_000_000_000  # the estimator's word comes each half second, from some each other second
BOOTING = (dialect.MAV_STATE_BOOT, dialect.MAV_STATE_CALIBRATING)
CHANNELS_OF = attrgetter(*(f"chan{i}_raw" for i in range(1, 19)))  # of RC_CHANNELS
OUTPUTS_OF = attrgetter(*(f"servo{i}_raw" for i in range(1, 17)))  # of SERVO_OUTPUT_RAW


class VehicleStatus:
    """Takes messages in and gives the status that they come to; every handler gives it anew.

    `keeps_overrides`: without a receiver that it listens to, the autopilot goes on with the last override of a stick.
    """

    def __init__(self, modes: Mapping[str, int], parameters: ParameterWatch, *, keeps_overrides: bool) -> None:
        self._mode_names = {number: name for name, number in modes.items()}
        self._parameters = parameters
        self._keeps_overrides = keeps_overrides
        self.armed = False
        self.mode = ""
        self._ready = self._was_ready = self._has_attitude = False
        self._estimator_ns: int | None = None  # when its estimator was heard last
        self.booting = False
        self.arming_fault = ""
        self.transmitter = Transmitter()
        self.arming_checks = ArmingChecks()
        self.disarming = Disarming(lambda: parameters.fence_disarms)
        self._rc_us: tuple[int, ...] = ()
        self._outputs_us: tuple[int, ...] = ()
        self._sticks_us: Pulses | None = None
        self._motors_us: Pulses | None = None
        self._rc_ns = self._outputs_ns = 0
        self._battery_v: float | None = None
        self._battery_percent: float | None = None
        self._battery_a: float | None = None
        self._battery_ns = 0
        self._batteries = Batteries()
        self._fix: tuple[int | None, int | None] = (None, None)

    def restart(self, booted_ns: int) -> None:
        """The autopilot has rebooted, at that time by its clock."""
        self._ready = self._was_ready = self._has_attitude = False
        self._estimator_ns = None
        self.transmitter.restart()
        self.arming_checks.restart()
        self.disarming.restart(booted_ns)
        self._batteries.restart()

    def note_estimator(self, t_ns: int, *, position: bool, attitude: bool) -> None:
        """What the autopilot's own estimator says that it knows."""
        self._estimator_ns = t_ns
        self._ready, self._has_attitude = position, attitude
        self._was_ready |= position

    def ready(self, t_ns: int) -> bool:
        """Whether the position of the autopilot's estimator is good for a hold; not by a word of long ago."""
        return self._ready and not self.estimator_is_silent(t_ns)

    @property
    def knows_attitude(self) -> bool:
        """Whether heading and yaw rate of the autopilot's estimator are good.

        Before it has its first position its heading may not be aligned; later it keeps it without a receiver.
        """
        return self._ready or (self._was_ready and self._has_attitude)

    def estimator_is_silent(self, t_ns: int) -> bool:
        """Whether the autopilot's estimator has told what it knows, and no longer does."""
        return self._estimator_ns is not None and t_ns - self._estimator_ns > SILENT_NS

    @property
    def keeps_override(self) -> bool:
        """Whether the last override of a stick stands after its release, for want of a receiver to take its place."""
        return self._keeps_overrides and (
            self._parameters.receiver_ignored or self.transmitter.radio in (Radio.ABSENT, Radio.LOST)
        )

    def status(self, t_ns: int) -> tuple[FrontseatStatus]:
        """As a handler of a message gives it."""
        self.arming_fault = self.arming_checks.fault(t_ns)
        wiring, receiver_ignored = self._parameters.wiring, self._parameters.receiver_ignored
        batteries = self._batteries.sum(t_ns)
        is_fresh = t_ns - self._battery_ns < FORGOTTEN_NS
        percent, lowest = self._battery_percent if is_fresh else None, self._batteries.lowest_percent(t_ns)
        if percent is None or (lowest is not None and lowest < percent):
            percent = lowest  # SYS_STATUS tells the charge of the first alone (ArduPilot)
        status = FrontseatStatus(
            t_ns=t_ns,
            armed=self.armed,
            mode=self.mode,
            ready=self.ready(t_ns),
            rc_us=self._rc_us,
            outputs_us=self._outputs_us,
            motor_channels=wiring.channels,
            centres_us=wiring.centres_us,
            receiver_ignored=receiver_ignored,
            keeps_override=self.keeps_override,
            sticks_us=self._sticks_us,
            motors_us=self._motors_us,
            rc_ns=self._rc_ns,
            outputs_ns=self._outputs_ns,
            radio=self.transmitter.radio,
            disarmed_itself=self.disarming.itself,
            arming_fault="" if self.armed else self.arming_fault,
            battery_v=self._battery_v if is_fresh else None,
            battery_percent=percent,
            battery_a=self._battery_a if is_fresh else None,
            battery_ns=self._battery_ns,
            batteries=batteries,
            battery_complaint=self._batteries.complaint(t_ns),
            fix=self._fix[0],
            satellites=self._fix[1],
        )
        return (status,)

    def on_heartbeat(self, t_ns: int, m: Any) -> bool:
        """Take in mode and arming. Whether the set-up after a boot has ended."""
        self.armed = bool(m.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        self.disarming.on_heartbeat(t_ns, armed=self.armed)
        self.mode = self._mode_names.get(m.custom_mode, f"MODE_{m.custom_mode}")
        was_booting, self.booting = self.booting, m.system_status in BOOTING
        return was_booting and not self.booting

    def on_rc_channels(self, t_ns: int, m: Any) -> Sequence[FrontseatStatus]:
        """RC_CHANNELS."""
        self._rc_ns = time_of_its_own(t_ns, self._rc_ns)
        channels: tuple[int, ...] = CHANNELS_OF(m)
        if IGNORE_CHANNEL in channels:
            channels = tuple([0 if value == IGNORE_CHANNEL else value for value in channels])
        self._rc_us = channels
        self._sticks_us = self._parameters.wiring.of_sticks(self._rc_us)
        self.transmitter.on_rc_channels(t_ns, m.chancount, m.rssi)
        return self.status(t_ns)

    def on_servo_output(self, t_ns: int, m: Any) -> Sequence[FrontseatStatus]:
        """SERVO_OUTPUT_RAW: the first 16 outputs come with port 0."""
        return self.on_outputs(t_ns, OUTPUTS_OF(m)) if m.port == 0 else ()

    def on_outputs(self, t_ns: int, outputs_us: tuple[int, ...]) -> Sequence[FrontseatStatus]:
        """Pulse widths (us) of the outputs, from the first; 0: no signal."""
        self._outputs_ns = time_of_its_own(t_ns, self._outputs_ns)
        self._outputs_us = outputs_us
        self._motors_us = self._parameters.wiring.of_outputs(outputs_us)
        return self.status(t_ns)

    def on_sys_status(self, t_ns: int, m: Any) -> Sequence[FrontseatStatus]:
        """SYS_STATUS."""
        health = m.onboard_control_sensors_health
        self._battery_v = 1e-3 * m.voltage_battery if 0 < m.voltage_battery < NO_VOLTAGE else None
        self._battery_percent = charge(m.battery_remaining)
        self._battery_a = 0.01 * m.current_battery if m.current_battery >= 0 else None  # -1: not measured
        self._battery_ns = t_ns
        self.transmitter.on_sys_status(t_ns, m.onboard_control_sensors_present, health)
        self.arming_checks.on_sys_status(m.onboard_control_sensors_enabled, health)
        return self.status(t_ns)

    def on_battery(self, t_ns: int, m: Any) -> Sequence[FrontseatStatus]:
        """BATTERY_STATUS."""
        self._batteries.receive(t_ns, m)
        return self.status(t_ns)

    def on_fix(self, m: Any) -> None:
        """Take in quality and satellites of GPS_RAW_INT; the next status tells them."""
        known = m.satellites_visible != UNKNOWN_SATELLITES
        self._fix = (int(m.fix_type), int(m.satellites_visible) if known else None)

    def on_text(self, t_ns: int, m: Any) -> Sequence[FrontseatStatus]:
        """STATUSTEXT."""
        self.arming_checks.on_text(t_ns, m)
        if self.disarming.on_text(t_ns, m):
            self.armed = False  # its heartbeat says so up to a second later
        return self.status(t_ns)
