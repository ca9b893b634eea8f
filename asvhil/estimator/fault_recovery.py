"""Recovery of the filter from wrong states: when a rejected sensor is right after all, and which states are then reset.

`sensor_health.py` has the record of each sensor by itself; here it is compared with the others and the filter's state.
"""

from __future__ import annotations

import math

from asvhil.estimator import sensor_health
from asvhil.estimator.agreement import Agreement, Pair
from asvhil.estimator.sensor_health import FreezeLimits, Track
from asvhil.estimator.states import B_E, B_N, G_R, PSI, E, FilterState, N, R, U, V
from asvhil.geo import wrap_rad

LONGEST_GAP_S = 1.5  # between two velocities that are integrated
CLEARED_BY = {"position": "velocity", "velocity": "position", "heading": "yaw_rate", "yaw_rate": "heading"}
TURN_SLACK_RAD = 0.1  # by which a compass in a turn may leave the gyro: deviation, and the pull of motors
AGAIN_NS = 20_000_000_000  # after the filter was wrong about a pair, in which it is sooner taken to be
SOON_NS = 1_000_000_000  # for which a rate is rejected then: in less, nothing shows in the places
AGREEMENT_SLACK = 0.7  # of a rejection's limit by a position's own noise: two of a sound receiver differ by less
LEAST_ACCEPTED = 20  # readings that a sensor needs for a record to compare a jump with

# States that are reset with a sensor's, and their variances then. The velocity over ground is known
# in NED: with another heading it is another one in body axes.
RESET_VARIANCES = {
    "position": ((N, 1e4), (E, 1e4), (U, 4.0), (V, 4.0)),
    "heading": ((PSI, 3.0), (U, 4.0), (V, 4.0), (R, 0.25)),
    "velocity": ((U, 4.0), (V, 4.0)),
    "yaw_rate": ((R, 0.25),),
    "acceleration": (),
}

FREEZE_LIMITS = {
    "position": FreezeLimits(noise=0.02, motion=0.1),
    "velocity": FreezeLimits(noise=0.012, motion=0.1),
    "heading": FreezeLimits(noise=math.radians(0.05), motion=math.radians(1.0)),
    "yaw_rate": FreezeLimits(noise=0.002, motion=0.02),
    # The prediction of a force is the vessel model's: a motor that starts late, or a thrust that is a little off, must
    # not pass for a frozen sensor where the boat is at rest and the sensor coarse (ArduPilot's RAW_IMU: 1 mg).
    "acceleration": FreezeLimits(noise=0.01, motion=0.15, lag_ns=300_000_000),
}


def integrate_velocity(state: FilterState, t_ns: int, vn_mps: float, ve_mps: float) -> float:
    """Integrate the velocity of the receiver: the time (s) since the one before, 0 where that is too long."""
    elapsed_s = (t_ns - state.displacement_ns) * 1e-9
    state.displacement_ns = t_ns
    if elapsed_s > LONGEST_GAP_S:
        return 0.0
    state.displacement = (state.displacement[0] + vn_mps * elapsed_s, state.displacement[1] + ve_mps * elapsed_s)
    return elapsed_s


def is_frozen(state: FilterState, name: str, track: Track) -> bool:
    """Whether a sensor is frozen: by itself, or a velocity that repeats beside a frozen position of its receiver."""
    if track.frozen or name != "velocity":
        return track.frozen
    position = state.tracks.get("position")
    return position is not None and position.frozen and track.repeats >= sensor_health.LEAST_REPEATS


def consistency_offset(state: FilterState, t_ns: int, name: str, off: tuple[float, float]) -> tuple[float, float]:
    """The quantity that stays constant while a rejected sensor is consistent: its distance to the prediction.

    For a position it is the distance to the integrated velocity of the receiver, if there is one. Of a heading it goes
    on beyond half a turn, where the innovation of one that is off by that much leaps.
    """
    if name == "heading":
        first = state.tracks[name].steady[0]
        return first + wrap_rad(off[0] - first), 0.0
    if name != "position" or t_ns - state.displacement_ns > LONGEST_GAP_S * 1e9:
        return off
    value = state.tracks[name].value
    return value[0] - state.displacement[0], value[1] - state.displacement[1]


