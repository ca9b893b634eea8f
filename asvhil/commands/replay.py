"""`asvhil replay`: a log run through the backseat again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import FaultOption, JsonOption, PluginOption, RecordedPluginsOption, SetOption
from asvhil.commands.outputs import check_apart, check_figures, check_json, check_picture, config_and_bases, write_json
from asvhil.commands.views import progress, say, ticks_to
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.logs.following import Difference
    from asvhil.logs.replay import ReplayResult


TLOG_CONFIG = "field"


def replay(
    log: Annotated[
        Path | None, typer.Argument(help="A log of asvhil, the first of its segments, or a run's folder.")
    ] = None,
    tlog: Annotated[
        Path | None, typer.Option("--tlog", metavar="FILE", help="A MAVLink telemetry log: codec and estimator only.")
    ] = None,
    config: Annotated[
        str | None, typer.Option(help="With --tlog: the config to estimate with; field by default.")
    ] = None,
    set_: SetOption = [],  # noqa: B006
    plugin: PluginOption = [],  # noqa: B006
    allow_recorded_plugins: RecordedPluginsOption = False,
    fault: FaultOption = [],  # noqa: B006
    what_if: Annotated[
        list[str],
        typer.Option("--what-if", metavar="KEY=VALUE", help="Another controller or estimator; repeatable."),
    ] = [],  # noqa: B006
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --what-if: draw the differences (PNG, SVG or PDF).")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Run a log through the backseat and compare every tick byte by byte; exit 1 where one differs.

    From a tick that differs on, the recorded solutions are handed on, and all ticks are compared with a tolerance of
    1e-6. Exit 0 if they agree so and the log is of a machine whose arithmetic is another.

    With --fault, times from the log's first tick: what the backseat would have noticed and done; nothing is compared.
    With --what-if: what another controller or estimator would have computed. Open loop, the boat moves as recorded.
    """
    from rich.console import Console

    console = Console()
    if (log is None) == (tlog is None):
        raise ConfigError("replay: give either an MCAP log or --tlog FILE")
    check_apart(("the log", log or tlog), ("--picture", picture), ("--json", json_))
    if tlog is not None:
        given: dict[str, Any] = {"fault": fault, "what-if": what_if, "picture": picture, "plugin": plugin}
        given["allow-recorded-plugins"] = allow_recorded_plugins
        for option in (name for name, value in given.items() if value):
            raise ConfigError(f"replay: --{option} goes with an MCAP log of asvhil, not with --tlog")
        check_figures(json_, *config_and_bases(config or TLOG_CONFIG))
        _replay_tlog(console, tlog, config or TLOG_CONFIG, tuple(set_), json_)
        return
    assert log is not None
    if set_ or config:
        words = "an MCAP log is replayed with the config it holds; --what-if has another controller or estimator"
        raise ConfigError(f"replay: --{'set' if set_ else 'config'} goes with --tlog only; {words}")
    if fault and what_if:
        raise ConfigError("replay: --fault and --what-if are two questions; ask one at a time")
    if picture is not None and not what_if:
        raise ConfigError("replay: --picture goes with --what-if")
    check_picture(picture)
    check_json(json_)
    from asvhil.logs.plugins import load_plugins
    from asvhil.logs.replay import replay as replay_log

    load_plugins([log], plugin, allow_recorded=allow_recorded_plugins)

    if fault:
        _replay_faults(console, log, fault, json_)
        return
    if what_if:
        _replay_what_if(console, log, what_if, json_, picture)
        return
    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        result = replay_log(log, ticks_to(bar, task))
    write_json(json_, _figures(result))
    for line in result.damaged_records:
        say(console, f"{log}: {line}")
    speed = f"{result.span_s:.1f} s in {result.wall_s:.2f} s, {result.span_s / result.wall_s:.0f} times real time"
    tail = f", up to where the log is not whole: {result.damage}" if result.truncated else ""
    if result.mismatch is None:
        say(console, f"{log}: {result.compared} ticks bit-exact ({speed}){tail}")
        return
    _say_differences(console, log, result, f"{speed}{tail}")
    if not result.same_within_tolerance:
        raise typer.Exit(1)


