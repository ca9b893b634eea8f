"""A simulated PX4 boat on the link, sans-IO, as measured on a real one: docs/simulated-autopilots.md compares."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, GnssSensorConfig, PwmConfig
from asvhil.config.autopilots import px4_custom_mode
from asvhil.geo import LocalFrame
from asvhil.io.mavlink.frames import message_id
from asvhil.simplant.boat.sensors import Navigation
from asvhil.simplant.boat.vessel import Vessel
from asvhil.simplant.px4.commander import Px4Vehicle
from asvhil.simplant.px4.telemetry import RATES_HZ, Px4Telemetry
from asvhil.simplant.px4.traffic import OtherTraffic, RawFrame
from asvhil.simplant.vehicle.autopilot import (
    ACCEPTED,
    CUSTOM_MODE,
    DENIED,
    FAILED,
    SimulatedAutopilot,
    whole,
)
from asvhil.simplant.vehicle.schedule import Schedule
from asvhil.types import Frame

TEMPORARILY_REJECTED = int(dialect.MAV_RESULT_TEMPORARILY_REJECTED)
ROLL_PITCH_RATE_IGNORE = (
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
)
PEERS = 8  # whose heartbeats are forwarded to one another
POSITION_IGNORE, VELOCITY_IGNORE, ACCELERATION_IGNORE = 0b111, 0b111000, 0b111000000  # of a position target's mask


class SimulatedPx4(SimulatedAutopilot):
    """An autopilot with OFFBOARD, actuator sets and packed modes. Only heartbeats tell of mode and arming."""

    arming_refused = TEMPORARILY_REJECTED
    timesync_every_ns = 100_000_000

    def __init__(
        self,
        config: FrontseatConfig,
        pwm: PwmConfig,
        gnss: GnssSensorConfig,
        origin: LocalFrame,
        nav: Navigation,
        truth: Vessel,
        t_ns: int,
    ) -> None:
        self._loop_hz = config.loop_hz
        self.vehicle = Px4Vehicle(config, pwm, nav, t_ns)
        self._peers: list[str] = []
        self._messages = Px4Telemetry(self.vehicle, nav, truth, origin, gnss, config.px4_version)
        super().__init__(self.vehicle, self.vehicle.parameters, self._messages, config.system_id, t_ns)
        self._handlers |= {
            dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: self._on_attitude_target,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_position_target,
            dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: self._on_position_target,
        }
        self._commands[dialect.MAV_CMD_DO_SET_ACTUATOR] = self._do_set_actuator

    def reboot(self, t_ns: int) -> None:
        """Power on."""
        super().reboot(t_ns)
        self._traffic = OtherTraffic(self.vehicle.boot_ns)

    def loop(self, t_ns: int) -> list[Frame]:
        """One main loop, with the other messages of a real one."""
        vehicle = self.vehicle
        if t_ns >= vehicle.boot_ns:
            more = self._traffic.take_due(t_ns, (t_ns - vehicle.power_on_ns) // 1000)
            self._outbox += [("", message) for message in more]
        return super().loop(t_ns)

    def _dispatch(self, peer: str, data: bytes) -> None:
        """Forward heartbeats to the other stations, as PX4 does between its links."""
        if peer not in self._peers:
            self._peers = [*self._peers[1 - PEERS :], peer]
        if message_id(data) == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            self._outbox += [(other, RawFrame(data)) for other in self._peers if other != peer]
        super()._dispatch(peer, data)

    def _new_schedule(self, boot_ns: int) -> Schedule:
        messages = self._messages
        return Schedule(messages.streamed, messages.on_request, self._loop_hz, boot_ns, RATES_HZ, limited=False)

    def _tell_of_change(self, t_ns: int) -> None:
        """Nothing: the next heartbeat reports it."""

    def _set_message_interval(self, peer: str, m: Any) -> int:
        """The rate of HEARTBEAT cannot be changed; a stream that does not exist gives FAILED."""
        if m.param1 == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            return FAILED
        return ACCEPTED if super()._set_message_interval(peer, m) == ACCEPTED else FAILED

    def _do_set_mode(self, peer: str, m: Any) -> int:
        base_mode, main, sub = whole(m.param1), whole(m.param2), whole(m.param3)
        if base_mode is None or main is None or sub is None or not base_mode & CUSTOM_MODE:
            return DENIED
        if not (0 <= main <= 255 and 0 <= sub <= 255):
            return DENIED
        return ACCEPTED if self.vehicle.enter_mode(px4_custom_mode(main, sub)) else TEMPORARILY_REJECTED

    def _do_set_actuator(self, peer: str, m: Any) -> int:
        """Always accepted, as by PX4's commander; sets other than the first have no effect."""
        if m.get_type() == "COMMAND_LONG":
            fifth, sixth, index = m.param5, m.param6, m.param7
        else:
            fifth, sixth, index = float(m.x), float(m.y), m.z
        if whole(index + 0.5) == 0:
            self.vehicle.set_actuators([m.param1, m.param2, m.param3, m.param4, fifth, sixth])
        return ACCEPTED

    def _on_attitude_target(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        attitude = not m.type_mask & dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        if attitude or not m.type_mask & ROLL_PITCH_RATE_IGNORE:
            self.vehicle.offboard_signal()

    def _on_position_target(self, peer: str, sender: tuple[int, int], m: Any) -> None:
        given = [mask for mask in (POSITION_IGNORE, VELOCITY_IGNORE, ACCELERATION_IGNORE) if m.type_mask & mask != mask]
        if given:
            self.vehicle.offboard_signal(position=True)
