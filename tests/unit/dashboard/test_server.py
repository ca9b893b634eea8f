"""The page's server by HTTP and WebSocket: what it serves, and that no control passes without the token."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from typing import Any

import pytest
from aiohttp import ClientSession, WSServerHandshakeError
from aiohttp.test_utils import TestServer

from asvhil.config import load_config
from asvhil.dashboard.access import PageAccess
from asvhil.dashboard.daemon_client import DaemonClient
from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.server import PAGE, PageServer
from asvhil.dashboard.steady_clock import steady_s
from asvhil.errors import LinkError
from tests.support.ports import free_port

pytestmark = pytest.mark.real_time
TOKEN = "0123456789abcdef"
WITH_TOKEN = {"Authorization": f"Bearer {TOKEN}"}


def page_server(token: str | None, origins: tuple[str, ...] = ()) -> TestServer:
    """At an operator's port where no daemon is."""
    config = load_config("sitl", (f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}",))
    picture = BoatPicture()
    client = DaemonClient(config, picture)
    server = PageServer(config, picture, client, PageAccess(token, origins=origins), steady_s)
    return TestServer(server.application(), host="127.0.0.1")


@pytest.fixture
async def served() -> AsyncIterator[TestServer]:
    async with page_server(TOKEN) as server:
        yield server


@pytest.fixture
async def session() -> AsyncIterator[ClientSession]:
    async with ClientSession() as session:
        yield session


async def ask(session: ClientSession, server: TestServer, headers: dict[str, str], **body: Any) -> tuple[int, Any]:
    async with session.post(server.make_url("/control"), json=body, headers=headers) as answer:
        return answer.status, await answer.json()


async def test_without_the_token_every_control_is_refused(session: ClientSession, served: TestServer) -> None:
    controls: list[dict[str, Any]] = [{"action": name} for name in ("hold", "neutral", "release")]
    controls += [{"action": "move", "n_m": 1.0, "e_m": 1.0}, {"action": "heading", "heading_deg": 1.0}]
    here = f"http://127.0.0.1:{served.port}"
    for headers in (
        {},
        {"Authorization": "Bearer wrong"},
        {"Origin": here},
        WITH_TOKEN | {"Origin": "http://evil.example"},
        WITH_TOKEN | {"Origin": "null"},
        WITH_TOKEN | {"Host": "evil.example"},
    ):
        for control in controls:
            status, said = await ask(session, served, headers, **control)
            assert status == 403 and said["error"], (headers, control)
    async with page_server(None) as read_only:
        status, said = await ask(session, read_only, WITH_TOKEN, action="neutral")
        assert (status, said["error"]) == (403, "controls are off")


async def test_no_control_goes_by_the_websocket_with_or_without_a_token(
    session: ClientSession, served: TestServer
) -> None:
    url = served.make_url("/live")
    for headers in ({}, WITH_TOKEN):
        async with session.ws_connect(url, headers=headers) as page:
            told = [await page.receive_json() for _ in range(3)]
            assert [message["kind"] for message in told] == ["boat", "history", "live"]
            assert told[2]["behind_s"] == pytest.approx(0.0, abs=0.5)
            await page.send_json({"action": "neutral", "token": TOKEN})
            while (said := await page.receive_json())["kind"] == "live":
                pass
            assert (said["kind"], said["status"]) == ("refused", 403)
    for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}):
        with pytest.raises(WSServerHandshakeError) as refused:
            await session.ws_connect(url, headers=headers)
        assert refused.value.status == 403


async def test_a_page_of_an_allowed_site_looks_on_and_no_browser_lets_it_control(session: ClientSession) -> None:
    site = {"Origin": "http://cockpit.example"}
    async with page_server(TOKEN, ("http://cockpit.example",)) as server:
        async with session.ws_connect(server.make_url("/live"), headers=site) as page:
            assert (await page.receive_json())["kind"] == "boat"
        asks = site | {"Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "authorization"}
        async with session.options(server.make_url("/control"), headers=asks) as answer:
            assert answer.status == 405 and not [name for name in answer.headers if name.startswith("Access-Control")]


async def test_with_the_token_nonsense_is_told_and_a_daemon_that_is_not_there(
    session: ClientSession, served: TestServer
) -> None:
    status, said = await ask(session, served, WITH_TOKEN, action="sail")
    assert status == 400 and "action must be one of" in said["error"]
    for raw in (b"", b"{", b"\xff", b"[" * 3000, b"NaN"):
        async with session.post(served.make_url("/control"), data=raw, headers=WITH_TOKEN) as answer:
            assert answer.status == 400, raw[:9]
    async with session.post(served.make_url("/control"), data=b"x" * 100_000, headers=WITH_TOKEN) as answer:
        assert answer.status == 413
    status, said = await ask(session, served, WITH_TOKEN, action="neutral")
    assert (status, said) == (409, {"granted": False, "words": "no answer yet: it may still be done"})


async def test_the_page_is_whole_and_takes_nothing_from_elsewhere(session: ClientSession, served: TestServer) -> None:
    async with session.get(served.make_url("/")) as answer:
        text = await answer.text()
        assert answer.content_type == "text/html" and "default-src 'none'" in answer.headers["Content-Security-Policy"]
    for name in {*re.findall(r'(?:src|href)="([^"#]+)"', text), *(path.name for path in PAGE.iterdir())}:
        assert "/" not in name, "relative, so that a proxy may serve it under a path of its own"
        async with session.get(served.make_url(f"/{name}")) as answer:
            assert answer.status == 200, name
    scripts = "".join(path.read_text() for path in PAGE.glob("*.*"))
    assert not re.findall(r"""["'(]/[a-z]|https?://(?!www\.w3\.org/2000/svg)""", scripts)
    for odd in (
        "/nowhere.js",
        "/..%2fserver.py",
        "/%2e%2e/server.py",
        "/server.py",
        "/page/",
        f"/{'a' * 300}.js",
        "/a%00.js",
    ):
        async with session.get(served.make_url("/").join(served.make_url(odd))) as answer:
            assert answer.status == 404, odd


async def test_values_are_told_to_pages_of_its_own_and_none_while_nothing_is_known(
    session: ClientSession, served: TestServer
) -> None:
    async with session.ws_connect(served.make_url("/values")) as values:
        with pytest.raises(TimeoutError):
            await values.receive(timeout=0.5)
    with pytest.raises(WSServerHandshakeError) as refused:
        await session.ws_connect(served.make_url("/values"), headers={"Origin": "http://evil.example"})
    assert refused.value.status == 403


async def test_blueos_finds_it(session: ClientSession, served: TestServer) -> None:
    async with session.get(served.make_url("/register_service")) as answer:
        told = await answer.json()
    assert {"name", "description", "icon", "company", "version", "webpage", "api"} <= set(told)
    assert told["icon"].startswith("mdi-") and told["works_in_relative_paths"] is True


def test_a_link_on_which_no_daemon_listens_is_refused_at_once() -> None:
    config = load_config("sitl", ("links.operator.endpoint=udpout:127.0.0.1:5",))
    with pytest.raises(LinkError, match="no daemon listens there"):
        DaemonClient(config, BoatPicture())
