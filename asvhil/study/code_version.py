"""Which code made a run: a digest of the sources that determine its result."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
# Packages that determine the result of a run. How studies count, draw and show their runs does not.
DECISIVE = (
    *("types.py", "geo.py", "config", "io", "dynamics", "estimator", "controller", "autopilot", "supervisor", "motion"),
    *("operator", "backseat", "simplant", "logs", "study/trials"),
)


@functools.cache
def code_version() -> str:
    """First 12 hex digits of the SHA-256 over the sources that determine the result of a run."""
    digest = hashlib.sha256()
    for name in DECISIVE:
        path = PACKAGE / name
        for source in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(source.read_bytes())
    return digest.hexdigest()[:12]
