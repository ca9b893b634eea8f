"""The page in headless Chromium at a picture of the daemon that a test makes up: no boat, and no waiting."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from aiohttp import web

from asvhil.config import load_config
from asvhil.dashboard.access import PageAccess
from asvhil.dashboard.daemon_client import DaemonClient
from asvhil.dashboard.picture import BoatPicture
from asvhil.dashboard.server import PageServer
from asvhil.dashboard.steady_clock import steady_s
from asvhil.io.mavlink.frames import decode, dialect
from asvhil.operator.state_arrays import BoatState, state_arrays
from asvhil.types import Station
from tests.support.page_bench import CHROMIUM, browser, wait_for_text
from tests.support.ports import free_port
from tests.support.supervisor_bench import ESTIMATE

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not shutil.which(CHROMIUM), reason="not installed: chromium (tests/page/install-tools.sh)"),
]
TOKEN = "0123456789abcdef"
DAEMON = dialect.MAVLink(None, srcSystem=1, srcComponent=191)
STATION = Station(n_m=4.0, e_m=-2.0, psi_rad=0.5)
HELD = BoatState(estimate=ESTIMATE, station=STATION, point=STATION, armed=True, origin_deg=(40.0, -86.0))


class ShownPage:
    """An open page, what its server takes for the daemon's state, and the controls that it has sent."""

    def __init__(self, page: Any, address: str, picture: BoatPicture) -> None:
        self.page, self.address, self._picture = page, address, picture
        self.sent: list[str] = []
        page.route("**/control", self._answer)

    def _answer(self, route: Any) -> None:
        self.sent.append(route.request.post_data)
        route.fulfill(json={"granted": True, "words": "granted"})

    def tell(self, state: BoatState, ago_s: float = 0.0, **parameters: float) -> None:
        rows = [dialect.MAVLink_param_value_message(n.encode(), value, 9, 40, 3) for n, value in parameters.items()]
        for message in (*rows, *state_arrays(0, state)):
            self._picture.receive(steady_s() - ago_s, decode(bytes(message.pack(DAEMON))))

    def label(self) -> str:
        return str(self.page.get_attribute("#map-picture", "aria-label"))


@contextlib.contextmanager
def served(token_in_file: bool = False) -> Iterator[tuple[str, BoatPicture]]:
    """A page's server on a thread of its own, at a port where no daemon is."""
    config = load_config("sitl", (f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}",))
    picture = BoatPicture()
    access = PageAccess(TOKEN, token_in_file=token_in_file)
    server = PageServer(config, picture, DaemonClient(config, picture), access, steady_s)
    loop, addresses = asyncio.new_event_loop(), list[str]()
    up = threading.Event()

    async def begin() -> web.AppRunner:
        runner = web.AppRunner(server.application(), shutdown_timeout=0.1)
        await runner.setup()
        await web.TCPSite(runner, "127.0.0.1", 0).start()
        addresses.append(f"http://127.0.0.1:{runner.addresses[0][1]}/")
        up.set()
        return runner

    def run() -> None:
        runner = loop.run_until_complete(begin())
        loop.run_forever()
        loop.run_until_complete(runner.cleanup())
        loop.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert up.wait(10.0)
        yield addresses[0], picture
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10.0)


@pytest.fixture
def shown() -> Iterator[ShownPage]:
    with served() as (address, picture), browser() as chromium:
        shown = ShownPage(chromium.new_page(), address, picture)
        yield shown


def test_two_presses_of_neutral_within_its_time_always_send_it(shown: ShownPage) -> None:
    page = shown.page
    page.clock.install()
    page.goto(f"{shown.address}#token={TOKEN}")
    page.wait_for_selector("#neutral:not(:disabled)")
    for wait_ms, sent in ((0, 0), (400, 1), (1600, 1), (1400, 2)):  # the first press is 3.4 s before the last
        page.clock.run_for(wait_ms)
        page.click("#neutral")
        wait_for_text(lambda: len(shown.sent), str(sent).__eq__, 3.0)
    page.click("#neutral")
    page.clock.run_for(3100)
    assert page.inner_text("#neutral") == "Neutral now"
    page.click("#neutral")
    assert len(shown.sent) == 2, "too late for a second press"