def _figures(result: ReplayResult) -> dict[str, Any]:
    """The figures of a replay, for --json."""
    from asvhil.logs.following import TOLERANCE

    mismatch, followed = result.mismatch, result.followed
    return {
        "ticks": result.ticks,
        "compared": result.compared,
        "exact": mismatch is None,
        "mismatch": None
        if mismatch is None
        else {"tick": mismatch.tick, "t_ns": mismatch.t_ns, "field": mismatch.field},
        "followed": None
        if followed is None
        else {
            "differing": followed.differing,
            "tolerance": TOLERANCE,
            "beyond": None if followed.beyond is None else _difference(followed.beyond),
            "largest": None if followed.largest is None else _difference(followed.largest),
        },
        "other_machine": list(result.other_machine),
        "truncated": result.truncated,
        "damaged_records": list(result.damaged_records),
        "span_s": result.span_s,
        "wall_s": result.wall_s,
        "realtime_factor": result.span_s / result.wall_s if result.wall_s else None,
    }


def _difference(one: Difference) -> dict[str, Any]:
    size = one.size if math.isfinite(one.size) else None
    return {"tick": one.tick, "t_ns": one.t_ns, "field": one.field, "size": size}


def _say_differences(console: Any, log: Path, result: ReplayResult, tail: str) -> None:
    """What differs, by tick and field, and what of the machine or of the plug-ins does."""
    from asvhil.logs.following import TOLERANCE

    mismatch, followed = result.mismatch, result.followed
    assert mismatch is not None and followed is not None
    changed = f" (plug-ins: {', '.join(result.changed_packages)})" if result.changed_packages else ""
    if followed.beyond is None:
        largest = followed.largest
        most = "" if largest is None else f", at most {largest.size:.1e} (tick {largest.tick}, {largest.field})"
        elsewhere = " on a machine of other arithmetic" if result.other_arithmetic else ""
        say(
            console,
            f"{log}: not bit-exact, but the same within {TOLERANCE:g}{elsewhere}: {followed.differing} of "
            f"{followed.compared} ticks differ{most}, with the recorded solutions handed on{changed} ({tail})",
        )
    else:
        one, count = followed.beyond, f"{followed.differing} of {followed.compared} ticks differ"
        say(console, f"{log}: tick {one.tick} at {one.t_ns} ns differs: {one.field}{changed}; {count} ({tail})")
    if mismatch.tick != (followed.beyond or mismatch).tick:
        say(console, f"the first difference of all is in tick {mismatch.tick}: {mismatch.field}")
    for line in result.other_machine:
        say(console, line)


def _replay_faults(console: Any, log: Path, texts: list[str], json_file: Path | None) -> None:
    from asvhil.config.fault_text import parse_fault
    from asvhil.logs.fault_replay import replay_with_faults

    faults = [parse_fault(text) for text in texts]
    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        found = replay_with_faults(log, faults, ticks_to(bar, task))
    first = found.first_difference
    figures = {
        "faults": texts,
        "ticks": found.ticks,
        "edited_frames": found.edited,
        "untouched_ports": list(found.untouched),
        "first_difference": None if first is None else dict(zip(("tick", "t_s", "field"), first, strict=True)),
        "recorded_holds": list(found.recorded_holds),
        "holds": list(found.holds),
        "notes": [dict(zip(("t_s", "subject", "text", "ok"), note, strict=True)) for note in found.notes],
        "estimate_off_m": found.estimate_off_m,
        "pulses_apart_us": found.pulses_apart_us,
        "judged_to_s": found.judged_to_s,
    }
    write_json(json_file, figures)
    say(
        console,
        f"{log}: {found.ticks} ticks with {', '.join(texts)} in {found.edited} frames; the boat moves as recorded",
    )
    for port in found.untouched:
        say(console, f"{port}: as recorded, its bytes cannot be edited")
    if not found.edited:
        say(console, "the faults change no byte of this log: it ends before them, or has nothing that shows them")
    if first is None:
        say(console, "no output differs from the record")
    else:
        say(console, f"outputs differ from {first[1]:.2f} s on: {first[2]}")
    for t_s, subject, text, ok in found.notes:
        say(console, f"{t_s:7.2f} s  {subject}: {text}{'' if ok else ' (!)'}")
    for name, holds in (("recorded", found.recorded_holds), ("with the faults", found.holds)):
        for hold in holds:
            ended = f"ended by {hold['ended']}" if hold["ended"] else "to the end"
            say(console, f"{name}: hold from {hold['from_s']:.2f} to {hold['to_s']:.2f} s, {ended}")
    if found.judged_to_s is not None:
        say(
            console,
            f"not judged from {found.judged_to_s:.2f} s on: the hold goes on there, and the recorded one has ended",
        )
    if first is not None:
        off_m, apart_us = found.estimate_off_m, found.pulses_apart_us
        say(console, f"at most {off_m:.2f} m between the estimates, {apart_us} us between the commands")
    if not found.edited:
        raise typer.Exit(1)


