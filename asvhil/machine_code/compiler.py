"""Compiles CasADi functions with the computer's own C compiler, and keeps what it made in the user's cache folder.

CasADi evaluates a function instruction by instruction, 4 ns each; machine code takes a fifth of that, which on a small
companion computer decides how many steps the optimiser can take within a control period. The results are the same to
the last bit, so a log replays whichever way either side evaluates: the operations and their order are those of the
function, no product is fused with a sum, and the elementary functions come from the same library. Each function that
was compiled is compared with the original on a few arguments, and is not used where they differ.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from asvhil.dynamics import buffers
from asvhil.dynamics.arrays import Array

SWITCH = "ASVHIL_MACHINE_CODE"  # "off" leaves all to CasADi; else the folder of what was compiled
# -ffp-contract=off: GCC fuses products with sums on aarch64 from -O2 on, other compilers may at any level. Without
# -fno-builtin constants are folded.
FLAGS = ("-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-builtin")
LONGEST_S = 120.0
# Of the arguments on which both are compared: as small as those of an estimate that is settled, and larger ones.
RANGES = ((0.001, 0.02), (0.02, 0.2), (0.05, 0.5), (0.5, 1.0))
OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
KEPT = 1000  # libraries, of 30 to 80 kB each


def use_compiler(tell: Callable[[str], None] = lambda _: None) -> bool:
    """From now on functions are compiled where they are built; False: not here, since something is missing.

    `tell` gets one line before the first compilation of this process, which takes seconds.
    """
    wanted = os.environ.get(SWITCH, "")
    compiler = shutil.which(os.environ.get("CC") or "cc")
    if wanted == "off" or compiler is None:
        return False
    folder = _own_folder(Path(wanted) if wanted else _cache() / "asvhil" / "machine-code")
    if folder is None:
        return False
    buffers.evaluate_with(Compiler(compiler, folder, tell))
    return True


class Compiler:
    """Calling it gives a function in machine code, or None where that failed."""

    def __init__(self, command: str, folder: Path, tell: Callable[[str], None] = lambda _: None) -> None:
        self._command, self._folder, self._tell = command, folder, tell
        self._told = False
        self._made: dict[str, ca.Function | None] = {}  # by source, failures too: they are not tried again

    def __call__(self, function: ca.Function) -> ca.Function | None:
        """The function in machine code, compiled now or earlier."""
        generator = ca.CodeGenerator("machine_code", {"casadi_int": "long long int"})
        generator.add(function)
        source = generator.dump()
        key = hashlib.sha256("\0".join((source, self._command, *FLAGS)).encode()).hexdigest()[:32]
        if key not in self._made:
            self._made[key] = self._make(function, source, self._folder / f"{function.name()}-{key}.so")
        return self._made[key]

    def _make(self, function: ca.Function, source: str, library: Path) -> ca.Function | None:
        if not library.exists() and not self._compile(source, library):
            return None
        try:
            os.utime(library)  # in use: not among the oldest
            compiled = ca.external(function.name(), str(library))
        except (OSError, RuntimeError):  # taken away meanwhile, half a file, or one of another processor
            library.unlink(missing_ok=True)
            return None
        return compiled if _equal(function, compiled) else None

    def _compile(self, source: str, library: Path) -> bool:
        if not self._told:
            self._told = True
            self._tell(f"compiling this boat's functions, once ... ({self._folder}; {SWITCH}=off: never)")
        try:
            with tempfile.TemporaryDirectory(dir=self._folder) as scratch:
                text, made = Path(scratch) / "function.c", Path(scratch) / "function.so"
                text.write_text(source)
                done = subprocess.run(
                    [self._command, *FLAGS, str(text), "-o", str(made), "-lm"],
                    stdin=subprocess.DEVNULL,
                    capture_output=True,
                    timeout=LONGEST_S,
                    check=False,
                )
                if done.returncode:
                    return False
                made.replace(library)  # whole or not at all, whoever else compiles it
            self._forget_the_oldest()
        except (OSError, subprocess.SubprocessError):
            return False
        return True

    def _forget_the_oldest(self) -> None:
        libraries = sorted(self._folder.glob("*.so"), key=lambda path: path.stat().st_mtime)
        for library in libraries[:-KEPT]:
            library.unlink(missing_ok=True)


def _equal(function: ca.Function, compiled: ca.Function) -> bool:
    """Whether both give the same numbers to the last bit; of what is not a number, in the same places."""
    return all(
        np.array_equal(_results(function, least, most), _results(compiled, least, most), equal_nan=True)
        for least, most in RANGES
    )


def _results(function: ca.Function, least: float, most: float) -> Array:
    rng = np.random.default_rng(0)
    arguments = [rng.uniform(least, most, function.nnz_in(i)) for i in range(function.n_in())]
    results = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
    buffers.bind(function, arguments, results)()
    return np.concatenate(results)


def _cache() -> Path:
    given = os.environ.get("XDG_CACHE_HOME", "")
    return Path(given) if os.path.isabs(given) else Path("~/.cache").expanduser()


def _own_folder(folder: Path) -> Path | None:
    """The folder, made if need be; None where others could put code into it, or nothing can be written."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except (OSError, RuntimeError):
        return None
    if found.st_uid != os.getuid() or found.st_mode & OTHERS_MAY_WRITE or not os.access(folder, os.W_OK):
        return None
    return folder


def tell_on_terminal(line: str) -> None:
    """For commands: where somebody waits for it."""
    if sys.stderr.isatty():
        print(line, file=sys.stderr, flush=True)
