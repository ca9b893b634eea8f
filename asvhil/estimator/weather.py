"""The heading that the weather wants: the one at which its mean force on the boat acts along the boat, from ahead."""

from __future__ import annotations

import functools
import math

import casadi as ca
import numpy as np

from asvhil.dynamics.buffers import bind, fastest
from asvhil.dynamics.integrate import motion_derivative
from asvhil.dynamics.protocol import Dynamics
from asvhil.dynamics.remembered import by_model
from asvhil.estimator.prediction import REMEMBERED
from asvhil.geo import body_to_ned, ned_to_body, wrap_rad
from asvhil.types import Estimate, Wind

HEADINGS = 36  # at which the force is evaluated; in between it is interpolated
EVERY_NS = 1_000_000_000
GAP_NS = 5_000_000_000  # without an estimate for so long the average begins anew
CALM_RADPS = math.radians(2.0)  # the disturbance of a boat that turns so fast counts half
TURN_S = 10.0  # time constant with which a turn is forgotten: the error of the model in it stays that long
WIND_SHARE = 0.25  # of the time constant: a wind is measured, and what is left over is made out slowly
CALM_S = 8.0  # for so long nothing was left over, as it were: the first seconds of a hold have the errors of the way
DOUBT_MPS2 = 0.015  # of the disturbance ahead: so much may be the error of the thrust, or of the wind's load
DOUBT_SHARE = 0.6  # of the wind's own push ahead: the error of its load and of a small thrust was 0.4 of it
FELT_S, LATELY_S = 20.0, 5.0  # time constants of the disturbance as it is, for what a heading costs
UNSETTLED_MPS2, UNSETTLED_SHARE = 0.03, 0.3  # a push that changes by more, and by this share, is not known yet
DOUBT_STDS, CURRENT_STDS = 2.0, 4.0  # a current to the side may be there, and is: in wind alone it came to 3
CURRENT_MORE = 1.5  # and counts where it pushes by so much more than the disturbance, which is bounded and late
LEAST_MPS2 = 0.004  # of the mean acceleration: in less weather no heading is better than another


