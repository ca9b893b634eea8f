"""Commands whose options come from a table rather than from the parameters of one function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


def parameters_of(function: Callable[..., Any]) -> list[inspect.Parameter]:
    """The parameters of a function with their annotations evaluated; `**options` is left out."""
    found = inspect.signature(function, eval_str=True).parameters.values()
    return [parameter for parameter in found if parameter.kind is not parameter.VAR_KEYWORD]


def option(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    """One option as a parameter."""
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def with_parameters(function: F, parameters: Sequence[inspect.Parameter]) -> F:
    """The function with a signature of these parameters for typer. It gets them as keyword arguments."""
    function.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    function.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return function
