"""Whether logs replay to the byte where the arithmetic libraries are others. Not a test.

    python -m bench.machines [--seconds 180] [--json FILE]

Records a log of each config under one kernel of OpenBLAS and in CasADi's hands, and replays it in machine code, where
there is a compiler, under other kernels, under the one that OpenBLAS chooses, and with the plain loops of NumPy; under
the chosen one without machine code; and with the functions of the C library for a processor without fused multiply-add.
There the record is followed.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from asvhil.machine_code.compiler import SWITCH
from bench.ending import end_in_words

WIND = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90", "plant.seed=7")
CASES: dict[str, tuple[str, ...]] = {
    "WAM-V, NNSEM-MPC": ("sitl",),
    "WAM-V, LagNet-MPC": ("sitl", "controller.name=lagnet-mpc"),
    "WAM-V, SD-MPC": ("sitl", "controller.name=sd-mpc"),
    "WAM-V in waves": (
        "sitl",
        "plant.weather.waves.orbital_std_mps=0.1",
        "plant.weather.waves.yaw_std_radps=0.03",
    ),
    "BREAM": ("sitl-bream",),
    "VN-300": ("sitl-vn300",),
    "PX4": ("sitl-px4",),
}
KERNEL = "OPENBLAS_CORETYPE"
CHOSEN: dict[str, dict[str, str]] = {"the chosen one": {}, "the chosen one, no machine code": {SWITCH: "off"}}
OTHERS: dict[str, dict[str, dict[str, str]]] = {
    "x86_64": {
        "Haswell": {KERNEL: "Haswell"},
        "Sandybridge": {KERNEL: "Sandybridge"},
        "Zen": {KERNEL: "Zen"},
        **CHOSEN,
        "NumPy's plain loops": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"},
        "no fused multiply-add": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-FMA_Usable,-AVX2_Usable"},
    },
    "aarch64": {"CORTEXA57": {KERNEL: "CORTEXA57"}, "NEOVERSEN1": {KERNEL: "NEOVERSEN1"}, **CHOSEN},
}
RECORDED = {"x86_64": {KERNEL: "Nehalem"}, "aarch64": {KERNEL: "ARMV8"}}
RECORD = """
import sys
from pathlib import Path
from asvhil.config import load_config
from asvhil.sitl import run_lockstep
run_lockstep(load_config(sys.argv[2], tuple(sys.argv[3:])), Path(sys.argv[1]), {seconds})
"""


def run(code: list[str], environment: dict[str, str]) -> int:
    """The exit code of Python in an environment."""
    outer = {name: value for name, value in os.environ.items() if name not in (KERNEL, SWITCH)}
    done = subprocess.run([sys.executable, *code], env={**outer, **environment}, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(done.stderr)
    return done.returncode


def replayed(log: Path, environment: dict[str, str]) -> dict[str, Any]:
    """The figures of a replay in an environment."""
    out = log.with_suffix(".json")
    run(["-m", "asvhil", "replay", str(log), "--json", str(out)], environment)
    figures: dict[str, Any] = json.loads(out.read_text())
    followed = figures["followed"]
    largest = None if followed is None or followed["largest"] is None else followed["largest"]["size"]
    return {
        "exact": figures["exact"],
        "compared": figures["compared"],
        "differing": 0 if followed is None else followed["differing"],
        "largest": largest,
        "within_tolerance": figures["exact"] or followed["beyond"] is None,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    kind = platform.machine()
    figures: dict[str, Any] = {"machine": kind, "seconds": arguments.seconds, "recorded": RECORDED[kind], "logs": {}}
    for number, (name, (config, *sets)) in enumerate(CASES.items()):
        print(f"{name} ({number + 1} of {len(CASES)}) ...", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log.mcap"
            code = RECORD.format(seconds=arguments.seconds)
            if run(["-c", code, str(log), config, *WIND, *sets], RECORDED[kind]):
                raise SystemExit(f"{name}: no log was made")
            figures["logs"][name] = {other: replayed(log, value) for other, value in OTHERS[kind].items()}
        if arguments.json:  # after each log: it takes half an hour
            arguments.json.write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    end_in_words(main)
