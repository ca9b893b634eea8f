"""The Euler rollout of a learned model over a batch of windows, with its hand-derived back-propagation through time.

In scaled velocities x (three in a row), with dt inside the weights:

    h_k = tanh(x_k Wx + p_k),   x_k+1 = x_k + q_k + s_k Ws + h_k Wh,   s_k = [x_k, x_k |x_k|, x_k o shift(x_k)]

The parts p and q, which do not depend on the state, are computed for all steps at once by the caller. The loop is
NumPy inside one autograd function: with such small arrays torch takes five times as long, by the overhead of its calls.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from asvhil.dynamics.arrays import Array

N_STATE = 3
N_PRODUCTS = 9  # x, x |x|, and (u v, v r, r u)
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]


class EulerRollout(torch.autograd.Function):
    """x_1 .. x_m (N, m, B, 3) of N models over B windows each, float64.

    x0 (N, B, 3), p (N, m, B, H), q (N, m, B, 3), Wx (N, 3, H), Wh (N, H, 3), Ws (N, 9, 3) or None for no products.
    No gradient flows into x0.
    """

    @staticmethod
    def forward(ctx: Any, x0: Tensor, p: Tensor, q: Tensor, wx: Tensor, wh: Tensor, ws: Tensor | None) -> Tensor:
        start, to_hidden, to_state, x_in, h_out = (part.detach().numpy() for part in (x0, p, q, wx, wh))
        s_out = None if ws is None else ws.detach().numpy()
        states, h, s = _forward(start, to_hidden, to_state, x_in, h_out, s_out)
        ctx.saved = states, h, s, x_in, h_out, s_out
        return torch.from_numpy(states[:, 1:])

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        parts = _backward(grads[0].numpy(), *ctx.saved)
        return None, *(None if part is None else torch.from_numpy(part) for part in parts)


def _forward(
    x0: Array, p: Array, q: Array, wx: Array, wh: Array, ws: Array | None
) -> tuple[Array, Array, Array | None]:
    """States (N, m + 1, B, 3), hidden values (N, m, B, H) and products (N, m, B, 9)."""
    models, steps, batch, _ = p.shape
    states = np.empty((models, steps + 1, batch, N_STATE))
    h = np.empty(p.shape)
    s = None if ws is None else np.empty((models, steps, batch, N_PRODUCTS))
    states[:, 0] = x0
    for k in range(steps):
        x, after, row = states[:, k], states[:, k + 1], h[:, k]
        np.matmul(x, wx, out=row)
        row += p[:, k]
        np.tanh(row, out=row)
        np.matmul(row, wh, out=after)
        after += x
        after += q[:, k]
        if s is not None and ws is not None:
            products = s[:, k]
            products[..., :3] = x
            np.multiply(x, np.abs(x), out=products[..., 3:6])
            np.multiply(x, x[..., AFTER], out=products[..., 6:])
            after += products @ ws
    return states, h, s


def _backward(
    grad: Array, states: Array, h: Array, s: Array | None, wx: Array, wh: Array, ws: Array | None
) -> tuple[Array, Array, Array, Array, Array | None]:
    """Gradients of p, q, Wx, Wh and Ws, given that of the states x_1 .. x_m."""
    steps = grad.shape[1]
    dz = np.multiply(h, h)
    np.subtract(1.0, dz, out=dz)  # the slope of tanh, until it is multiplied by what comes back
    dx = np.empty(grad.shape)
    begin = states[:, :-1]
    wxt, wht = np.ascontiguousarray(wx.swapaxes(1, 2)), np.ascontiguousarray(wh.swapaxes(1, 2))
    wst = None if ws is None else np.ascontiguousarray(ws.swapaxes(1, 2))
    magnitude = None if ws is None else 2.0 * np.abs(begin)
    shifted = None if ws is None else begin[..., AFTER]
    dx[:, -1] = grad[:, -1]
    for k in range(steps - 1, -1, -1):
        g, slope = dx[:, k], dz[:, k]
        slope *= g @ wht
        if k == 0:
            break
        before = dx[:, k - 1]
        np.matmul(slope, wxt, out=before)
        before += g
        before += grad[:, k - 1]
        if wst is not None and magnitude is not None and shifted is not None:
            into = g @ wst
            before += into[..., :3]
            before += into[..., 3:6] * magnitude[:, k]
            before += into[..., 6:] * shifted[:, k]
            before += (into[..., 6:] * begin[:, k])[..., BEFORE]
    return dz, dx, _products(begin, dz), _products(h, dx), None if s is None else _products(s, dx)


def _products(left: Array, right: Array) -> Array:
    """Inputs times gradients, summed over steps and windows: (N, m, B, I), (N, m, B, J) to (N, I, J)."""
    a = left.reshape(len(left), -1, left.shape[-1])
    b = right.reshape(len(right), -1, right.shape[-1])
    return a.swapaxes(1, 2) @ b


def euler_rollout(x0: Tensor, p: Tensor, q: Tensor, wx: Tensor, wh: Tensor, ws: Tensor | None) -> Tensor:
    """`EulerRollout`, typed."""
    states: Tensor = EulerRollout.apply(x0, p, q, wx, wh, ws)  # type: ignore[no-untyped-call]
    return states
