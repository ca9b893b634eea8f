"""The motion of a station that `asvhil hold` asks for: checked before the hold, set once the station is held."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from asvhil.errors import AsvhilError, LinkError

if TYPE_CHECKING:
    from asvhil.config import Config

RETRY_S = 0.2


def parameters_of_course(drift: str | None, way_m: float, leader: int | None) -> dict[str, float]:
    """The parameters of a station that moves, in the order in which they are set: the speed, which starts it, last."""
    from asvhil.config.mean_wind import parse_course
    from asvhil.operator.station_parameters import COURSE_PARAMETER, FOLLOW_PARAMETER, SPEED_PARAMETER, WAY_PARAMETER

    if leader is not None:
        return {FOLLOW_PARAMETER: float(leader)}
    if drift is None:
        return {}
    speed_mps, course_deg = parse_course(drift)
    return {COURSE_PARAMETER: course_deg, WAY_PARAMETER: way_m, SPEED_PARAMETER: speed_mps}


def check_course(config: Config, moving: Mapping[str, float]) -> None:
    """Raises AsvhilError where the daemon would refuse one of the parameters: a hold that comes first takes the motors,
    or drops the station that was held, and a course that is refused after it leaves the boat there.
    """
    from asvhil.operator.station_parameters import FOLLOW_PARAMETER, SPEED_PARAMETER, request_of_change
    from asvhil.supervisor.reasons import Explanation, describe
    from asvhil.types import ParameterChange

    for name, value in moving.items():
        meant = request_of_change(ParameterChange(t_ns=0, name=name, value=value))
        if isinstance(meant, Explanation):
            raise AsvhilError(f"{describe(meant)}, not {value:g}; nothing has changed")
    at = config.links.autopilot
    leader = moving.get(FOLLOW_PARAMETER)
    if leader in (at.system_id, at.autopilot_system_id):
        raise AsvhilError(f"--follow {leader:.0f}: that is the boat itself; nothing has changed")
    if SPEED_PARAMETER in moving:
        _check_speed(config, moving[SPEED_PARAMETER])


def _check_speed(config: Config, speed_mps: float) -> None:
    """Raises AsvhilError for more than the daemon tells that it allows; one of before tells nothing, and refuses it."""
    from asvhil.links.operator_client import is_value, read_parameter
    from asvhil.operator.encoding import encode_parameter_question
    from asvhil.operator.station_parameters import MOST_SPEED_PARAMETER, SPEED_PARAMETER
    from asvhil.supervisor.reasons import Reason, describe, explain

    link = config.links.operator

    def told(name: str) -> float:
        question = encode_parameter_question(config.links.autopilot, name)
        return read_parameter(question, link.endpoint, name, signing=link.signing)

    try:
        most_mps = told(MOST_SPEED_PARAMETER)
    except LinkError:
        told(SPEED_PARAMETER)  # raises where nobody answers at all
        return
    if speed_mps > most_mps and not is_value(most_mps, speed_mps):
        too_fast = explain(Reason.STATION_TOO_FAST, speed=speed_mps, most=most_mps)
        raise AsvhilError(f"the daemon refuses {describe(too_fast)}; nothing has changed")


@contextmanager
def once_held() -> Iterator[None]:
    """What is asked for after a hold was granted: where nobody answers any more, the error says that it was."""
    try:
        yield
    except LinkError as error:
        raise LinkError(f"the hold was granted, and then: {error}") from None


def set_course(config: Config, name: str, value: float) -> None:
    """Set a parameter of the station's motion, once the station is held. Raises AsvhilError where it is not taken."""
    from asvhil.links.operator_client import is_value, set_parameter
    from asvhil.operator.encoding import encode_parameter

    link, data = config.links.operator, encode_parameter(config.links.autopilot, name, value)
    end_s = time.monotonic() + config.supervisor.take_mode_timeout_s
    while True:
        known, text = set_parameter(data, link.endpoint, name, value, signing=link.signing)
        if is_value(known, value):
            return
        # While the autopilot's mode is asked for no station is held yet.
        waits = "no station is held" in text
        if not waits or time.monotonic() > end_s:
            held = "no station is held" if waits else "a new station is held, at rest; `asvhil release` ends it"
            why = text or f"it is {known:g}, and nothing tells why"
            raise AsvhilError(f"the hold was granted, and {held}: the daemon refused {name} = {value:g}: {why}")
        time.sleep(RETRY_S)
