"""Dubins paths: end poses, optimality against search and against any other path, symmetries, projection."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from asvhil.controller.dubins import SIGN, WORDS, Dubins, candidates, shortest
from asvhil.geo import wrap_rad

coordinates = st.floats(-12.0, 12.0)
angles = st.floats(-7.0, 7.0)
poses = st.tuples(coordinates, coordinates, angles)
radii = st.floats(0.3, 5.0)


def miss(path: Dubins, end) -> float:
    n_m, e_m, psi_rad = path.pose(path.length_m)
    return max(abs(n_m - end[0]), abs(e_m - end[1]), abs(wrap_rad(psi_rad - end[2])))


def reverse(pose):
    return pose[0], pose[1], pose[2] + math.pi


def mirror(pose):
    return pose[0], -pose[1], -pose[2]


# --- by hand -----------------------------------------------------------------------------------------------


def test_straight_ahead():
    path = shortest((1.0, 2.0, math.pi / 2), (1.0, 12.0, math.pi / 2), 3.0)
    assert path.length_m == pytest.approx(10.0)
    assert path.pose(4.0) == pytest.approx((1.0, 6.0, math.pi / 2))


def test_half_a_turn_to_starboard_goes_east():
    path = shortest((0.0, 0.0, 0.0), (0.0, 4.0, math.pi), 2.0)
    assert path.word[0] == "R" and path.length_m == pytest.approx(2.0 * math.pi)
    assert path.pose(math.pi)[:2] == pytest.approx((2.0, 2.0))  # a quarter turn: ahead and to starboard
    assert path.curvature(1.0) == pytest.approx(0.5)


def test_about_turn_on_the_spot_takes_seven_thirds_of_pi():
    path = shortest((0.0, 0.0, 0.0), (0.0, 0.0, math.pi), 1.0)
    assert path.word in ("RLR", "LRL")
    assert path.pieces_m == pytest.approx((math.pi / 3, 5 * math.pi / 3, math.pi / 3))


def test_a_lane_change_far_ahead_is_two_opposite_turns():
    """Inner tangent of circles 2 R apart across and 20 R along: length from the right triangle of the centres."""
    path = shortest((0.0, 0.0, 0.0), (20.0, 1.0, 0.0), 1.0)
    assert path.word == "RSL"
    distance = math.hypot(20.0, 1.0 - 2.0)
    straight = math.sqrt(distance**2 - 4.0)
    heading = math.asin(2.0 / distance) - math.atan2(1.0, 20.0)
    assert path.pieces_m == pytest.approx((heading, straight, heading))


@pytest.mark.parametrize(("north_m", "words"), [(3.9, {"RLR", "LRL"}), (4.1, set())])
def test_a_third_circle_fits_between_circles_up_to_four_radii_apart(north_m, words):
    found = {path.word for path in candidates((0.0, 0.0, 0.0), (north_m, 0.0, 0.0), 1.0)}
    assert found - {"LSL", "RSR", "LSR", "RSL"} == words


def test_same_pose_is_no_path():
    assert shortest((3.0, 4.0, 1.0), (3.0, 4.0, 1.0 + 2 * math.pi), 2.0).length_m == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("radius_m", [0.0, -1.0, math.nan, math.inf])
def test_a_radius_must_be_positive_and_finite(radius_m):
    with pytest.raises(ValueError, match="positive radius"):
        shortest((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), radius_m)


def test_poses_must_be_finite():
    with pytest.raises(ValueError, match="finite poses"):
        shortest((0.0, math.nan, 0.0), (1.0, 1.0, 1.0), 1.0)


# --- properties ----------------------------------------------------------------------------------------------


@settings(max_examples=120, deadline=None)
@given(poses, poses, radii)
def test_every_word_ends_at_the_goal(begin, end, radius_m):
    found = candidates(begin, end, radius_m)
    assert {"LSL", "RSR"} <= {path.word for path in found} <= set(WORDS)
    for path in found:
        assert min(path.pieces_m) >= 0.0
        assert miss(path, end) < 1e-6


@settings(max_examples=120, deadline=None)
@example((2.0, 2.0, 1.0), [("S", 1e-9)], 0.3046875)  # the bearing of circles so close is known to 1e-7 only
@example((0.0, 0.0, 0.0), [("S", 1.192092896e-07)], 3.3304969087687053)  # d^2 - 4 R^2 loses its digits
@example((0.0, 0.0, 0.0), [("S", 1.192092896e-07)], 1.25)
@example((0.0, 0.0, 0.0), [("L", 1.192092896e-07), ("S", 1.192092896e-07)], 2.375)
@given(poses, st.lists(st.tuples(st.sampled_from("LSR"), st.floats(0.0, 6.0)), min_size=1, max_size=6), radii)
def test_no_path_of_bounded_curvature_is_shorter(begin, pieces, radius_m):
    """Wherever a boat gets by any sequence of arcs and straights, it gets there by the shortest path no later."""
    pose, travelled_m = begin, 0.0
    for letter, piece_m in pieces:
        piece = Dubins(begin=pose, word=letter + "SS", radius_m=radius_m, pieces_m=(piece_m, 0.0, 0.0))
        pose, travelled_m = piece.pose(piece_m), travelled_m + piece_m
    path = shortest(begin, pose, radius_m)
    # Rounding of the goal may cost the square root of it: the length has infinite slope where a word sets in.
    assert path.length_m <= travelled_m + 1e-5 * radius_m or _degenerate(begin, pose, radius_m, travelled_m)
    assert path.length_m >= math.hypot(pose[0] - begin[0], pose[1] - begin[1]) - 1e-9
    assert path.length_m >= radius_m * abs(wrap_rad(pose[2] - begin[2])) - 1e-6


def _degenerate(begin, pose, radius_m, travelled_m) -> bool:
    """Whether a goal moved by rounding (the length jumps at such places) is within reach in the time."""
    nudges = [(dn, de, dp) for dn in (-1e-9, 0, 1e-9) for de in (-1e-9, 0, 1e-9) for dp in (-1e-9, 0, 1e-9)]
    lengths = [shortest(begin, (pose[0] + a, pose[1] + b, pose[2] + c), radius_m).length_m for a, b, c in nudges]
    return min(lengths) <= travelled_m + 1e-3 * radius_m


@settings(max_examples=80, deadline=None)
@given(poses, poses, radii)
def test_reversed_and_mirrored_paths_are_as_long(begin, end, radius_m):
    length_m = shortest(begin, end, radius_m).length_m
    back_m = shortest(reverse(end), reverse(begin), radius_m).length_m
    assert back_m == pytest.approx(length_m, abs=1e-5) or _jump(begin, end, radius_m)
    mirrored_m = shortest(mirror(begin), mirror(end), radius_m).length_m
    assert mirrored_m == pytest.approx(length_m, abs=1e-5) or _jump(begin, end, radius_m)


@settings(max_examples=60, deadline=None)
@example((0.0, 0.0, 0.0), (0.0, 0.0, 1e-9), 0.375, 0.0, 0.0, 1.25)  # within rounding of the goal: no path, or a loop
@example((1e-9, 0.0, 0.0), (0.0, 0.0, 0.0), 0.8610015915251525, 0.0, 0.0, 0.857421875)
@given(poses, poses, radii, coordinates, coordinates, angles)
def test_moved_and_turned_paths_are_as_long(begin, end, radius_m, dn_m, de_m, turn_rad):
    def moved(pose):
        c, s = math.cos(turn_rad), math.sin(turn_rad)
        return c * pose[0] - s * pose[1] + dn_m, s * pose[0] + c * pose[1] + de_m, pose[2] + turn_rad

    length_m = shortest(begin, end, radius_m).length_m
    assert shortest(moved(begin), moved(end), radius_m).length_m == pytest.approx(length_m, abs=1e-5) or _jump(
        begin, end, radius_m
    )


def _jump(begin, end, radius_m) -> bool:
    """Whether the length jumps here: a nudge of the goal turns no arc into a whole turn, or back."""
    nudges = (-1e-7, -1e-9, 0.0, 1e-9, 1e-7)
    lengths = [
        shortest(begin, (end[0] + a, end[1] + b, end[2] + c), radius_m).length_m
        for a in nudges
        for b in nudges
        for c in nudges
    ]
    return max(lengths) - min(lengths) > 1e-5


# --- against a search --------------------------------------------------------------------------------------------


def searched_length(begin, end, radius_m: float) -> float:
    """The least length over all words, by Newton's method from a dense grid of the first two pieces, no geometry.

    The third piece is what brings the heading round; the two unknowns are to bring the position to the goal.
    """
    best = math.inf
    for word in WORDS:
        signs = [SIGN[letter] for letter in word]
        first = np.linspace(0.0, 2 * math.pi, 25)
        middle = first if signs[1] else np.linspace(0.0, 30.0 / radius_m, 40)
        t, p = (grid.ravel() for grid in np.meshgrid(first, middle))

        def run(t, p, signs=signs):
            q = np.mod(signs[2] * (end[2] - begin[2] - signs[0] * t - signs[1] * p), 2 * math.pi)
            n, e, psi = np.full_like(t, begin[0]), np.full_like(t, begin[1]), np.full_like(t, begin[2])
            for sign, part in zip(signs, (t, p, q), strict=True):
                if sign:
                    after = psi + sign * part
                    n = n + sign * radius_m * (np.sin(after) - np.sin(psi))
                    e = e - sign * radius_m * (np.cos(after) - np.cos(psi))
                    psi = after
                else:
                    n, e = n + radius_m * part * np.cos(psi), e + radius_m * part * np.sin(psi)
            return n - end[0], e - end[1], q

        step = 1e-6
        for _ in range(25):
            n0, e0, _ = run(t, p)
            nt, et, _ = run(t + step, p)
            np_, ep, _ = run(t, p + step)
            a, b, c, d = (nt - n0) / step, (np_ - n0) / step, (et - e0) / step, (ep - e0) / step
            det = a * d - b * c
            det = np.where(np.abs(det) < 1e-9, 1e-9, det)
            t = t - np.clip((d * n0 - b * e0) / det, -0.5, 0.5)
            p = p - np.clip((a * e0 - c * n0) / det, -2.0, 2.0)
        n0, e0, q = run(t, p)
        good = (np.hypot(n0, e0) < 1e-6) & (t > -1e-7) & (p > -1e-7) & (t < 2 * math.pi) & np.isfinite(n0)
        if good.any():
            best = min(best, float(radius_m * (t + p + q)[good].min()))
    return best


@pytest.mark.parametrize("seed", range(15))
def test_the_shortest_is_what_a_search_over_all_words_finds(seed):
    rng = np.random.default_rng(seed)
    reach = (2.0, 6.0, 12.0)[seed % 3]
    begin, end = ((*rng.uniform(-reach, reach, 2).tolist(), float(rng.uniform(-math.pi, math.pi))) for _ in range(2))
    radius_m = float(rng.uniform(1.0, 3.0))
    path = shortest(begin, end, radius_m)
    assert path.length_m == pytest.approx(searched_length(begin, end, radius_m), abs=1e-4)


def test_each_of_the_six_words_is_the_shortest_for_some_poses():
    rng = np.random.default_rng(4)
    won = {
        shortest((0.0, 0.0, 0.0), (*rng.uniform(-3, 3, 2).tolist(), float(rng.uniform(-3, 3))), 1.0).word
        for _ in range(300)
    }
    assert won == set(WORDS)


# --- along the path ------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(poses, poses, radii, st.floats(0.0, 1.0))
def test_the_pose_moves_as_heading_and_curvature_say(begin, end, radius_m, share):
    path = shortest(begin, end, radius_m)
    along_m, step_m = share * path.length_m, 1e-5
    n0, e0, psi0 = path.pose(along_m)
    n1, e1, psi1 = path.pose(along_m + step_m)
    if path.curvature(along_m) == path.curvature(along_m + step_m) and along_m + step_m < path.length_m:
        assert (n1 - n0) / step_m == pytest.approx(math.cos(psi0), abs=1e-4)
        assert (e1 - e0) / step_m == pytest.approx(math.sin(psi0), abs=1e-4)
        assert wrap_rad(psi1 - psi0) / step_m == pytest.approx(path.curvature(along_m), abs=1e-4)


@settings(max_examples=60, deadline=None)
@given(poses, poses, radii, coordinates, coordinates)
def test_the_foot_is_the_nearest_of_dense_samples(begin, end, radius_m, n_m, e_m):
    path = shortest(begin, end, radius_m)

    def distance_m(pose):
        return math.hypot(n_m - pose[0], e_m - pose[1])

    for low, high in ((0.0, 1.0), (0.2, 0.6)):
        low_m, high_m = low * path.length_m, high * path.length_m
        foot_m = path.project(n_m, e_m, low_m, high_m)
        assert low_m - 1e-9 <= foot_m <= high_m + 1e-9
        sampled_m = min(distance_m(path.pose(x)) for x in np.linspace(low_m, high_m, 200).tolist())
        assert distance_m(path.pose(foot_m)) <= sampled_m + 1e-9


def test_samples_run_from_where_asked_to_the_end():
    path = shortest((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 2.0)
    samples = path.sample(3.5, 2.0)
    assert [along_m for along_m, _ in samples] == pytest.approx([3.5, 5.5, 7.5, 9.5, 10.0])
    assert samples[-1][1] == pytest.approx((10.0, 0.0, 0.0))
    assert [along_m for along_m, _ in path.sample(99.0, 2.0)] == pytest.approx([10.0])
    assert [along_m for along_m, _ in path.sample(6.0, 2.0)] == pytest.approx([6.0, 8.0, 10.0])
