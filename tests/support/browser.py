"""A headless Chromium that shows a page of this machine: what it looks like, and what it asks the network for."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import matplotlib.image
import numpy as np

QUIET = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run", "--disable-extensions"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-default-apps"),
    "--host-resolver-rules=MAP * ~NOTFOUND",  # what it would ask for by itself finds nobody
)


def chromium() -> str | None:
    """The program, None where it is not installed."""
    return shutil.which("chromium")


def shown(page: Path, folder: Path, size: tuple[int, int] = (1100, 2400)) -> tuple[np.ndarray, list[str]]:
    """The picture of a page (height, width, RGB of 0 to 1), and the addresses elsewhere that were asked for."""
    program, picture, network = chromium(), folder / "shot.png", folder / "network.json"
    assert program is not None
    command = [
        program,
        *QUIET,
        f"--user-data-dir={folder / 'profile'}",
        f"--window-size={size[0]},{size[1]}",
        f"--log-net-log={network}",
        f"--screenshot={picture}",
        page.resolve().as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=150)
    assert picture.exists(), done.stderr
    events = json.loads(network.read_text())["events"]
    asked = {
        event["params"]["url"]
        for event in events
        if "file://" in event.get("params", {}).get("network_isolation_key", "")  # by the page, not by the program
    }
    return matplotlib.image.imread(picture)[:, :, :3], sorted(one for one in asked if not one.startswith("file:"))
