"""A first guess of a small catamaran's parameters (Fossen 2011) from what its owner can measure: tape and scale.

Good enough for `sd-mpc` to hold a station until a model is trained on the boat's own logs, and no better: for the three
shipped boats, whose values come from other sources, most guesses are within a factor of two, and
`tests/unit/dynamics/test_hull_guess.py` holds them to that. Each equation says where it comes from:

    [F]  Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control (2011): manoeuvring, drag and wind loads
    [O]  the Otter of PythonVehicleSimulator (otter.py), whose ratios are used as those of a small catamaran
    [H]  Hoerner, Fluid-Dynamic Drag (1965)
    [A]  an assumption of this project, set by the three shipped boats
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from asvhil.config import VesselConfig
from asvhil.errors import ConfigError
from asvhil.types import record

WATER_KGPM3 = 1000.0
AIR_KGPM3 = 1.2

ADDED_SURGE = 0.1  # of the mass [O]
ADDED_SWAY = 1.5  # of the mass [O]
ADDED_YAW = 1.2  # of the moment of inertia: 1.7 [O], 1.1 and 1.0 of the other boats [A]
GYRATION_OF_LENGTH, GYRATION_OF_BEAM = 0.25, 0.35  # [F], 0.25 L for ships; the hulls' distance adds its part [A]
LINEAR_SHARE = 0.2  # of the drag at top speed [A]
DECAY_S = 1.0  # time in which sway and yaw die away by their linear drag [O]
CROSS_FLOW = 0.5  # drag coefficient of two round hulls, one in the lee of the other [H] [A]
HULL_OF_LENGTH, BLOCK = 1.0 / 8.0, 0.6  # beam of one hull, and the filled share of its box [A]
YAW_QUADRATIC_S = 1.0  # quadratic over linear drag in yaw, where no turning rate is known [A]
DRAG_OF_FROUDE = 0.6  # drag over weight and squared Froude number: 0.62 [O], 0.59 of a BlueBoat [A]
ASTERN = 0.6  # thrust astern over ahead [A]
DEAD_BAND = 0.05  # of the command, in which the propeller does not turn [A]
CURVE = 1.5  # thrust over command: between 2 of a bare propeller and 1 of a controller by power [A]
COMMANDS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
MOTOR_LAG_S = 0.2  # [A]
WINDAGE_M = 0.35  # height of what stands above the water [A]
WIND_COEFFICIENT = 0.8  # of the front's and the side's area [F]
WIND_MOMENT = 0.1  # of the side's area times the length [F]

# By figure: its name for people, least, most, unit.
RANGES = {
    "length": ("length", 0.3, 12.0, "m"),
    "beam": ("beam", 0.1, 8.0, "m"),
    "mass": ("mass", 1.0, 5000.0, "kg"),
    "top_speed": ("top speed", 0.2, 15.0, "m/s"),
    "motors_apart": ("distance of the motors", 0.05, 8.0, "m"),
    "turn_rate": ("turning rate", 2.0, 360.0, "deg/s"),
    "thrust": ("thrust", 1.0, 5000.0, "N"),
}


@record
class HullMeasures:
    """What an owner knows of a boat. SI units; `turn_degps` and `thrust_n` may be None, and are guessed then.

    `top_speed_mps`: both motors full ahead, no wind. `motors_apart_m`: from one propeller's axis to the other's.
    `turn_degps`: on the spot, one motor full ahead and the other full astern. `thrust_n`: one motor, full ahead, held
    at a post (bollard pull); 1 kgf is 9.81 N.
    """

    length_m: float
    beam_m: float
    mass_kg: float
    top_speed_mps: float
    motors_apart_m: float
    turn_degps: float | None = None
    thrust_n: float | None = None


def check_measures(boat: HullMeasures) -> None:
    """ConfigError, one line, where a figure is none of a boat that this program is for, or two do not go together."""
    check_figures(
        {
            "length": boat.length_m,
            "beam": boat.beam_m,
            "mass": boat.mass_kg,
            "top_speed": boat.top_speed_mps,
            "motors_apart": boat.motors_apart_m,
            "turn_rate": boat.turn_degps,
            "thrust": boat.thrust_n,
        }
    )


def check_figures(figures: Mapping[str, float | None]) -> None:
    """The same of some of the figures, by their names in `RANGES`; one that is not known yet is missing or None."""
    for key, value in figures.items():
        name, low, high, unit = RANGES[key]
        if value is not None and not low <= value <= high:
            raise ConfigError(f"{name} {value:g} {unit}: {low:g} to {high:g} {unit} is expected")
    length_m, beam_m, mass_kg, apart_m = map(figures.get, ("length", "beam", "mass", "motors_apart"))
    if length_m is not None and beam_m is not None and beam_m > length_m:
        raise ConfigError(f"beam {beam_m:g} m is more than the length of {length_m:g} m: exchanged?")
    if beam_m is not None and apart_m is not None and apart_m > 1.2 * beam_m:
        apart = f"distance of the motors {apart_m:g} m"
        raise ConfigError(f"{apart} is more than the beam of {beam_m:g} m: from propeller to propeller is meant")
    if length_m is not None and mass_kg is not None and draught(mass_kg, length_m) > 0.5 * length_m:
        raise ConfigError(f"mass {mass_kg:g} kg is too much to float on hulls of {length_m:g} m: kg and m?")


def doubts(boat: HullMeasures) -> str:
    """What is odd about figures that are possible each, as one line; empty where nothing is."""
    if boat.thrust_n is None:
        return ""
    usual_n = usual_thrust(boat)
    if 0.2 <= boat.thrust_n / usual_n <= 5.0:
        return ""
    boat_words = f"{boat.mass_kg:.3g} kg at {boat.top_speed_mps:.3g} m/s"
    return (
        f"thrust {boat.thrust_n:.3g} N of a motor is unusual for {boat_words}, "
        f"where about {usual_n:.0f} N is expected: N of one motor (1 kgf is 9.81 N), and m/s?"
    )


def usual_thrust(boat: HullMeasures) -> float:
    """Thrust (N) of one motor at full ahead from the top speed U.

    At U both motors balance the drag; small catamarans have a drag of 0.6 m g Fr^2 with the Froude number
    Fr = U / sqrt(g L) [O] [A]. So T = 0.3 m U^2 / L.
    """
    return 0.5 * DRAG_OF_FROUDE * boat.mass_kg * boat.top_speed_mps**2 / boat.length_m


def draught(mass_kg: float, length_m: float) -> float:
    """Draught (m) of two hulls of length L and beam L/8 that displace the mass: m / (2 rho C_B L L/8) [A]."""
    return mass_kg / (2.0 * WATER_KGPM3 * BLOCK * HULL_OF_LENGTH * length_m**2)


def guess_vessel(boat: HullMeasures) -> VesselConfig:
    """Parameters of the boat. ConfigError where `check_measures` refuses it.

        X_udot = -0.1 m                                                     [O]
        Y_vdot = -1.5 m                                                     [O]
        I_z    = m ((0.25 L)^2 + (0.35 B)^2)                                [F] [A]
        N_rdot = -1.2 I_z                                                   [O] [A]
        2 T = X_u U + X_u|u| U^2, the linear part being a fifth             [F] (6.109) in steady state, [A]
        Y_v = (m - Y_vdot) / 1 s, N_r = (I_z - N_rdot) / 1 s                [O]
        Y_v|v| = rho / 2 C_d 2 L D, cross-flow drag of two hulls            [F], [H]
        a (T + T_astern) = N_r R + N_r|r| R^2                               [F] (6.109), turning on the spot
        wind: rho_air / 2 C A of front B h and side L h; moment 0.1 of the side's times L   [F]

    The linear part in yaw is at most four fifths of the moment, where a high turning rate leaves no room for N_r above.
    """
    check_measures(boat)
    mass_kg, length_m, beam_m = boat.mass_kg, boat.length_m, boat.beam_m
    ahead_n = usual_thrust(boat) if boat.thrust_n is None else boat.thrust_n
    astern_n = ASTERN * ahead_n
    speed_mps, arm_m = boat.top_speed_mps, 0.5 * boat.motors_apart_m
    sway_kg = ADDED_SWAY * mass_kg
    inertia_kgm2 = mass_kg * ((GYRATION_OF_LENGTH * length_m) ** 2 + (GYRATION_OF_BEAM * beam_m) ** 2)
    yaw, yaw2 = yaw_drag((1.0 + ADDED_YAW) * inertia_kgm2, arm_m * (ahead_n + astern_n), boat.turn_degps)
    half_air = 0.5 * AIR_KGPM3 * WIND_COEFFICIENT
    side = half_air * length_m * WINDAGE_M
    cross_flow = 0.5 * WATER_KGPM3 * CROSS_FLOW * 2.0 * length_m * draught(mass_kg, length_m)
    return VesselConfig(
        mass_kg=mass_kg,
        added_mass_surge_kg=_rounded(ADDED_SURGE * mass_kg),
        added_mass_sway_kg=_rounded(sway_kg),
        inertia_yaw_kgm2=_rounded(inertia_kgm2),
        added_inertia_yaw_kgm2=_rounded(ADDED_YAW * inertia_kgm2),
        surge_drag_n_per_mps=_rounded(LINEAR_SHARE * 2.0 * ahead_n / speed_mps),
        surge_drag_n_per_mps2=_rounded((1.0 - LINEAR_SHARE) * 2.0 * ahead_n / speed_mps**2),
        sway_drag_n_per_mps=_rounded((mass_kg + sway_kg) / DECAY_S),
        sway_drag_n_per_mps2=_rounded(cross_flow),
        yaw_drag_nm_per_radps=_rounded(yaw),
        yaw_drag_nm_per_radps2=_rounded(yaw2),
        motor_arm_m=_rounded(arm_m),
        motor_lag_s=MOTOR_LAG_S,
        thrust_curve=guess_curve(ahead_n, astern_n),
        wind_surge_n_per_mps2=_rounded(half_air * beam_m * WINDAGE_M),
        wind_sway_n_per_mps2=_rounded(side),
        wind_yaw_nm_per_mps2=_rounded(WIND_MOMENT * side * length_m),
    )


def yaw_drag(inertia_kgm2: float, moment_nm: float, turn_degps: float | None) -> tuple[float, float]:
    """N_r (N m/(rad/s)) and N_r|r| (N m/(rad/s)^2), as magnitudes, of the whole inertia and the moment of a turn."""
    linear = inertia_kgm2 / DECAY_S
    if turn_degps is None:
        return linear, YAW_QUADRATIC_S * linear
    rate_radps = math.radians(turn_degps)
    linear = min(linear, 0.8 * moment_nm / rate_radps)
    return linear, (moment_nm - linear * rate_radps) / rate_radps**2


def guess_curve(ahead_n: float, astern_n: float) -> tuple[tuple[float, float], ...]:
    """Rows (command, thrust in N) of one motor: T ((|c| - d) / (1 - d))^1.5 beyond a dead band d [A]."""

    def thrust_n(command: float, most_n: float) -> float:
        share = float(((command - DEAD_BAND) / (1.0 - DEAD_BAND)) ** CURVE)
        return round(most_n * share, 2)

    astern = tuple((-command, -thrust_n(command, astern_n)) for command in reversed(COMMANDS))
    ahead = tuple((command, thrust_n(command, ahead_n)) for command in COMMANDS)
    return (*astern, (-DEAD_BAND, 0.0), (DEAD_BAND, 0.0), *ahead)


def _rounded(value: float) -> float:
    """To three digits: a guess has no more."""
    return float(f"{value:.3g}")
