"""MAVProxy, headless in an environment of its own, as ground station of the daemon; and its telemetry log read by us.

Real time, over UDP on loopback.
"""

from __future__ import annotations

import os
import re
import subprocess
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.logs.replay import replay
from asvhil.logs.tlog_check import check_tlog
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.processes import PeerProcess, Process, sets

pytestmark = pytest.mark.real_time

PYTHON = Path(os.environ.get("ASVHIL_MAVPROXY_PYTHON", ROOT / ".venv-mavproxy" / "bin" / "python"))
MAVPROXY = PYTHON.parent / "mavproxy.py"


class MavProxy(PeerProcess):
    """MAVProxy on a UDP port: what it prints is kept, to wait for words in it."""

    def __init__(self, port: int, folder: Path) -> None:
        self._said = ""
        self._read_to = 0
        words = [
            str(PYTHON), "-u", str(MAVPROXY), f"--master=udp:127.0.0.1:{port}", f"--state-basedir={folder}",
            "--default-modules=mode,arm,cmdlong,param",
        ]  # fmt: skip
        super().__init__(words, self._keep, by_line=False, cwd=folder, stderr=subprocess.STDOUT, bufsize=1)

    def _keep(self, text: str) -> None:
        self._said += text

    def hear(self, pattern: str, timeout_s: float = 20.0) -> str:
        """Wait for words that come after those that were heard last."""
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            found = re.compile(pattern).search(self._said, self._read_to)
            if found:
                self._read_to = found.end()
                return found.group()
            assert self.child.poll() is None, f"MAVProxy has ended: {self._said[-500:]}"
            time.sleep(0.05)
        raise AssertionError(f"{pattern!r} was not said within {timeout_s} s after: {self._said[self._read_to :]}")


@pytest.mark.skipif(
    not MAVPROXY.exists() and not os.environ.get("CI"), reason="needs `make .venv/.stamps/mavproxy` for MAVProxy"
)
def test_mavproxy_through_the_daemon_and_its_log(tmp_path: Path) -> None:
    autopilot, gcs, operator = free_port(), free_port(), free_port()
    log = tmp_path / "log.mcap"
    options = sets(
        "links.anemometer=null",
        "plant.links.anemometer=null",
        f"plant.links.autopilot=udpout:127.0.0.1:{autopilot}",
        f"links.autopilot.endpoint=udpin:127.0.0.1:{autopilot}",
        f"links.operator.endpoint=udpin:127.0.0.1:{operator}",
        f"links.ground_stations.gcs.endpoint=udpout:127.0.0.1:{gcs}",
        "supervisor.engage=command",
        "plant.start_n_m=0",
        "plant.weather.wind.speed_mps=0",
    )
    with ExitStack() as stack:
        plant = stack.enter_context(Process("plant", "sitl", "--quiet", *options))
        daemon = stack.enter_context(Process("run", "sitl", "--log", str(log), "--status-json", *options))
        proxy = stack.enter_context(MavProxy(gcs, tmp_path))
        proxy.hear("Detected vehicle 1:1 on link 0")
        proxy.hear("Mode MANUAL")
        daemon.wait_for(lambda status: status["heading_deg"] is not None, 60.0)
        # The vehicle, through the daemon's routing.
        proxy.say("mode HOLD")
        proxy.hear("Mode HOLD")
        proxy.say("mode MANUAL")
        proxy.hear("Mode MANUAL")
        proxy.say("arm throttle")
        proxy.hear("ARMED")
        # The daemon itself, by its component.
        proxy.say("set target_component 191")
        proxy.say("long NAV_GUIDED_ENABLE 1")
        proxy.hear("NAV_GUIDED_ENABLE: ACCEPTED")
        proxy.hear("hold: holding")
        daemon.wait_for(lambda status: status["phase"] == "hold", 10.0)
        proxy.say("param fetch")
        proxy.hear(r"Received \d+ parameters")
        proxy.say("param set W_NEAR_HDG 321")
        time.sleep(1.0)
        proxy.say("param show W_NEAR_HDG")
        proxy.hear(r"W_NEAR_HDG\s+321\.0")
        time.sleep(5.0)
        proxy.say("long NAV_GUIDED_ENABLE 0")
        proxy.hear("standby: released by the operator")
        daemon.wait_for(lambda status: status["phase"] == "standby", 10.0)
        proxy.say("set target_component 1")
        proxy.say("disarm")
        proxy.hear("DISARMED")
        time.sleep(4.0)
        proxy.end()
        assert daemon.end()[0] == 0 and plant.end()[0] == 0
    assert replay(log).mismatch is None
    # What MAVProxy has recorded, through our codec and estimator.
    figures = check_tlog(load_config("sitl"), tmp_path / "mav.tlog")
    assert figures["undecoded"] == 0 and figures["messages"]["HEARTBEAT"] > 20
    assert figures["messages"]["NAMED_VALUE_FLOAT"] > 20 and figures["messages"]["COMMAND_ACK"] >= 5
    against = figures["against_autopilot"]
    assert against is not None and against["position_m"]["max"] < 1.0 and against["heading_deg"]["max"] < 3.0
