"""The BlueOS extension as far as no container is needed: its labels, and its start script as it stands."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from asvhil import __version__
from asvhil.config import load_config
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.waiting import wait_until

DOCKERFILE = (ROOT / "blueos" / "Dockerfile").read_text()
TAKEN = {80, 81, 2748, 2770, 5201, 5777, 6020, 6040, 7000, 7117, 7777, 8000, 8080, 8081, 8088, 8554, 9000, 9090, 9100}


def labels() -> dict[str, str]:
    joined = DOCKERFILE.replace("\\\n", "")
    return {name: value for name, _, value in re.findall(r"^LABEL (\w+)=(['\"])(.*)\2$", joined, re.MULTILINE)}


def test_the_labels_are_those_that_blueos_reads() -> None:
    found = labels()
    assert found["version"] == __version__ and found["type"] == "device-integration"
    host = json.loads(found["permissions"])["HostConfig"]
    assert (host["NetworkMode"], host["Init"]) == ("host", True), "MAVLink is on the host's loopback"
    assert any(bind.endswith(":/data") for bind in host["Binds"]) and "/dev:/dev" in host["Binds"]
    for name in ("authors", "company", "tags"):
        assert json.loads(found[name])
    for copied in re.findall(r"^COPY ([^/\n].*) /\S+$", DOCKERFILE, re.MULTILINE):
        assert all((ROOT / name).exists() for name in copied.split()), copied


def test_the_boat_is_a_component_that_blueos_has_not_taken_on_a_port_that_it_has_not() -> None:
    config = load_config("blueboat")
    assert config.links.autopilot.component_id == 192
    assert config.links.autopilot.endpoint == "udpout:127.0.0.1:14550"
    port = int(re.findall(r"ASVHIL_PAGE_PORT:-(\d+)", (ROOT / "blueos" / "start.sh").read_text())[0])
    assert port not in TAKEN


def children(pid: int) -> list[tuple[int, str]]:
    """(pid, command line) of all descendants."""
    done = subprocess.run(["ps", "-e", "-o", "pid=,ppid=,args="], capture_output=True, text=True, check=True)
    rows = [line.split(None, 2) for line in done.stdout.splitlines()]
    found, parents = [], {pid}
    for _ in range(5):
        found = [(int(row[0]), row[2]) for row in rows if int(row[1]) in parents]
        parents |= {child for child, _ in found}
    return found


def ask(port: int, path: str) -> Any:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/{path}", timeout=2.0) as answer:
        return json.load(answer)


@pytest.mark.real_time
@pytest.mark.alone
def test_the_start_script_keeps_daemon_and_page_running_until_it_is_told_to_end(tmp_path: Path) -> None:
    port = free_port()
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "asvhil").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m asvhil "$@"\n')
    (programs / "asvhil").chmod(0o755)
    data = tmp_path / "data"
    data.mkdir()
    (data / "boat.yaml").write_text(
        f"base: blueboat\nrecorder: {{directory: {data}/runs}}\n"
        f"links: {{autopilot: {{endpoint: 'udpout:127.0.0.1:{free_port()}'}}, "
        f"operator: {{endpoint: 'udpin:127.0.0.1:{free_port()}'}}}}\n"
    )
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    env = os.environ | {"PATH": path, "ASVHIL_DATA": str(data), "ASVHIL_PAGE_PORT": str(port)}
    with subprocess.Popen([str(ROOT / "blueos" / "start.sh")], env=env, stdout=subprocess.DEVNULL) as script:

        def running(word: str) -> list[int]:
            return [pid for pid, line in children(script.pid) if f"-m asvhil {word}" in line]

        def answers() -> bool:
            try:
                return bool(ask(port, "register_service")["works_in_relative_paths"])
            except OSError:
                return False

        try:
            wait_until(answers, 60.0)
            wait_until(lambda: bool(running("run")), 60.0)
            token = data / "page-token"
            assert len(token.read_text().strip()) >= 16 and token.stat().st_mode & 0o077 == 0
            wait_until(lambda: bool(list(data.glob("runs/*/log.mcap"))), 60.0)
            (first,) = running("run")
            os.kill(first, signal.SIGKILL)
            wait_until(lambda: bool(running("run")) and running("run") != [first], 60.0)
        finally:
            script.terminate()
            script.wait(30.0)
        assert script.returncode == 0
        assert running("run") == running("dashboard") == []
