"""A log replayed with another controller or estimator: what it would have computed and asked of the motors. Open loop.

The boat of a log moves as it did, by the commands that it got. These are therefore what the motors get here too, as in
`fault_replay`; what the other backseat would have sent is set beside them. So the two agree on where the boat was at
every tick but for their estimates, and nothing here tells where the other controller would have brought it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from asvhil.backseat.build import build_backseat
from asvhil.config import Config, overridden, override_value
from asvhil.config.registry import CONTROLLERS
from asvhil.controller.pwm import command_of_pulse
from asvhil.dynamics.arrays import Array
from asvhil.errors import ConfigError, LogError
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.fault_replay import RecordedPulses
from asvhil.logs.figure import save_figure
from asvhil.logs.metrics import motor_figures
from asvhil.logs.picture import PORT_COLOUR, STARBOARD_COLOUR, parted, shade_phases
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import check_begin, config_of, recorded_model
from asvhil.logs.run import RunLog, RunReader
from asvhil.types import Phase, record

SECTIONS = ("controller", "estimator", "sources")  # what may be another one in the same boat on the same day
OPTION = "--what-if"


@record
class WhatIf:
    """Both runs, with the command that each had for the motors while both drove them.

    Rows of commands: t_s, port, starboard, number of the stretch of ticks without another between them.

    `other` has the motion and the commands of the other controller and estimator. `judged_to_s`: from then on the other
    one drives and the record does not, and nothing more is compared; None: to the end.
    """

    overrides: tuple[str, ...]
    recorded: RunLog
    other: RunLog
    recorded_command: Array
    other_command: Array
    judged_to_s: float | None


def replay_what_if(path: Path, overrides: Sequence[str], on_tick: Callable[[int], None] = lambda ticks: None) -> WhatIf:
    """Step a backseat with other config keys through a log. LogError, ConfigError.

    The plug-ins of the run must have been loaded (`plugins.load_plugins`).
    """
    log = LogFile(path)
    check_begin(log)
    config = config_of(log, path)
    changed = overridden(config, _checked(overrides), OPTION)
    pulses = RecordedPulses(config.vehicle.pwm)
    with recorded_model(log, path) as file:
        backseat = build_backseat(changed, file if _same_model(config, changed) else None, limiter=pulses)
    recorded, other = RunReader(config, None), RunReader(changed, None)
    sent: list[tuple[float, ...]] = []
    wanted: list[tuple[float, ...]] = []
    judged_to_s: float | None = None
    start_ns: int | None = None
    stretch, driven = 0, False
    for inputs, data in log.ticks(up_to_gap=True):
        if data is None:
            break
        start_ns = inputs.t_ns if start_ns is None else start_ns
        t_s = (inputs.t_ns - start_ns) * 1e-9
        was = decode_outputs(data, path)
        pulses.begin_tick(was.pwm_us)
        outputs = backseat.step(inputs)
        if pulses.alone:
            judged_to_s = t_s
            break
        recorded.tick(inputs, was)
        other.tick(inputs, outputs)
        before, driven = driven, False
        if was.phase is Phase.HOLD and outputs.phase is Phase.HOLD and was.pwm_us and pulses.wanted_us:
            driven = True
            stretch += not before
            for rows, pair_us in ((sent, was.pwm_us), (wanted, pulses.wanted_us)):
                pair = (command_of_pulse(config.vehicle.pwm, pulse_us) for pulse_us in pair_us)
                rows.append((t_s, *pair, stretch))
        on_tick(recorded.ticks)
    if not recorded.ticks:
        raise LogError(f"{path}: holds no tick with outputs to compare")
    return WhatIf(
        overrides=tuple(overrides),
        recorded=recorded.run(log.metadata),
        other=other.run(log.metadata),
        recorded_command=np.array(sent).reshape(-1, 4),
        other_command=np.array(wanted).reshape(-1, 4),
        judged_to_s=judged_to_s,
    )


def what_if_figures(found: WhatIf) -> dict[str, Any]:
    """The differences as a JSON-ready tree; parts that the log has no data for are None."""
    apart = found.other_command[:, 1:3] - found.recorded_command[:, 1:3]
    position_m, heading_deg = _estimates_apart(found)
    runs = {"recorded": found.recorded, "what_if": found.other}
    return {
        "open_loop": True,
        "what_if": list(found.overrides),
        "ticks": found.recorded.ticks,
        "span_s": found.recorded.duration_s,
        "judged_to_s": found.judged_to_s,
        "estimates_apart": {"position_m": _mean_max(position_m), "heading_deg": _mean_max(np.abs(heading_deg))},
        "commands_apart": _mean_max(np.abs(apart)),
        "motors": {name: motor_figures(run.command[run.command[:, 3] > 0]) for name, run in runs.items()},
        "against_truth": {name: _against_truth(run) for name, run in runs.items()},
        "model_error": {name: _model_error(run) for name, run in runs.items()},
        "holds": {
            name: [
                {"from_s": span.from_s, "to_s": span.to_s, "ended": span.ended}
                for span in run.spans
                if span.phase is Phase.HOLD
            ]
            for name, run in runs.items()
        },
    }


def draw_what_if(found: WhatIf, path: Path) -> None:
    """Commands of both, their estimates' distance, and their models' errors over time."""
    figure = Figure(figsize=(12.0, 9.0), layout="constrained")
    figure.suptitle(f"open loop, the boat moves as recorded: {', '.join(found.overrides)}")
    port, starboard, position, heading, model = figure.subplots(5, 1, sharex=True)
    for axes in (port, starboard, position, heading, model):
        shade_phases(axes, found.recorded)
        axes.grid(alpha=0.3)
    for column, axes, name, colour in ((1, port, "port", PORT_COLOUR), (2, starboard, "starboard", STARBOARD_COLOUR)):
        rows = parted(found.recorded_command, found.recorded_command[:, 3])
        axes.step(rows[:, 0], rows[:, column], where="post", color="grey", linewidth=0.9, label="recorded")
        rows = parted(found.other_command, found.other_command[:, 3])
        axes.step(rows[:, 0], rows[:, column], where="post", color=colour, linewidth=0.9, label="what if")
        axes.set_ylabel(name)
        axes.set_ylim(-1.05, 1.05)
    position_m, heading_deg = _estimates_apart(found)
    t_s = found.recorded.estimated.t_s[-len(position_m) :] if len(position_m) else np.empty(0)
    position.plot(t_s, position_m, color="black", linewidth=0.9)
    position.set_ylabel("estimates apart (m)")
    heading.plot(t_s, heading_deg, color="black", linewidth=0.9)
    heading.set_ylabel("heading apart (deg)")
    for run, name, colour in ((found.recorded, "recorded", "grey"), (found.other, "what if", "tab:blue")):
        _draw_model_error(model, run, name, colour)
    model.set_ylabel("model error, surge\nat the horizon (m/s)")
    model.set_xlabel("time (s)")
    for axes in (port, model):
        axes.legend(loc="upper right", fontsize="small")
    save_figure(figure, path)


def _draw_model_error(axes: Axes, run: RunLog, name: str, colour: str) -> None:
    axes.plot(run.model_error[:, 0], run.model_error[:, 4], color=colour, linewidth=0.9, label=name)


def _checked(overrides: Sequence[str]) -> tuple[str, ...]:
    """The overrides, all of which change the controller or the estimator. ConfigError."""
    for override in overrides:
        key, _ = override_value(override, OPTION)
        if key.partition(".")[0] not in SECTIONS:
            known = ", ".join(f"{section}.*" for section in SECTIONS)
            raise ConfigError(f"{OPTION} {override}: the boat of a log is as recorded; {known} may be others")
    return tuple(overrides)


def _same_model(config: Config, changed: Config) -> bool:
    """Whether the learned model in the log is that of the changed controller too."""
    kinds = [CONTROLLERS.find(one.controller.name).model for one in (config, changed)]
    return bool(kinds[0]) and kinds[0] == kinds[1] and config.controller.model == changed.controller.model


def _estimates_apart(found: WhatIf) -> tuple[Array, Array]:
    """Distance (m) and heading difference (deg) of the estimates at the ticks at which both have one."""
    both = [run.estimated for run in (found.recorded, found.other)]
    shared = np.intersect1d(both[0].t_s, both[1].t_s)
    a, b = (track.pose[np.isin(track.t_s, shared)] for track in both)
    off = b - a
    return np.hypot(off[:, 0], off[:, 1]), np.degrees((off[:, 2] + np.pi) % (2.0 * np.pi) - np.pi)


def _against_truth(run: RunLog) -> dict[str, float] | None:
    """Root mean square error of the estimate while a station is held, where a simulator told the truth."""
    if run.truth is None or not (truth := run.truth.of_hold()).hold.any():
        return None
    at = np.searchsorted(run.estimated.t_s, truth.t_s)
    inside = at < len(run.estimated.t_s)
    off = run.estimated.pose[at[inside]] - truth.where(inside).pose
    turned = (off[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return {
        "position_m": float(np.sqrt((off[:, :2] ** 2).sum(axis=1).mean())),
        "heading_deg": float(np.degrees(np.sqrt((turned**2).mean()))),
    }


def _model_error(run: RunLog) -> dict[str, list[float]] | None:
    """Means of the errors of (u, v, r) one step and a horizon ahead."""
    if not len(run.model_error):
        return None
    means = run.model_error.mean(axis=0)
    return {"one_step": means[1:4].tolist(), "horizon": means[4:7].tolist()}


def _mean_max(values: Array) -> dict[str, float] | None:
    return {"mean": float(values.mean()), "max": float(values.max())} if values.size else None
