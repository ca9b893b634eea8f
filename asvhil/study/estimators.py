"""Comparison of the estimators on both boats' sensors: errors, abrupt faults, and station keeping in glitches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from asvhil.config import load_config
from asvhil.study.rows import FROM_S, TO_S, row_overrides
from asvhil.study.runner import Job, Run
from asvhil.study.six_tests import cost_figures
from asvhil.study.statistics import mean_ci95
from asvhil.study.trials.abrupt import AFTER_S, MOVE_DEG, MOVE_M, run_abrupt, run_survival
from asvhil.study.trials.estimation import ACTIVITIES, KINDS, METRICS, run_estimation
from asvhil.study.trials.trial import run_key
from asvhil.types import record

SETS = {"VN-300": "sitl-vn300", "BREAM": "sitl-bream"}  # name: config
GUSTY = ("plant.weather.wind.speed_mps=6",)
CONDITIONS: dict[str, tuple[str, ...]] = {
    "calm": ("plant.weather.wind={speed_mps: 2, gust_along: 0, gust_across: 0}",),
    "gusty": GUSTY,
    "glitching": GUSTY,
}
TURN_DEG = 72.0  # between the winds of two seeds
# Limits of the EKF, and the required ratio to the others.
ASKED: dict[str, dict[str, float]] = {
    "VN-300": {"velocity_mps": 0.03, "heading_deg": 0.15, "wind_speed_mps": 0.3, "wind_direction_deg": 5.0},
    "BREAM": {"velocity_mps": 0.10, "heading_deg": 2.0},
}
RAW_RATIO, FIR_RATIO = 2.0, 1.0
WINDOW_S = (30.0, 150.0)
QUICK_WINDOW_S = (8.0, 14.0)

# Fault: (kind, duration in s). Of a boat with several sets of sensors it is the preferred one that fails.
ABRUPT: dict[str, tuple[str, float]] = {
    "none": ("", 30.0),
    "position jumps by 20 m": ("gnss-jump", 5.0),
    "heading jumps by 60 degrees": ("heading-jump", 5.0),
    "GNSS frozen": ("gnss-frozen", 10.0),
    "GNSS silent": ("gnss-silent", 30.0),
    "heading silent": ("heading-silent", 30.0),
    "IMU silent": ("imu-silent", 30.0),
    "anemometer stuck": ("anemometer-stuck", 30.0),
    "anemometer silent": ("anemometer", 30.0),
}
ALL_OF_IT = {"VN-300": {"INS silent": ("ins", 30.0)}, "BREAM": {"GNSS and compass silent": ("nmea", 30.0)}}
DEVICE = {"VN-300": "ins", "BREAM": "nmea"}
EVERYWHERE = frozenset({"anemometer", "anemometer-stuck", "ins", "nmea"})  # kinds that know their device
NAMED_BY = {  # words of which a flag about the sensor has one
    "gnss": ("gnss", "position", "velocity"),
    "heading": ("compass", "heading"),
    "imu": ("gyro", "accelerometer", "yaw_rate", "acceleration"),
}
WIND_NAMES = ("wind", "anemometer")
RECOVERY_S = 5.0
START_S = 60.0
SURVIVAL_ROW = "2"
LOST_M = 20.0  # the paper's R_D


@record
class Plan:
    """How much of each part is run; `abrupt` names the faults, all of them where it is None."""

    seeds: Sequence[int]
    abrupt_seeds: Sequence[int]
    survival_seeds: Sequence[int]
    window_s: tuple[float, float]
    start_s: float
    longest_s: float
    after_s: float
    survival_s: tuple[float, float]
    abrupt: frozenset[str] | None = None


FULL = Plan(
    seeds=range(1, 6),
    abrupt_seeds=range(1, 4),
    survival_seeds=range(1, 21),
    window_s=WINDOW_S,
    start_s=START_S,
    longest_s=30.0,
    after_s=AFTER_S,
    survival_s=(FROM_S, TO_S),
)
QUICK = Plan(
    seeds=(1,),
    abrupt_seeds=(1,),
    survival_seeds=(1,),
    window_s=QUICK_WINDOW_S,
    start_s=8.0,
    longest_s=3.0,
    after_s=12.0,
    survival_s=QUICK_WINDOW_S,
    abrupt=frozenset({"none", "GNSS silent", "INS silent", "GNSS and compass silent"}),
)


def run_part(part: str, base: str, overrides: tuple[str, ...], arguments: tuple[Any, ...]) -> dict[str, Any]:
    """One run of a part of the study; importable, for other processes."""
    runs: dict[str, Callable[..., dict[str, Any]]] = {
        "errors": run_estimation,
        "abrupt": run_abrupt,
        "survival": run_survival,
    }
    return runs[part](base, overrides, *arguments)


def study_estimators(
    run: Run,
    *,
    plan: Plan = FULL,
    sets: Iterable[str] = tuple(SETS),
    overrides: tuple[str, ...] = (),
) -> dict[str, Any]:
    """All tables."""
    jobs: list[Job] = []
    names: list[tuple[str, ...]] = []
    for name in sets:
        for path, job in [*_error_jobs(name, plan, overrides), *_abrupt_jobs(name, plan, overrides)]:
            names.append(path)
            jobs.append(job)
    if "BREAM" in sets:
        for path, job in _survival_jobs(plan, overrides):
            names.append(path)
            jobs.append(job)
    finished = run(run_part, jobs)
    found = list(zip(names, finished.results, strict=True))
    cells = _errors_of(found)
    return {
        "window_s": list(plan.window_s),
        "seeds": list(plan.seeds),
        "abrupt_seeds": list(plan.abrupt_seeds),
        "errors": cells,
        "verdicts": {name: verdicts(name, activities) for name, activities in cells.items()},
        "abrupt": _abrupt_of(found),
        "survival": _survival_of(found, plan),
        "traces": _traces_of(found),
        "cost": cost_figures(finished),
    }


# --- runs -------------------------------------------------------------------------------------------


def _job(part: str, group: str, base: str, overrides: tuple[str, ...], arguments: tuple[Any, ...]) -> Job:
    key = f"estimator {part} {run_key(load_config(base, overrides))} {arguments}"
    return Job(key=key, group=group, arguments=(part, base, overrides, arguments))


def _error_jobs(name: str, plan: Plan, overrides: tuple[str, ...]) -> Iterable[tuple[tuple[str, ...], Job]]:
    for seed in plan.seeds:
        toward_deg = (TURN_DEG * (seed - 1) + 180.0) % 360.0 - 180.0
        for activity in ACTIVITIES:
            for condition, keys in CONDITIONS.items():
                seeded = (f"plant.seed={seed}", f"controller.manoeuvres.seed={seed}")
                wind = f"plant.weather.wind.toward_deg={toward_deg:g}"
                start = _glitches(name, plan.window_s[0]) if condition == "glitching" else ()
                all_keys = (*keys, wind, *seeded, *start, *overrides)
                traces = seed == min(plan.seeds)
                job = _job("errors", f"{name} errors", SETS[name], all_keys, (activity, plan.window_s, traces))
                yield ("errors", name, activity, condition, str(seed)), job


def _glitches(name: str, from_s: float) -> tuple[str, ...]:
    """The config keys of the glitches; on a boat with two sets of sensors they are in the preferred one."""
    device = ", device: ins" if name == "VN-300" else ""
    return (f"plant.glitches={{from_s: {from_s:g}{device}}}",)


def _abrupt_jobs(name: str, plan: Plan, overrides: tuple[str, ...]) -> Iterable[tuple[tuple[str, ...], Job]]:
    for seed in plan.abrupt_seeds:
        for label, (kind, asked_s) in (ABRUPT | ALL_OF_IT[name]).items():
            if plan.abrupt is not None and label not in plan.abrupt:
                continue
            duration_s = min(asked_s, plan.longest_s)
            device = "" if kind in EVERYWHERE else f", device: {_device(name, kind)}"
            span = f"from_s: {plan.start_s:g}, until_s: {plan.start_s + duration_s:g}"
            fault = (f"plant.faults=[{{kind: {kind}, {span}{device}}}]",) if kind else ()
            keys = (*row_overrides(SURVIVAL_ROW, seed), *fault, *overrides)
            job = _job("abrupt", f"{name} abrupt", SETS[name], keys, (plan.start_s, duration_s, plan.after_s))
            yield ("abrupt", name, label, str(seed)), job


def _survival_jobs(plan: Plan, overrides: tuple[str, ...]) -> Iterable[tuple[tuple[str, ...], Job]]:
    for seed in plan.survival_seeds:
        keys = (*row_overrides(SURVIVAL_ROW, seed), "plant.glitches={}", *overrides)
        yield ("survival", str(seed)), _job("survival", "survival", SETS["BREAM"], keys, (plan.survival_s, LOST_M))


def _device(name: str, kind: str) -> str:
    """The device of the preferred sensor of a kind of fault: the IMU of BREAM is the autopilot's."""
    return "autopilot" if (name, kind) == ("BREAM", "imu-silent") else DEVICE[name]


