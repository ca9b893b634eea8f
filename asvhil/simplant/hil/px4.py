"""PX4's simulator interface, sans-IO: sensors out, motor controls in, in lockstep where PX4 says so.

PX4's clock is the time in HIL_SENSOR. Until its first HIL_ACTUATOR_CONTROLS, and for good where that lacks the lockstep
flag (a real board), samples go out in real time. In lockstep a sample goes out when the last one has been answered.
Some vehicles answer only every second or third sample (rovers, whose loops run at 100 Hz: at 250 samples a second after
2 and 3 by turns), so the longest of the last distances says which sample to wait at; and one without answer for
`answer_timeout_s` holds nothing up.

A PX4 that falls silent drives no motor: a rover that is disarmed, or whose controller has nothing to do, sends no
controls at all. After `SILENT_US` of PX4's time without an answer the motors are off, as without a signal, and lockstep
is over until the next answer.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

from asvhil.config import Config
from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.simplant.hil.plant import OFF, HilPlant
from asvhil.simplant.hil.px4_messages import HilMessages
from asvhil.types import Frame

PORT = "physics"
COMPONENT_ID = 200
LOCKSTEP = 1  # bit of HIL_ACTUATOR_CONTROLS.flags
HEARTBEAT_NS = 1_000_000_000  # a board starts MAVLink on its USB port once it has heard some
CATCH_UP_NS = 100_000_000  # a host that stalls longer makes the plant's time stand still
REBOOT_US = 1_000_000  # PX4's time runs back by more than this only when it has started anew
MAX_STRIDE = 25
STRIDES = 8  # answers whose distances are looked at
SILENT_US = 200_000
FASTEST_US, SLOWEST_US = 1_000, 20_000
TERMINATED, TERMINATED_BAND = -1.8, 0.01  # 600 us: what PX4's simulated outputs say for their fail-safe value
NEVER_NS = 2**63


@dataclass
class Px4Counters:
    """What went and came. `unanswered`: samples in lockstep whose answer was awaited in vain."""

    samples: int = 0
    answers: int = 0
    unanswered: int = 0
    duplicates: int = 0
    silences: int = 0
    restarts: int = 0
    garbage_bytes: int = 0


class Px4Hil:
    """The simulator's side of one connection: `connect`, then `receive` what comes and `poll` when `next_ns` is due."""

    def __init__(self, config: Config) -> None:
        section = config.plant.hil.px4
        self._whole, self._config = config, section
        self._pwm = config.vehicle.pwm
        self._band_us = config.plant.hil.neutral_band_us
        self._system_id = config.plant.frontseat.system_id
        self._asked_us = self._step_us = round(1e6 / section.sensor_hz)
        self._slow_us = round(1e6 / section.slow_sensor_hz)
        self.plant = HilPlant(config, self._step_us * 1e-6, sample_each_step=True)
        self.counters = Px4Counters()
        self.connected = False
        self._forget(0)

    def connect(self, t_ns: int) -> None:
        """A link to an autopilot that starts: the boat is at its start, time at 0."""
        if self.counters.samples:
            self.counters.restarts += 1
            self.plant.restart()
        self.connected = True
        self._forget(t_ns)

    def disconnect(self) -> None:
        """The autopilot has left: time stands still."""
        self.connected = False

    def _forget(self, t_ns: int) -> None:
        self._mav = dialect.MAVLink(None, srcSystem=self._system_id, srcComponent=COMPONENT_ID)
        self._messages = HilMessages(self._whole, self.plant)
        self._splitter = FrameSplitter()
        self._heard = self.lockstep = self.armed = self.silent = False
        self.outputs_us = OFF
        self._neutral = True
        self._answered_us: int | None = None  # PX4's time in its last answer
        self._strides: deque[int] = deque([1], STRIDES)  # samples from one answer to the next
        self._since = 0  # samples sent since the last that was answered
        self._due_ns = self._sent_ns = self._heartbeat_ns = t_ns
        self._fixes = 0
        self._slow_due_us = self._truth_due_us = 0
        self._truth_us = 0  # interval of the truth; 0: not asked for

    # --- what comes ---------------------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[Frame]:
        """Bytes from the autopilot; what to answer at once."""
        splitter = self._splitter
        before = splitter.garbage_bytes
        sent: list[Frame] = []
        for data in splitter.receive(frame.data):
            message = decode(data)
            if message is None:
                continue
            if not self._heard:
                self._heard = True
                self._due_ns = frame.t_ns
            kind = message.get_msgId()
            if kind == dialect.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS:
                self._on_controls(message, frame.t_ns)
            elif kind == dialect.MAVLINK_MSG_ID_COMMAND_LONG:
                result = self._on_command(message)
                ack = dialect.MAVLink_command_ack_message(message.command, result)
                sent.append(self._frame(frame.t_ns, ack))
        self.counters.garbage_bytes += splitter.garbage_bytes - before
        return sent

    def _on_controls(self, message: Any, t_ns: int) -> None:
        now_us = int(message.time_usec)
        last_us = self._answered_us
        if last_us is not None and now_us < last_us - REBOOT_US:
            self.counters.restarts += 1
            self.plant.restart()
            self._forget(t_ns)
            self._heard = True
            last_us = None
        elif last_us is not None and now_us <= last_us:
            self.counters.duplicates += 1
            return
        self.counters.answers += 1
        if self.silent:
            self.silent, last_us = False, None
        self.armed = bool(message.mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)
        controls = message.controls
        self._drive(controls[self._config.port_control - 1], controls[self._config.starboard_control - 1])
        if last_us is not None:
            self._strides.append(max(1, min(MAX_STRIDE, round((now_us - last_us) / self._step_us))))
        self._answered_us = now_us
        # An answer may be late: it is to the sample whose time it bears, and later ones are still to be answered.
        behind = round((self.plant.t_ns // 1000 - now_us) / self._step_us)
        self._since = behind if 0 <= behind <= self._since else 0
        self.lockstep = bool(message.flags & LOCKSTEP)

    def _watch_for_silence(self) -> None:
        """Motors off, and no more waiting for answers, once PX4 has sent no controls for a while."""
        answered_us = self._answered_us
        if answered_us is None or self.silent or self.plant.t_ns // 1000 - answered_us < SILENT_US:
            return
        self.silent = True
        self.counters.silences += 1
        self.lockstep = self.armed = False
        self.outputs_us, self._neutral = OFF, True

    def _drive(self, port: float, starboard: float) -> None:
        if not self.armed:
            self.outputs_us, self._neutral = OFF, True
            return
        neutral_us, band_us = self._pwm.neutral_us, self._band_us
        self.outputs_us = self._pulse_us(port), self._pulse_us(starboard)
        self._neutral = all(abs(pulse_us - neutral_us) <= band_us for pulse_us in self.outputs_us)

    def _pulse_us(self, control: float) -> int:
        """The pulse width of a control in [-1, 1]; neutral where the motor is off: NaN, or PX4 has terminated."""
        pwm = self._pwm
        if math.isnan(control) or abs(control - TERMINATED) <= TERMINATED_BAND:
            return pwm.neutral_us
        span_us = pwm.ahead_us - pwm.neutral_us if control >= 0.0 else pwm.neutral_us - pwm.astern_us
        return pwm.neutral_us + round(max(-1.0, min(1.0, control)) * span_us)

    def _on_command(self, message: Any) -> int:
        """MAV_RESULT of a command: the intervals of the truth and of the sensors can be set."""
        if message.command != dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            return int(dialect.MAV_RESULT_UNSUPPORTED)
        msg_id, interval_us = message.param1, message.param2
        if not math.isfinite(interval_us):
            return int(dialect.MAV_RESULT_DENIED)
        if msg_id == dialect.MAVLINK_MSG_ID_HIL_STATE_QUATERNION:
            self._truth_us = round(interval_us) if interval_us >= 1.0 else 0
            self._truth_due_us = self.plant.t_ns // 1000
            return int(dialect.MAV_RESULT_ACCEPTED)
        if msg_id == dialect.MAVLINK_MSG_ID_HIL_SENSOR:
            asked_us = self._asked_us if interval_us == 0.0 else round(interval_us)
            if FASTEST_US <= asked_us <= SLOWEST_US:
                self._step_us = asked_us
                self._strides = deque([1], STRIDES)
                self.plant.set_step(asked_us * 1e-6)
                return int(dialect.MAV_RESULT_ACCEPTED)
        return int(dialect.MAV_RESULT_DENIED)

    # --- what goes ----------------------------------------------------------------------------------------------

    @property
    def next_ns(self) -> int:
        """When `poll` is to be called next, unless something comes first."""
        if not self.connected:
            return NEVER_NS
        return min(self._heartbeat_ns, self._sample_ns)

    @property
    def _awaits(self) -> bool:
        """Whether the next sample is for after the answer to the last."""
        return self.lockstep and self._since >= max(self._strides)

    @property
    def _sample_ns(self) -> int:
        if not self._heard:
            return NEVER_NS
        if self._awaits:
            return max(self._due_ns, self._sent_ns + round(1e9 * self._config.answer_timeout_s))
        return self._due_ns

    def poll(self, t_ns: int) -> list[Frame]:
        """What is due: a heartbeat, or one step of the plant and its sensors, with what others sent on their links."""
        sent: list[Frame] = []
        if not self.connected:
            return sent
        if t_ns >= self._heartbeat_ns:
            self._heartbeat_ns = t_ns + HEARTBEAT_NS
            heartbeat = dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_GENERIC, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
            )
            sent.append(self._frame(t_ns, heartbeat))
        if t_ns >= self._sample_ns:
            sent += self._sample(t_ns)
        return sent

    def _sample(self, t_ns: int) -> list[Frame]:
        if self._awaits:
            self.counters.unanswered += 1
        self._watch_for_silence()
        sent = self.plant.step(self.outputs_us, neutral=self._neutral)
        self.counters.samples += 1
        self._since += 1
        self._sent_ns = t_ns
        speed = self._config.speed or (0.0 if self.lockstep else 1.0)
        span_ns = 0 if speed == 0.0 else round(1000.0 * self._step_us / speed)
        late = t_ns - self._due_ns > CATCH_UP_NS
        self._due_ns = (t_ns if late or speed == 0.0 else self._due_ns) + span_ns
        now_us = self.plant.t_ns // 1000
        messages = []
        # The truth and the fix go before the sample: PX4's clock moves on with the latter.
        if self._truth_us and now_us >= self._truth_due_us:
            self._truth_due_us = _next_due(self._truth_due_us, self._truth_us, now_us)
            messages.append(self._messages.truth())
        if self.plant.navigation.fixes != self._fixes:
            self._fixes = self.plant.navigation.fixes
            messages.append(self._messages.gps())
        slow = now_us >= self._slow_due_us
        if slow:
            self._slow_due_us = _next_due(self._slow_due_us, self._slow_us, now_us)
        messages.append(self._messages.sensor(slow=slow))
        return [*(self._frame(t_ns, message) for message in messages), *sent]

    def _frame(self, t_ns: int, message: Any) -> Frame:
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return Frame(t_ns=t_ns, port=PORT, data=data)


def _next_due(due: int, interval: int, now: int) -> int:
    """The next instant of a grid; a grid that is finer than what can be kept up starts anew."""
    return due + interval if due + interval > now else now + interval
