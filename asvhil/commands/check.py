"""`asvhil check`: the preflight checks."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ConfigArgument, JsonOption, SetOption
from asvhil.commands.outputs import check_figures, config_and_bases, write_json
from asvhil.commands.views import say, stage_bar
from asvhil.errors import ConfigError

if TYPE_CHECKING:
    from asvhil.autopilot.requirements import Finding
    from asvhil.config import Config
    from asvhil.preflight.survey import Survey
    from asvhil.preflight.table import Check

COLOURS = {"pass": "green", "warn": "yellow", "fail": "red", "unverified": "magenta"}
PIPE_WIDTH = 140  # of tables in a file or a pipe, which have no width of their own
SAYS = {
    "waiting": "waiting for the autopilot's heartbeat",
    "booting": "waiting for the autopilot to have set itself up",
    "asking": "reading parameters, asking for streams",
    "counting": "counting messages",
    "done": "done",
}


def check(
    config: ConfigArgument,
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    fix: Annotated[bool, typer.Option("--fix", help="Write the parameters that are wrong, after asking.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="With --fix: do not ask.")] = False,
    all_: Annotated[bool, typer.Option("--all", help="Show every parameter, not only those to look at.")] = False,
    timeout: Annotated[float, typer.Option(min=1.0, help="Seconds to wait for the first heartbeat.")] = 15.0,
    json_: JsonOption = None,
) -> None:
    """Check the vehicle before it leaves the dock; exit 1 where a check fails. It never moves a motor."""
    import asyncio

    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.borrowed import borrowed_from
    from asvhil.config.shipped_script import shipped_script
    from asvhil.preflight.checks import checks_of
    from asvhil.preflight.computer import computer_checks
    from asvhil.preflight.runner import Preflight
    from asvhil.preflight.script_checks import script_checks
    from asvhil.preflight.script_tool import ScriptTool
    from asvhil.preflight.table import as_json, worst
    from asvhil.preflight.wiring import found_keys, yaml_to_pin

    settings = load_config(config, tuple(set_))
    if yes and not fix:
        raise ConfigError("check: --yes goes with --fix")
    if fix and not yes and not sys.stdin.isatty():
        raise ConfigError("check: --fix needs a terminal to confirm; use --yes")
    check_figures(json_, *config_and_bases(config))
    console = Console()
    if not console.is_terminal:
        console = Console(width=PIPE_WIDTH)
    own = computer_checks(settings, borrowed_from(config, set_))
    with stage_bar(console) as bar:
        task = bar.add_task(SAYS["waiting"], total=1.0)
        preflight = Preflight(settings, timeout, lambda survey: _advance(bar, task, survey))
        survey = preflight.survey

        async def choose(wrong: list[Finding]) -> bool:
            bar.stop()
            _show(console, settings, [*checks_of(survey), *own], all_)
            return yes or await _agreed(console, wrong)

        written = asyncio.run(preflight.run(choose if fix else None))
        if settings.links.autopilot.output == "script":
            bar.update(task, description="looking at the scripts")
            own = [*asyncio.run(script_checks(ScriptTool(settings, timeout), shipped_script())), *own]
    checks = [*checks_of(survey), *own]
    if not fix or written or not survey.fixable:
        _tell_written(console, written, survey)
        _show(console, settings, checks, all_)
    pin = yaml_to_pin(survey)
    if pin:
        say(console, "To hold the boat to this wiring, and refuse any other from now on, put this into its config:")
        say(console, pin.rstrip())
    result = worst(checks)
    write_json(
        json_,
        {
            "vehicle": settings.vehicle.name,
            "result": result.value,
            "checks": [as_json(check) for check in checks],
            "wiring": found_keys(survey),
            "written": {finding.name: finding.wanted for finding in written},
        },
    )
    if result.value == "fail":
        raise typer.Exit(1)


async def _agreed(console: Any, wrong: list[Finding]) -> bool:
    from asvhil.commands.question import agreed

    for finding in wrong:
        say(console, f"  {finding.name}: {finding.value:g} -> {finding.wanted:g}")
    return await agreed(f"Write {len(wrong)} parameters to the autopilot?")


def _tell_written(console: Any, written: list[Finding], survey: Survey) -> None:
    parameters = survey.link.parameters
    for finding in written:
        now = parameters.values.get(finding.name)
        if now is None or finding.name in parameters.writing | parameters.unconfirmed:
            words = "written, and not read back: run the check again"
        else:
            words = f"{'not taken: still' if finding.name in parameters.unwritten else 'written, reads back'} {now:g}"
        say(console, f"{finding.name}: {finding.value:g} -> {finding.wanted:g}, {words}")


def _show(console: Any, settings: Config, checks: list[Check], everything: bool) -> None:
    from rich.table import Table
    from rich.text import Text

    from asvhil.preflight.table import folded

    table = Table(title=f"preflight of {settings.vehicle.name}", title_justify="left")
    table.add_column("")
    table.add_column("", overflow="fold", min_width=18)
    for heading in ("found", "wanted", "what to do"):
        table.add_column(heading, overflow="fold")
    section = ""
    for line in checks if everything else folded(checks):
        if line.section != section:
            section = line.section
            table.add_section()
            table.add_row("", Text(section, style="bold"), "", "", "")
        result = Text(line.result.value, style=COLOURS[line.result.value])
        table.add_row(result, Text(line.item), Text(line.found), Text(line.wanted), Text(line.todo))
    console.print(table)
    counts = {result: sum(line.result.value == result for line in checks) for result in COLOURS}
    unverified = f", {counts['unverified']} unverified" if counts["unverified"] else ""
    say(console, f"{counts['pass']} pass, {counts['warn']} warn, {counts['fail']} fail{unverified}")


def _advance(bar: Any, task: Any, survey: Survey) -> None:
    bar.update(task, description=SAYS[survey.stage], completed=survey.progress)
