"""Which training recipe is recommended: the lowest score over records left out, or a plainer one not told from it."""

from __future__ import annotations

from bench.leave_one_out import RECIPES, recommended


def scores(**means: tuple[float, ...]) -> dict[str, dict[str, float]]:
    return {name: {f"run {number}": value for number, value in enumerate(values)} for name, values in means.items()}


def test_the_lowest_score_is_recommended_where_it_is_told_from_the_plainer_ones() -> None:
    assert recommended(scores(plain=(0.9, 1.0, 1.1), robust=(0.5, 0.6, 0.7))) == "robust"
    assert recommended(scores(plain=(0.9, 1.0, 1.1), robust=(0.2, 1.4, 1.3))) == "plain"  # one record alone is better
    assert recommended(scores(sd=(2.0, 2.1, 2.2), plain=(0.5, 0.6, 0.7), robust=(0.6, 0.9, 0.7))) == "plain"
    assert recommended(scores(plain=(0.5,), robust=(0.4,))) == "plain"  # of one record nothing can be told


def test_one_record_that_goes_wrong_does_not_decide_alone() -> None:
    # Half the error on eleven records of twelve; by the mean of differences the twelfth alone would outweigh them.
    sd = tuple(0.8 + 0.02 * number for number in range(12))
    assert recommended(scores(sd=sd, plain=(*(0.5 * value for value in sd[:11]), 2.5 * sd[11]))) == "plain"


def test_plainer_recipes_stand_first() -> None:
    names = list(RECIPES)
    assert names[0] == "fitted SD" and names[1] == "LagNet, plain" and not RECIPES["LagNet, plain"][1]
