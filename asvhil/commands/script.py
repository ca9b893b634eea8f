"""`asvhil script ...`: the script on the autopilot that drives its motors."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import SetOption
from asvhil.commands.outputs import writing
from asvhil.commands.views import say, stage_bar
from asvhil.errors import AsvhilError, ConfigError
from asvhil.files import is_there

if TYPE_CHECKING:
    from asvhil.preflight.script_tool import ScriptStatus, ScriptTool

app = typer.Typer(no_args_is_help=True, help="The script on an ArduRover that drives its motors (autopilot-script.md).")

DaemonConfig = Annotated[str, typer.Argument(help="The daemon's config: where the autopilot is.")]
YesOption = Annotated[bool, typer.Option("--yes", help="Do not ask.")]
TimeoutOption = Annotated[float, typer.Option(min=1.0, help="Seconds to wait for the first heartbeat.")]


@app.command()
def install(
    config: DaemonConfig = "field",
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    yes: YesOption = False,
    copy_to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the script to a file, to be copied by hand.")
    ] = None,
    timeout: TimeoutOption = 15.0,
) -> None:
    """Put the script on the autopilot, read it back, and start it."""
    from asvhil.config.shipped_script import NAME, shipped_script
    from asvhil.preflight.script_tool import advice

    text = shipped_script()
    if copy_to is not None:
        _copy(copy_to, text)
        typer.echo(
            f"{copy_to}: copy it as {NAME} into APM/scripts of the memory card (on Linux: scripts, where ArduPilot"
        )
        typer.echo("runs), and restart the autopilot; SCR_ENABLE must be 1")
        return
    _confirm(f"Write {NAME} to the autopilot and restart its scripts?", yes)
    status = _run(config, set_, timeout, lambda tool: tool.install(text))
    _tell(status)
    for words in advice(status):
        typer.echo(words)


@app.command()
def status(
    config: DaemonConfig = "field",
    set_: SetOption = [],  # noqa: B006
    timeout: TimeoutOption = 15.0,
) -> None:
    """Tell what is on the autopilot; exit 1 where it is not as it should be."""
    from asvhil.config.shipped_script import shipped_script
    from asvhil.preflight.script_tool import advice

    text = shipped_script()
    found = _run(config, set_, timeout, lambda tool: tool.status(text))
    _tell(found)
    wrong = advice(found)
    for words in wrong:
        typer.echo(words)
    if wrong:
        raise typer.Exit(1)


@app.command()
def remove(
    config: DaemonConfig = "field",
    set_: SetOption = [],  # noqa: B006
    yes: YesOption = False,
    timeout: TimeoutOption = 15.0,
) -> None:
    """Take the script off the autopilot."""
    from asvhil.config.shipped_script import NAME

    _confirm(f"Remove {NAME} from the autopilot and restart its scripts?", yes)
    path = _run(config, set_, timeout, lambda tool: tool.remove())
    typer.echo(f"{path}: removed" if path else f"{NAME} is not on the autopilot")


def _confirm(question: str, yes: bool) -> None:
    if yes:
        return
    if not sys.stdin.isatty():
        raise ConfigError("script: a terminal is needed to confirm; use --yes")
    if not typer.confirm(question):
        raise typer.Exit(1)


def _copy(path: Path, text: str) -> None:
    if is_there(path):
        raise AsvhilError(f"--copy-to {path}: is there already; name a new file")
    with writing(path, "--copy-to "):
        path.write_text(text, encoding="ascii")


def _run(config: str, set_: list[str], timeout_s: float, job: Any) -> Any:
    """A job with its progress shown."""
    import asyncio

    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.preflight.script_tool import ScriptTool

    settings = load_config(config, tuple(set_))
    console = Console()
    said = ""
    with stage_bar(console) as bar:
        task = bar.add_task("", total=1.0)

        def show(stage: str, share: float) -> None:
            nonlocal said
            bar.update(task, description=stage, completed=share)
            if stage != said and not console.is_terminal:
                say(console, stage)
            said = stage

        tool: ScriptTool = ScriptTool(settings, timeout_s, show)
        return asyncio.run(job(tool))


def _tell(found: ScriptStatus) -> None:
    from asvhil.autopilot.script_protocol import TEXTS

    installed = "not installed" if found.installed is None else f"version {found.installed}"
    same = "" if found.installed is None else ", as shipped" if found.same else ", not as shipped"
    typer.echo(f"file: {installed}{same} ({found.folder})")
    state = found.state
    if state is None:
        typer.echo("alive sign: none")
    else:
        reason = "a reason that only it knows" if state.reason is None else TEXTS[state.reason]
        typer.echo(f"alive sign: version {state.version}, {reason}; {state.used} orders used, {state.dropped} dropped")
    if found.checked is not None:
        said = "the autopilot does not arm" if found.checked else "the autopilot arms all the same (ARMING_CHECK)"
        typer.echo(f"when a script fails: {said}")
