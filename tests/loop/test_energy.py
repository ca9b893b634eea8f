"""The energy of a hold, told tick by tick, is that of its log, and of the pulses that were sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from asvhil.config import Config, load_config
from asvhil.logs.opening import open_recorder
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.logs.summary import summarise
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import EnergyUse, Phase

# Made up here: full power is in proportion to the command.
POWER = "vehicle.power={power_curve: [[-1, 100], [0, 0], [1, 200]], hotel_w: 10, capacity_wh: 50}"


def config(*overrides: str, name: str = "sitl") -> Config:
    return load_config(name, (POWER, "controller.name=backstepping", *overrides))


def drawn_w(pulses_us: tuple[int, int]) -> float:
    return 10.0 + sum(0.5 * p if p > 0 else -0.25 * p for p in (us - 1500 for us in pulses_us))


def held(loop: Lockstep, ticks: int) -> list[tuple[EnergyUse, float]]:
    """Of each tick of a hold what was told, and the power of its pulses."""
    found: list[tuple[EnergyUse, float]] = []
    for _ in range(ticks):
        _, outputs = loop.tick()
        assert outputs.energy is not None
        if outputs.phase is Phase.HOLD:
            assert outputs.pwm_us is not None
            found.append((outputs.energy, drawn_w(outputs.pwm_us)))
        else:
            assert outputs.energy.hold_wh is None
    return found


def test_a_hold_by_the_curve_is_told_logged_and_replayed(tmp_path: Path) -> None:
    across = config("plant.weather.wind.toward_deg=90")
    recorder = open_recorder(across, tmp_path / "log.mcap", "lockstep", threaded=False)
    told = held(Lockstep(across, recorder), 16 * 20)
    recorder.close()
    joule = 0.0
    for i, (use, power_w) in enumerate(told):
        assert use.by == "curve" and use.power_w == pytest.approx(power_w)
        assert i == 0 or use.hold_wh == pytest.approx(joule / 3600.0)
        joule += 0.05 * power_w
    last = told[-1][0]
    assert len(told) > 150 and last.hold_wh is not None and last.hold_wh > 0.1 and last.mean_w is not None
    assert last.hours_left == pytest.approx((50.0 - last.hold_wh) / last.mean_w, rel=0.01)
    figures = summarise(read_run(tmp_path / "log.mcap"))
    assert " W at full thrust; turned to it" in figures["notes"]["heading cost"], "by the same curve"
    (hold,) = figures["holds"]
    assert (figures["energy_wh"], hold["energy_wh"]) == (last.hold_wh, last.hold_wh)
    assert figures["energy_by"] == hold["energy_by"] == "curve"
    result = replay(tmp_path / "log.mcap")
    assert result.mismatch is None and result.compared == result.ticks


@pytest.mark.parametrize("name", ["sitl", pytest.param("sitl-px4", marks=pytest.mark.thorough)])
def test_what_a_simulated_sensor_measures_is_what_the_curve_gives(name: str) -> None:
    """The motors are limited to a steady half: their power then does not depend on when SYS_STATUS was sent."""
    keys = ("plant.frontseat.current_sensor=true", "plant.start_n_m=-60", "vehicle.pwm.command_max=0.5")
    told = held(Lockstep(config(*keys, name=name)), 14 * 20)
    assert len(told) > 100 and {use.by for use, _ in told} == {"measured"}
    use = told[-1][0]
    assert use.hold_wh == pytest.approx(sum(power_w for _, power_w in told) * 0.05 / 3600.0, rel=0.1)
    assert use.power_w is not None and 10.0 < use.power_w < 211.0
