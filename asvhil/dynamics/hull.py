"""Which boat a learned model was trained on, as the few figures of its hull and motors that decide how it moves."""

from __future__ import annotations

from collections.abc import Mapping

from asvhil.config import VesselConfig

SAME = 1.5  # figures within this factor are of one boat, measured twice or loaded otherwise
UNITS = {"mass": "kg", "yaw inertia": "kg m2", "motor arm": "m", "thrust ahead": "N", "thrust astern": "N"}


def hull_of(vessel: VesselConfig) -> dict[str, float]:
    """The figures by name, in the units of `UNITS`. Masses are with the water that moves along."""
    return {
        "mass": vessel.mass_kg + vessel.added_mass_surge_kg,
        "yaw inertia": vessel.inertia_yaw_kgm2 + vessel.added_inertia_yaw_kgm2,
        "motor arm": vessel.motor_arm_m,
        "thrust ahead": vessel.thrust_curve[-1][1],
        "thrust astern": -vessel.thrust_curve[0][1],
    }


def differences(trained: Mapping[str, float], vessel: VesselConfig) -> str:
    """How the hull of a model differs from a vessel, in words; "" where they are of one boat, or nothing is known."""
    return figures_apart(trained, hull_of(vessel))


def figures_apart(trained: Mapping[str, float], own: Mapping[str, float]) -> str:
    """The same of two hulls by their figures."""
    return ", ".join(
        f"{name} {trained[name]:.3g} {unit} for {own[name]:.3g} {unit}"
        for name, unit in UNITS.items()
        if name in trained and name in own and not 1.0 / SAME <= trained[name] / own[name] <= SAME
    )


def hull_text(vessel: VesselConfig) -> str:
    """What an owner knows a boat by, such as "38 kg, arm 0.42 m, motors of 28.5 N ahead, 17.1 N astern"."""
    ahead_n, astern_n = vessel.thrust_curve[-1][1], -vessel.thrust_curve[0][1]
    motors = f"motors of {ahead_n:g} N ahead, {astern_n:g} N astern"
    return f"{vessel.mass_kg:g} kg, arm {vessel.motor_arm_m:g} m, {motors}"
