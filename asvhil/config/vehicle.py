"""One boat: its hull, motors and motor outputs."""

from __future__ import annotations

import math
from itertools import pairwise

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section, ServoUs
from asvhil.config.power import PowerConfig


class CouplingConfig(Section):
    """Terms of the paper's full equations that couple sway and yaw (names after Fossen 2011); zero where unknown.

    Masses and drags count as in the rest of `vessel`, as minus the hydrodynamic derivative, but may have either sign.
    `y_v_absr` is -Y_v|r|, the sway drag over v |r|, and so on.
    """

    x_g_m: float = Field(default=0.0, description="Centre of gravity ahead of the origin, x_G.")
    y_g_m: float = Field(default=0.0, description="Centre of gravity to starboard of the origin, y_G.")
    y_rdot_kgm: float = Field(default=0.0, description="Added mass of yaw in sway, -Y_rdot.")
    n_vdot_kgm: float = Field(default=0.0, description="Added mass of sway in yaw, -N_vdot.")
    y_v_absr: float = Field(default=0.0, description="Sway drag over v |r|, -Y_v|r| (N s2/m).")
    y_r_absv: float = Field(default=0.0, description="Sway drag over r |v|, -Y_r|v| (N s2/m).")
    y_r_absr: float = Field(default=0.0, description="Sway drag over r |r|, -Y_r|r| (N s2).")
    n_v_absv: float = Field(default=0.0, description="Yaw drag over v |v|, -N_v|v| (N s2/m).")
    n_v_absr: float = Field(default=0.0, description="Yaw drag over v |r|, -N_v|r| (N s2).")
    n_r_absv: float = Field(default=0.0, description="Yaw drag over r |v|, -N_r|v| (N s2).")


