"""The whole loop in virtual time: the station is kept, and the same seed gives the same bytes."""

import io
from pathlib import Path

import pytest
from rich.console import Console

from asvhil.commands.views import print_summary
from asvhil.config import Config, load_config
from asvhil.logs.encoding import encode_outputs
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep
from asvhil.types import Phase
from tests.support.settled import NO_BIAS, settled


def config(*overrides: str) -> Config:
    return load_config("sitl", (NO_BIAS, *overrides))


@pytest.mark.parametrize(
    ("wind", "heading_deg"),
    [((3.0, 300.0), 120.0), pytest.param((3.0, 0.0), 0.0, marks=pytest.mark.thorough)],
)
def test_along_the_wind_the_station_is_kept_within_decimetres(wind: tuple[float, float], heading_deg: float) -> None:
    loop = Lockstep(
        config(
            f"plant.weather.wind.speed_mps={wind[0]}",
            f"plant.weather.wind.toward_deg={wind[1]}",
            f"supervisor.station.heading_deg={heading_deg}",
        )
    )
    distance_m, heading_mean_deg, _ = settled(loop, 70.0, 45.0)
    assert distance_m <= 0.6 and abs(heading_mean_deg) <= 1.0


@pytest.mark.thorough
def test_across_the_wind_the_boat_swings_and_stays() -> None:
    loop = Lockstep(config("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90"))
    distance_m, heading_mean_deg, heading_std_deg = settled(loop, 90.0, 45.0)
    # No boat with two fixed motors can hold still here; the limit cycle swings by about 10 degrees.
    assert distance_m < 3.0 and abs(heading_mean_deg) < 3.0 and 5.0 < heading_std_deg < 16.0


def test_without_an_anemometer_the_station_is_kept_too() -> None:
    loop = Lockstep(config("plant.sensors.anemometer.rate_hz=0.001"))
    distance_m, heading_mean_deg, _ = settled(loop, 70.0, 45.0)
    assert distance_m <= 0.8 and abs(heading_mean_deg) <= 2.0


def test_same_seed_same_bytes_another_seed_others() -> None:
    def outputs(seed: int) -> list[bytes]:
        loop = Lockstep(config(f"plant.seed={seed}"))
        return [encode_outputs(loop.tick()[1]) for _ in range(250)]

    first = outputs(1)
    assert first == outputs(1)
    assert first != outputs(2)


def test_the_summary_of_a_log_has_every_figure(tmp_path: Path) -> None:
    wall_s = run_lockstep(config(), tmp_path / "log.mcap", 75.0)
    run = read_run(tmp_path / "log.mcap")
    figures = summarise(run, wall_s)
    assert figures["controller"] == "lagnet-mpc" and figures["seed"] == 1
    assert figures["config_hash"] == config().content_hash()
    assert figures["settled_from_s"] == pytest.approx(37.5, abs=0.1)
    for name in ("truth", "estimated", "measured"):
        assert figures[name]["distance_m"]["mean"] <= 0.6
        assert figures[name]["distance_m"]["max"] > 13.0  # it came from 14 m off
        assert figures[name]["distance_m"]["max_settled"] < 1.5
        parts = figures[name]["distance_m"], figures[name]["heading_deg"]
        assert figures[name]["penalty_score"] == pytest.approx(
            parts[0]["mean"] + parts[0]["std"] + abs(parts[1]["mean"]) + parts[1]["std"]
        )
    assert figures["ticks"] == 75 * 20 + 3 and figures["overruns"] == 0
    assert figures["phases"][Phase.HOLD] > 65.0
    assert 0.0 < figures["step_ms"]["p50"] <= figures["step_ms"]["p99"] <= figures["step_ms"]["max"]
    assert figures["realtime_factor"] > 1.0
    assert figures["wind"]["estimated"]["speed_mps"]["mean"] == pytest.approx(3.0, abs=0.7)
    assert 0.0 < figures["energy"] <= 1.0


def test_the_summary_has_the_share_of_time_of_each_source(tmp_path: Path) -> None:
    """The receiver is silent for 4 s: 1 s later the filter takes over, 5 s after its return it gives back."""
    lost = "plant.faults=[{kind: gnss, from_s: 8, until_s: 12}]"
    run_lockstep(load_config("sitl", (NO_BIAS, lost)), tmp_path / "log.mcap", 20.0)
    run = read_run(tmp_path / "log.mcap")
    position = run.source_shares["position"]
    assert sum(position.values()) == pytest.approx(1.0)
    assert set(position) == {"autopilot.GPS_RAW_INT", "autopilot.GLOBAL_POSITION_INT"} and len(position) == 2
    assert 0.25 < position["autopilot.GLOBAL_POSITION_INT"] < 0.5  # 8 s of some 19 s
    assert run.source_shares["heading"] == {"autopilot.ATTITUDE": 1.0}
    said = io.StringIO()
    print_summary(Console(file=said, width=200), summarise(run))
    (line,) = [line for line in said.getvalue().splitlines() if line.startswith("sources, of the time: ")]
    assert "position autopilot.GPS_RAW_INT" in line and "heading" not in line


def test_a_run_ends_with_neutral_and_release() -> None:
    loop = Lockstep(config())
    last = []
    loop.run(20.0, last.append)
    assert last[-4].pwm_us is not None and last[-4].phase is Phase.HOLD
    assert last[-1].phase is Phase.STANDBY and last[-1].pwm_us is None
    loop.plant.advance(loop.t_ns + 200_000_000)
    assert loop.plant.truth.outputs_us == (1500, 1500)


@pytest.mark.thorough
def test_the_small_boat_with_fast_motors_keeps_its_station_too() -> None:
    # Its motor lag is shorter than the steps of the prediction: a rule for the step that ignores that parks the boat.
    loop = Lockstep(load_config("sitl-bream", (NO_BIAS,)))
    distance_m, heading_mean_deg, _ = settled(loop, 65.0, 40.0)
    assert distance_m <= 1.0 and abs(heading_mean_deg) <= 2.0
