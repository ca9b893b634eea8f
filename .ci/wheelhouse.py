"""A folder from which the daemon installs without a network: `make wheelhouse`.

    python .ci/wheelhouse.py FOLDER MACHINE PYTHON_VERSION      (aarch64 3.11)

It holds the package's own wheel, those of its dependencies in the pinned versions, and requirements.txt with the
SHA-256 of each, by which pip refuses any other file.
"""

import hashlib
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GLIBC = ("2_28", "2_17")  # manylinux: the newest that Debian 11 and all after it have, and the usual one
OLD_NAMES = {"2_17": "manylinux2014"}


def pip(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments], check=True, cwd=ROOT)


def download(folder: Path, machine: str, version: str) -> None:
    """The wheels of the dependencies for another machine. Only ready ones: nothing is compiled on a boat."""
    abi = "cp" + version.replace(".", "")
    tags = [f"manylinux_{glibc}_{machine}" for glibc in GLIBC] + [f"{name}_{machine}" for name in OLD_NAMES.values()]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    platform = [part for tag in tags for part in ("--platform", tag)]
    abis = [part for each in (abi, "abi3", "none") for part in ("--abi", each)]
    target = ["--python-version", version, "--implementation", "cp", *abis, *platform]
    pip(
        *("download", "-qq", "-d", str(folder), "-c", "constraints.txt", "--only-binary", ":all:"),
        *target,
        *project["dependencies"],
    )


def requirement(wheel: Path) -> str:
    name, version = wheel.name.split("-")[:2]
    return f"{name.replace('_', '-')}=={version} --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}"


def main() -> None:
    if len(sys.argv) != 4:
        sys.exit(f"usage: {Path(sys.argv[0]).name} FOLDER MACHINE PYTHON_VERSION")
    folder, machine, version = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    pip("wheel", "-qq", "--no-deps", "-w", str(folder.resolve()), ".")
    download(folder.resolve(), machine, version)
    wheels = sorted(folder.glob("*.whl"))
    (folder / "requirements.txt").write_text("".join(f"{requirement(wheel)}\n" for wheel in wheels))
    size_mb = sum(wheel.stat().st_size for wheel in wheels) / 1e6
    print(f"{folder}: {len(wheels)} wheels for {machine}, Python {version}, {size_mb:.0f} MB")


if __name__ == "__main__":
    main()
