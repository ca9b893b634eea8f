"""`asvhil study ...`: the long studies, each resumable, with its table, figure and JSON."""

from __future__ import annotations

import typer

from asvhil.commands.study_bound import bound
from asvhil.commands.study_learned import boat_models, changed_boats, learned_loop
from asvhil.commands.study_models import models
from asvhil.commands.study_pages import pages
from asvhil.commands.study_runs import approach, estimator, field_tests, robustness, safety, six_tests
from asvhil.commands.study_soak import soak
from asvhil.commands.study_solvers import solvers
from asvhil.commands.study_waves import waves

app = typer.Typer(no_args_is_help=True, help="Studies behind the tables under docs/results.")

for command in (
    models,
    bound,
    six_tests,
    solvers,
    approach,
    robustness,
    learned_loop,
    boat_models,
    changed_boats,
    waves,
    estimator,
    safety,
    field_tests,
    soak,
    pages,
):
    app.command()(command)
