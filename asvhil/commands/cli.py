"""The `asvhil` command. Heavy parts are imported by the subcommand that needs them."""

from __future__ import annotations

import functools
import os
import signal
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer

from asvhil import __version__
from asvhil.commands import config, log, script, study
from asvhil.commands.calibrate import calibrate
from asvhil.commands.campaign import campaign
from asvhil.commands.check import check
from asvhil.commands.collect import collect
from asvhil.commands.dashboard import dashboard
from asvhil.commands.evaluate import evaluate
from asvhil.commands.init import init
from asvhil.commands.learn import learn
from asvhil.commands.numbers import refuse_odd_numbers
from asvhil.commands.operate import hold, neutral, release
from asvhil.commands.output import guard_standard_streams
from asvhil.commands.plant import plant
from asvhil.commands.replay import replay
from asvhil.commands.report import report
from asvhil.commands.run import run
from asvhil.commands.sitl import sitl
from asvhil.commands.status import status
from asvhil.commands.termination import interrupted_by, left_to_tell
from asvhil.commands.train import train
from asvhil.commands.tune import tune
from asvhil.commands.typer_parts import HELP, ClickException, one_line, show_flags_plainly
from asvhil.errors import AsvhilError, is_interrupt

RUN_A_BACKSEAT = {"run", "sitl", "replay", "study", "learn", "collect", "campaign", "tune"}
# Long work, often in several processes. A daemon takes SIGTERM itself.
ENDS_LIKE_CTRL_C = RUN_A_BACKSEAT - {"run"} | {"train", "evaluate"}
# asyncio takes Ctrl-C itself where nobody has before, and ends what waits in order.
WAITS_IN_ASYNCIO = {"check", "script", "dashboard"}

INTERRUPTED = 130

app = typer.Typer(
    no_args_is_help=True,
    context_settings=HELP,
    pretty_exceptions_enable=False,
    help="Station keeping of small autonomous surface vehicles over MAVLink.",
)

for command in (
    *(init, run, hold, neutral, release, status, dashboard, check, calibrate),
    *(sitl, plant, report, replay),
    *(learn, collect, train, evaluate),
    *(campaign, tune),
):
    app.command()(command)
app.add_typer(config.app, name="config")
app.add_typer(log.app, name="log")
app.add_typer(script.app, name="script")
app.add_typer(study.app, name="study")
refuse_odd_numbers(app)
show_flags_plainly(app)


def _version(value: bool) -> None:
    if value:
        typer.echo(f"asvhil {__version__}")
        raise typer.Exit


@app.callback()
def _main(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    if context.invoked_subcommand not in WAITS_IN_ASYNCIO:
        also = (signal.SIGTERM,) if context.invoked_subcommand in ENDS_LIKE_CTRL_C else ()
        context.with_resource(interrupted_by(signal.SIGINT, *also))
    if context.invoked_subcommand in RUN_A_BACKSEAT:
        from asvhil.machine_code.compiler import tell_on_terminal, use_compiler

        use_compiler(tell_on_terminal)


def main() -> None:
    """Entry point: an asvhil error is one line and status 2; an interrupt is a line and status 130.

    Output that could not be written is an error too, but not where the reader of a pipe has left: it had enough.
    """
    output, _ = guard_standard_streams()
    try:
        error, status = _run()
    except KeyboardInterrupt:  # another one, while the first was seen to
        error, status = left_to_tell(), INTERRUPTED
    if status == INTERRUPTED and sys.stdout is output:  # this process is ours, and about to end: with this status
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if output.failure and not output.reader_left:
        error, status = error or f"standard output: {output.failure}", status or 2
    if error:
        typer.echo(f"asvhil: {error}", err=True)
    sys.exit(status)


@functools.cache
def _command() -> Callable[..., Any]:
    """The commands with their options, which take a tenth of a second to make."""
    return typer.main.get_command(app)


def _run() -> tuple[str, int]:
    """What to say of an error, if there is anything, and the status."""
    try:
        status = _command()(standalone_mode=False, prog_name="asvhil") or 0
        return left_to_tell() if status == INTERRUPTED else "", status  # typer makes that status of most interrupts
    except AsvhilError as error:
        return str(error), 2
    except ClickException as error:  # a wrong word on the command line
        return one_line(error), 2
    except typer.Abort:  # a question that was not answered
        return "interrupted at a question: nothing was done", INTERRUPTED
    except SystemExit as ended:
        return "", ended.code if isinstance(ended.code, int) else 1 if ended.code else 0
    except BaseException as error:
        if is_interrupt(error):
            return left_to_tell(), INTERRUPTED
        if isinstance(error, FileNotFoundError) and _folder_is_gone():
            return "the folder that it was started in is not there any more; go to another", 2
        raise


def _folder_is_gone() -> bool:
    """Whether the working directory was deleted: then whatever asks for its path fails, and nobody expects that."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False