def test_neutral_ends_the_requests_that_wait(shown: ShownPage) -> None:
    """A browser sends six at a time: the seventh, neutral, would not have left it."""
    page, failed = shown.page, []
    page.on("requestfailed", lambda request: failed.append(request.post_data))
    page.goto(f"{shown.address}#token={TOKEN}")
    page.wait_for_selector("#neutral:not(:disabled)")
    page.unroute("**/control")
    page.route(
        "**/control", lambda route: "neutral" in route.request.post_data and route.fulfill(json={"words": "granted"})
    )
    for _ in range(3):
        page.click("#hold")
        page.click("#confirm-yes")
    page.click("#neutral")
    page.click("#neutral")
    wait_for_text(lambda: page.inner_text("#answer"), "neutral: granted".__eq__, 3.0)
    wait_for_text(lambda: len(failed), "3".__eq__, 3.0)


def test_a_boat_that_may_be_elsewhere_is_hollow_and_one_of_which_nothing_is_known_is_not_drawn(
    shown: ShownPage,
) -> None:
    page = shown.page
    page.goto(shown.address)
    shown.tell(HELD)
    page.wait_for_selector(".boat:not(.unsure)")
    shown.tell(replace(HELD, estimate=replace(ESTIMATE, valid=False)))
    page.wait_for_selector(".boat.unsure")
    assert "Position and heading are not valid." in shown.label()
    shown.tell(BoatState())
    wait_for_text(shown.label, "Map: position not known.".__eq__, 3.0)
    assert page.locator(".boat").count() == 0 and "position not known" in page.text_content("#map-picture")


def test_a_track_from_another_origin_is_dropped(shown: ShownPage) -> None:
    page = shown.page
    shown.tell(HELD, ago_s=1.5)
    shown.tell(HELD)
    page.goto(shown.address)
    points = lambda: len((page.get_attribute(".track", "points") or "").split())  # noqa: E731
    wait_for_text(points, "2".__eq__, 3.0)
    shown.tell(replace(HELD, origin_deg=(40.0004, -86.0)))
    wait_for_text(points, "1".__eq__, 3.0)


def test_a_click_on_the_map_while_a_leader_is_followed_says_what_to_do_first(shown: ShownPage) -> None:
    page = shown.page
    page.goto(f"{shown.address}#token={TOKEN}")
    shown.tell(HELD, ST_FOLLOW=42.0)
    page.wait_for_selector(".station")
    page.click("#map-picture", position={"x": 200, "y": 100})
    assert page.inner_text("#answer") == "The station follows system 42: have it stay, then move it."
    assert page.is_hidden("#confirm")
    shown.tell(HELD, ST_FOLLOW=0.0)
    page.wait_for_timeout(400)
    page.click("#map-picture", position={"x": 200, "y": 100})
    page.wait_for_selector("#confirm[open]")


def test_the_token_of_an_address_counts_in_a_page_that_is_open_already(shown: ShownPage) -> None:
    page = shown.page
    page.goto(shown.address)
    page.wait_for_selector("#token-form:not([hidden])")
    page.goto(f"{shown.address}#token={TOKEN}")
    page.wait_for_selector("#hold:not(:disabled)")
    assert page.url == shown.address, "it does not stay in the address"


def test_what_is_no_token_is_refused_where_it_is_typed_and_locks_nothing(shown: ShownPage) -> None:
    """No header may have an ellipsis, as a phone makes it of three dots: the browser would send no request with it."""
    page = shown.page
    page.goto(shown.address)
    page.wait_for_selector("#token-form:not([hidden])")
    for typed in ("0123456789abcde…", "0123 456789abcdef", "0123456789abcdeé"):
        page.fill("#token", typed)
        page.press("#token", "Enter")
        wait_for_text(lambda: page.inner_text("#answer"), lambda text: text.startswith("That is no token"), 3.0)
        assert page.is_visible("#token-form") and page.is_disabled("#neutral"), typed
    page.fill("#token", f" {TOKEN} ")
    page.press("#token", "Enter")
    page.wait_for_selector("#neutral:not(:disabled)")
    assert page.inner_text("#answer") == "" and page.is_hidden("#token-form")


