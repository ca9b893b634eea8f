"""`asvhil tune`: the search for a controller's gains or weights, one record for each controller."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.study_command import (
    RUNS,
    ConfigOption,
    OutOption,
    QuickOption,
    SchedulerOption,
    Study,
    WorkersOption,
    study_command,
)
from asvhil.commands.study_views import stem_of

if TYPE_CHECKING:
    from asvhil.study.runner import Finished, Function, Job, Run, StudyProgress, Tell

BUDGET = 100
QUICK_BUDGET = 10


@study_command
def tune(
    name: Annotated[list[str], typer.Argument(help="A controller, as controller.name; repeatable.")],
    output: OutOption = RUNS,
    budget: Annotated[
        int, typer.Option(min=1, help="Candidates at the least, the same for each; the last generation is whole.")
    ] = (BUDGET),
    seed: Annotated[int, typer.Option(min=0, help="Seed of the candidates.")] = 1,
    config: ConfigOption = "sitl",
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    quick: QuickOption = False,
) -> Study:
    """Search a controller's gains, or an MPC's weights, by CMA-ES; judged on winds and seeds that it did not see.

    Each generation goes to NAME.json in the folder: the same command resumes a search that was interrupted, and with a
    larger budget goes on where it had ended.
    """
    from asvhil.config import load_config
    from asvhil.config.registry import CONTROLLERS
    from asvhil.study import tuning
    from asvhil.study.rows import QUICK_S, checked
    from asvhil.study.runner import run_into
    from asvhil.study.search_spaces import spaces
    from asvhil.study.tuning_report import draw, markdown

    settings = load_config(config)  # and the plug-ins that it names
    for one in name:
        CONTROLLERS.get(one)  # one of an installed package
    known = spaces(settings)
    names = checked(name, known, "NAME")
    ending = "-quick" if quick else ""
    training, held_out = tuning.TRAINING, tuning.HELD_OUT
    if quick:
        training, held_out = (
            dataclasses.replace(cases, winds=cases.winds[:2], seeds=cases.seeds[:1]) for cases in (training, held_out)
        )
    given = min(budget, QUICK_BUDGET) if quick else budget
    each = len(training.cases)
    counts = {one: tuning.candidates_of(given, len(known[one])) * each for one in names}
    judged = 2 * len(held_out.cases) + each

    def figures(tell: Tell) -> dict[str, Any]:
        counter = _Counter(sum(counts.values()) + judged * len(names), tell)

        def run_of(function: Function, jobs: Sequence[Job]) -> Finished:
            run: Run = run_into(
                output / f"tune{ending}.jsonl", workers=workers, tell=counter.tell, scheduler=scheduler, isolate=True
            )
            return run(function, jobs)

        found: dict[str, Any] = {}
        for number, one in enumerate(names):
            before = sum(counts[earlier] + judged for earlier in names[:number])

            def show(done: int, best: float, before: int = before, one: str = one) -> None:
                counter.reach(before + done * each, f"{one}: {done} candidates, best typical ps {best:.2f}")

            typed = ["asvhil tune", one, f"--budget {given}", f"--seed {seed}"]
            typed += [f"--config {config}"] if config != "sitl" else []
            typed += ["--quick"] if quick else []
            found[one] = tuning.tune(
                one,
                given,
                seed,
                run_of,
                output / f"{one}{ending}.json",
                show,
                training=training,
                held_out=held_out,
                window_s=QUICK_S if quick else (tuning.FROM_S, tuning.TO_S),
                base=config,
                command=" ".join(typed),
            )
        return {"controllers": found}

    return Study(
        title="tuning",
        stem=stem_of("tune", quick),
        figures=figures,
        text=markdown,
        store=output / f"tune{ending}.jsonl",
        keeps=tuple((f"the record of the search of {one}", output / f"{one}{ending}.json") for one in names),
        draw=draw,
        made_of=None,
    )


class _Counter:
    """The progress of a search out of that of its generations, which are run one after the other."""

    def __init__(self, total: int, tell: Tell) -> None:
        self._total, self._tell = total, tell
        self._before = self._now = 0
        self._made = 0  # runs that this process has waited for
        self._begin_s = time.monotonic()

    def tell(self, now: StudyProgress) -> None:
        self._made += not now.note and now.done == self._now + 1
        self._now = now.done
        self._say(self._before + now.done, now.note)

    def reach(self, done: int, note: str) -> None:
        """A generation is done."""
        self._before, self._now = done, 0
        self._say(done, note)

    def _say(self, done: int, note: str) -> None:
        from asvhil.study.runner import StudyProgress

        done = min(done, self._total)  # a stored search may have gone beyond this budget
        each_s = (time.monotonic() - self._begin_s) / self._made if self._made else None
        left_s = None if each_s is None else each_s * (self._total - done)
        self._tell(StudyProgress(done=done, total=self._total, remaining_s=left_s, note=note))
