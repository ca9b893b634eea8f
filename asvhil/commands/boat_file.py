"""The config of one's own boat as commented YAML, and that of its simulated twin: what `asvhil init` writes."""

from __future__ import annotations

import json

from asvhil.config import VesselConfig
from asvhil.config.yaml_text import parse_yaml
from asvhil.dynamics.hull_guess import HullMeasures, guess_vessel
from asvhil.errors import ConfigError
from asvhil.types import record

ARDUINO = "arduino"  # the wind sensor of docs/anemometer.md, whose firmware's version is checked

LIVELY_MPS2 = 3.0  # acceleration from rest from which the default weights make a boat shuttle, as the BlueBoat does

# What each parameter of the hull is, and how to get a better value of it than the guess.
HULL_WORDS: dict[str, tuple[str, str]] = {
    "mass_kg": ("ready to go, batteries and payload in", "a scale"),
    "added_mass_surge_kg": ("water that moves along ahead: 0.1 m", "leave it"),
    "added_mass_sway_kg": ("and sideways: 1.5 m", "leave it"),
    "inertia_yaw_kgm2": ("m ((0.25 L)^2 + (0.35 B)^2)", "leave it"),
    "added_inertia_yaw_kgm2": ("1.2 of the inertia", "leave it"),
    "surge_drag_n_per_mps": ("a fifth of the drag at top speed", "speeds at several throttles"),
    "surge_drag_n_per_mps2": ("the rest: both motors' thrust at top speed", "as above"),
    "sway_drag_n_per_mps": ("sway dies away within about 1 s", "a pull sideways with a spring balance"),
    "sway_drag_n_per_mps2": ("cross-flow drag of two hulls at their draught", "as above"),
    "yaw_drag_nm_per_radps": ("a turn dies away within about 1 s", "turns on the spot at several throttles"),
    "yaw_drag_nm_per_radps2": ("the rest: both motors' moment at the turning rate", "as above"),
    "motor_arm_m": ("half the distance of the propellers", "a tape"),
    "motor_lag_s": ("from command to thrust", "leave it"),
    "wind_surge_n_per_mps2": ("front of beam times 0.35 m above the water", "the real area, times 0.48"),
    "wind_sway_n_per_mps2": ("side of length times 0.35 m", "the real area, times 0.48"),
    "wind_yaw_nm_per_mps2": ("a tenth of the side's times the length", "leave it"),
}
NOT_ASKED = {
    "yaw_drag_nm_per_radps2": "for want of a turning rate as much as linear at 1 rad/s",
}


@record
class OwnBoat:
    """What `asvhil init` has been told. Links are specs of text; no `anemometer`: none is on board.

    `anemometer_kind` is `arduino` or `nmea`. `pwm_us` is (full astern, off, full ahead) of a plain motor.
    """

    name: str
    autopilot: str
    port: str
    anemometer: str | None
    anemometer_kind: str
    hull: HullMeasures
    pwm_us: tuple[int, int, int]


def boat_text(boat: OwnBoat) -> str:
    """The YAML of the boat. ConfigError where its hull cannot be (`hull_guess.check_measures`)."""
    vessel = guess_vessel(boat.hull)
    hull = boat.hull
    turn = "not told" if hull.turn_degps is None else f"{hull.turn_degps:.4g} deg/s"
    thrust = f"guessed from the top speed, {vessel.thrust_curve[-1][1]:g} N"
    thrust = thrust if hull.thrust_n is None else f"{hull.thrust_n:.4g} N"
    astern_us, neutral_us, ahead_us = boat.pwm_us
    return f"""\
# Written by `asvhil init`. `asvhil config docs KEY` tells what a key does, `asvhil config check` whether this file is
# right, `asvhil check` whether the boat is. For what does not stand here the defaults hold (docs/configuration.md).
vehicle:
  name: {plain(boat.name)}   # model files are bound to it
  # GUESSED (docs/own-boat.md has the equations) from length {hull.length_m:.4g} m, beam {hull.beam_m:.4g} m, mass \
{hull.mass_kg:.4g} kg, top speed {hull.top_speed_mps:.4g} m/s,
  # propellers {hull.motors_apart_m:.4g} m apart, turning rate {turn}, thrust of one motor {thrust}.
  # Within a factor of two that is enough to hold a station; a model trained on the boat's own logs will replace it.
  vessel:
{_vessel_lines(vessel, hull)}
  # Pulse widths of a plain motor. Which output has which motor, and which is reversed, is read from the autopilot;
  # `asvhil check` prints lines to put here, and a boat that is wired otherwise is then refused.
  pwm:
    astern_us: {astern_us}
    neutral_us: {neutral_us}
    ahead_us: {ahead_us}
  # What the battery gives (docs/operation.md): the hours left, where the autopilot measures its current.
  # power: {{capacity_wh: 1200}}

links:
{_autopilot_lines(boat)}
{_anemometer_lines(boat)}
  operator:
    endpoint: udpin:127.0.0.1:14660   # where `asvhil hold`, `release` and `status` reach the daemon
  # A ground station of your own (docs/mavlink.md), if the autopilot has no link for one:
  # ground_stations:
  #   tablet: {{endpoint: "udpin:0.0.0.0:14550"}}

estimator:
  ekf:
    accelerometer: false       # an autopilot's roll and pitch are not good enough for it; true with an INS of its own
    position_bias_std_m: 1.0   # slow error of a plain GNSS receiver: followed, not chased; 0 with RTK
    position_bias_time_s: 90
    heading_std_deg: 2.0       # a compass near motors, see `asvhil calibrate`; two antennas: 0.5

controller:
  # Predicts with the guess above. `asvhil learn` trains a model on the boat's own logs and says what to put here.
  name: sd-mpc
  mpc:
{_weight_lines(vessel)}

supervisor:
  engage: command          # nothing moves before the pilot has armed and `asvhil hold` has been sent
  max_distance_m: 100      # a station farther away is refused, unless `asvhil hold --within` allows it
  # geofence: [[LAT, LON], [LAT, LON], [LAT, LON]]   # the water where the boat may be
  # battery: {{low_v: 13.2, on_low: release}}          # where the autopilot does not know the charge
"""