def test_what_is_no_token_in_address_or_store_leaves_the_form_or_the_token_of_before(shown: ShownPage) -> None:
    page = shown.page
    page.goto(f"{shown.address}#token=0123456789abcde%E2%80%A6")
    page.wait_for_selector("#token-form:not([hidden])")
    assert page.inner_text("#answer").startswith("That is no token")
    page.evaluate("sessionStorage.setItem('token', '0123456789abcde\u2026')")  # as a page of before kept it
    page.reload()
    page.wait_for_selector("#token-form:not([hidden])")
    page.goto(f"{shown.address}#token={TOKEN}")
    page.wait_for_selector("#hold:not(:disabled)")
    page.goto(f"{shown.address}#token=0123456789abcde%E2%80%A6")
    wait_for_text(lambda: page.inner_text("#answer"), lambda text: text.startswith("That is no token"), 3.0)
    assert page.is_enabled("#hold") and page.url == shown.address


@pytest.mark.parametrize("damaged", ["#token=%", "#token=%ff%ff", "#token="])
def test_a_damaged_token_in_the_address_is_told_and_the_page_lives(shown: ShownPage, damaged: str) -> None:
    page = shown.page
    shown.tell(HELD)
    page.goto(shown.address + damaged)
    page.wait_for_selector(".boat")
    assert page.url == shown.address and page.inner_text("#answer").startswith("That is no token")
    page.wait_for_selector("#token-form:not([hidden])")


def test_where_a_browser_denies_storage_the_page_lives_and_keeps_the_token_while_it_is_open(shown: ShownPage) -> None:
    page = shown.page
    denied = "get() { throw new DOMException('denied', 'SecurityError') }"
    for area in ("sessionStorage", "localStorage"):
        page.add_init_script(f"Object.defineProperty(window, '{area}', {{ {denied} }})")
    shown.tell(HELD)
    page.goto(shown.address)
    page.wait_for_selector(".boat")
    theme = page.inner_text("#theme")
    page.click("#theme")
    assert page.inner_text("#theme") != theme
    page.fill("#token", TOKEN)
    page.press("#token", "Enter")
    page.wait_for_selector("#neutral:not(:disabled)")
    page.unroute("**/control")
    page.route("**/control", lambda route: route.fulfill(status=403, json={"error": "the token is wrong"}))
    page.click("#neutral")
    page.click("#neutral")
    page.wait_for_selector("#token-form:not([hidden])")


def test_a_page_whose_script_fails_says_that_it_has_no_data(shown: ShownPage) -> None:
    page = shown.page
    page.add_init_script("window.ResizeObserver = window.matchMedia = () => { throw new Error('not here') }")
    shown.tell(HELD)
    page.goto(shown.address)
    wait_for_text(lambda: page.inner_text("#stale"), lambda text: text.startswith("NO DATA"), 5.0)


@pytest.mark.parametrize(
    ("n_m", "labels"), [(3.0, "3 1.5 0"), (9.96, "10 5 0"), (99.6, "100 50 0"), (183.0, "183 92 0")]
)
def test_charts_are_labelled_in_plain_figures(shown: ShownPage, n_m: float, labels: str) -> None:
    page = shown.page
    at = replace(ESTIMATE, n_m=STATION.n_m + n_m, e_m=STATION.e_m)
    shown.tell(replace(HELD, estimate=at))
    page.goto(shown.address)
    told = lambda: " ".join(reversed(page.locator("#distance-chart text[text-anchor=end]").all_text_contents()))  # noqa: E731
    wait_for_text(told, lambda text: text.endswith(labels), 5.0)


def test_what_is_asked_of_a_station_is_refused_at_once_where_none_is_held(shown: ShownPage) -> None:
    page = shown.page
    shown.tell(replace(HELD, station=None, point=None))
    page.goto(f"{shown.address}#token={TOKEN}")
    page.wait_for_selector(".boat")
    page.wait_for_selector("#heading:not(:disabled)")
    fields = {"heading-wish": "40", "drift-speed": "0.2", "drift-course": "90", "follow-system": "42"}
    for name, value in fields.items():
        page.fill(f"#{name}", value)
    for button in ("heading", "drift", "follow", "stay"):
        page.evaluate("document.getElementById('answer').textContent = ''")
        page.click(f"#{button}")
        assert page.is_hidden("#confirm"), button
        assert page.inner_text("#answer") == "No station is held: hold first, then have it move or turn."
    assert not shown.sent


@pytest.mark.parametrize(("token_in_file", "place"), [(False, "on the terminal of"), (True, "with --token-file")])
def test_a_locked_page_says_where_the_token_stands(token_in_file: bool, place: str) -> None:
    with served(token_in_file) as (address, _), browser() as chromium:
        page = chromium.new_page()
        page.goto(address)
        wait_for_text(lambda: page.inner_text("#locked"), lambda text: place in text, 5.0)
