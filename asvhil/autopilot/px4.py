"""The PX4 profile: readiness, packed modes, OFFBOARD, outputs and parameters of PX4. Sans-IO.

Tried with PX4 1.15 and 1.16 in software in the loop: docs/autopilots.md says what rests on what.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from asvhil.autopilot.after_silence import AfterSilence, after_silence_of_px4
from asvhil.autopilot.mavlink_autopilot import MavlinkAutopilot
from asvhil.autopilot.parameter_watch import ParameterRules
from asvhil.autopilot.px4_parameters import requirements
from asvhil.autopilot.px4_wiring import names_of_wiring, wiring_of
from asvhil.config import AutopilotLinkConfig, Config, PwmConfig
from asvhil.io.mavlink.frames import dialect
from asvhil.types import Frame, Measurement

POSITION_USED = dialect.ESTIMATOR_POS_HORIZ_ABS
ALIVE_NS = 100_000_000
ALIVE_MASK = dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
LEAST_PULSE_US, GREATEST_PULSE_US = 500.0, 2500.0


class Px4Autopilot(MavlinkAutopilot):
    """Ready once its estimator uses a position; modes are packed main and sub numbers.

    PX4 stays in OFFBOARD only while set-points come, so they do, at 10 Hz, from the ticks of the backseat: body rates
    and thrust of zero, which move nothing. When this program dies PX4 leaves OFFBOARD after COM_OF_LOSS_T, and does
    what COM_OBL_RC_ACT says.
    """

    bytewise_parameters = True

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, *, keeps_offboard: bool = True) -> None:
        """`keeps_offboard`: OFFBOARD is the control mode; else its set-points are left to whoever uses it."""
        rules = ParameterRules(
            wiring=partial(wiring_of, config, pwm),
            requirements=partial(requirements, config, pwm),
            names_of_wiring=partial(names_of_wiring, config, pwm),
        )
        super().__init__(config, pwm, rules)
        self._keeps_offboard = keeps_offboard
        self._alive_due_ns = 0
        self._handlers |= {
            dialect.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self._on_estimator_status,
            dialect.MAVLINK_MSG_ID_ACTUATOR_OUTPUT_STATUS: self._on_actuator_output,
        }

    @property
    def after_silence(self) -> AfterSilence | None:
        return after_silence_of_px4(self.parameters.values, keeps_offboard=self._keeps_offboard)

    def data_to_send(self, t_ns: int) -> list[Frame]:
        """Add the set-points that OFFBOARD needs, before and while in that mode."""
        frames = super().data_to_send(t_ns)
        heard = self.autopilot_heartbeat_ns is not None
        if self._keeps_offboard and heard and t_ns >= self._alive_due_ns:
            self._alive_due_ns = t_ns + ALIVE_NS
            level = [1.0, 0.0, 0.0, 0.0]
            alive = dialect.MAVLink_set_attitude_target_message(
                t_ns // 1_000_000 & 0xFFFFFFFF, *self._it, ALIVE_MASK, level, 0, 0, 0, 0
            )
            frames.append(self._sender.frame(t_ns, alive))
        return frames

    def _mode_parameters(self, number: int) -> tuple[float, ...]:
        return float(number >> 16 & 0xFF), float(number >> 24 & 0xFF)

    def _on_estimator_status(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        # CONST_POS_MODE says nothing here: from 1.16 on it is also set at rest with a good position.
        attitude = bool(m.flags & dialect.ESTIMATOR_ATTITUDE)
        self._vehicle.note_estimator(t_ns, position=bool(m.flags & POSITION_USED), attitude=attitude)
        return self._vehicle.status(t_ns)

    def _on_actuator_output(self, t_ns: int, m: Any) -> Sequence[Measurement]:
        # Microseconds of PWM outputs; what is no pulse width, as of an ESC on a bus, is no signal that can be followed.
        pulses = [round(us) if LEAST_PULSE_US <= us <= GREATEST_PULSE_US else 0 for us in m.actuator[:16]]
        return self._vehicle.on_outputs(t_ns, tuple(pulses))


def build(config: Config) -> Px4Autopilot:
    """The conversation of a config."""
    keeps_offboard = config.supervisor.control_mode == "OFFBOARD"
    return Px4Autopilot(config.links.autopilot, config.vehicle.pwm, keeps_offboard=keeps_offboard)
