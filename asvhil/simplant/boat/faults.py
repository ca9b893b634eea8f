"""Faults of the simulated boat: spans of time from the config, or drawn from the seed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asvhil.config import OF_ONE_DEVICE, FaultConfig, GlitchesConfig, PlantConfig
from asvhil.simplant.boat.vessel import NO_SIGNAL_US

STUCK_US = 5000  # beyond every range of pulses: full ahead
GLITCH_STREAM = 5  # of the plant's seed; 0 to 4 are those of the weather and the sensors


def all_faults(plant: PlantConfig) -> tuple[FaultConfig, ...]:
    """The faults of the config, and the glitches that its seed draws."""
    if plant.glitches is None:
        return plant.faults
    seed = np.random.SeedSequence(plant.seed, spawn_key=(GLITCH_STREAM,))
    return (*plant.faults, *_glitches(plant.glitches, np.random.default_rng(seed)))


def motor_signals_us(outputs_us: tuple[int, int], faults: frozenset[str], neutral_us: int) -> tuple[int, int]:
    """The pulse widths (port, starboard) that reach the motors: 0 for a dead one, mirrored for a reversed one.

    A stuck one has full ahead, as from a speed controller whose output has burnt through. Swapped: each motor hangs on
    the other's output. The other kinds name the motor, not the output.
    """
    if not faults:
        return outputs_us
    port_us, starboard_us = reversed(outputs_us) if "motors-swapped" in faults else outputs_us
    return (
        _signal_us(port_us, "port-motor", faults, neutral_us),
        _signal_us(starboard_us, "starboard-motor", faults, neutral_us),
    )


def _signal_us(output_us: int, motor: str, faults: frozenset[str], neutral_us: int) -> int:
    if motor in faults or output_us == NO_SIGNAL_US:
        return NO_SIGNAL_US
    if f"{motor}-stuck" in faults:
        return STUCK_US
    return 2 * neutral_us - output_us if f"{motor}-reversed" in faults else output_us


def _glitches(config: GlitchesConfig, rng: np.random.Generator) -> Iterator[FaultConfig]:
    """Rounds of all kinds in random order, so that a run of a few minutes has each of them."""
    t_s = config.from_s
    while True:
        for number in rng.permutation(len(config.kinds)):
            glitch = config.kinds[number]
            t_s += float(rng.exponential(config.gap_s))
            end_s = t_s + float(rng.uniform(glitch.least_s, glitch.most_s))
            device = glitch.device or (config.device if glitch.kind in OF_ONE_DEVICE else None)
            toward_deg, side = float(rng.uniform(0.0, 360.0)), float(rng.choice((-1.0, 1.0)))
            if end_s > config.until_s:
                return
            fault = FaultConfig(
                kind=glitch.kind,
                from_s=t_s,
                until_s=end_s,
                size=glitch.size,
                toward_deg=toward_deg,
                device=device,
            )
            yield fault.model_copy(update={"size": side * fault.magnitude}) if fault.kind == "heading-jump" else fault
            t_s = end_s + config.rest_s
