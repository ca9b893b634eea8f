"""Two processes, real UDP, a real serial line: engagement, noise on every link, kill -9, and the log afterwards."""

import random
import re
import signal
import socket
import time
from pathlib import Path

import pytest

from asvhil.config import load_config
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.sitl import run_realtime
from tests.support.processes import bench, listen

pytestmark = pytest.mark.real_time


@pytest.mark.alone
def test_hold_by_command_through_noise_and_a_clean_end(tmp_path: Path) -> None:
    noise = random.Random(3)
    with bench(tmp_path, "supervisor.engage=command") as at, at.plant(), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["heading_deg"] is not None, 15.0)
        refused = at.command("hold")
        assert refused.returncode == 2 and "vehicle is not armed" in refused.stderr
        assert daemon.wait_for(lambda s: True, 5.0)["phase"] == "standby"
        daemon.end()
    with bench(tmp_path / "second", "supervisor.engage=auto") as at:
        (tmp_path / "second").mkdir()
        with at.plant(), at.daemon() as daemon:
            daemon.wait_for(lambda s: s["phase"] == "hold", 15.0)
            released = at.command("release")
            assert (released.returncode, released.stdout) == (0, "released\n"), released.stderr
            daemon.wait_for(lambda s: s["phase"] == "standby" and s["pwm_us"] is None, 5.0)
            held = at.command("hold", "--heading", "10")
            assert held.returncode == 0, held.stderr
            told = re.fullmatch(
                r"holding (-?\d+\.\d{7}), (-?\d+\.\d{7}), heading (\d+\.\d) deg; (\d+\.\d) m away\n", held.stdout
            )
            assert told is not None, held.stdout
            assert float(told[4]) < 3.0, "a hold without a place is one where the boat is"
            daemon.wait_for(lambda s: s["phase"] == "hold", 5.0)
            turned = at.command("hold", "--policy", "bow")
            assert turned.returncode == 0 and turned.stdout.endswith("; heading: bow\n"), turned.stderr
            again = at.command("hold")
            assert again.stdout.endswith("; heading: bow\n"), "it stays, and the grant says so"
            fixed = at.command("hold", "--heading", "60", "--policy", "fixed")
            granted, *_ = fixed.stdout.splitlines() or [""]  # a line on what that heading costs may follow
            assert "heading 60.0 deg" in granted and granted.endswith("; heading: fixed"), fixed
            mistaken = at.command("hold", "--policy", "sideways")
            assert mistaken.returncode == 2 and "known: fixed, bow, stern, either, free" in mistaken.stderr
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
                for _ in range(256):  # a megabyte into each link, in a few seconds
                    data = noise.randbytes(4096)
                    attacker.sendto(data, ("127.0.0.1", at.autopilot_port))
                    attacker.sendto(data, ("127.0.0.1", at.operator_port))
                    at.line.write(data)
                    time.sleep(0.005)
            status = daemon.wait_for(lambda s: s["wind_mps"] is not None, 5.0)
            assert status["phase"] == "hold", status
            time.sleep(2.0)
            assert daemon.wait_for(lambda s: True, 5.0)["phase"] == "hold"
            code, words = daemon.end(signal.SIGTERM)
        assert (code, words) == (0, "")
        run = read_run(at.log)
        assert run.counters["autopilot.garbage_bytes"] > 500_000
        assert run.counters["operator.garbage_bytes"] > 500_000
        assert run.counters["anemometer.bad"] > 500
        result = replay(at.log)
        assert result.mismatch is None and not result.truncated and result.compared > 100


def test_kill_9_leaves_neutral_motors_and_a_readable_log(tmp_path: Path) -> None:
    with bench(tmp_path, "daemon.guardian=false") as at, at.plant():  # the autopilot's own time-out
        with at.daemon() as daemon:
            daemon.wait_for(lambda s: s["phase"] == "hold", 15.0)
            time.sleep(3.0)
            last_t_s = daemon.wait_for(lambda s: True, 3.0)["t_s"]
            daemon.end(signal.SIGKILL)
        heard = listen(at.autopilot_port, 5.0)
        outputs = [(t_s, m.servo1_raw, m.servo3_raw) for t_s, m in heard if m.get_type() == "SERVO_OUTPUT_RAW"]
        assert outputs and outputs[0][1:] != (1500, 1500), "the motors were running when the daemon died"
        late = [pulses for t_s, *pulses in outputs if t_s > 3.2]  # the override time-out is 2.9 s
        assert late and all(pulses == [1500, 1500] for pulses in late)
        log = LogFile(at.log)
        ticks = list(log.ticks())
        span_s = (ticks[-1][0].t_ns - ticks[0][0].t_ns) * 1e-9
        assert log.truncated and span_s > last_t_s - 0.6
        assert replay(at.log).mismatch is None


@pytest.mark.parametrize("name", ["sitl", pytest.param("sitl-px4", marks=pytest.mark.thorough)])
def test_real_time_over_udp_keeps_the_station(name: str, tmp_path: Path) -> None:
    config = load_config(name, ("plant.sensors.gnss.slow_bias_m=0", "plant.start_n_m=-5.0"))
    statuses: list[dict[str, object]] = []
    run_realtime(config, tmp_path, tmp_path / "log.mcap", 30.0, statuses.append)
    figures = summarise(read_run(tmp_path / "log.mcap"))
    assert figures["truth"]["distance_m"]["mean"] <= 0.8
    assert abs(figures["truth"]["heading_deg"]["mean"]) <= 2.0
    assert figures["phases"]["hold"] > 20.0
    assert len(statuses) > 45
    assert figures["overruns"] <= 0.05 * figures["ticks"]
    assert replay(tmp_path / "log.mcap").mismatch is None
