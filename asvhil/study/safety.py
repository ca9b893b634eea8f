"""Study of runaways: how soon a hold of a boat with a fault of its motion ends, and whether healthy ones ever do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from asvhil.config import load_config
from asvhil.motion.hypotheses import FAULTY
from asvhil.study.runner import Job, Run
from asvhil.study.safety_cases import FAULTS, SEEDS, WINDS, HoldCase, MotionFault, healthy, runaways
from asvhil.study.statistics import other_code
from asvhil.study.trials.safety import run_hold
from asvhil.study.trials.trial import run_key
from asvhil.supervisor.reasons import describe

CODES = {describe(h.fault): str(h.fault.reason) for h in FAULTY if h.fault is not None}  # by its text
THRUST_S, FARTHER_M = 15.0, 10.0  # asked for: ended, or told, within this thrust and before it is so much farther off


def study_safety(
    run: Run,
    part: str = "confirming",
    *,
    faults: Iterable[str] = tuple(FAULTS),
    with_healthy: bool = True,
    every: int = 1,
    healthy_s: float = 120.0,
    overrides: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Figures of all holds of a part as a JSON-ready tree; `every`: one in so many of them.

    `healthy_s`: the length of the holds of healthy boats.
    """
    wanted = set(faults)
    cases = [(fault, start, case) for fault, start, case in runaways(part) if fault.name in wanted][::every]
    sound = list(healthy(part, healthy_s))[::every] if with_healthy else []
    jobs = [_job(case, overrides) for case in (*(case for _, _, case in cases), *sound)]
    finished = run(run_hold, jobs)
    results = finished.results
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for (fault, start, case), result in zip(cases, results, strict=False):
        rows.setdefault(fault.name, {}).setdefault(case.boat, []).append({"start": start, **judge(fault, result)})
    calm: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for case, result in zip(sound, results[len(cases) :], strict=True):
        calm.setdefault(case.group, {}).setdefault(case.boat, []).append({"keys": list(case.keys), **result})
    return {
        "part": part,
        "every": every,
        "healthy_s": healthy_s,
        "winds": [list(wind) for wind in WINDS[part]],
        "seeds": list(SEEDS[part]),
        "overrides": list(overrides),
        "asked": {"thrust_s": THRUST_S, "farther_m": FARTHER_M},
        "runaways": rows,
        "healthy": calm,
        "runs_of_other_code": finished.outdated,
    }


def judge(fault: MotionFault, result: Mapping[str, Any]) -> dict[str, Any]:
    """A hold with its verdicts: `met`, as asked for, and `named`, by the code of the fault.

    `found`: the thrust (s) until it ended, or was told by name where that is enough, and how much farther off the boat
    got until then (m); None where neither came.
    """
    told = [at for text, at in result["told"].items() if CODES.get(text) in fault.codes]
    found = None
    if result["ended_s"] is not None:
        found = {"thrust_s": result["thrust_s"], "farther_m": result["farther_m"]}
    if fault.only_told and told and (found is None or told[0]["thrust_s"] < found["thrust_s"]):
        found = {"thrust_s": told[0]["thrust_s"], "farther_m": told[0]["farther_m"]}
    met = found is not None and found["thrust_s"] <= THRUST_S and found["farther_m"] < FARTHER_M
    return {**result, "found": found, "met": met, "named": result["reason"] in fault.codes or bool(told)}


def false_alarms(runs: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The holds of healthy boats that ended, or in which something was told of the motion."""
    return [run for run in runs if run["ended_s"] is not None or run["told"] or not run["begun"]]


def _job(case: HoldCase, overrides: tuple[str, ...]) -> Job:
    keys = (*case.keys, *overrides)
    key = f"safety {run_key(load_config(case.base, keys))} {case.hold_s:g}"
    return Job(key=key, group=f"{case.boat} {case.hold_s:g} s", arguments=(case.base, keys, case.hold_s))


def markdown(study: Mapping[str, Any]) -> str:
    """One table of the runaways, one of the healthy boats."""
    asked = study["asked"]
    winds = ", ".join(f"{speed:g} m/s toward {toward:g}°" for speed, toward in study["winds"])
    share = f", one in {study['every']} of them" if study["every"] > 1 else ""
    seeds = ", ".join(map(str, study["seeds"]))
    head = (
        f"Holds `{study['part']}`{share}: {winds}; seeds {seeds}; from 5 m off and from the station. "
        f"Met: ended, or told by name where that is enough (one motor dead, 45°), within {asked['thrust_s']:g} s of "
        f"thrust and before the boat was {asked['farther_m']:g} m farther off than at the begin. Named: by the right "
        "cause. Thrust and farther off until then: median and worst; of holds that were neither, how far off "
        "they got in a minute."
    )
    lines = [
        "| fault | boat | holds | ended | met | named | thrust, s | farther off, m |",
        "|" + " --- |" * 8,
    ]
    for name, boats in study["runaways"].items():
        for boat, runs in boats.items():
            lines.append(f"| {name} | {boat} | {_row(runs)} |")
    sound = ["| healthy boats | boat | holds | false alarms | farther off, m |", "|" + " --- |" * 5]
    total = wrong = 0
    for group, boats in study["healthy"].items():
        for boat, runs in boats.items():
            alarms = false_alarms(runs)
            total, wrong = total + len(runs), wrong + len(alarms)
            words = "; ".join(sorted({run["text"] or next(iter(run["told"]), "never held") for run in alarms}))
            count = f"**{len(alarms)}**: {words}" if alarms else "none"
            far = max(run["farther_m"] for run in runs)
            lines_of = f"| {group} | {boat} | {len(runs)} | {count} | {far:.1f} |"
            sound.append(lines_of)
    parts = [head, "### Runaways", "\n".join(lines)]
    if total:
        parts += [
            "### Healthy boats",
            f"{total} holds of {study['healthy_s']:g} s, {wrong} false alarms.",
            "\n".join(sound),
        ]
    return "\n\n".join([*parts, *other_code(study["runs_of_other_code"])]) + "\n"


def _row(runs: Sequence[Mapping[str, Any]]) -> str:
    ended = sum(run["ended_s"] is not None for run in runs)
    found = [run["found"] for run in runs if run["found"] is not None]
    met, named = (sum(run[key] for run in runs) for key in ("met", "named"))
    figures = f"{len(runs)} | {ended} | {met if met == len(runs) else f'**{met}**'} | {named}"
    thrust, farther = (_middle_and_worst([each[key] for each in found]) for key in ("thrust_s", "farther_m"))
    left = [run["farther_m"] for run in runs if run["found"] is None]
    if left:
        farther = f"{farther}; not found: {_middle_and_worst(left)}"
    return f"{figures} | {thrust} | {farther}"


def _middle_and_worst(values: Sequence[float]) -> str:
    if not values:
        return "-"
    ordered = sorted(values)
    return f"{ordered[len(ordered) // 2]:.1f}, {ordered[-1]:.1f}"
