"""The state of the computer that the daemon runs on, as ONBOARD_COMPUTER_STATUS for operators."""

from __future__ import annotations

import os
import time
from pathlib import Path

from asvhil.config import AutopilotLinkConfig
from asvhil.io.mavlink.frames import dialect

UNKNOWN_8, UNKNOWN_U8, UNKNOWN_16, UNKNOWN_32 = 127, 255, 32767, 2**32 - 1
CORES, TEMPERATURES = 8, 8
STORAGE_UNKNOWN = 0
MIB = 1 << 20


class ComputerStatus:
    """Reads /proc and /sys; what a system does not tell is left out. To be called on a thread: a disk may stall."""

    def __init__(self, config: AutopilotLinkConfig, folder: Path, proc: Path = Path("/proc")) -> None:
        """`folder` is where the log is: of that disk the space is told."""
        self._mav = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._folder = folder
        self._proc = proc
        self._busy: dict[str, tuple[int, int]] = {}

    def encode(self) -> bytes:
        """The frame, of now."""
        cores = self._loads()
        ram_total, ram_free = self._ram_mib()
        disk_total, disk_free = self._disk_mib()
        message = dialect.MAVLink_onboard_computer_status_message(
            time.time_ns() // 1000,
            time.monotonic_ns() // 1_000_000 % 2**32,
            0,
            _padded(cores, CORES, UNKNOWN_U8),
            [UNKNOWN_U8] * 10,
            [UNKNOWN_U8] * 4,
            [UNKNOWN_U8] * 10,
            UNKNOWN_8,
            _padded(_temperatures(), TEMPERATURES, UNKNOWN_8),
            [UNKNOWN_16] * 4,
            UNKNOWN_32 if ram_total is None or ram_free is None else ram_total - ram_free,
            UNKNOWN_32 if ram_total is None else ram_total,
            [STORAGE_UNKNOWN] + [UNKNOWN_32] * 3,
            [UNKNOWN_32 if disk_total is None else disk_total - disk_free] + [UNKNOWN_32] * 3,
            [UNKNOWN_32 if disk_total is None else disk_total] + [UNKNOWN_32] * 3,
            [UNKNOWN_32] * 6,
            [UNKNOWN_32] * 6,
            [UNKNOWN_32] * 6,
            [UNKNOWN_32] * 6,
            [UNKNOWN_32] * 6,
        )
        return bytes(message.pack(self._mav))

    def _loads(self) -> list[int]:
        """Of each core, the share of time (%) in which it was busy since the last call."""
        found = []
        try:
            lines = (self._proc / "stat").read_text().splitlines()
        except OSError:
            return []
        for line in lines:
            name, *fields = line.split()
            if not name.startswith("cpu") or name == "cpu" or len(fields) < 5:
                continue
            times = [int(field) for field in fields[:8]]
            total, idle = sum(times), times[3] + times[4]
            before_total, before_idle = self._busy.get(name, (total, idle))
            self._busy[name] = total, idle
            span = total - before_total
            found.append(round(100.0 * (1.0 - (idle - before_idle) / span)) if span > 0 else 0)
        return [min(max(load, 0), 100) for load in found]

    def _ram_mib(self) -> tuple[int | None, int | None]:
        try:
            lines = (self._proc / "meminfo").read_text().splitlines()
        except OSError:
            return None, None
        kib = {name: int(rest.split()[0]) for name, _, rest in (line.partition(":") for line in lines) if rest.split()}
        total, free = kib.get("MemTotal"), kib.get("MemAvailable")
        return (None if total is None else total // 1024), (None if free is None else free // 1024)

    def _disk_mib(self) -> tuple[int | None, int]:
        try:
            disk = os.statvfs(self._folder)
        except OSError:
            return None, 0
        return disk.f_blocks * disk.f_frsize // MIB, disk.f_bavail * disk.f_frsize // MIB


def _temperatures() -> list[int]:
    """Of each thermal zone, in whole degrees Celsius."""
    found = []
    for zone in sorted(Path("/sys/class/thermal").glob("thermal_zone*/temp")):
        try:
            found.append(max(-127, min(126, round(int(zone.read_text()) / 1000.0))))
        except (OSError, ValueError):
            continue
    return found


def _padded(values: list[int], count: int, filler: int) -> list[int]:
    return (values + [filler] * count)[:count]
