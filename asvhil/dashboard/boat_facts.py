"""What the page needs to know of the boat, from its config: radii, fence, thrust, pulses."""

from __future__ import annotations

from typing import Any

from asvhil.config import Config

LENGTH_OF_ARM = 4.5  # of a catamaran; a picture of the boat needs no better


def boat_facts(config: Config) -> dict[str, Any]:
    """In JSON types. `radii`: (name, metres) about the station; `thrust`: rows of (command, N) of one motor."""
    controller, vessel, pwm = config.controller, config.vehicle.vessel, config.vehicle.pwm
    radii = [("near", controller.mpc.near_radius_m), ("far", controller.mpc.far_radius_m)]
    if controller.procedure.enabled:
        procedure = controller.procedure
        radii += [("hand-over", procedure.r_s_m), ("approach again", procedure.r_d_m)]
    return {
        "kind": "boat",
        "name": config.vehicle.name,
        "controller": controller.name,
        "radii": radii,
        "farthest_m": config.supervisor.max_distance_m,
        "length_m": LENGTH_OF_ARM * vessel.motor_arm_m,
        "width_m": 2.0 * vessel.motor_arm_m,
        "thrust": [list(row) for row in vessel.thrust_curve],
        "pulses_us": [pwm.astern_us, pwm.neutral_us, pwm.ahead_us],
    }