# --- figures ---------------------------------------------------------------------------------------

Found = Sequence[tuple[tuple[str, ...], Mapping[str, Any]]]


def _errors_of(found: Found) -> dict[str, Any]:
    """{set: {activity: {condition: {kind: {metric: mean and interval over the seeds}}}}}"""
    runs: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for (part, *path), result in found:
        if part == "errors":
            name, activity, condition, _ = path
            runs.setdefault((name, activity, condition), []).append(result)
    cells: dict[str, Any] = {}
    for (name, activity, condition), results in runs.items():
        kinds = {kind: _mean_errors([result["errors"][kind] for result in results]) for kind in KINDS}
        invalid = {kind: max(result["invalid"][kind] for result in results) for kind in KINDS}
        cells.setdefault(name, {}).setdefault(activity, {})[condition] = {"errors": kinds, "invalid": invalid}
    return cells


def _mean_errors(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean and interval of each metric, None where any run has none."""
    return {
        metric: None if any(part[metric] is None for part in parts) else mean_ci95([part[metric] for part in parts])
        for metric in METRICS
    }


def verdicts(name: str, activities: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Each figure required of the EKF beside the figure reached, in each activity and condition."""
    lines = []
    for activity, conditions in activities.items():
        for condition, cell in conditions.items():
            for metric, asked in ASKED[name].items():
                ekf, fir, raw = (cell["errors"][kind][metric] for kind in KINDS)
                values = [None if part is None else part["mean"] for part in (ekf, fir, raw)]
                lines.append({"activity": activity, "condition": condition, "metric": metric, **_judge(asked, values)})
    return lines


def _judge(asked: float, values: Sequence[float | None]) -> dict[str, Any]:
    ekf, fir, raw = values
    ratio_fir = None if ekf is None or fir is None else fir / ekf
    ratio_raw = None if ekf is None or raw is None else raw / ekf
    return {
        "asked": asked,
        "ekf": ekf,
        "ratio_fir": ratio_fir,
        "ratio_raw": ratio_raw,
        "met": ekf is not None and ekf <= asked,
        "better": ratio_fir is not None and ratio_raw is not None and ratio_fir > FIR_RATIO and ratio_raw >= RAW_RATIO,
    }


def _abrupt_of(found: Found) -> dict[str, Any]:
    """{set: {fault: the worst of all seeds}}, beside the limits."""
    runs: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for (part, *path), result in found:
        if part == "abrupt":
            runs.setdefault((path[0], path[1]), []).append(result)
    table: dict[str, Any] = {}
    for (name, label), results in runs.items():
        table.setdefault(name, {})[label] = worst(label, (ABRUPT | ALL_OF_IT[name])[label][0], results)
    return table


def worst(label: str, kind: str, results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The largest of each figure, the flag that was slowest to come up, and whether all limits are kept."""
    figures = {
        key: max(result[key] for result in results)
        for key in ("moved_m", "moved_deg", "moved_after_m", "moved_after_deg", "wind_moved_mps", "invalid")
    }
    recoveries = [result["recovery_s"] for result in results]
    recovery_s = None if None in recoveries else max(recoveries)
    delays = [min((d for flag, d in result["flags"].items() if names(kind, flag)), default=None) for result in results]
    known = [delay for delay in delays if delay is not None]
    named = len(known) == len(delays)
    return {
        **figures,
        "recovery_s": recovery_s,
        "flag_delay_s": max(known) if named and known else None,
        "flags": sorted({flag for result in results for flag in result["flags"]}),
        "false_flags": sorted({flag for result in results for flag in result["false_flags"]}),
        "held": all(result["held"] for result in results),
        "still": figures["moved_m"] <= MOVE_M and figures["moved_deg"] <= MOVE_DEG,
        "named": named if kind else not any(result["flags"] for result in results),
        "recovered": recovery_s is not None and recovery_s <= RECOVERY_S,
    }


def names(kind: str, flag: str) -> bool:
    """Whether a flag is about the sensor that a kind of fault is in."""
    if kind.startswith("anemometer"):
        return any(word in flag for word in WIND_NAMES)
    if kind in ("ins", "nmea"):
        return any(word in flag for words in NAMED_BY.values() for word in words)
    return any(word in flag for word in NAMED_BY.get(kind.split("-")[0], ()))


def _survival_of(found: Found, plan: Plan) -> dict[str, Any]:
    """The run of each seed, and the number of lost ones."""
    runs = {path[1]: dict(result) for path, result in found if path[0] == "survival"}
    return {
        "row": SURVIVAL_ROW,
        "window_s": list(plan.survival_s),
        "runs": runs,
        "lost": sorted((seed for seed, result in runs.items() if result["lost"]), key=int),
        "max_distance_m": max((result["max_distance_m"] for result in runs.values()), default=None),
    }


def _traces_of(found: Found) -> dict[str, Any]:
    """Points of the curves of one run for each set and condition, of a boat that keeps station."""
    traces: dict[str, Any] = {}
    for path, result in found:
        if path[0] == "errors" and path[2] == "station" and "traces" in result:
            traces.setdefault(path[1], {})[path[3]] = result["traces"]
    return traces
