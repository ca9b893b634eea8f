"""One hold of a boat with a fault of its motion, or of a healthy one: when it ended, why, and how far off it got."""

from __future__ import annotations

import math
from typing import Any

from asvhil.config import load_config
from asvhil.controller.pwm import command_of_pulse
from asvhil.dynamics.rigid_body import ThrustCurve
from asvhil.geo import LocalFrame
from asvhil.simplant.lockstep import Lockstep
from asvhil.types import Phase

THRUST = 0.05  # of full ahead, by the curve of the config: a motor that is told to give more has thrust
AFTER_S = 1.0  # the run goes on for so long after the end of the hold


def run_hold(base: str, overrides: tuple[str, ...], hold_s: float) -> dict[str, Any]:
    """One hold in lockstep, of `hold_s` or until it ends; distances are those of the truth, from its begin to its end.

    `ended_s` counts from the begin of the hold and is None where it did not end; `thrust_s` is the time until then
    with thrust. `farther_m`: how much farther off than at the begin the boat got. `told` are the notes on the motion
    that came up, by their text, with the seconds since the begin, the thrust and how far off it had got by then.
    """
    config = load_config(base, overrides)
    at = config.supervisor.station
    assert at is not None  # of `engage: auto`
    origin = LocalFrame(lat_deg=config.plant.origin_lat_deg, lon_deg=config.plant.origin_lon_deg)
    n_m, e_m = origin.to_ned(at.lat_deg, at.lon_deg)
    loop, hz = Lockstep(config), config.daemon.tick_hz
    pwm, curve = config.vehicle.pwm, ThrustCurve(config.vehicle.vessel.thrust_curve)
    begun = ended = None
    thrust = 0
    begin_m = farthest_m = 0.0
    failsafe = False
    told: dict[str, dict[str, float]] = {}
    reason = text = ""
    for tick in range(round((60.0 + hold_s) * hz)):
        _, outputs = loop.tick()
        truth = loop.plant.truth
        distance_m = math.hypot(truth.n_m - n_m, truth.e_m - e_m)
        if begun is None:
            if outputs.phase is Phase.HOLD:
                begun, begin_m, farthest_m = tick, distance_m, distance_m
            continue
        if ended is None:
            farthest_m = max(farthest_m, distance_m)
            failsafe = failsafe or outputs.phase is Phase.FAILSAFE
            told_n = (curve.thrust_n(command_of_pulse(pwm, us)) for us in outputs.pwm_us or ())
            thrust += any(abs(thrust_n) > THRUST * curve.ahead_n for thrust_n in told_n)
            for note in outputs.health.notes:
                if note.subject == "motion" and not note.ok:
                    since_s, thrust_s = (tick - begun) / hz, thrust / hz
                    found = {"since_s": since_s, "thrust_s": thrust_s, "farther_m": farthest_m - begin_m}
                    told.setdefault(note.text, found)
            if outputs.phase is Phase.STANDBY:
                ended, reason, text = tick, outputs.health.code, outputs.health.reason
        since = tick - (begun if ended is None else ended)
        if since >= (hold_s if ended is None else AFTER_S) * hz:
            break
    return {
        "begun": begun is not None,
        "ended_s": None if ended is None or begun is None else (ended - begun) / hz,
        "thrust_s": thrust / hz,
        "reason": reason,
        "text": text,
        "begin_m": begin_m,
        "farther_m": farthest_m - begin_m,
        "failsafe": failsafe,
        "told": told,
    }
