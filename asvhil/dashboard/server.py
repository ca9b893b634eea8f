"""HTTP and WebSocket of the page. The WebSocket only tells; a control is a POST with the token."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web

from asvhil import __version__
from asvhil.config import Config
from asvhil.dashboard.access import PageAccess
from asvhil.dashboard.boat_facts import boat_facts
from asvhil.dashboard.controls import read_control
from asvhil.dashboard.daemon_client import PERIOD_S, DaemonClient
from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.steady_clock import behind_s

PAGE = Path(__file__).parent / "page"
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
FILES = {path.name for path in PAGE.iterdir() if path.suffix in KINDS}
MOST_PAGES = 100
MOST_BYTES = 4096  # of a control
HEADERS = {
    # Nothing from elsewhere is loaded, and nothing is sent elsewhere.
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class OpenPage:
    """A page's number of the last event that it was told, and what is being sent to it."""

    def __init__(self, told: int) -> None:
        self.told = told
        self.sending: asyncio.Task[None] | None = None


class PageServer:
    """The application for one daemon. `clock` tells seconds as `steady_s` does."""

    def __init__(
        self, config: Config, picture: BoatPicture, client: DaemonClient, access: PageAccess, clock: Callable[[], float]
    ) -> None:
        self._config = config
        self._picture = picture
        self._client = client
        self._access = access
        self._clock = clock
        self._pages: dict[web.WebSocketResponse, OpenPage] = {}
        self._streams = 0  # of values
        self._facts = json.dumps(
            {**boat_facts(config), "controllable": access.controllable, "token_in_file": access.token_in_file}
        )

    def application(self) -> web.Application:
        """All that the server answers to."""
        app = web.Application(middlewares=[self._guard], client_max_size=MOST_BYTES)
        app.router.add_get("/", self._file)
        app.router.add_get("/live", self._live)
        app.router.add_get("/values", self._values)
        app.router.add_get("/register_service", self._service)
        app.router.add_post("/control", self._control)
        app.router.add_get("/{name}", self._file)
        app.cleanup_ctx.append(self._beside)
        return app

    async def _beside(self, app: web.Application) -> Any:
        """The conversation with the daemon and the telling of the pages, for as long as the server runs."""
        tasks = [asyncio.create_task(self._client.run()), asyncio.create_task(self._tell_on())]
        yield
        for page in list(self._pages):
            await page.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        refusal = self._access.refusal(request.headers.get("Host"), request.headers.get("Origin"))
        answer = _refused(refusal) if refusal else await handler(request)
        if not answer.prepared:
            answer.headers.update(HEADERS)
        return answer

    async def _file(self, request: web.Request) -> web.StreamResponse:
        name = request.match_info.get("name", "index.html")
        if name not in FILES:
            return web.json_response({"error": "there is no such page"}, status=404)
        path = PAGE / name
        return web.Response(body=path.read_bytes(), content_type=KINDS[path.suffix], charset="utf-8")

    async def _service(self, request: web.Request) -> web.StreamResponse:
        """What BlueOS asks of each web server, to put it into its menu."""
        return web.json_response(
            {
                "name": "asvhil",
                "description": "Station keeping: the boat, the station, and what the program does.",
                "icon": "mdi-crosshairs-gps",
                "company": "asvhil",
                "version": __version__,
                "webpage": "",
                "api": "",
                "works_in_relative_paths": True,
            }
        )

    async def _control(self, request: web.Request) -> web.StreamResponse:
        if not self._access.may_control(request.headers.get("Authorization")):
            return _refused("the token is missing or wrong" if self._access.controllable else "controls are off")
        try:
            control = read_control(json.loads(await request.read()))
        except (ValueError, RecursionError) as error:
            text = "no JSON" if isinstance(error, json.JSONDecodeError | UnicodeDecodeError) else str(error)
            return web.json_response({"error": text}, status=400)
        granted, words = await self._client.ask(control)
        said = "" if granted else f": {words}"
        told = f"{control.describe()}, asked for by {request.remote}"
        self._picture.tell(self._clock(), f"{told}{said}", ok=granted)
        return web.json_response({"granted": granted, "words": words}, status=200 if granted else 409)

    # --- the pages -----------------------------------------------------------------------------------------

    async def _live(self, request: web.Request) -> web.StreamResponse:
        if len(self._pages) >= MOST_PAGES:
            return web.json_response({"error": "too many pages are open"}, status=503)
        page = web.WebSocketResponse(heartbeat=10.0, max_msg_size=MOST_BYTES, compress=False)
        await page.prepare(request)
        await page.send_str(self._facts)
        await page.send_str(json.dumps(self._picture.history()))
        first = self._live_text(self._clock())
        told = self._picture.last_event
        await page.send_str(first)
        self._pages[page] = OpenPage(told)
        try:
            async for message in page:
                if message.type in (WSMsgType.TEXT, WSMsgType.BINARY):
                    await page.send_str('{"kind": "refused", "status": 403, "error": "controls are POSTs to control"}')
        finally:
            opened = self._pages.pop(page, None)
            if opened is not None and opened.sending is not None:
                opened.sending.cancel()
        return page

    def _live_text(self, now_s: float, after_event: int = 0) -> str:
        """How it is now; with `behind_s` a page makes times of day of the events' seconds."""
        return json.dumps({**self._picture.live(now_s, after_event), "behind_s": round(behind_s(), 2)})

    async def _tell_on(self) -> None:
        """The same text to every page, but to one that has not taken the last; that one gets missed events later."""
        while True:
            now_s = self._clock()
            self._picture.live(now_s)  # notes that the daemon has fallen silent, whether a page is open or not
            texts: dict[int, str] = {}
            for page, opened in list(self._pages.items()):
                if opened.sending is not None and not opened.sending.done():
                    continue
                if opened.told not in texts:
                    texts[opened.told] = self._live_text(now_s, opened.told)
                opened.sending = asyncio.create_task(_send(page, texts[opened.told]))
                opened.told = self._picture.last_event
            await asyncio.sleep(PERIOD_S)

    async def _values(self, request: web.Request) -> web.StreamResponse:
        """The numbers alone as `name=value`, as Cockpit's generic WebSocket takes them; old ones are not told."""
        if self._streams >= MOST_PAGES:
            return web.json_response({"error": "too many streams are open"}, status=503)
        stream = web.WebSocketResponse(heartbeat=10.0, max_msg_size=MOST_BYTES, compress=False)
        await stream.prepare(request)
        self._streams += 1
        reading = asyncio.create_task(_read_to_the_end(stream))
        try:
            while not reading.done():
                for line in self._picture.values(self._clock()):
                    await _send(stream, line)
                await asyncio.wait((reading,), timeout=1.0)
        finally:
            self._streams -= 1
            reading.cancel()
        return stream


async def _read_to_the_end(stream: web.WebSocketResponse) -> None:
    """What it says is of no interest; that it is gone, is."""
    async for _ in stream:
        pass


async def _send(page: web.WebSocketResponse, text: str) -> None:
    with contextlib.suppress(ConnectionError, RuntimeError):
        await page.send_str(text)


def _refused(why: str) -> web.Response:
    return web.json_response({"error": why}, status=403)
