"""An autopilot that disarms by itself in a hold: told as such, at neutral, and an emergency until it is armed again."""

from typing import Any

import pytest

from asvhil.config import load_config
from asvhil.io.mavlink.frames import dialect
from asvhil.operator.encoding import encode_presence, encode_release
from asvhil.types import Frame, Phase
from tests.support.loop import PLAIN_CONTROLLER, GroundStationLoop

STANDBY, EMERGENCY = dialect.MAV_STATE_STANDBY, dialect.MAV_STATE_EMERGENCY


class Loop(GroundStationLoop):
    """A held boat in wind, whose autopilot may not hear us."""

    cut = False

    def __init__(self, config: str, *overrides: str) -> None:
        wind = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=0")
        super().__init__(load_config(config, (PLAIN_CONTROLLER, *wind, *overrides)))
        assert self.wait(60.0, until=lambda outputs: outputs.phase is Phase.HOLD).phase is Phase.HOLD
        self.say(encode_presence())
        self.wait(8.0)

    def deliver(self, frames: tuple[Frame, ...]) -> None:
        if not self.cut:
            super().deliver(frames)

    def ends(self, seconds: float = 5.0) -> Any:
        return self.wait(seconds, until=lambda outputs: outputs.phase is Phase.STANDBY)

    def state(self) -> int:
        self.heard.clear()
        self.say(encode_presence())
        self.wait(1.2)
        return int([m for m in self.heard if m.get_type() == "HEARTBEAT"][-1].system_status)


@pytest.mark.parametrize("lost_s", [1.05, 1.2, 3.0])
def test_a_px4_that_does_not_hear_us_has_disarmed_by_itself(lost_s: float) -> None:
    loop = Loop("sitl-px4")
    loop.cut = True
    loop.wait(lost_s)
    loop.cut = False
    outputs = loop.ends()
    assert (outputs.health.code, outputs.health.reason) == (
        "autopilot-disarmed",
        "autopilot disarmed by itself: failsafe",
    )
    assert "standby: autopilot disarmed by itself: failsafe" in loop.texts
    loop.wait(1.0)
    assert not any("stuck" in text or "outputs" in text for text in loop.texts), loop.texts
    assert loop.state() == EMERGENCY and loop.plant.frontseat.outputs_us == (1500, 1500)
    loop.wait(20.0)
    assert loop.state() == EMERGENCY, "time does not help"
    assert loop.plant.frontseat.vehicle.arm()
    loop.wait(1.5)
    assert loop.state() == STANDBY and loop.plant.frontseat.outputs_us == (1500, 1500), "somebody has it"


def test_a_person_who_disarms_is_told_as_before_and_is_no_emergency() -> None:
    loop = Loop("sitl-px4")
    loop.plant.frontseat.vehicle.disarm()
    assert loop.ends(0.3).health.code == "disarmed"
    assert loop.state() == STANDBY and "standby: disarmed" in loop.texts
    loop.wait(3.0)
    assert not any("stuck" in text for text in loop.texts), loop.texts


@pytest.mark.parametrize("config", ["sitl", "sitl-px4"])
def test_a_reboot_is_told_as_such_and_leaves_the_boat_adrift(config: str) -> None:
    loop = Loop(config)
    loop.plant.frontseat.reboot(loop.plant.t_ns)
    loop.ends(10.0)
    outputs = loop.wait(6.0)
    assert outputs.health.code == "autopilot-rebooted", outputs.health.reason
    assert any("autopilot rebooted" in text for text in loop.texts)
    assert loop.state() == EMERGENCY
    loop.wait(20.0)
    assert loop.state() == EMERGENCY, "nor does the mode that it starts in"
    loop.say(encode_release(loop.config.links.autopilot))
    loop.wait(0.2)
    assert loop.state() == STANDBY, "an operator knows of it"