def _replay_what_if(
    console: Any, log: Path, overrides: list[str], json_file: Path | None, picture: Path | None
) -> None:
    from asvhil.logs.what_if import draw_what_if, replay_what_if, what_if_figures

    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        found = replay_what_if(log, overrides, ticks_to(bar, task))
    figures = what_if_figures(found)
    write_json(json_file, figures)
    say(console, f"{log}: {figures['ticks']} ticks with {', '.join(overrides)}; open loop, the boat moves as recorded")
    apart, commands = figures["estimates_apart"], figures["commands_apart"]
    if apart["position_m"] is not None:
        position, heading = apart["position_m"], apart["heading_deg"]
        say(
            console,
            f"estimates apart: {position['mean']:.3f} m, at most {position['max']:.3f} m; heading "
            f"{heading['mean']:.2f} deg, at most {heading['max']:.2f} deg",
        )
    if commands is not None:
        say(console, f"commands apart: {commands['mean']:.3f} of full command, at most {commands['max']:.3f}")
    for name, label in (("recorded", "recorded"), ("what_if", "what if")):
        motors, truth = figures["motors"][name], figures["against_truth"][name]
        model = figures["model_error"][name]
        if model is not None:
            u, v, r = model["one_step"]
            ahead = ", ".join(f"{value:.3f}" for value in model["horizon"])
            words = f"u {u:.3f} m/s, v {v:.3f} m/s, r {r:.3f} rad/s after a step, {ahead} after the horizon"
            say(console, f"{label}: mean error of the model: {words}")
        if motors["energy"] is not None:
            turned = motors["reversals_per_min"]
            words = "" if turned is None else f", {turned:.1f} reversals per minute"
            say(console, f"{label}: energy {motors['energy']:.4f}{words}")
        if truth is not None:
            words = f"{truth['position_m']:.3f} m, heading {truth['heading_deg']:.2f} deg (rms)"
            say(console, f"{label}: estimate against the truth {words}")
        for hold in figures["holds"][name]:
            ended = f"ended by {hold['ended']}" if hold["ended"] else "to the end"
            say(console, f"{label}: hold from {hold['from_s']:.2f} to {hold['to_s']:.2f} s, {ended}")
    if figures["judged_to_s"] is not None:
        at_s = figures["judged_to_s"]
        say(console, f"not judged from {at_s:.2f} s on: the hold goes on there, and the recorded one has ended")
    if picture is not None:
        draw_what_if(found, picture)
        say(console, f"picture {picture}")


def _replay_tlog(console: Any, tlog: Path, config: str, overrides: tuple[str, ...], json_file: Path | None) -> None:
    from asvhil.config import load_config
    from asvhil.logs.tlog_check import check_tlog

    with progress(console, spinner=True) as bar:
        task = bar.add_task("replay", total=None)
        settings = load_config(config, overrides)
        figures = check_tlog(settings, tlog, lambda ticks: bar.update(task, completed=ticks))
    write_json(json_file, figures)
    counts = figures["messages"]
    say(console, f"{tlog}: {sum(counts.values())} messages of {len(counts)} kinds, {figures['undecoded']} undecoded")
    if figures["cut_off"]:
        say(console, f"{tlog}: {figures['cut_off']}; all before it was read")
    against = figures["against_autopilot"]
    if against is None:
        lasted_s = figures["estimate_s"]
        say(
            console,
            "the estimator never started: no position with heading in this log"
            if lasted_s is None
            else f"only {lasted_s:.0f} s with an estimate in this log: the first 10 are not compared",
        )
        raise typer.Exit(1)
    say(
        console,
        f"estimate against the autopilot's own from {against['from_s']:.0f} s on: position max "
        f"{against['position_m']['max']:.3f} m, mean {against['position_m']['mean']:.3f} m; heading max "
        f"{against['heading_deg']['max']:.2f} deg, mean {against['heading_deg']['mean']:.2f} deg",
    )
