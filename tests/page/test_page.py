"""The operator's page in headless Chromium, at a daemon that holds the simulated boat: all of it real, in real time."""

from __future__ import annotations

import json
import re
import signal
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from asvhil.io.mavlink.frames import decode, dialect, message_id
from asvhil.logs.reader import LogFile
from tests.support.page_bench import (
    AXE,
    browser,
    dashboard,
    keep_picture,
    missing_tools,
    number,
    wait_for_text,
    wait_for_value,
)
from tests.support.processes import bench, sets

LACKS = missing_tools()
pytestmark = [
    pytest.mark.real_time,
    pytest.mark.alone,
    pytest.mark.skipif(bool(LACKS), reason=f"not installed: {LACKS} (tests/page/install-tools.sh)"),
]
SIZES = ((390, 844), (820, 1180), (1280, 800))
THEMES = ("light", "dark")
CONTROLS = ("neutral", "hold", "release", "heading", "drift", "stay", "follow", "policy", "effort")
KINDS_ASKED = ("COMMAND_LONG", "COMMAND_INT")


def serious_faults(page: Any) -> list[str]:
    """What axe-core finds of serious and critical faults of accessibility."""
    page.evaluate(AXE.read_text() + "\n;0")  # past the page's own policy, which lets no script in
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{fault['id']}: {fault['nodes'][0]['html']}"
        for fault in found["violations"]
        if fault["impact"] in ("serious", "critical")
    ]


def post(address: str, body: dict[str, Any], **headers: str) -> int:
    request = urllib.request.Request(f"{address}control", json.dumps(body).encode(), headers)
    try:
        with urllib.request.urlopen(request, timeout=5.0) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def neutral_ticks(log: Path) -> list[tuple[int, int] | None]:
    """What went to the motors in each tick that took an operator's command for neutral."""
    found = []
    for inputs, outputs in LogFile(log).ticks():
        for frame in inputs.frames:
            if frame.port != "operator" or message_id(frame.data) != dialect.MAVLINK_MSG_ID_COMMAND_LONG:
                continue
            message = decode(frame.data)
            if message is not None and message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
                assert outputs is not None
                told = json.loads(outputs)
                found.append(told["pwm_us"] and tuple(told["pwm_us"]))
    return found


