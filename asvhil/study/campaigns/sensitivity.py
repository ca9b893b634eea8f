"""Which parameter moves the score: partial rank correlations, and shares of the variance, from the runs themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from asvhil.dynamics.arrays import Array
from asvhil.study.statistics import Z_95

Indices = np.ndarray[Any, np.dtype[np.intp]]
MOST_BINS = 8
LEAST_IN_BIN = 8


def sensitivities(
    columns: Mapping[str, Sequence[Any]], numeric: Mapping[str, bool], score: Sequence[float]
) -> dict[str, dict[str, Any]]:
    """Figures of each parameter, the most decisive first; empty where the runs are too few (below 4) or all alike.

    `columns` has one value for each of the n runs, by the name of the parameter; `numeric` says which are numbers.

    - `share`: first-order share of the variance of the score's ranks, that is, how much of it the parameter explains by
      itself, in any shape: omega^2 of a one-way analysis of variance, over the values or over bins of equal counts, in
      [0, 1]; `p` is the Kruskal-Wallis test's chance of as much where it does nothing.
    - `prcc`: partial rank correlation coefficient (Marino et al. 2008), with `prcc_ci95` by Fisher's z; None of what is
      no number. It tells the direction, and misses what rises and falls.
    """
    from scipy.stats import rankdata

    n = len(score)
    if n < 4 or len(set(score)) < 2:
        return {}
    ranks = np.asarray(rankdata(score), dtype=float)
    varied = {name: values for name, values in columns.items() if len({str(one) for one in values}) > 1}
    found = {
        name: {**_share(_groups(values, numeric[name]), ranks), **_prcc(name, varied, numeric, ranks)}
        for name, values in varied.items()
    }
    return dict(sorted(found.items(), key=lambda item: -item[1]["share"]))


def _groups(values: Sequence[Any], numeric: bool) -> list[Indices]:
    """The indices of the runs with each value, or in each bin of a number that has many."""
    kinds = sorted({str(one) for one in values})
    bins = max(2, min(MOST_BINS, len(values) // LEAST_IN_BIN))
    if not numeric or len(kinds) <= bins:
        text = np.array([str(one) for one in values])
        return [np.flatnonzero(text == kind) for kind in kinds]
    order = np.argsort(np.asarray(values, dtype=float), kind="stable")
    return [part for part in np.array_split(order, bins) if len(part)]


def _share(groups: Sequence[Indices], ranks: Array) -> dict[str, Any]:
    from scipy.stats import kruskal

    n, k = len(ranks), len(groups)
    total = float(((ranks - ranks.mean()) ** 2).sum())
    between = float(sum(len(group) * (ranks[group].mean() - ranks.mean()) ** 2 for group in groups))
    within = (total - between) / (n - k) if n > k else math.nan
    share = (between - (k - 1) * within) / (total + within) if n > k else math.nan
    if math.isnan(share):
        return {"share": 0.0, "p": None}
    return {"share": min(1.0, max(0.0, share)), "p": float(kruskal(*[ranks[group] for group in groups]).pvalue)}


def _prcc(name: str, columns: Mapping[str, Sequence[Any]], numeric: Mapping[str, bool], ranks: Array) -> dict[str, Any]:
    from scipy.stats import rankdata

    nothing = {"prcc": None, "prcc_ci95": None}
    if not numeric[name]:
        return nothing
    others = [np.ones(len(ranks))]
    for other, values in columns.items():
        if other == name:
            continue
        if numeric[other]:
            others.append(np.asarray(rankdata(np.asarray(values, dtype=float))))
        else:
            text = np.array([str(one) for one in values])
            others += [(text == kind).astype(float) for kind in sorted(set(text))[1:]]
    freedom = len(ranks) - len(others) - 2
    if freedom < 1:
        return nothing
    known = np.column_stack(others)
    own = np.asarray(rankdata(np.asarray(columns[name], dtype=float)))
    x, y = (target - known @ np.linalg.lstsq(known, target, rcond=None)[0] for target in (own, ranks))
    size = math.sqrt(float((x**2).sum()) * float((y**2).sum()))
    if size < 1e-9 * len(ranks):
        return nothing
    value = max(-1.0, min(1.0, float((x * y).sum()) / size))
    if freedom < 2 or abs(value) > 1.0 - 1e-12:
        return {"prcc": value, "prcc_ci95": None}
    half = Z_95 / math.sqrt(freedom - 1)
    return {"prcc": value, "prcc_ci95": [math.tanh(math.atanh(value) - half), math.tanh(math.atanh(value) + half)]}
