"""A campaign: its runs, their table, and what it says; the worst runs once more, with logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from asvhil.errors import AsvhilError
from asvhil.files import is_there
from asvhil.study.campaigns.design import NO_VARIANT, PlannedRun, job_of, plan
from asvhil.study.campaigns.sensitivity import sensitivities
from asvhil.study.campaigns.spec import CampaignSpec
from asvhil.study.campaigns.table import Row, row_of, write_parquet
from asvhil.study.runner import Finished, Job, Run
from asvhil.study.statistics import mean_ci95
from asvhil.study.trials.trial import run_logged_trial, run_named_trial

CONFIDENCE = 0.95
MILLION = 1_000_000
MOST_LISTED = 20  # failures in the summary; the table has all


def run_campaign(
    spec: CampaignSpec,
    run: Run,
    again: Run,
    output: Path,
    stem: str,
    planned: Callable[[int], None] = lambda count: None,
) -> tuple[dict[str, Any], list[Row]]:
    """The summary and the table of a campaign. Writes the table and the logs of the worst runs to `output`.

    `run` runs the jobs and must isolate them (`run_into(..., isolate=True)`); `again` runs those of the worst cases, on
    this machine. The spec must have been checked (`design.check`). `planned` is told every thousandth run before the
    first is run. AsvhilError where a file cannot be written.
    """
    runs: list[PlannedRun] = []
    jobs: list[Job] = []
    for one in plan(spec):
        runs.append(one)
        jobs.append(job_of(one, spec.window_s))
        if len(runs) % 1000 == 0:
            planned(len(runs))
    finished = run(run_named_trial, jobs)
    rows = [
        row_of(one, result, finished.errors.get(job.key, ""))
        for one, job, result in zip(runs, jobs, finished.results, strict=True)
    ]
    write_parquet(spec, rows, output / f"{stem}.parquet")
    worst, other = _worst(spec, runs, jobs, rows, again, output / f"{stem}-worst")
    return {
        "campaign": spec.model_dump(mode="json"),
        "runs": len(rows),
        "failed": sum(bool(row["error"]) for row in rows),
        "failures": [_named(spec, row) | {"error": row["error"]} for row in rows if row["error"]][:MOST_LISTED],
        "let_go": sum(row["held"] is not None and row["held"] < 1.0 for row in rows),
        "score": spec.score,
        "all": summary_of(rows, spec.score),
        "variants": variants_of(spec, rows),
        "sensitivity": sensitivity_of(spec, rows),
        "worst": worst,
        "cost": {**cost_of(finished, len(rows)), "logs_of_other_bits": other},
    }, rows


def summary_of(rows: Sequence[Row], score: str) -> dict[str, Any] | None:
    """Mean, median, 95th percentile of the score and the share of runs held throughout, with 95 % intervals.

    That of the mean is by Student's t, those of the percentiles need no distribution (order statistics), that of the
    share is Wilson's. None of no runs; an end that the runs do not bound is None.
    """
    from scipy.stats import binomtest, quantile_test

    known = [row for row in rows if row[score] is not None]
    if not known:
        return None
    scores = [row[score] for row in known]
    held = sum(row["held"] >= 1.0 for row in known)
    wilson = binomtest(held, len(known)).proportion_ci(CONFIDENCE, method="wilson")
    found: dict[str, Any] = {"runs": len(known), **mean_ci95(scores)}
    for name, share in (("median", 0.5), ("p95", 0.95)):
        interval = quantile_test(scores, q=0.0, p=share).confidence_interval(CONFIDENCE)
        found[name] = {"value": _quantile(scores, share), "ci95": [_known(interval.low), _known(interval.high)]}
    found["held"] = {"share": held / len(known), "ci95": [float(wilson.low), float(wilson.high)]}
    return found


def variants_of(spec: CampaignSpec, rows: Sequence[Row]) -> dict[str, Any]:
    """The summary of each variant, and the mean difference to the first one at the same points and seeds."""
    if not spec.variants:
        return {}
    parts = {name: [row for row in rows if row["variant"] == name] for name in spec.variants}
    first = next(iter(parts.values()))
    found: dict[str, Any] = {}
    for name, part in parts.items():
        pairs = [
            own[spec.score] - other[spec.score]
            for own, other in zip(part, first, strict=True)
            if own[spec.score] is not None and other[spec.score] is not None
        ]
        behind = mean_ci95(pairs) if pairs and part is not first else None
        found[name] = {"summary": summary_of(part, spec.score), "behind_first": behind}
    return found


def sensitivity_of(spec: CampaignSpec, rows: Sequence[Row]) -> dict[str, Any]:
    """`sensitivities` of the parameters, and of the variant where there are some."""
    known = [row for row in rows if row[spec.score] is not None]
    numeric = {name: parameter.is_number for name, parameter in spec.parameters.items()}
    if spec.variants:
        numeric["variant"] = False
    columns = {name: [row[name] for row in known] for name in numeric}
    return sensitivities(columns, numeric, [row[spec.score] for row in known])


def cost_of(finished: Finished, runs: int) -> dict[str, Any]:
    """Computing time: of a run, around it, and what a million such runs would take. All from measured times."""
    mean_s = sum(finished.group_s.values()) / max(1, runs)
    each_s = mean_s + (finished.idle_s or 0.0)
    return {
        "run_s": mean_s,
        "overhead_s": finished.idle_s,
        "runs_per_core_hour": 3600.0 / each_s if each_s else None,
        "million_core_hours": MILLION * each_s / 3600.0,
        "processes": finished.processes,
        "elapsed_s": round(finished.elapsed_s, 2),
        "runs_now": finished.runs_now,
        "runs_of_other_code": finished.outdated,
    }


def _worst(
    spec: CampaignSpec, runs: Sequence[PlannedRun], jobs: Sequence[Job], rows: Sequence[Row], again: Run, folder: Path
) -> tuple[list[dict[str, Any]], int]:
    """The runs of the highest scores, run again with a log each; a log that is there already is kept.

    And the number of logs made now whose run scored otherwise, as on another machine or with other code.
    """
    known = [row for row in rows if row[spec.score] is not None]
    chosen = sorted(known, key=lambda row: (-row[spec.score], row["run"]))[: spec.worst]
    # A log is named by the run's key, so that one of an earlier campaign is never taken for it.
    logs = {row["run"]: folder / f"run-{row['run']:06d}-{jobs[row['run']].key.split()[1][:8]}.mcap" for row in chosen}
    if chosen:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise AsvhilError(f"{folder}: cannot be made ({error.strerror}), for the logs of the worst runs") from None
    wanted = [row for row in chosen if not is_there(logs[row["run"]])]
    other = 0
    if wanted:
        arguments = [(*jobs[row["run"]].arguments, str(logs[row["run"]])) for row in wanted]
        made = again(run_logged_trial, [Job(key=f"log {one[-1]}", group="logs", arguments=one) for one in arguments])
        for row, result in zip(wanted, made.results, strict=True):
            other += row_of(runs[row["run"]], result, "")[spec.score] != row[spec.score]
    named = [
        _named(spec, row)
        | {spec.score: row[spec.score], "held": row["held"], "log": f"{folder.name}/{logs[row['run']].name}"}
        | {"config": runs[row["run"]].base, "overrides": list(runs[row["run"]].overrides)}
        for row in chosen
    ]
    return named, other


def _named(spec: CampaignSpec, row: Row) -> dict[str, Any]:
    variant = {"variant": row["variant"]} if row["variant"] != NO_VARIANT else {}
    return {"run": row["run"], "seed": row["seed"], **variant, "values": {name: row[name] for name in spec.parameters}}


def _quantile(values: Sequence[float], share: float) -> float:
    import numpy as np

    return float(np.quantile(values, share))


def _known(value: float) -> float | None:
    return None if value != value or value in (float("inf"), float("-inf")) else float(value)