class WeatherHeading:
    """Averages wind and disturbance, and finds where the boat, at rest with its motors neutral, is pushed astern alone.

    A boat whose station moves is looked at in that motion, so that the water's drag is part of the weather. The force
    is the model's acceleration in the mean wind, and the disturbance: current, waves, and what the model does not know
    of the wind. To the side all of it counts, since no motor pushes there. Ahead it has the errors of the thrust as
    well, which come and go: there it counts beyond what these may be, and where it comes from the same side as the
    weather that has been found. Left out, a boat that lies in a current would be thought to feel the wind alone, and a
    small push to the side to take a large turn.
    """

    def __init__(self, model: Dynamics, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        function = _function(_serialized_rate(model), model.input_of_command((0.0, 0.0)))
        self._wind, self._disturbance, self._force = np.zeros(2), np.zeros(3), np.zeros(2 * HEADINGS)
        self._moves = np.zeros(2)
        self._felt, self._lately = np.zeros(2), np.zeros(2)
        self._current, self._current_std_mps = (0.0, 0.0), math.inf
        headings = 2.0 * math.pi * np.arange(HEADINGS) / HEADINGS
        self._evaluate = bind(function, [headings, self._wind, self._disturbance, self._moves], [self._force])
        self._t_ns: int | None = None
        self._since_ns = 0
        self._turn_rate2 = self._weight_s = 0.0
        self._bow_rad: float | None = None
        self._wind_push_mps2 = 0.0
        self.push_mps2 = 0.0  # astern, at that heading; as it was last

    def step(self, t_ns: int, estimate: Estimate | None, wind: Wind | None) -> float | None:
        """The heading (rad) with the weather on the bow; None where it is not known, or there is no weather."""
        if estimate is None or not estimate.valid:
            return self._bow_rad if self._t_ns is not None and t_ns - self._t_ns < GAP_NS else None
        if self._t_ns is None or not 0 <= t_ns - self._t_ns < GAP_NS:
            self._t_ns = self._since_ns = t_ns
            self._wind[:] = self._disturbance[:] = self._felt[:] = self._lately[:] = 0.0
            self._turn_rate2, self._weight_s, self._bow_rad = 0.0, CALM_S, None
        elapsed_s = (t_ns - self._t_ns) * 1e-9
        if t_ns > self._since_ns and elapsed_s < EVERY_NS * 1e-9:
            return self._bow_rad
        # A mean of all there is at first, then a low-pass filter.
        known_s = (t_ns - self._since_ns) * 1e-9 + EVERY_NS * 1e-9
        step_s = max(elapsed_s, EVERY_NS * 1e-9)
        gain = min(step_s / min(known_s, WIND_SHARE * self._time_constant_s), 1.0)
        self._t_ns = t_ns
        air = (0.0, 0.0) if wind is None else (wind.vn_mps, wind.ve_mps)
        self._wind += gain * (np.array(air) - self._wind)
        share = self._share(step_s, estimate.r_radps)
        self._disturbance[:2] += share * (np.array(self._counted(estimate)) - self._disturbance[:2])
        for mean, time_s in ((self._felt, FELT_S), (self._lately, LATELY_S)):
            mean += min(step_s / min(known_s, time_s), 1.0) * (np.array(estimate.disturbance[:2]) - mean)
        self._evaluate()
        self._bow_rad = self._bow()
        return self._bow_rad

    def _counted(self, estimate: Estimate) -> tuple[float, float]:
        """What of the disturbance (m/s^2, north and east) is taken for weather."""
        ahead, sway = ned_to_body(estimate.psi_rad, *estimate.disturbance[:2])
        agrees = self._bow_rad is not None and ahead * math.cos(self._bow_rad - estimate.psi_rad) < 0.0
        doubt_mps2 = max(DOUBT_MPS2, DOUBT_SHARE * self._wind_push_mps2)
        certain = math.copysign(max(abs(ahead) - doubt_mps2, 0.0), ahead) if agrees else 0.0
        return body_to_ned(estimate.psi_rad, certain, sway)

    def _share(self, step_s: float, r_radps: float) -> float:
        """How much of the average is this sample of the disturbance: the less, the more the boat has turned of late."""
        self._turn_rate2 += min(step_s / TURN_S, 1.0) * (r_radps**2 - self._turn_rate2)
        counts_s = step_s / (1.0 + max(self._turn_rate2, r_radps**2) / CALM_RADPS**2)
        self._weight_s += counts_s - min(step_s / self._time_constant_s, 1.0) * self._weight_s
        return min(counts_s / self._weight_s, 1.0)

    def note_motion(self, velocity_mps: tuple[float, float]) -> None:
        """The velocity (north, east) of the station that is held; zero for one at rest, and without one."""
        self._moves[:] = velocity_mps

    def note_current(self, current_mps: tuple[float, float], std_mps: float) -> None:
        """The current (north, east) that somebody else has made out of the boat's motion, and how well it is known."""
        self._current, self._current_std_mps = current_mps, std_mps

    def push_at_rest(self, psi_rad: float) -> tuple[float, float] | None:
        """As `push_at`, for a boat that rests though its station moves: that of the weather alone. Changes nothing."""
        force, moves = self._force.copy(), self._moves.copy()
        self._moves[:] = 0.0
        self._evaluate()
        push = self.push_at(psi_rad)
        self._force[:], self._moves[:] = force, moves
        return push

    def push_at(self, psi_rad: float) -> tuple[float, float] | None:
        """The mean push (m/s^2) ahead and to starboard at a heading on a boat that moves as its station.

        None where it is not known. To the side it is no less than the disturbance of late, nor than what the current
        does: the average by which the weather's heading is found takes minutes to show them on a boat that swings.
        """
        if self._t_ns is None:
            return None
        ahead, abeam = self._interpolated(psi_rad)
        counted, felt, lately = (
            ned_to_body(psi_rad, *mean[:2].tolist())[1] for mean in (self._disturbance, self._felt, self._lately)
        )
        if abs(abeam + felt - counted) > abs(abeam) + UNSETTLED_MPS2:
            abeam += felt - counted
        settled = abs(lately - felt) <= max(UNSETTLED_MPS2, UNSETTLED_SHARE * abs(abeam))
        across_mps, std_mps = abs(ned_to_body(psi_rad, *self._current)[1]), self._current_std_mps
        if across_mps > DOUBT_STDS * std_mps:
            drag = self._drag_abeam(psi_rad, 1.0 - std_mps / across_mps)
            if abs(drag) > CURRENT_MORE * abs(abeam):
                abeam, settled = drag, across_mps >= CURRENT_STDS * std_mps
        return (ahead, abeam) if settled else None

    def _drag_abeam(self, psi_rad: float, share: float) -> float:
        """The push to starboard of wind and water alone, in a share of the current."""
        force, moves, disturbance = self._force.copy(), self._moves.copy(), self._disturbance.copy()
        self._moves -= share * np.array(self._current)
        self._disturbance[:] = 0.0
        self._evaluate()
        abeam = self._interpolated(psi_rad)[1]
        self._force[:], self._moves[:], self._disturbance[:] = force, moves, disturbance
        return abeam

    def _interpolated(self, psi_rad: float) -> tuple[float, float]:
        """The force of the last evaluation at a heading, ahead and to starboard."""
        place = (psi_rad % (2.0 * math.pi)) / (2.0 * math.pi) * HEADINGS
        k = int(place) % HEADINGS
        after, share = (k + 1) % HEADINGS, place - int(place)
        ahead, abeam = (
            float(part[k] + share * (part[after] - part[k])) for part in (self._force[0::2], self._force[1::2])
        )
        return ahead, abeam

    def _bow(self) -> float | None:
        """Where the sideways force changes its sign and the other one is astern; of several, where it is strongest."""
        ahead, abeam = self._force[0::2].tolist(), self._force[1::2].tolist()
        best: tuple[float, float] | None = None
        for k in range(HEADINGS):
            after = (k + 1) % HEADINGS
            if abeam[k] * abeam[after] > 0.0 or abeam[k] == abeam[after]:
                continue
            share = abeam[k] / (abeam[k] - abeam[after])
            force = ahead[k] + share * (ahead[after] - ahead[k])
            if force < -LEAST_MPS2 and (best is None or force < best[0]):
                best = force, wrap_rad(2.0 * math.pi * (k + share) / HEADINGS)
        if best is None:
            return None
        self.push_mps2 = -best[0]
        self._wind_push_mps2 = max(self.push_mps2 - math.hypot(*self._disturbance[:2].tolist()), 0.0)
        return best[1]


@by_model
def _serialized_rate(model: Dynamics) -> str:
    """A model's rate (state, input, wind, disturbance) -> s_dot, remembered as that of `prediction.py`."""
    x, a = ca.SX.sym("x", 6 + model.n_motor), ca.SX.sym("a", 2)
    wind, disturbance = ca.SX.sym("w", 2), ca.SX.sym("d", 3)
    rate = ca.Function("rate", [x, a, wind, disturbance], [motion_derivative(model, x, a, wind, disturbance)])
    serialized: str = rate.serialize()
    return serialized


@functools.lru_cache(maxsize=REMEMBERED)
def _function(serialized: str, neutral: tuple[float, float]) -> ca.Function:
    """(headings, wind, disturbance, motion) -> pushes by a model's rate; remembered as those of `prediction.py`."""
    rate_of = ca.Function.deserialize(serialized)
    psi, wind, disturbance = ca.SX.sym("psi"), ca.SX.sym("w", 2), ca.SX.sym("d", 3)
    moves = ca.SX.sym("c", 2)
    along = ca.cos(psi) * moves[0] + ca.sin(psi) * moves[1], ca.cos(psi) * moves[1] - ca.sin(psi) * moves[0]
    with_it = ca.vertcat(0.0, 0.0, psi, *along, ca.SX.zeros(rate_of.size1_in(0) - 5))
    push = rate_of(with_it, ca.SX(ca.DM(neutral)), wind, disturbance)[3:5]
    at_one = ca.Function("push", [psi, wind, disturbance, moves], [push], {"cse": True})
    return fastest(at_one.map("pushes", "serial", HEADINGS, [1, 2, 3], []))
