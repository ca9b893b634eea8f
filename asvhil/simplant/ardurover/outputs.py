"""The servo outputs of an ArduRover, what drives each of them, and the boat's motors that hang on two of them."""

from __future__ import annotations

import math

from asvhil.config import PwmConfig
from asvhil.simplant.ardurover.parameters import OUTPUTS, PORT_MOTOR, STARBOARD_MOTOR, MotorOutput, Parameters
from asvhil.simplant.vehicle.wiring import WiredMotor


class ServoOutputs:
    """Pulses in `servo_us`: throttles where a parameter gives an output the function of a motor, else what was set."""

    def __init__(self, parameters: Parameters, pwm: PwmConfig, servo_us: list[int], loop_hz: float) -> None:
        self._parameters = parameters
        self._servo_us = servo_us
        self._loop_hz = loop_hz
        self._held: dict[int, tuple[int, int]] = {}  # by scripts: index of an output to its pulse, and loops left
        # The motors hang where the parameters that the boat is built with say, and stay there whatever is set later.
        self._motors = tuple(
            self._wired(pwm, function, usual)
            for function, usual in zip((PORT_MOTOR, STARBOARD_MOTOR), pwm.outputs, strict=True)
        )
        # The last pulses of both with what they are to plain motors, and throttles with their pulses: commands stand
        # for several loops.
        self._plain_us: tuple[tuple[int, int], tuple[int, int]] = ((0, 0), (0, 0))
        self._put: tuple[tuple[float, float], tuple[MotorOutput, ...], list[tuple[int, int]]] | None = None

    def restart(self) -> None:
        """Power on: what scripts hold is forgotten."""
        self._held.clear()

    @property
    def motors_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor, as motors on plain outputs would get them (`WiredMotor`).

        0: no signal, as before boot.
        """
        port, starboard = self._motors
        pulses_us = self._servo_us[port.output - 1], self._servo_us[starboard.output - 1]
        if pulses_us != self._plain_us[0]:
            self._plain_us = pulses_us, (port.plain_us(self._servo_us), starboard.plain_us(self._servo_us))
        return self._plain_us[1]

    def set_servo(self, channel: int, pulse_us: int) -> bool:
        """DO_SET_SERVO: refused on outputs with a function; any other holds its value until power-off."""
        if not 1 <= channel <= OUTPUTS or not 0 <= pulse_us <= 2500 or self._parameters.functions[channel - 1] != 0:
            return False
        self._servo_us[channel - 1] = pulse_us
        return True

    def hold(self, index: int, pulse_us: int, timeout_ms: int) -> None:
        """Drive an output (from 0) past everything, for a time that is rounded up to whole loops; 0 lets go.

        Raises ValueError where there is no such output.
        """
        if not 0 <= index < OUTPUTS:
            raise ValueError("argument out of range")
        loops = math.ceil(timeout_ms * 1e-3 * self._loop_hz - 1e-9)
        self._held.pop(index, None)
        if loops > 0:
            self._held[index] = pulse_us, loops

    def put_out(self, port: float, starboard: float, *, armed: bool, emergency_stop: bool) -> None:
        """Throttles in [-1, 1] to the outputs that have their functions; an output without one keeps its pulse.

        The emergency stop neutralises motors while armed alone: what scripts hold goes out disarmed, whatever is on.
        """
        if emergency_stop:
            port = starboard = 0.0
        throttles, outputs = (port, starboard), self._parameters.motor_outputs
        if self._put is None or self._put[0] != throttles or self._put[1] is not outputs:
            pulses_us = [
                (output.number - 1, output.pulse_us(port if output.function == PORT_MOTOR else starboard))
                for output in outputs
            ]
            self._put = throttles, outputs, pulses_us
        for index, pulse_us in self._put[2]:
            self._servo_us[index] = pulse_us
        if self._held:
            self._put_out_held(motors_stopped=emergency_stop and armed)

    def _put_out_held(self, *, motors_stopped: bool) -> None:
        for index, (pulse_us, loops) in list(self._held.items()):
            is_motor = self._parameters.functions[index] in (PORT_MOTOR, STARBOARD_MOTOR)
            if not (is_motor and motors_stopped):
                self._servo_us[index] = pulse_us
            if loops > 1:
                self._held[index] = pulse_us, loops - 1
            else:
                del self._held[index]

    def _wired(self, pwm: PwmConfig, function: int, usual: int) -> WiredMotor:
        """On the output that has its function, in the sense and with the neutral of that output."""
        functions = self._parameters.functions
        output = functions.index(function) + 1 if function in functions else usual
        neutral_us, turned = (self._parameters[f"SERVO{output}_{part}"] for part in ("TRIM", "REVERSED"))
        return WiredMotor(pwm, output, neutral_us=neutral_us, reversed=turned != 0.0)
