"""The docking windows that are told while a station is held are those that its log has."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.backseat.build import build_decoder
from asvhil.config import load_config
from asvhil.logs.metrics import docking_windows
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.logs.run import RunReader
from asvhil.logs.summary import tracks
from asvhil.simplant.lockstep import Lockstep


def test_windows_open_and_end_as_the_metrics_have_them(tmp_path: Path) -> None:
    """From 5 m astern across 2 m/s: on its way the boat is too fast, and each swing may end a window."""
    keys = (
        "controller.name=sliding-mode",  # no MPC, and one that opens windows
        "plant.weather.wind={speed_mps: 2, toward_deg: 90}",
        "plant.start_n_m=-5",
        "plant.start_e_m=0",
    )
    config = load_config("sitl", keys)
    recorder = open_recorder(config, tmp_path / "log.mcap", "lockstep", threaded=False)
    loop, reader = Lockstep(config, recorder), RunReader(config, build_decoder(config))
    told: list[list[float]] = []
    since_s: float | None = None
    for tick in range(70 * 20):
        inputs, outputs = loop.tick()
        reader.tick(inputs, outputs)
        window, t_s = outputs.docking, tick / 20.0
        assert (window is None) == (outputs.station is None or outputs.estimate is None)
        is_open = window is not None and window.open_s is not None
        if is_open and since_s is None:
            since_s = t_s
            told.append([t_s, t_s])
        elif not is_open:
            since_s = None
        if since_s is not None:
            assert window is not None and window.open_s == pytest.approx(t_s - since_s, abs=1e-6)
            told[-1][1] = t_s
    recorder.close()
    estimated = tracks(reader.run({"run": {"mode": "lockstep"}}))["estimated"]
    assert estimated is not None
    measured = [(window["from_s"], window["to_s"]) for window in docking_windows(estimated)]
    assert measured and [tuple(span) for span in told if span[1] - span[0] >= 10.0] == [
        pytest.approx(span, abs=0.06) for span in measured
    ]
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == result.ticks
