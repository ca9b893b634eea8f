"""Boats in lockstep whose autopilot is set wrong, and what is to be found of each."""

from __future__ import annotations

from collections.abc import Collection
from typing import cast

from asvhil.config import load_config
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import Reason
from asvhil.types import Outputs, Phase
from tests.support.loop import PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop
from tests.support.lossy_plant import PlantBehindLink, losing_messages

# What may be wrong: parameters of the vehicle, and the reason that is found without reading them.
WRONG: dict[str, tuple[dict[str, float], Reason]] = {
    "overrides ignored": ({"SYSID_MYGCS": 255}, Reason.OVERRIDES_IGNORED),
    "RC_OPTIONS": ({"RC_OPTIONS": 34}, Reason.OVERRIDES_IGNORED),
    "dead zones": ({"RC1_DZ": 30, "RC3_DZ": 30}, Reason.OUTPUTS_DIFFER),
    "one dead zone": ({"RC3_DZ": 40}, Reason.OUTPUTS_DIFFER),
    "slew": ({"MOT_SLEWRATE": 100}, Reason.OUTPUTS_DIFFER),
    "swapped": ({"SERVO1_FUNCTION": 74, "SERVO3_FUNCTION": 73}, Reason.OUTPUTS_SWAPPED),
    "reversed": ({"SERVO1_REVERSED": 1}, Reason.OUTPUT_REVERSED),
    "both reversed": ({"SERVO1_REVERSED": 1, "SERVO3_REVERSED": 1}, Reason.OUTPUT_REVERSED),
    "mixed": ({"PILOT_STEER_TYPE": 0}, Reason.COMMANDS_MIXED),
    "no motor": ({"SERVO1_FUNCTION": 0, "SERVO3_FUNCTION": 0}, Reason.OUTPUT_STUCK),
    "no port motor": ({"SERVO1_FUNCTION": 0}, Reason.OUTPUT_STUCK),
    "scaled": (
        {f"SERVO{n}_{end}": us for n in (1, 3) for end, us in (("MIN", 1100), ("MAX", 1900))},
        Reason.OUTPUTS_DIFFER,
    ),
}

# Ways to wire a boat, which are followed where they can be read.
WIRED = ("swapped", "reversed", "both reversed", "scaled")

# As much as can be known of overrides that are ignored where neither parameters nor sticks are reported.
BLIND_REASON = Reason.OUTPUTS_UNCHANGED


class Trial(GroundStationLoop):
    """Wait until all is ready, arm, ask to hold, and see what becomes of it. `lost`: messages that never arrive."""

    def __init__(self, parameters: dict[str, float], *overrides: str, lost: Collection[str] = ()) -> None:
        values = ", ".join(f"{name}: {value}" for name, value in parameters.items())
        settings = (
            PLAIN_CONTROLLER,
            "supervisor.engage=command",
            f"plant.frontseat.parameters={{{values}}}",
            *overrides,
        )
        super().__init__(load_config("sitl", settings))
        self.plant = cast(Plant, PlantBehindLink(self.plant, losing_messages(lost)))
        self.wait(11.0 if "PARAM_VALUE" in lost else 7.0)  # until what does not answer is given up
        assert self.plant.frontseat.rover.arm(force=True)  # a real one refuses some of these
        self.wait(0.5)
        self.texts.clear()

    def hold(self, limit_s: float = 6.0) -> tuple[float | None, Outputs]:
        """Seconds until the motors are let go after a hold (0: refused; None: it goes on), and the last outputs."""
        start_ns = self.t_ns
        outputs = self.ask_to_hold(STATION_DEG, 0.0)
        if self.results[-1] != 0:
            return 0.0, outputs
        while (self.t_ns - start_ns) * 1e-9 < limit_s:
            if outputs.phase is Phase.STANDBY:
                return (self.t_ns - start_ns) * 1e-9, outputs
            outputs = self.step()
        return None, outputs
