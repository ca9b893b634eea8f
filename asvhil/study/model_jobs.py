"""The rows of the model table: kind, options, number of networks, and the sea of the training data."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from asvhil.errors import ConfigError, meant
from asvhil.train.options import OPTIONS, FitOptions
from asvhil.types import record

ODE_ITERATIONS = 20000
ODE_SEEDS = 1  # networks per data set that are trained by the adjoint method, which is slow
SEEDS = 3
IN_WAVES = " (waves)"


@record
class TrainingJob:
    """One row of the table: its name, the kind and options behind it, and how many networks a data set trains.

    A row with `waves` is trained and tested on logs that were driven in waves.
    """

    name: str
    kind: str
    options: FitOptions
    seeds: int
    waves: bool = False


def jobs(ode_iterations: int = ODE_ITERATIONS) -> tuple[TrainingJob, ...]:
    """The paper's models, LagNet, LagNet with its parts added one by one, and NNSEM and LagNet in waves."""
    lagnet = dataclasses.replace(OPTIONS["lagnet"], members=1)

    def variant(name: str, *frozen: str, mirror: bool = False) -> TrainingJob:
        options = dataclasses.replace(lagnet, frozen=frozen, mirror=mirror)
        return TrainingJob(name=name, kind="lagnet", options=options, seeds=SEEDS)

    def ode(kind: str) -> TrainingJob:
        options = dataclasses.replace(OPTIONS[kind], iterations=ode_iterations)
        return TrainingJob(name=kind, kind=kind, options=options, seeds=ODE_SEEDS)

    def in_waves(job: TrainingJob) -> TrainingJob:
        return dataclasses.replace(job, name=f"{job.name}{IN_WAVES}", waves=True)

    nnsem = TrainingJob(name="nnsem", kind="nnsem", options=OPTIONS["nnsem"], seeds=SEEDS)
    single = variant("lagnet: map, lag, mirror, skip (single)", mirror=True)
    return (
        TrainingJob(name="sd", kind="sd", options=OPTIONS["sd"], seeds=1),
        nnsem,
        variant("lagnet: lag alone", "map", "skip"),
        variant("lagnet: map, lag", "skip"),
        variant("lagnet: map, lag, mirror", "skip", mirror=True),
        single,
        TrainingJob(name="lagnet", kind="lagnet", options=OPTIONS["lagnet"], seeds=1),
        ode("node"),
        ode("knode"),
        in_waves(nnsem),
        in_waves(single),
    )


def chosen_jobs(known: Sequence[TrainingJob], only: Sequence[str]) -> tuple[TrainingJob, ...]:
    """The jobs of these names, or all for none. ConfigError for an unknown name."""
    for name in only:
        if name not in {job.name for job in known}:
            raise ConfigError(f"--only {name}: unknown{meant(name, (job.name for job in known), '; ')}")
    return tuple(job for job in known if not only or job.name in only)