def requires_reset(state: FilterState, t_ns: int, name: str, distance: float, return_ns: int) -> bool:
    """Whether the filter is wrong, and not the sensor that it keeps rejecting.

    It must have been steady for the return time, and one of these must hold: it has no record yet; there has been no
    valid estimate for as long; or both position and velocity of a receiver are rejected, agree with each other, and
    the velocity explains how far off (m) the position is, as after a push that no other sensor shows.
    """
    track = state.tracks[name]
    if track.steady_since_ns == sensor_health.NEVER or t_ns - track.steady_since_ns < return_ns:
        return False
    if track.accepted < LEAST_ACCEPTED:
        return True
    if state.invalid_since_ns != sensor_health.NEVER and t_ns - state.invalid_since_ns >= return_ns:
        return True
    velocity = state.tracks.get("velocity")
    if name != "position" or velocity is None or velocity.rejected_in_row == 0:
        return False
    span_s = (t_ns - velocity.rejected_since_ns) * 1e-9
    return span_s * 1e9 >= return_ns and distance <= math.hypot(*velocity.innovation) * span_s


def integrate_rate(state: FilterState, t_ns: int, r_radps: float) -> None:
    """Integrate the yaw rate of the gyro, less its bias."""
    elapsed_s = (t_ns - state.turned_ns) * 1e-9
    state.turned_ns = t_ns
    if elapsed_s > LONGEST_GAP_S:
        state.turn_agreement = Agreement()
    else:
        state.turned_rad += (r_radps - float(state.x[G_R])) * elapsed_s


def note_place(state: FilterState, t_ns: int, name: str, value: Pair, elapsed_ns: int, *, accepted: bool) -> None:
    """Keep how a position (m, NED) or heading (rad), so long after the last, agrees with the velocity or yaw rate.

    Without a rate of late there is nothing to agree with. While the rate is rejected what they agreed on is kept: else
    a wrong one would be borne out in the end by a mean that has followed it.
    """
    elapsed_s = min(elapsed_ns * 1e-9, LONGEST_GAP_S)
    rate = state.tracks.get(CLEARED_BY[name])
    accepted = accepted and rate is not None and rate.rejected_in_row == 0
    if name == "position":
        state.agreement = (
            state.agreement.with_place(value, state.displacement, elapsed_s, accepted=accepted)
            if t_ns - state.displacement_ns <= LONGEST_GAP_S * 1e9
            else Agreement()
        )
    elif t_ns - state.turned_ns <= LONGEST_GAP_S * 1e9:
        near_rad = state.turned_rad + state.turn_agreement.last[0]  # of the turns, the nearest one
        psi_rad = near_rad + wrap_rad(value[0] - near_rad)
        state.turn_agreement = state.turn_agreement.with_place(
            (psi_rad, 0.0), (state.turned_rad, 0.0), elapsed_s, accepted=accepted
        )
    else:
        state.turn_agreement = Agreement()


def is_cleared(state: FilterState, t_ns: int, name: str, slack_m: float, return_ns: int) -> bool:
    """Whether a rejected sensor agrees with the one that measures its integral or its rate: then the filter is wrong.

    It must have been rejected for the return time. Once the filter has been wrong about such a pair that is not waited
    for again: what it does not know is still there.
    """
    track = state.tracks[name]
    if name not in CLEARED_BY or track.accepted < LEAST_ACCEPTED or track.rejected_in_row < sensor_health.TOLD_AFTER:
        return False
    turns = name in ("heading", "yaw_rate")
    agreement, slack = (state.turn_agreement, TURN_SLACK_RAD) if turns else (state.agreement, slack_m)
    again = t_ns - (state.turn_cleared_ns if turns else state.cleared_ns) <= AGAIN_NS
    span_ns = t_ns - track.rejected_since_ns
    if name in ("position", "heading"):
        return (again or span_ns >= return_ns) and agreement.clears_place(slack)
    if span_ns < (SOON_NS if again else return_ns):
        return False
    return agreement.clears_rate(math.hypot(*track.innovation), span_ns * 1e-9, slack)


def note_cleared(state: FilterState, t_ns: int, name: str) -> None:
    """Keep when a sensor was believed because it agrees with the other one of its pair."""
    if name in ("heading", "yaw_rate"):
        state.turn_cleared_ns = t_ns
    else:
        state.cleared_ns = t_ns


def reset_states(state: FilterState, name: str) -> None:
    """Reset the variances of the states that a sensor measures, and of those that depend on them."""
    state.resets += 1
    p = state.p.copy()
    for i, variance in RESET_VARIANCES[name]:
        p[i, :] = p[:, i] = 0.0
        p[i, i] = variance
    if name == "position":  # the slow error was estimated for the old position
        x = state.x.copy()
        x[[N, E]] += x[[B_N, B_E]]  # what the reading is expected to say stays as it is
        x[[B_N, B_E]] = 0.0
        p[[B_N, B_E], :] = 0.0
        p[:, [B_N, B_E]] = 0.0
        state.x = x
    state.p = p