def twin_text(boat: OwnBoat, file: str) -> str:
    """The YAML of the simulated twin of the boat whose config is `file`, beside it."""
    px4 = boat.autopilot == "px4"
    wind = boat.anemometer is not None
    anemometer = "  anemometer: {endpoint: serial:anemometer:115200, firmware: null}\n" if wind else ""
    return f"""\
# The simulated twin of {boat.name}: `asvhil sitl`, `learn` and `plant` with it need neither boat nor water.
base: {plain(file)}

links:
  autopilot:
    endpoint: udpin:127.0.0.1:14560
    streams_hz: {{SIM_STATE: 10}}   # truth, for the summary only
{anemometer}
supervisor:
  engage: auto             # simulation only
  station: {{lat_deg: 40.4237, lon_deg: -86.9212, heading_deg: 0.0}}

plant:
{"  autopilot: px4" + chr(10) if px4 else ""}\
  # vessel: ...            # by default just what was guessed; give it another hull to see what that costs
  seed: 1
  origin_lat_deg: 40.4237
  origin_lon_deg: -86.9212
  start_n_m: -14.0
  start_e_m: -3.0
  start_heading_deg: 0.0
  weather:
    wind: {{speed_mps: 3.0, toward_deg: 0.0}}
  links:
    autopilot: udpout:127.0.0.1:14560
{"    anemometer: pty:anemometer" + chr(10) if wind else ""}"""


def plain(text: str) -> str:
    """A text as a YAML value: as it is, or in quotes where it would be read as something else."""
    try:
        same = parse_yaml(text, "").tree == text
    except ConfigError:
        same = False
    return text if same else json.dumps(text)


def _vessel_lines(vessel: VesselConfig, hull: HullMeasures) -> str:
    words = dict(HULL_WORDS)
    if hull.turn_degps is None:
        words["yaw_drag_nm_per_radps2"] = NOT_ASKED["yaw_drag_nm_per_radps2"], "that rate"
    lines = []
    for key, (guess, better) in words.items():
        start = f"    {key}: {getattr(vessel, key):g}"
        lines.append(f"{start:<36} # {guess}" + ("" if better == "leave it" else f"; better: {better}"))
    lines.append(
        "    # (command, N) of one motor: T ((c - 0.05) / 0.95)^1.5, astern 0.6 of ahead; better: bollard pull"
    )
    lines.append("    thrust_curve:")
    lines += [f"      - [{command:.2f}, {thrust:g}]" for command, thrust in vessel.thrust_curve]
    return "\n".join(lines)


def _autopilot_lines(boat: OwnBoat) -> str:
    first = f"  autopilot:\n    profile: {boat.autopilot}\n    endpoint: {plain(boat.port)}"
    if boat.autopilot == "px4":
        return first
    own = "    override_system_id: 1      # must equal SYSID_MYGCS (newer: MAV_GCS_SYSID) of the autopilot"
    return f"{first}\n{own}"


def _anemometer_lines(boat: OwnBoat) -> str:
    if boat.anemometer is None:
        return """\
  # No anemometer: the wind then shows in the disturbance that the estimator finds. With one on an NMEA line:
  # anemometer: {endpoint: "serial:/dev/ttyUSB0:4800"}"""
    firmware = (
        "arduino_anemometer   # its version is asked for and checked" if boat.anemometer_kind == ARDUINO else "null"
    )
    return f"  anemometer:\n    endpoint: {plain(boat.anemometer)}\n    firmware: {firmware}"


def _weight_lines(vessel: VesselConfig) -> str:
    pull_mps2 = 2.0 * vessel.thrust_curve[-1][1] / vessel.mass_kg
    if pull_mps2 < LIVELY_MPS2:
        words, near = "Weights near the station: less of the heading and more of the distance than by default.", ""
    else:
        words = "So strong motors on so light a hull shuttle with the default weights; `slew` calms them."
        near = ", slew: 20"
    lag = "    unmodelled_lag_s: 0.13     # two thirds of the motor lag: for learned models, which have no motor states"
    return f"    # {words}\n    near: {{heading: 120{near}}}\n    lasting_offset_m: [0.10, 0.25]\n{lag}"
