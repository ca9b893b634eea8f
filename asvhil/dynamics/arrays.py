"""The array operations that vessel models need, with one signature for NumPy, CasADi and torch.

NumPy and torch arrays have components on the last axis, so that leading axes are batches; CasADi arrays are columns.
A model calls `namespace_of(x)` on its input and returns arrays of the same kind.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def is_finite(array: Array) -> bool:
    """Whether no component of an array is infinite or NaN; counted, in half of `all`'s time."""
    return bool(np.count_nonzero(np.isfinite(array)) == array.size)


class ArrayNamespace(Protocol):
    """The operations on the arrays of one library."""

    @staticmethod
    def component(x: Any, i: int) -> Any:
        """Component i of x (..., n), of shape (...)."""

    @staticmethod
    def stack(parts: Sequence[Any]) -> Any:
        """n components of shape (...), broadcast against each other, as one array (..., n)."""

    @staticmethod
    def concat(parts: Sequence[Any]) -> Any:
        """Arrays (..., n_i) joined to one (..., sum of n_i)."""

    @staticmethod
    def affine(weight: Any, bias: Any, x: Any) -> Any:
        """weight (m, n) x (..., n) + bias (m), of shape (..., m)."""

    @staticmethod
    def tanh(x: Any) -> Any:
        """The hyperbolic tangent of each component."""


class NumpyArrays:
    """The operations on NumPy arrays."""

    @staticmethod
    def component(x: Any, i: int) -> Any:
        return x[..., i]

    @staticmethod
    def stack(parts: Sequence[Any]) -> Any:
        if not any(map(np.ndim, parts)):  # the usual case in a tick, at a tenth of the cost
            return np.array(parts)
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
    """The operations on CasADi's SX, MX and DM, columns of shape (n, 1)."""

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
    """The operations on torch tensors. Torch comes from `sys.modules`, so that this module does not import it."""

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
    """The operations for arrays of the kind of `x`. Raises TypeError for any other kind."""
    if isinstance(x, np.ndarray):
        return NumpyArrays
    if isinstance(x, ca.SX | ca.MX | ca.DM):
        return CasadiArrays
    torch = sys.modules.get("torch")
    if torch is not None and isinstance(x, torch.Tensor):
        return TorchArrays
    raise TypeError(f"a NumPy, CasADi or torch array is needed, not {type(x).__name__}")
