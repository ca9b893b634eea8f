"""One spelling of the few array operations that vessel models need, for NumPy, CasADi and torch alike.

NumPy and torch arrays hold components on the last axis (so leading axes are batches); CasADi arrays are columns.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, Protocol

import casadi as ca
import numpy as np


class ArrayNamespace(Protocol):
    """What a model may do to the arrays it is given."""

    @staticmethod
    def component(x: Any, i: int) -> Any: ...
    @staticmethod
    def stack(parts: Sequence[Any]) -> Any: ...
    @staticmethod
    def concat(parts: Sequence[Any]) -> Any: ...
    @staticmethod
    def affine(weight: Any, bias: Any, x: Any) -> Any: ...
    @staticmethod
    def tanh(x: Any) -> Any: ...


class NumpyArrays:
    @staticmethod
    def component(x: Any, i: int) -> Any:
        return x[..., i]

    @staticmethod
    def stack(parts: Sequence[Any]) -> Any:
        return np.stack(np.broadcast_arrays(*parts), axis=-1)

    @staticmethod
    def concat(parts: Sequence[Any]) -> Any:
        return np.concatenate(parts, axis=-1)

    @staticmethod
    def affine(weight: Any, bias: Any, x: Any) -> Any:
        return x @ weight.T + bias

    @staticmethod
    def tanh(x: Any) -> Any:
        return np.tanh(x)


class CasadiArrays:
    @staticmethod
    def component(x: Any, i: int) -> Any:
        return x[i]

    @staticmethod
    def stack(parts: Sequence[Any]) -> Any:
        return ca.vertcat(*parts)

    @staticmethod
    def concat(parts: Sequence[Any]) -> Any:
        return ca.vertcat(*parts)

    @staticmethod
    def affine(weight: Any, bias: Any, x: Any) -> Any:
        return ca.mtimes(ca.DM(np.asarray(weight)), x) + ca.DM(np.asarray(bias))

    @staticmethod
    def tanh(x: Any) -> Any:
        return ca.tanh(x)


class TorchArrays:
    """Used only where a torch tensor comes in, so that nothing here imports torch."""

    @staticmethod
    def component(x: Any, i: int) -> Any:
        return x[..., i]

    @staticmethod
    def stack(parts: Sequence[Any]) -> Any:
        torch = sys.modules["torch"]
        return torch.stack(torch.broadcast_tensors(*parts), dim=-1)

    @staticmethod
    def concat(parts: Sequence[Any]) -> Any:
        return sys.modules["torch"].cat(list(parts), dim=-1)

    @staticmethod
    def affine(weight: Any, bias: Any, x: Any) -> Any:
        torch = sys.modules["torch"]
        return x @ torch.as_tensor(weight, dtype=x.dtype).mT + torch.as_tensor(bias, dtype=x.dtype)

    @staticmethod
    def tanh(x: Any) -> Any:
        return sys.modules["torch"].tanh(x)


def namespace_of(x: Any) -> type[ArrayNamespace]:
    """The operations for the kind of array that `x` is."""
    if isinstance(x, np.ndarray):
        return NumpyArrays
    if isinstance(x, ca.SX | ca.MX | ca.DM):
        return CasadiArrays
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(x, torch.Tensor):
        return TorchArrays
    raise TypeError(f"a NumPy, CasADi or torch array is needed, not {type(x).__name__}")
