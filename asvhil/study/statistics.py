"""Means over seeds with their 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

# Two-sided 95 % quantiles of Student's t for 1 to 10 degrees of freedom; beyond, the expansion about the normal.
T_95 = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
Z_95 = 1.959964


def t_quantile(freedom: int) -> float:
    """The two-sided 95 % quantile of Student's t, to 0.005 (Abramowitz and Stegun 26.7.5). ValueError below 1."""
    if freedom < 1:
        raise ValueError(f"{freedom} degrees of freedom")
    if freedom <= len(T_95):
        return T_95[freedom - 1]
    z = Z_95
    return z + (z**3 + z) / (4.0 * freedom) + (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / (96.0 * freedom**2)


def mean_ci95(values: Sequence[float]) -> dict[str, Any]:
    """{"mean", "ci95"}: the half width of the interval of the mean is None for a single value."""
    array = np.asarray(values, dtype=float)
    mean, n = float(array.mean()), len(array)
    if n < 2:
        return {"mean": mean, "ci95": None}
    return {"mean": mean, "ci95": t_quantile(n - 1) * float(array.std(ddof=1)) / math.sqrt(n)}


def mean_of_all(values: Sequence[float | None]) -> dict[str, Any]:
    """`mean_ci95`, with both None if any value is: a mean over fewer runs would not be comparable."""
    known = [value for value in values if value is not None]
    return mean_ci95(known) if known and len(known) == len(values) else {"mean": None, "ci95": None}


def in_digits(value: float | None, digits: int = 2) -> str:
    """A number as text with some digits, `-` for None."""
    return "-" if value is None else f"{value:.{digits}f}"


def plus_minus(figure: dict[str, Any], digits: int = 2) -> str:
    """`mean ± half width` as text, `-` without a mean."""
    text = in_digits(figure["mean"], digits)
    return text if figure["ci95"] is None else f"{text} ± {figure['ci95']:.{digits}f}"


def other_code(runs: int) -> list[str]:
    """A remark on the number of runs made by other code; empty if there are none."""
    return [f"{runs} run{'s were' if runs != 1 else ' was'} made by another version of the code."] if runs else []


def count_of_seeds(seeds: Sequence[Any]) -> str:
    return f"{len(seeds)} seed{'s' if len(seeds) != 1 else ''}"
