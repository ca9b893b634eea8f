"""Names and helpers of the tests of the simulated ArduRover."""

from __future__ import annotations

import itertools

from asvhil.io.mavlink.frames import dialect as mav
from tests.support.simplant_boat import Boat, of, times

GCS = {"system": 255, "component": 190, "peer": "station"}
MANUAL, HOLD, LOITER, GUIDED = 0, 4, 5, 15
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
NO_RECEIVER = "plant.frontseat.rc_receiver=false"
ATTITUDE, GPS_RAW_INT, SERVO_OUTPUT_RAW, RC_CHANNELS, SIM_STATE = 30, 24, 36, 65, 108


def intervals(boat: Boat, name: str, seconds: float) -> list[float]:
    seen = times(boat.run(seconds), name)
    return [round(b - a, 6) for a, b in itertools.pairwise(seen)]


def set_parameter(boat: Boat, name: str, value: float) -> float | None:
    boat.send(mav.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
    values = of(boat.run(0.04), "PARAM_VALUE")
    assert all(m.param_id == name for m in values)
    return values[-1].param_value if values else None
