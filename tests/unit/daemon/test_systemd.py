"""What systemd is told, by a real socket; and the unit, by systemd's own checks where it is installed."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from asvhil.daemon.systemd import ServiceManager
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.processes import sets

UNIT = ROOT / "config" / "systemd" / "asvhil.service"


class Listener:
    """Stands where systemd listens."""

    def __init__(self, address: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self.socket.settimeout(0.05)

    def heard(self) -> list[str]:
        found = []
        try:
            while True:
                found += self.socket.recv(4096).decode().split("\n")
        except TimeoutError:
            return found

    def __enter__(self) -> "Listener":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()


@pytest.mark.parametrize("kind", ["path", "abstract"])
def test_ready_alive_status_and_stopping(kind: str, tmp_path: Path) -> None:
    address = str(tmp_path / "notify") if kind == "path" else f"@asvhil-test-{os.getpid()}"
    with Listener(address) as listener:
        environment = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "200000", "PATH": "/bin"}
        service = ServiceManager(environment)
        assert environment == {"PATH": "/bin"}, "no child answers for this process"
        assert listener.heard() == [], "nothing before the first tick"
        service.tick("standby: waiting\nfor a hold")
        assert listener.heard() == ["READY=1", "WATCHDOG=1", "STATUS=standby: waiting for a hold"]
        time.sleep(0.06)
        for _ in range(8):
            service.tick("standby: waiting\nfor a hold")
        assert listener.heard() == ["WATCHDOG=1"], "no more often than it is needed"
        time.sleep(0.06)
        service.tick("hold: holding")
        assert listener.heard() == ["WATCHDOG=1", "STATUS=hold: holding"]
        service.stopping()
        service.tick("hold: holding")
        assert listener.heard() == ["STOPPING=1"]


def test_without_a_watchdog_or_with_that_of_another_process_there_is_no_sign_of_life(tmp_path: Path) -> None:
    for extra in ({}, {"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}, {"WATCHDOG_USEC": "soon"}):
        with Listener(f"@asvhil-none-{os.getpid()}") as listener:
            service = ServiceManager({"NOTIFY_SOCKET": f"@asvhil-none-{os.getpid()}", **extra})
            service.tick("")
            assert listener.heard() == ["READY=1"]
            service.stopping()


def test_nobody_who_listens_is_no_error_and_gets_ready_once_he_does(tmp_path: Path) -> None:
    ServiceManager({}).tick("standby")
    service = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "late")})
    service.tick("standby")
    with Listener(str(tmp_path / "late")) as listener:
        service.tick("standby")
        assert listener.heard() == ["READY=1", "STATUS=standby"]
        service.stopping()


@pytest.mark.real_time
def test_a_daemon_feeds_the_watchdog_by_its_ticks_and_stops_when_they_stop(tmp_path: Path) -> None:
    keys = (f"links.autopilot.endpoint=udpin:127.0.0.1:{free_port()}", "links.anemometer=null")
    keys = (*keys, f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}")
    words = [sys.executable, "-m", "asvhil", "run", "sitl", "--log", str(tmp_path / "log.mcap"), *sets(*keys)]
    with Listener(str(tmp_path / "notify")) as listener:
        environment = os.environ | {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "2000000"}
        with subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL) as daemon:
            try:
                heard: list[str] = []
                end_s = time.monotonic() + 90.0
                while heard.count("WATCHDOG=1") < 5 and time.monotonic() < end_s:
                    heard += listener.heard()
                assert heard[0] == "READY=1" and heard.count("WATCHDOG=1") >= 5
                assert any(line.startswith("STATUS=standby: ") for line in heard)
                daemon.send_signal(signal.SIGSTOP)
                listener.heard()
                time.sleep(0.6)
                assert listener.heard() == [], "no thread of its own keeps it fed"
                daemon.send_signal(signal.SIGCONT)
                daemon.send_signal(signal.SIGTERM)
                assert daemon.wait(30.0) == 0
                assert listener.heard()[-1] == "STOPPING=1"
            finally:
                daemon.kill()


# --- the unit ---


def settings() -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for line in UNIT.read_text().splitlines():
        if line and line[0] not in "#[":
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


def test_the_unit_lets_serial_ports_through_and_the_guardian_live() -> None:
    of = settings()
    assert of["Type"] == ["notify"] and float(of["WatchdogSec"][0]) <= 5.0
    assert of["KillMode"] == ["control-group"], "mixed and process would end or forget the guardian"
    assert "PrivateDevices" not in of and "ProtectClock" not in of, "they deny serial ports"
    kinds = {value.split()[0] for value in of["DeviceAllow"]}
    assert {"char-ttyACM", "char-ttyUSB", "char-ttyAMA", "char-ttyTHS"} <= kinds
    modules = {word for value in of["Wants"] for word in value.split()}
    assert modules <= set(of["After"][0].split()) and "modprobe@cdc_acm.service" in modules
    assert "AF_UNIX" in of["RestrictAddressFamilies"][0], "the guardian's socket"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_finds_nothing_wrong_with_the_unit(tmp_path: Path) -> None:
    program = tmp_path / "asvhil"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    unit = tmp_path / "asvhil.service"
    unit.write_text(UNIT.read_text().replace("/opt/asvhil/bin/asvhil", str(program)))
    verified = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)
    said = [line for line in verified.stderr.splitlines() if "asvhil.service" in line]
    assert (verified.returncode, said) == (0, []), verified.stderr
    words = ["systemd-analyze", "security", "--offline=true", "--threshold=20", unit]
    rated = subprocess.run(words, capture_output=True, text=True, check=False)
    if "unrecognized option" not in rated.stderr:
        assert rated.returncode == 0, rated.stdout[-200:]
