"""One boat: its hull, motors and motor outputs."""

from __future__ import annotations

from itertools import pairwise

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section, ServoUs


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
    inertia_yaw_kgm2: Positive = Field(description="Moment of inertia about the vertical axis, I_z.")
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


class PwmConfig(Section):
    """How a motor command in [-1, 1] becomes a pulse width, and the limits that are applied last before sending."""

    port_channel: int = Field(
        default=1, ge=1, le=8, description="Channel of the port motor: RC channel and servo output of the autopilot."
    )
    starboard_channel: int = Field(default=3, ge=1, le=8, description="Channel of the starboard motor.")
    astern_us: ServoUs = Field(default=1100, description="Pulse width of the command -1, full astern.")
    neutral_us: ServoUs = Field(default=1500, description="Pulse width of the command 0, motor off.")
    ahead_us: ServoUs = Field(default=1900, description="Pulse width of the command 1, full ahead.")
    slew_us_per_s: Positive = Field(
        default=8000.0,
        description="Highest rate of change of a pulse width away from neutral; toward neutral there is no limit.",
    )

    @model_validator(mode="after")
    def _check_order(self) -> PwmConfig:
        if not self.astern_us < self.neutral_us < self.ahead_us:
            raise ValueError("astern_us < neutral_us < ahead_us must hold")
        if self.port_channel == self.starboard_channel:
            raise ValueError("port_channel and starboard_channel must differ")
        return self


class VehicleConfig(Section):
    """One boat: its name, its hull and motors, and its motor outputs."""

    name: str = Field(description="Name of the boat. Model files are bound to it: NAME-nnsem.npz and the like.")
    vessel: VesselConfig = Field(description="Hull and motors.")
    pwm: PwmConfig = Field(default=PwmConfig(), description="Motor outputs.")
