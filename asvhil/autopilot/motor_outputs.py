"""Protocols that command two motors of an autopilot by pulse widths, each with its own release. Sans-IO.

Pulses come as those of `vehicle.pwm`; what the boat's own sticks and outputs need instead is its `Wiring`.

`RcOverride` and `ManualControl` take the place of the pilot's sticks, and the autopilot drops them by itself when they
stop. `SetServo` and `SetActuator` set outputs that keep their last value until another is sent, through disarming and
arming too: neutral is their release, and it is sent repeatedly, at the start, after every hold and while disarmed.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, Protocol

from asvhil.autopilot.wiring import Pulses, Wiring
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.config.registry import OUTPUTS
from asvhil.io.mavlink.frames import dialect, pack
from asvhil.supervisor.reasons import Explanation

IGNORE_CHANNEL = 65535
FIRST_CHANNELS, CHANNELS = 8, 18  # of RC_CHANNELS_OVERRIDE: those that MAVLink 1 has too, and all
RELEASE_FIRST, RELEASE_OTHER = 0, 65534  # one of the first channels, and one of the others, which take 0 for "ignore"
RELEASE_AXIS = 32767  # INT16_MAX: ArduPilot gives the channel of such an axis back
AXIS = 1000  # -1000..1000 is a stick's whole travel
NEUTRAL_NS = 3_000_000_000
NEUTRAL_EVERY_NS = 100_000_000
LAST_NEUTRALS, LAST_RELEASES = 4, 3  # of the last words: datagrams get lost, and an override has to be seen


class Output(Protocol):
    """Pulse widths (us; port, starboard) in, packed messages out.

    `wiring` is how the boat is wired, as far as is known; it may be set anew while the motors are not driven.
    """

    wiring: Wiring
    hazard: str  # what users must know before they choose it; empty where there is nothing
    refused: str  # why the autopilot does not accept its commands; empty while it does

    def drive(self, port_us: int, starboard_us: int) -> list[bytes]:
        """Command both motors; to be repeated in every tick, because datagrams get lost and commands time out."""
        ...

    def release(self, t_ns: int) -> list[bytes]:
        """Give the motors back: stop overriding sticks, or set outputs that hold their value to neutral."""
        ...

    def last_words(self, *, neutral: bool) -> list[list[bytes]]:
        """What another process is to send, step by step, if this one dies now; changes nothing here.

        Neutral first, for so long that no release can overtake it, unless the motors are being given to the pilot.
        """
        ...

    def on_connect(self, t_ns: int) -> None:
        """Note that the autopilot is heard for the first time, again after a silence, or after a reboot."""
        ...

    def on_disarmed(self, t_ns: int) -> None:
        """Note that the autopilot says that it is disarmed; comes with each of its heartbeats while it is."""
        ...

    def receive(self, acknowledgement: Any) -> None:
        """Take in a COMMAND_ACK of the autopilot."""
        ...

    def fault(self, t_ns: int) -> Explanation | None:
        """Why this way does not lead to the motors, as far as it can tell by itself; a hold is refused, or ends."""
        ...

    def data_to_send(self, t_ns: int) -> list[bytes]:
        """What is due now besides `drive` and `release`."""
        ...


class _Sticks(Output):
    """The pilot's sticks, overridden: the autopilot's own time-out gives them back when the messages stop."""

    hazard = refused = ""

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, wiring: Wiring) -> None:
        self.wiring = wiring
        self._neutral_us = pwm.neutral_us
        self._system_id, self._component_id = config.autopilot_system_id, config.autopilot_component_id
        # ArduPilot obeys both messages only from the system id of its ground station.
        self._mav = dialect.MAVLink(None, srcSystem=config.override_system_id, srcComponent=config.component_id)

    def on_connect(self, t_ns: int) -> None:
        """Overrides of before have timed out: there is nothing to do."""

    def on_disarmed(self, t_ns: int) -> None:
        """Nothing is held that could move a motor at the next arming."""

    def receive(self, acknowledgement: Any) -> None:
        """These messages are never acknowledged."""

    def fault(self, t_ns: int) -> Explanation | None:
        """Nothing that these could tell."""
        return None

    def data_to_send(self, t_ns: int) -> list[bytes]:
        return []

    def last_words(self, *, neutral: bool) -> list[list[bytes]]:
        """Neutral alone, then the release alone: in one go neutral would have no effect."""
        middle = self.drive(self._neutral_us, self._neutral_us)
        return [middle] * (LAST_NEUTRALS if neutral else 0) + [self.release(0)] * LAST_RELEASES


class RcOverride(_Sticks):
    """RC_CHANNELS_OVERRIDE of the two motor channels; every other channel is left to the pilot."""

    _last: tuple[tuple[Pulses, Pulses], bytes] | None = None  # channels and values, and the message of these

    def drive(self, port_us: int, starboard_us: int) -> list[bytes]:
        return self._override(self.wiring.to_sticks((port_us, starboard_us)))

    def release(self, t_ns: int) -> list[bytes]:
        port, starboard = self.wiring.channels
        return self._override((_release_of(port), _release_of(starboard)))

    def _override(self, values: Pulses) -> list[bytes]:
        """Without the channels of MAVLink 2 where they are not needed: zeros, which say "ignore" there, are cut off."""
        asked = self.wiring.channels, values
        if self._last is None or self._last[0] != asked:  # in most ticks they are the same again
            channels = [IGNORE_CHANNEL] * FIRST_CHANNELS + [0] * (CHANNELS - FIRST_CHANNELS)
            for channel, value in zip(*asked, strict=True):
                channels[channel - 1] = value
            to = self._system_id, self._component_id
            message = dialect.MAVLink_rc_channels_override_message(*to, *channels)
            self._last = asked, pack(message, self._mav)
        return [self._last[1]]


class ManualControl(_Sticks):
    """MANUAL_CONTROL: y is the port paddle (RCMAP_ROLL), z the starboard one (RCMAP_THROTTLE)."""

    def drive(self, port_us: int, starboard_us: int) -> list[bytes]:
        pulses = self.wiring.to_sticks((port_us, starboard_us))
        port, starboard = (
            round(2 * AXIS * (pulse_us - stick.low_us) / (stick.high_us - stick.low_us)) - AXIS
            for pulse_us, stick in zip(pulses, self.wiring.sticks, strict=True)
        )
        return self._axes(port, starboard)

    def release(self, t_ns: int) -> list[bytes]:
        return self._axes(RELEASE_AXIS, RELEASE_AXIS)

    def _axes(self, y: int, z: int) -> list[bytes]:
        message = dialect.MAVLink_manual_control_message(self._system_id, RELEASE_AXIS, y, z, RELEASE_AXIS, 0)
        return [pack(message, self._mav)]


class _Held(ABC):
    """Outputs that keep their value when the commands stop. To release them is to send neutral for a while."""

    hazard = refused = ""
    command: int

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, wiring: Wiring) -> None:
        self.wiring = wiring
        self._config, self._neutral_us = config, pwm.neutral_us
        self._mav = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._neutral_until_ns: int | None = None
        self._neutral_due_ns = 0

    @abstractmethod
    def _set(self, port_us: int, starboard_us: int) -> list[bytes]: ...

    def drive(self, port_us: int, starboard_us: int) -> list[bytes]:
        self._neutral_until_ns = None
        return self._set(port_us, starboard_us)

    def release(self, t_ns: int) -> list[bytes]:
        """Send neutral now, and every 0.1 s for 3 s, so that some of it gets through a bad link."""
        self.on_connect(t_ns)
        return self._neutral(t_ns)

    def last_words(self, *, neutral: bool) -> list[list[bytes]]:
        """Neutral, which is the release too."""
        return [self._set(self._neutral_us, self._neutral_us)] * (LAST_NEUTRALS + LAST_RELEASES)

    def on_connect(self, t_ns: int) -> None:
        """Send neutral: this program or the autopilot may have restarted while the motors ran."""
        self._neutral_until_ns = t_ns + NEUTRAL_NS
        self._neutral_due_ns = t_ns

    def on_disarmed(self, t_ns: int) -> None:
        """Send neutral once: the value that is held now drives the motors from the next arming on."""
        if self._neutral_until_ns is None:
            self._neutral_until_ns = self._neutral_due_ns = t_ns

    def data_to_send(self, t_ns: int) -> list[bytes]:
        if self._neutral_until_ns is None or t_ns < self._neutral_due_ns:
            return []
        if t_ns >= self._neutral_until_ns:
            self._neutral_until_ns = None
        return self._neutral(t_ns)

    def receive(self, acknowledgement: Any) -> None:
        result = acknowledgement.result
        if acknowledgement.command == self.command and result != dialect.MAV_RESULT_IN_PROGRESS:
            accepted = result == dialect.MAV_RESULT_ACCEPTED
            self.refused = "" if accepted else self._refusal(_result_name(result))

    def fault(self, t_ns: int) -> Explanation | None:
        """A refusal is told in words, and ends nothing by itself: the outputs decide."""
        return None

    @abstractmethod
    def _refusal(self, result: str) -> str: ...

    def _neutral(self, t_ns: int) -> list[bytes]:
        self._neutral_due_ns = t_ns + NEUTRAL_EVERY_NS
        return self._set(self._neutral_us, self._neutral_us)

    def _command(self, *parameters: float) -> bytes:
        message = dialect.MAVLink_command_long_message(
            self._config.autopilot_system_id,
            self._config.autopilot_component_id,
            self.command,
            0,
            *parameters,
            *[0.0] * (7 - len(parameters)),
        )
        return pack(message, self._mav)


class SetServo(_Held):
    """MAV_CMD_DO_SET_SERVO on ArduPilot's outputs with SERVOn_FUNCTION 0; one command for each motor."""

    command = int(dialect.MAV_CMD_DO_SET_SERVO)
    hazard = (
        "DO_SET_SERVO has no time-out: if this computer or the link dies, the motors run on as last set, "
        "armed or not, in any mode; rc_override stops by itself"
    )

    def _set(self, port_us: int, starboard_us: int) -> list[bytes]:
        pulses = self.wiring.to_outputs((port_us, starboard_us))
        return [self._command(*commanded) for commanded in zip(self.wiring.outputs, pulses, strict=True)]

    def _refusal(self, result: str) -> str:
        functions = " and ".join(f"SERVO{output}_FUNCTION" for output in self.wiring.outputs)
        return f"the autopilot refuses DO_SET_SERVO ({result}): {functions} must be 0"


