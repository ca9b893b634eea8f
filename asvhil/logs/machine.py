"""What a log says of the machine it was made on, so that a replay knows whether its arithmetic is the same.

The core has one order of operations (`dynamics/ordered.py`), and rounds as IEEE 754 has it. What is left to the machine
are the elementary functions: glibc has others for processors without fused multiply-add, and other libraries have
theirs. The digest is of fixed arguments of these functions, and of the ordered products, in NumPy's and CasADi's hands.
"""

from __future__ import annotations

import functools
import hashlib
import math
import platform
from collections.abc import Mapping
from pathlib import Path

import casadi as ca
import numpy as np

from asvhil.dynamics.ordered import product, solve

CPUINFO = Path("/proc/cpuinfo")
ARGUMENTS = tuple(-3.0 + 0.0015 * k for k in range(4001))  # implementations differ for one argument in a thousand
DIGITS = 12  # of the digest, hexadecimal


@functools.cache
def machine() -> Mapping[str, str]:
    """Kind of processor, its name, the C library, and the digest of its arithmetic."""
    library, version = platform.libc_ver()
    return {
        "machine": platform.machine(),
        "cpu": _cpu_name(),
        "libc": f"{library} {version}".strip() or "unknown",
        "arithmetic": arithmetic_digest(),
    }


def arithmetic_digest() -> str:
    """A digest of results to the last bit: equal ones mean that a replay is exact."""
    results: list[float] = []
    for x in ARGUMENTS:
        positive = abs(x) + 0.1
        results += [math.sin(x), math.cos(x), math.tan(x), math.atan2(x, 0.7), math.tanh(x), math.exp(x)]
        results += [math.log(positive), math.expm1(x), math.hypot(x, 0.3), positive**0.37]
    z = ca.SX.sym("z")
    values = ca.vertcat(ca.sin(z), ca.cos(z), ca.tanh(z), ca.exp(z), ca.atan2(z, 0.7), ca.log(z * z))
    functions = ca.Function("functions", [z], [values])
    for x in ARGUMENTS[::100]:
        results += np.array(functions(x)).ravel().tolist()
    a = np.array(ARGUMENTS[:64]).reshape(8, 8)
    results += product(a, a.T).ravel().tolist() + solve(product(a, a.T) + 9.0 * np.eye(8), a[0]).tolist()
    results += [float(np.add.reduce(np.array(results)))]
    return hashlib.sha256(np.array(results, dtype="<f8").tobytes()).hexdigest()[:DIGITS]


def differences(recorded: Mapping[str, str]) -> list[str]:
    """What of the machine, of the `versions` record of a log, is not as here: "cpu: ... recorded, ... here"."""
    return [
        f"{name}: {recorded.get(name, 'unknown')} recorded, {here} here"
        for name, here in machine().items()
        if recorded.get(name, "unknown") != here
    ]


def _cpu_name() -> str:
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        key, _, value = line.partition(":")
        if key.strip() in ("model name", "Model") and value.strip():
            return value.strip()
    return platform.processor() or "unknown"
