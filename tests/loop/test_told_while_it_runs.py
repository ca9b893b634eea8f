"""What goes wrong with log and links is told at once, on the terminal and to the operator, while the daemon runs."""

import os
import pty
import resource
import socket
import time
import tty
from pathlib import Path

import pytest

from asvhil.io.mavlink.frames import FrameSplitter, decode, dialect
from asvhil.io.mavlink.texts import TextReader
from tests.support.loop import PLAIN_CONTROLLER
from tests.support.ports import free_port
from tests.support.processes import Process, bench, sets

pytestmark = pytest.mark.real_time


def test_a_log_that_ends_early_is_told_while_the_hold_goes_on(tmp_path: Path) -> None:
    with bench(tmp_path, PLAIN_CONTROLLER) as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold", 20.0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as operator:
            operator.connect(("127.0.0.1", at.operator_port))
            operator.settimeout(3.0)
            station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
            operator.send(station.heartbeat_encode(6, 8, 0, 0, 4).pack(station))
            resource.prlimit(daemon.child.pid, resource.RLIMIT_FSIZE, (1000, 1000))  # the next write fails
            status = daemon.wait_for(lambda s: "log" in s["notes"], 3.0)
            assert status["notes"]["log"] == "recording stopped: File too large" and status["phase"] == "hold"
            texts, reader, splitter = [], TextReader(), FrameSplitter(datagrams=True)
            end_s = time.monotonic() + 3.0
            while "log: recording stopped: File too large" not in texts and time.monotonic() < end_s:
                for message in map(decode, splitter.receive(operator.recv(4096))):
                    if message is not None and message.get_type() == "STATUSTEXT":
                        texts.append(reader.receive(message))
            assert "log: recording stopped: File too large" in texts
        code, words = daemon.end()
        assert code == 2 and words == f"asvhil: {at.log}: recording stopped: File too large\n"


def test_a_link_that_is_open_and_brings_nothing_says_so(tmp_path: Path) -> None:
    master, slave = pty.openpty()
    tty.setraw(master)
    keys = [
        f"links.autopilot.endpoint=udpin:127.0.0.1:{free_port()}",
        f"links.anemometer.endpoint=serial:{os.ttyname(slave)}:115200",
        f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}",
    ]
    try:
        with Process("run", "sitl", "--status-json", "--log", str(tmp_path / "log.mcap"), *sets(*keys)) as daemon:
            links = daemon.wait_for(lambda s: "nothing" in s["links"]["anemometer"], 15.0)["links"]
            assert links == {
                "autopilot": "up, nothing heard yet",
                "anemometer": "up, nothing heard yet",
                "operator": "up",
            }
            os.write(master, bytes(range(128, 256)) + b"\r\n")
            links = daemon.wait_for(lambda s: "bad" in s["links"]["anemometer"], 5.0)["links"]
            assert links["anemometer"] == "up, nothing but bad bytes, baud rate?; 130 bytes"
            os.write(master, b"$WIMWV,090.0,R,003.0,M,A*2A\r\n")
            links = daemon.wait_for(lambda s: "bad" not in s["links"]["anemometer"], 5.0)["links"]
            assert links["anemometer"] == "up"
            daemon.end()
    finally:
        os.close(master)
        os.close(slave)