class SetActuator(_Held):
    """MAV_CMD_DO_SET_ACTUATOR: both motors in one command, -1..1 over the output's range; NaN leaves the others alone.

    PX4 maps -1..1 linearly to PWM_MAIN_MINn..MAXn, and mirrors it where PWM_MAIN_REV has the output's bit.
    """

    command = int(dialect.MAV_CMD_DO_SET_ACTUATOR)
    hazard = (
        "DO_SET_ACTUATOR has no time-out: if this computer or the link dies, PX4 runs the motors on as last set "
        "unless COM_OBL_RC_ACT disarms (7) or terminates (6) when OFFBOARD is lost; PX4 keeps the value while "
        "disarmed and starts the motors with it at the next arming: do not arm before this program runs again"
    )

    def _set(self, port_us: int, starboard_us: int) -> list[bytes]:
        values = [math.nan] * 6
        values[self._config.port_actuator - 1] = self.wiring.throttle(0, port_us)
        values[self._config.starboard_actuator - 1] = self.wiring.throttle(1, starboard_us)
        return [self._command(*values, 0.0)]

    def _refusal(self, result: str) -> str:
        return f"the autopilot refuses DO_SET_ACTUATOR ({result})"


def make_output(config: AutopilotLinkConfig, pwm: PwmConfig, wiring: Wiring) -> Output:
    """The way that `links.autopilot.output` names."""
    output: Output = OUTPUTS.find(config.output).make(config, pwm, wiring)
    return output


def _release_of(channel: int) -> int:
    return RELEASE_FIRST if channel <= FIRST_CHANNELS else RELEASE_OTHER


def _result_name(result: int) -> str:
    names = dialect.enums["MAV_RESULT"]
    return names[result].name.removeprefix("MAV_RESULT_") if result in names else f"result {result}"
