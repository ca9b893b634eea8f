"""`asvhil status` at a running daemon, and what operators are told of its state and its computer."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command_line import call, refused
from tests.support.ports import free_port
from tests.support.processes import bench, sets

pytestmark = pytest.mark.real_time


def status(*arguments: str, timeout_s: float = 20.0) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "asvhil", "status", "--config", "sitl", *arguments]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=timeout_s)


def test_a_daemon_tells_how_it_is(tmp_path: Path) -> None:
    with bench(tmp_path) as at, at.plant("plant.weather.wind.speed_mps=6"), at.daemon() as daemon:
        daemon.wait_for(lambda s: s["phase"] == "hold" and s["distance_m"] is not None, 20.0)
        done = status("--json", *at.sets)
        assert (done.returncode, done.stderr) == (0, "")
        look = json.loads(done.stdout)
        assert (look["phase"], look["state"], look["reason"]) == ("hold", "active", "holding")
        assert look["distance_m"] >= 0.0 and abs(look["heading_error_deg"]) <= 180.0
        assert abs(look["station"]["lat_deg"] - 40.4237) < 0.01
        computer = look["computer"]
        assert 0 <= computer["load_percent"] <= 100 and computer["ram_free_mib"] > 0 and computer["disk_free_mib"] > 0
        lines = dict(line.split(": ", 1) for line in status(*at.sets).stdout.splitlines())
        assert lines["phase"] == "hold: holding" and "MiB" in lines["computer"] and " m, " in lines["to the station"]
        assert look["docking"].keys() == {"open_s", "stays"} and "open" in lines["docking window"]
        assert (
            look["energy"]["by"] == "curve" and look["energy"]["hold_wh"] > 0.0 and "Wh in this hold" in lines["energy"]
        )
        assert lines["mode"] == "MANUAL, armed" and lines["receiver and battery"].startswith("3D fix")
        # 300 m north, across the wind.
        far = ("hold", "--at", "40.4264,-86.9212", "--heading", "90", "--config", "sitl", *at.sets)
        refused(call(*far, cwd=tmp_path), "m away, at most 100 m unless the hold command names more")
        refused_by_hand = call(*far, cwd=tmp_path, typed="n\n")
        assert refused_by_hand.status == 2 and "Is that meant?" in refused_by_hand.out
        meant = call(*far, cwd=tmp_path, typed="y\n")
        assert meant.status == 0 and "holding 40.4264" in meant.out, meant
        assert "its heading: the weather is on the side: at best " in meant.out, meant
        own = daemon.wait_for(lambda s: s["station"] is not None and s["station"]["from_m"] > 100.0, 5.0)
        assert (
            own["vehicle"].startswith("armed, MANUAL")
            and own["model"] == "lagnet-mpc: wamv16-lagnet.npz, lagnet of wamv16"
        )
        assert [event["text"][:20] for event in own["events"]][-2:] == ["refused: station is "] * 2
        with subprocess.Popen(
            [sys.executable, "-m", "asvhil", "status", "--config", "sitl", "--watch", "--json", *at.sets],
            stdout=subprocess.PIPE,
            text=True,
        ) as watching:
            assert watching.stdout is not None
            phases = [json.loads(watching.stdout.readline())["phase"] for _ in range(2)]
            assert at.command("release").returncode == 0
            while phases[-1] != "standby" and len(phases) < 8:
                phases.append(json.loads(watching.stdout.readline())["phase"])
            daemon.end()
            gone = [json.loads(watching.stdout.readline()) for _ in range(3)][-1]
            watching.kill()
        assert phases[0] == "hold" and phases[-1] == "standby"
        assert gone["phase"] is None and "no answer" in gone["reason"], "it waits for another daemon"


def test_without_a_daemon_it_is_one_line() -> None:
    done = status("--set", f"links.operator.endpoint=udpin:127.0.0.1:{free_port()}")
    assert done.returncode == 2 and done.stdout == "" and done.stderr.count("\n") == 1 and "no answer" in done.stderr
    done = status(*sets("links.operator.endpoint=udpout:127.0.0.1:5"))
    assert done.returncode == 2 and "the daemon does not listen there" in done.stderr


def test_by_tcp(tmp_path: Path) -> None:
    with bench(tmp_path) as at:
        keys = (*at.sets, *sets(f"links.operator.endpoint=tcpin:127.0.0.1:{at.operator_port}"))
        words = [sys.executable, "-m", "asvhil", "run", "sitl", "--log", str(at.log), *keys]
        with subprocess.Popen(words, stdout=subprocess.DEVNULL) as daemon:
            try:
                looks = [status("--json", *keys) for _ in range(3)]
                assert looks[-1].returncode == 0, looks[-1].stderr
                assert json.loads(looks[-1].stdout)["phase"] == "standby"
            finally:
                daemon.terminate()
                daemon.wait(10.0)