def test_an_operator_sees_the_boat_moves_the_station_stops_the_motors_and_notices_a_death(tmp_path: Path) -> None:
    with (
        bench(tmp_path) as at,
        at.plant(),
        at.daemon() as daemon,
        dashboard(*at.sets) as address,
        browser() as chromium,
    ):
        daemon.wait_for(lambda s: s["phase"] == "hold", 30.0)
        page = chromium.new_page(viewport={"width": 1280, "height": 800})
        troubles: list[str] = []
        asked: list[str] = []
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("console", lambda message: troubles.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: asked.append(request.url))
        page.goto(address)
        root = address.partition("#")[0]
        assert page.url == root, "the token does not stay in the address"

        # What it shows is what is, and moves.
        page.wait_for_selector("#phase[data-phase=hold]", timeout=15_000)
        told = {name: lambda name=name: page.inner_text(f"#{name}") for name in ("distance", "heading-error", "reason")}
        wait_for_text(told["reason"], "holding".__eq__, 5.0)
        first = page.inner_text("#distance"), page.get_attribute(".boat", "transform")
        wait_for_text(lambda: page.inner_text("#distance"), lambda text: text != first[0], 10.0)
        wait_for_text(lambda: page.get_attribute(".boat", "transform"), lambda place: place != first[1], 10.0)
        wait_for_value(told["distance"], lambda metres: metres < 2.0, 40.0)
        daemon.wait_for(lambda s: abs(s["distance_m"] - number(page.inner_text("#distance"))) < 0.3, 10.0)
        state = page.inner_text("#status")
        for words in (
            "armed\narmed",
            "MANUAL",
            "3D, ",
            " V",
            "solved, ",
            "anemometer up",
            "anemometer.MWV",
            "MiB free",
        ):
            assert words in re.sub(r"\s*\n\s*", "\n", state), (words, state)
        assert " µs, " in (page.get_attribute("#motors", "aria-label") or "")
        for mark, number_of in ((".plan", 1), (".radius", 2), (".wind", 1)):
            wait_for_text(page.locator(mark).count, str(number_of).__eq__, 5.0)

        # Without the token nothing is done.
        for headers in ({}, {"Authorization": "Bearer no"}, {"Origin": "http://evil.example"}):
            assert post(root, {"action": "neutral"}, **headers) == 403
        stranger = chromium.new_page()
        stranger.goto(root)
        stranger.wait_for_selector("#token-form:not([hidden])")
        assert all(stranger.is_disabled(f"#{name}") for name in CONTROLS)
        stranger.close()

        # A click on the map, confirmed, moves the station, and the boat follows.
        box = page.locator("#map-picture").bounding_box()
        assert box is not None
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.25 * box["height"])
        asks = page.inner_text("#confirm-text")
        metres = float(asks.split()[4])
        assert asks.startswith("Move the station to ") and 3.0 < metres < 30.0
        keep_picture(page, "confirm")
        page.click("#confirm-no")
        page.wait_for_timeout(700)
        assert number(told["distance"]()) < 2.5, "who says no moves nothing"
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.25 * box["height"])
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "move: granted".__eq__, 8.0)
        wait_for_value(told["distance"], lambda metres: metres > 3.0, 5.0)
        # By keys as well.
        page.focus("#map")
        page.keyboard.press("ArrowUp")
        page.keyboard.press("ArrowRight")
        assert "m off the boat" in page.inner_text("#map-cursor") and page.locator(".cursor").count() == 1
        page.keyboard.press("Enter")
        assert page.inner_text("#confirm-text").startswith("Move the station to ")
        page.keyboard.press("Escape")
        # A dialog tells that it was closed in a task of its own: the cross goes a moment after it.
        assert page.is_hidden("#confirm")
        page.wait_for_selector(".cursor", state="detached", timeout=5_000)
        page.fill("#heading-wish", "40")
        page.click("#heading")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "heading: granted".__eq__, 8.0)

        # Heading policy and effort: what is in force is shown, another is chosen, or not.
        for name, before, chosen in (("effort", "normal", "gentle"), ("policy", "fixed", "stern")):
            wait_for_text(lambda name=name: page.input_value(f"#{name}"), before.__eq__, 8.0)
            page.select_option(f"#{name}", chosen)
            page.click("#confirm-no")
            wait_for_text(lambda name=name: page.input_value(f"#{name}"), before.__eq__, 3.0)
            page.select_option(f"#{name}", chosen)
            page.click("#confirm-yes")
            wait_for_text(lambda: page.inner_text("#answer"), f"{name}: granted".__eq__, 8.0)
            wait_for_text(lambda name=name: page.input_value(f"#{name}"), chosen.__eq__, 3.0)

        # The station moves, unless too fast; map and words show it. By keys here: Enter in a field is the button.
        wait_for_value(told["distance"], lambda metres: metres < 2.0, 60.0)
        moves = re.compile(r"\nmoves at 0\.30 m/s toward 60°$")
        map_text = lambda: page.get_attribute("#map-picture", "aria-label")  # noqa: E731
        page.fill("#drift-speed", "5")
        page.fill("#drift-course", "60")
        page.press("#drift-course", "Enter")
        assert page.inner_text("#confirm-text").startswith("Have the station move at 5 m/s toward 60°")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), lambda text: text.startswith("drift: a station at 5.00"), 8.0)
        assert page.locator(".moving").count() == 0 and "wrong" in (page.get_attribute("#answer", "class") or "")
        page.fill("#drift-speed", "0.3")
        page.click("#drift")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "drift: granted".__eq__, 8.0)
        wait_for_text(lambda: page.inner_text("#state-station"), lambda text: bool(moves.search(text)), 5.0)
        assert map_text().endswith("The station moves at 0.30 m/s toward 60 degrees.")
        angle = re.search(r"rotate\((.*)\)", page.get_attribute(".moving", "transform") or "")
        assert angle is not None and float(angle[1]) == pytest.approx(60.0, abs=0.1)

        # Looked at in all sizes, by people and by axe-core, while the boat is under way.
        for theme in THEMES:
            for width, height in SIZES:
                page.set_viewport_size({"width": width, "height": height})
                if page.evaluate("document.documentElement.dataset.theme") != theme:
                    page.click("#theme")
                page.wait_for_timeout(400)
                keep_picture(page, f"{theme}-{width}x{height}")
                wide = page.evaluate("document.documentElement.scrollWidth")
                assert wide <= width, f"{theme} {width}: scrolls sideways to {wide}"
                assert serious_faults(page) == [], (theme, width)
        wait_for_text(lambda: page.inner_text("#notes"), lambda text: "moving station: 0.3 m/s toward 60" in text, 5.0)
        page.click("#stay")
        page.click("#confirm-no")
        page.wait_for_timeout(700)
        assert page.locator(".moving").count() == 1
        page.click("#stay")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "stay: granted".__eq__, 8.0)
        wait_for_text(page.locator(".moving").count, "0".__eq__, 5.0)
        assert "moves" not in page.inner_text("#state-station") + map_text()

        # For a way, after which it stays by itself; and after a vehicle that nobody hears.
        page.fill("#drift-way", "2.4")
        page.click("#drift")
        assert page.inner_text("#confirm-text").startswith("Have the station move at 0.3 m/s toward 60°, for 2.4 m?")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "drift: granted".__eq__, 8.0)
        wait_for_text(page.locator(".moving").count, "1".__eq__, 5.0)
        wait_for_text(page.locator(".moving").count, "0".__eq__, 20.0)
        page.fill("#follow-system", "42")
        page.click("#follow")
        page.click("#confirm-yes")
        wait_for_text(lambda: page.inner_text("#answer"), "follow: granted".__eq__, 8.0)
        wait_for_text(lambda: page.inner_text("#notes"), lambda text: "system 42 is not heard" in text, 8.0)

        # Neutral, pressed twice; and no station moves that is not held.
        page.click("#neutral")
        page.click("#neutral")
        wait_for_text(lambda: page.inner_text("#answer"), "neutral: granted".__eq__, 8.0)
        stopped = daemon.wait_for(lambda s: s["phase"] == "prepare", 5.0)
        assert stopped["pwm_us"] == [1500, 1500]
        wait_for_text(told["reason"], lambda text: text.startswith("neutral"), 5.0)
        wait_for_text(page.locator("circle.station").count, "0".__eq__, 5.0)  # it is told apart from the reason
        page.click("#drift")
        assert page.inner_text("#answer") == "No station is held: hold first, then have it move or turn."
        assert page.is_hidden("#confirm")
        wait_for_text(lambda: page.inner_text("#events"), lambda text: "neutral, asked for by 127.0.0.1" in text, 5.0)

        # The daemon is killed: what is shown is old within a second.
        page.evaluate(
            "new MutationObserver(() => { window.flagged = Date.now() })"
            ".observe(document.getElementById('stale'), {attributes: true})"
        )
        page.wait_for_timeout(1_500)  # a killed daemon takes up to half a second of its log along
        assert page.is_hidden("#stale")
        killed_ms = time.time() * 1000.0
        daemon.end(signal.SIGKILL)
        page.wait_for_selector("#stale:not([hidden])", timeout=3_000)
        assert page.evaluate("window.flagged") - killed_ms < 1000.0
        page.wait_for_timeout(300)
        assert "OLD DATA" in page.inner_text("#stale") and page.evaluate("document.body.classList.contains('old')")
        keep_picture(page, "stale")
        assert len(troubles) == 1 and "409 (Conflict)" in troubles[0], "the refusal of a speed"
        assert all(url.startswith((root, root.replace("http:", "ws:"))) for url in asked), asked
    assert neutral_ticks(at.log) and set(neutral_ticks(at.log)) == {(1500, 1500)}, "in the tick that took it"


def test_a_page_without_controls_and_one_without_a_daemon(tmp_path: Path) -> None:
    with (
        bench(tmp_path) as at,
        dashboard("--read-only", *at.sets, *sets("supervisor.max_distance_m=50")) as address,
        browser() as chromium,
    ):
        assert "#" not in address
        page = chromium.new_page()
        page.goto(address)
        wait_for_text(lambda: page.inner_text("#stale"), lambda text: text.startswith("NO DATA: udpin"), 20.0)
        wait_for_text(lambda: page.inner_text("#locked"), lambda text: "started without controls" in text, 5.0)
        assert page.is_disabled("#neutral") and page.is_hidden("#token-form")
