"""The geofence in the loop: a boat that is carried out of it is let go, and its log replays."""

from __future__ import annotations

import json
from pathlib import Path

from asvhil.config import load_config
from asvhil.geo import LocalFrame
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase
from tests.support.loop import PLAIN_CONTROLLER


def test_a_boat_that_is_carried_out_is_let_go_and_the_log_replays(tmp_path: Path) -> None:
    plain = load_config("sitl")
    station = plain.supervisor.station
    assert station is not None
    frame = LocalFrame(lat_deg=station.lat_deg, lon_deg=station.lon_deg)
    corners = [frame.to_geodetic(n, e) for n, e in ((-30.0, -30.0), (-30.0, 5.0), (30.0, 5.0), (30.0, -30.0))]
    keys = (
        PLAIN_CONTROLLER,
        f"supervisor.geofence={json.dumps(corners)}",
        *("plant.start_n_m=15", "plant.start_e_m=-12"),
        *("plant.weather.current.speed_mps=2.5", "plant.weather.current.toward_deg=90"),
        "supervisor.motion.on_fault=off",
    )
    config = load_config("sitl", keys)
    log = tmp_path / "log.mcap"
    recorder = open_recorder(config, log, "lockstep", threaded=False)
    loop = Lockstep(config, recorder)
    held = False
    for _ in range(60 * 20):
        _, outputs = loop.tick()
        held |= outputs.phase is Phase.HOLD
        if held and outputs.phase is Phase.STANDBY:
            break
    assert held and outputs.health.code == "outside-fence" and "the boat is" in outputs.health.reason
    for _ in range(60):
        _, outputs = loop.tick()
        assert outputs.phase is Phase.STANDBY and outputs.pwm_us in (None, (1500, 1500))
    recorder.close()
    assert replay(log).mismatch is None
