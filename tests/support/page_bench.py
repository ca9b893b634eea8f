"""The simulated boat, the daemon, the page's server and a browser, each a process of its own."""

from __future__ import annotations

import contextlib
import os
import queue
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import ROOT
from tests.support.processes import Process

CHROMIUM = "chromium"
AXE = ROOT / "tests" / "page" / "node_modules" / "axe-core" / "axe.min.js"
# Without a screen, and without looking for hosts of others.
FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


def missing_tools() -> str:
    """What `tests/page/install-tools.sh` has not been able to install; nothing where CI is set, which needs all."""
    lacks = [name for name, there in (("chromium", shutil.which(CHROMIUM)), ("axe-core", AXE.exists())) if not there]
    return "" if os.environ.get("CI") else ", ".join(lacks)


@contextlib.contextmanager
def browser() -> Iterator[Any]:
    """Headless Chromium, driven by Playwright."""
    from playwright.sync_api import sync_playwright

    path = shutil.which(CHROMIUM)
    assert path, "chromium is missing: tests/page/install-tools.sh"
    with sync_playwright() as play:
        made = play.chromium.launch(executable_path=path, args=list(FLAGS))
        try:
            yield made
        finally:
            made.close()


@contextlib.contextmanager
def dashboard(*arguments: str) -> Iterator[str]:
    """`asvhil dashboard` on a free port: its address, with the token. Ctrl-C ends it in order."""
    with Process("dashboard", "--config", "sitl", "--port", "0", *arguments) as server:
        try:
            address = server.lines.get(timeout=90.0).strip()
        except queue.Empty:
            pytest.fail(f"the page's server says nothing: {server.end()}")
        yield address
        assert server.end() == (0, "")


def number(text: str) -> float:
    """Such as 1.25 of "1.25 m"."""
    return float(text.split()[0])


def wait_for_text(read: Callable[[], Any], condition: Callable[[str], bool], timeout_s: float) -> str:
    """Read something of the page until it meets a condition. From outside: the page lets no text be run in it."""
    end_s = time.monotonic() + timeout_s
    while True:
        text = str(read())
        if condition(text):
            return text
        assert time.monotonic() < end_s, f"not within {timeout_s} s: {text}"
        time.sleep(0.1)


def wait_for_value(read: Callable[[], Any], condition: Callable[[float], bool], timeout_s: float) -> None:
    """The same of a figure with its unit; a dash is none."""
    wait_for_text(read, lambda text: text[:1] in "-0123456789" and condition(number(text)), timeout_s)


def keep_picture(page: Any, name: str) -> None:
    """A screenshot, where ASVHIL_PAGE_PICTURES names a folder for them."""
    folder = os.environ.get("ASVHIL_PAGE_PICTURES")
    if folder:
        page.evaluate("scrollTo(0, 0)")
        page.screenshot(path=str(Path(folder) / f"{name}.png"), full_page=True)
