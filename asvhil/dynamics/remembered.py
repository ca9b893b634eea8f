"""What is made of a vessel model, remembered by the model: a study builds the backseat of one boat again and again."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar

MODELS = 8  # of each function
T = TypeVar("T")


def by_model(make: Callable[..., T]) -> Callable[..., T]:
    """A function of a model, and of more that can be compared, that gives what it made of the same object before.

    Models are not compared with each other, and need no hash: those of a plug-in may be anything.
    """
    kept: list[tuple[Any, tuple[Any, ...], T]] = []

    @functools.wraps(make)
    def remembered(model: Any, *others: Any) -> T:
        for known, by, made in kept:
            if known is model and by == others:
                return made
        made = make(model, *others)
        kept[MODELS - 1 :] = []
        kept.insert(0, (model, others, made))
        return made

    return remembered