class VesselConfig(Section):
    """A vessel in 3 degrees of freedom with two fixed motors: parameters after Fossen (2011), all as magnitudes.

    Masses come from a scale or a data sheet, drag from towing or coasting tests, the thrust curve from a bollard pull
    test; `config/wamv16.yaml` and `config/bream.yaml` give a source for each value. sd-mpc, the classical controllers
    and the approach predict with them, and the simulated boat is built from them.
    """

    mass_kg: Positive = Field(description="Mass of the boat, payload included.")
    added_mass_surge_kg: NonNegative = Field(
        description="Added mass in surge, -X_udot; about 0.1 of the mass for a catamaran."
    )
    added_mass_sway_kg: NonNegative = Field(
        description="Added mass in sway, -Y_vdot; about 1.5 of the mass for a catamaran."
    )
    inertia_yaw_kgm2: Positive = Field(description="Moment of inertia about the vertical axis of the origin, I_z.")
    added_inertia_yaw_kgm2: NonNegative = Field(description="Added moment of inertia in yaw, -N_rdot.")
    surge_drag_n_per_mps: NonNegative = Field(description="Linear drag in surge, -X_u.")
    surge_drag_n_per_mps2: NonNegative = Field(description="Quadratic drag in surge, -X_u|u|.")
    sway_drag_n_per_mps: NonNegative = Field(description="Linear drag in sway, -Y_v.")
    sway_drag_n_per_mps2: NonNegative = Field(description="Quadratic drag in sway, -Y_v|v|.")
    yaw_drag_nm_per_radps: NonNegative = Field(description="Linear drag in yaw, -N_r.")
    yaw_drag_nm_per_radps2: NonNegative = Field(description="Quadratic drag in yaw, -N_r|r|.")
    motor_arm_m: Positive = Field(description="Distance of each motor's thrust line from the centre line.")
    motor_lag_s: Positive = Field(description="Time constant of the motors' first-order lag from command to thrust.")
    thrust_curve: tuple[tuple[float, float], ...] = Field(
        description=(
            "Thrust of one motor: rows of [command in -1..1, thrust in N], commands rising, thrust never falling; "
            "interpolated linearly."
        )
    )
    wind_surge_n_per_mps2: NonNegative = Field(
        description=("Wind load in surge over u_rw |u_rw|: half the air density times coefficient and area.")
    )
    wind_sway_n_per_mps2: NonNegative = Field(description="Wind load in sway over v_rw |v_rw|.")
    wind_yaw_nm_per_mps2: NonNegative = Field(
        description="Wind moment in yaw over 2 u_rw v_rw; it turns the boat across the wind."
    )

    coupling: CouplingConfig | None = Field(
        default=None, description="Terms that couple sway and yaw; null: none, the simplified dynamics."
    )

    left_out_if_empty = ("coupling",)

    @model_validator(mode="after")
    def _check_coupling(self) -> VesselConfig:
        part = self.coupling
        if part is None:
            return self
        m_v, m_r = self.mass_kg + self.added_mass_sway_kg, self.inertia_yaw_kgm2 + self.added_inertia_yaw_kgm2
        m_u = self.mass_kg + self.added_mass_surge_kg
        cross_kgm = self.mass_kg * part.x_g_m + 0.5 * (part.y_rdot_kgm + part.n_vdot_kgm)
        if m_r - cross_kgm**2 / m_v - (self.mass_kg * part.y_g_m) ** 2 / m_u <= 0.0:
            raise ValueError(
                "coupling: the mass matrix is not positive definite: x_g_m, y_g_m, y_rdot_kgm and n_vdot_kgm are too "
                "large for the masses and inertia_yaw_kgm2 (which is about the origin, m x_G^2 included)"
            )
        turn = self._pushes_in_turn(part)
        if turn is not None:
            raise ValueError(
                f"coupling: the quadratic drag pushes the boat where r = {turn:.2g} v (rad/s, m/s): the terms that "
                "couple sway and yaw are too large for sway_drag_n_per_mps2 and yaw_drag_nm_per_radps2"
            )
        return self

    def _pushes_in_turn(self, part: CouplingConfig) -> float | None:
        """A ratio r / v at which the quadratic drag would give power to the boat, or None."""
        for tenths in range(-30, 31):
            for side in (1.0, -1.0):
                r = side * math.pow(10.0, tenths / 10.0)  # of v = 1
                sway = self.sway_drag_n_per_mps2 + part.y_v_absr * abs(r) + (part.y_r_absv + part.y_r_absr * abs(r)) * r
                yaw = part.n_v_absv + part.n_v_absr * abs(r)
                yaw += (self.yaw_drag_nm_per_radps2 * abs(r) + part.n_r_absv) * r
                if sway + yaw * r < 0.0:
                    return r
        return None

    @model_validator(mode="after")
    def _check_curve(self) -> VesselConfig:
        commands = [row[0] for row in self.thrust_curve]
        thrusts = [row[1] for row in self.thrust_curve]
        if len(commands) < 2 or any(b <= a for a, b in pairwise(commands)):
            raise ValueError("thrust_curve needs at least 2 rows with rising commands")
        if any(b < a for a, b in pairwise(thrusts)):
            raise ValueError("thrust_curve: thrust must not fall while the command rises")
        if commands[0] < -1.0 or commands[-1] > 1.0 or thrusts[0] >= 0.0 or thrusts[-1] <= 0.0:
            raise ValueError("thrust_curve must lie in commands -1..1 and reach both astern and ahead thrust")
        return self

    @property
    def weak_astern(self) -> bool:
        """Whether the motors give less thrust astern than ahead, by more than a tenth."""
        return -self.thrust_curve[0][1] < 0.9 * self.thrust_curve[-1][1]

    def speed_ahead_mps(self, share: float = 1.0) -> float:
        """Where the drag is that share of both motors' thrust: X_u u + X_u|u| u^2 = share 2 T_max, in still water.

        inf without drag.
        """
        thrust_n = share * 2.0 * self.thrust_curve[-1][1]
        linear, quadratic = self.surge_drag_n_per_mps, self.surge_drag_n_per_mps2
        # The positive root, in the form that holds without a quadratic drag too.
        divisor = linear + math.sqrt(linear * linear + 4.0 * quadratic * thrust_n)
        return 2.0 * thrust_n / divisor if divisor > 0.0 else math.inf


