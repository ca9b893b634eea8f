"""`asvhil dashboard`: the operator's page."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from asvhil.commands.operate import DaemonOption
from asvhil.commands.options import SetOption
from asvhil.errors import AsvhilError, LinkError

PORT = 8095


def dashboard(
    config: DaemonOption = "field",
    host: Annotated[str, typer.Option(help="The address to listen on; 0.0.0.0 for tablets and phones.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="The TCP port to listen on; 0: any that is free.")] = PORT,
    token_file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A file with the token of the controls; a new one by default.")
    ] = None,
    read_only: Annotated[bool, typer.Option("--read-only", help="Without controls, for anybody.")] = False,
    allow_host: Annotated[
        list[str], typer.Option(metavar="NAME", help="A further name by which the page is called; repeatable.")
    ] = [],  # noqa: B006
    allow_origin: Annotated[
        list[str],
        typer.Option(metavar="URL", help="A site whose pages may look on, by WebSocket; without controls. Repeatable."),
    ] = [],  # noqa: B006
    set_: SetOption = [],  # noqa: B006
) -> None:
    """Serve a page that shows the running daemon live: map, motors, wind, errors, events; with a token, controls.

    It goes on until Ctrl-C or SIGTERM.
    """
    try:
        from aiohttp import web
    except ImportError:
        raise AsvhilError("the page needs aiohttp: pip install '.[dashboard]' in the clone of asvhil") from None
    import asyncio

    from asvhil.config import load_config
    from asvhil.dashboard.access import PageAccess, new_token, read_token
    from asvhil.dashboard.daemon_client import DaemonClient
    from asvhil.dashboard.picture import BoatPicture
    from asvhil.dashboard.server import PageServer
    from asvhil.dashboard.steady_clock import steady_s
    from asvhil.links.link import why

    settings = load_config(config, tuple(set_))
    token = None if read_only else new_token() if token_file is None else read_token(token_file)
    access = PageAccess(token, tuple(allow_host), tuple(allow_origin), token_in_file=token_file is not None)
    picture = BoatPicture(settings.supervisor.geofence)
    server = PageServer(settings, picture, DaemonClient(settings, picture), access, steady_s)

    async def serve() -> None:
        runner = web.AppRunner(server.application(), access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            site = web.TCPSite(runner, host, port)
            try:
                await site.start()
            except (OSError, UnicodeError) as error:  # of a name, the latter: of too long a part
                because = why(error) if isinstance(error, OSError) else "the name does not resolve"
                raise LinkError(f"{host}:{port}: cannot listen there ({because}); see --host and --port") from None
            bound = runner.addresses[0][1]
            shown = "127.0.0.1" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
            secret = f"#token={token}" if token is not None and token_file is None else ""
            typer.echo(f"http://{shown}:{bound}/{secret}")
            if host in ("0.0.0.0", "::"):
                typer.echo("on other devices: this computer's address in the place of 127.0.0.1")
            ended = asyncio.Event()
            for number in (signal.SIGINT, signal.SIGTERM):
                asyncio.get_running_loop().add_signal_handler(number, ended.set)
            await ended.wait()
        finally:
            await runner.cleanup()

    asyncio.run(serve())
