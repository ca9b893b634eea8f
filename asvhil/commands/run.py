"""`asvhil run`: the daemon on the vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from asvhil.commands.learned import check_kept, tell_kept, with_learned
from asvhil.commands.options import ConfigArgument, LearnedOption, SetOption
from asvhil.commands.views import LiveView, tell_borrowed_hull

if TYPE_CHECKING:
    from asvhil.types import Outputs


def run(
    config: ConfigArgument,
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    log: Annotated[Path | None, typer.Option(help="The MCAP log to write; a new run folder by default.")] = None,
    duration: Annotated[
        float | None, typer.Option(min=0.1, help="Seconds to run; until interrupted by default.")
    ] = None,
    no_guardian: Annotated[
        bool, typer.Option("--no-guardian", help="Without the process that sends neutral if this one dies.")
    ] = False,
    learned: LearnedOption = None,
    status_json: Annotated[bool, typer.Option(help="Print a JSON status line twice a second, no table.")] = False,
) -> None:
    """Run the daemon on the vehicle's companion computer. It holds only after `asvhil hold`."""
    import asyncio

    from asvhil.config import load_config
    from asvhil.daemon.daemon import Daemon
    from asvhil.links.clock import Clock
    from asvhil.logs.learned_file import LearnedKeeper
    from asvhil.logs.opening import make_run_folder, open_recorder

    overrides = (*set_, *(["daemon.guardian=false"] if no_guardian else []))
    settings = with_learned(load_config(config, overrides), config, overrides, learned)
    tell_borrowed_hull(settings, config, set_)
    check_kept(settings)
    path = log or make_run_folder(settings, "run") / "log.mcap"
    clock = Clock()
    keeper = LearnedKeeper(settings)
    recorder = open_recorder(settings, path, "live")
    try:
        view = LiveView(settings, f"asvhil {settings.vehicle.name}, log {path}", as_json=status_json)

        def on_tick(outputs: Outputs, links: dict[str, str]) -> None:
            keeper.see(outputs)
            view.show(outputs, links, daemon.overruns, daemon.vehicle)

        with view:
            daemon = Daemon(
                settings,
                recorder,
                clock,
                on_tick=on_tick,
                watches={"display": lambda: view.trouble},
            )
            asyncio.run(daemon.run(duration))
    finally:
        recorder.close()
        tell_kept(keeper)
    if recorder.error is not None:
        raise recorder.error