class MotorOutputConfig(Section):
    """One motor on its output. What is set here must be so on the boat; what is left out is read from its autopilot."""

    output: int | None = Field(
        default=None,
        ge=1,
        le=16,
        description=(
            "Servo output of the autopilot that the motor hangs on. Left out: the output that has the motor's function "
            "(ArduRover: SERVOn_FUNCTION 73 to port, 74 to starboard; PX4: PWM_MAIN_FUNCn), and where that is not "
            "known, or the way is `set_servo`, 1 to port and 3 to starboard."
        ),
    )
    astern_us: ServoUs | None = Field(
        default=None,
        description=(
            "Pulse width of full astern at this output, longer than `ahead_us` where the motor is reversed. Left out, "
            "with `ahead_us`: those of vehicle.pwm, exchanged where the autopilot reverses the output."
        ),
    )
    neutral_us: ServoUs | None = Field(
        default=None,
        description=(
            "Pulse width of motor off at this output. Left out: the output's trim (ArduRover), or that of vehicle.pwm."
        ),
    )
    ahead_us: ServoUs | None = Field(default=None, description="Pulse width of full ahead at this output.")

    @model_validator(mode="after")
    def _check_ends(self) -> MotorOutputConfig:
        if (self.astern_us is None) != (self.ahead_us is None):
            raise ValueError("astern_us and ahead_us are set together, or neither")
        return self

    @property
    def reversed(self) -> bool | None:
        """Whether short pulses go ahead; None where that is left to the autopilot's parameters."""
        return None if self.astern_us is None or self.ahead_us is None else self.ahead_us < self.astern_us


class PwmConfig(Section):
    """How a motor command in [-1, 1] becomes a pulse width, and the limits that are applied last before sending.

    Everything counts in the pulses of a plain motor, which these three are; `port` and `starboard` tell where a boat
    differs: what goes out, and what the autopilot reports, is converted.
    """

    port: MotorOutputConfig = Field(default=MotorOutputConfig(), description="The port motor's output.")
    starboard: MotorOutputConfig = Field(default=MotorOutputConfig(), description="The starboard motor's output.")
    astern_us: ServoUs = Field(default=1100, description="Pulse width of the command -1, full astern.")
    neutral_us: ServoUs = Field(default=1500, description="Pulse width of the command 0, motor off.")
    ahead_us: ServoUs = Field(default=1900, description="Pulse width of the command 1, full ahead.")
    slew_us_per_s: Positive = Field(
        default=8000.0,
        description="Highest rate of change of a pulse width away from neutral; toward neutral there is no limit.",
    )
    command_max: float = Field(
        default=1.0, gt=0.0, le=1.0, description="Largest command, ahead and astern: a cap on the thrust."
    )
    reversal_pause_s: float = Field(
        default=0.0,
        ge=0.0,
        le=5.0,
        description="Time that a motor stays at neutral before it turns the other way, for propellers that must stop.",
    )

    @model_validator(mode="after")
    def _check_order(self) -> PwmConfig:
        if not self.astern_us < self.neutral_us < self.ahead_us:
            raise ValueError("astern_us < neutral_us < ahead_us must hold")
        if self.port.output is not None and self.port.output == self.starboard.output:
            raise ValueError("port.output and starboard.output must differ")
        for side, motor in (("port", self.port), ("starboard", self.starboard)):
            neutral_us = self.neutral_us if motor.neutral_us is None else motor.neutral_us
            ends_us = sorted((motor.astern_us or self.astern_us, motor.ahead_us or self.ahead_us))
            if not ends_us[0] < neutral_us < ends_us[1]:
                raise ValueError(f"{side}: neutral_us must lie between astern_us and ahead_us")
        return self

    @property
    def outputs(self) -> tuple[int, int]:
        """The outputs (port, starboard) as far as the config tells, and where it does not 1 and 3."""
        port, starboard = self.port.output, self.starboard.output
        return port or (3 if starboard == 1 else 1), starboard or (1 if port == 3 else 3)


class VehicleConfig(Section):
    """One boat: its name, its hull and motors, its motor outputs, and what it takes from its battery."""

    name: str = Field(description="Name of the boat. Model files are bound to it: NAME-nnsem.npz and the like.")
    vessel: VesselConfig = Field(description="Hull and motors.")
    pwm: PwmConfig = Field(default=PwmConfig(), description="Motor outputs.")
    power: PowerConfig | None = Field(
        default=None, description="Power from the battery; null: neither energy nor hours left are told."
    )

    left_out_if_empty = ("power",)
