"""The simulated BlueBoat as delivered: held by the script, checked, and none of its parameters written."""

import pytest

from asvhil.config import load_config
from asvhil.preflight.table import Result
from asvhil.types import Inputs, Outputs, Phase
from tests.loop.test_wirings import turns_as_commanded
from tests.support.dock import Dock
from tests.support.loop import STATION_DEG, GroundStationLoop
from tests.support.messages import messages
from tests.support.settled import NO_BIAS

FIRMWARES = ("4.6", "4.7")
HOLD, NEUTRAL = 4, (1500, 1500)


def firmware(version: str) -> str:
    return f"plant.frontseat.firmware='{version}'"


class BlueBoat(GroundStationLoop):
    """Armed in HOLD, with the messages that went to its autopilot."""

    def __init__(self, version: str, *overrides: str) -> None:
        super().__init__(
            load_config("sitl-blueboat", ("supervisor.engage=command", firmware(version), NO_BIAS, *overrides))
        )
        self.to_autopilot: set[str] = set()
        self.wait(7.0)
        assert self.frontseat.set_mode(HOLD) and self.frontseat.rover.arm(), self.frontseat.rover.texts
        self.wait(1.0)

    def tick(self) -> tuple[Inputs, Outputs]:
        found = super().tick()
        self.to_autopilot |= {message.get_type() for message in messages(found[1].frames, "autopilot")}
        return found

    def held(self) -> "BlueBoat":
        self.ask_to_hold(STATION_DEG, 0.0)
        assert self.results[-1] == 0, self.texts
        self.wait(4.0, until=lambda outputs: outputs.phase is Phase.HOLD)
        self.wait(3.0)
        assert self.outputs is not None and self.outputs.phase is Phase.HOLD, self.texts
        return self


@pytest.mark.parametrize("version", ["4.7", pytest.param("4.6", marks=pytest.mark.thorough)])
def test_it_is_held_with_nothing_written(version: str) -> None:
    loop = BlueBoat(version, "plant.start_n_m=-14", "plant.start_e_m=4")
    before = {name: loop.frontseat.rover.parameters[name] for name in loop.frontseat.rover.parameters.names}
    loop.held()
    turns_as_commanded(loop.plant, loop.step)
    loop.wait(30.0)
    distances_m = []
    for _ in range(200):
        assert loop.step().phase is Phase.HOLD
        distances_m.append((loop.plant.truth.n_m**2 + loop.plant.truth.e_m**2) ** 0.5)
    assert sum(distances_m) / len(distances_m) < 1.5
    assert {name: loop.frontseat.rover.parameters[name] for name in before} == before
    assert not loop.to_autopilot & {"PARAM_SET", "RC_CHANNELS_OVERRIDE", "MANUAL_CONTROL", "FILE_TRANSFER_PROTOCOL"}
    loop.t_ns += 400_000_000  # the daemon dies
    loop.plant.advance(loop.t_ns)
    assert loop.frontseat.outputs_us == NEUTRAL


@pytest.mark.parametrize("version", FIRMWARES)
def test_the_check_finds_nothing_that_fails_and_fixes_nothing(version: str) -> None:
    dock = Dock(firmware(version), config="sitl-blueboat")
    failing = [check for check in dock.look() if check.result in (Result.FAIL, Result.UNVERIFIED)]
    assert not failing
    assert not [finding.name for finding in dock.survey.findings if finding.fixable and finding.requirement.must]
    assert "PARAM_SET" not in {message.get_type() for message in dock.said}


@pytest.mark.parametrize("version", FIRMWARES)
def test_without_the_script_the_hold_is_refused_by_name(version: str) -> None:
    loop = BlueBoat(version, "plant.frontseat.script=false")
    loop.ask_to_hold(STATION_DEG, 0.0)
    assert loop.results[-1] != 0 and "script" in loop.texts[-1]
    assert loop.frontseat.outputs_us == NEUTRAL


@pytest.mark.parametrize("version", FIRMWARES)
def test_a_boat_that_is_wired_otherwise_is_refused_by_name(version: str) -> None:
    """Its port motor on the other output: as written here, the config holds the boat to the maker's wiring."""
    swapped = "plant.frontseat.parameters={SERVO1_FUNCTION: 73, SERVO3_FUNCTION: 74}"
    loop = BlueBoat(version, swapped)
    loop.ask_to_hold(STATION_DEG, 0.0)
    assert loop.results[-1] != 0 and "SERVO" in loop.texts[-1], loop.texts
    assert loop.frontseat.outputs_us == NEUTRAL
