"""What the autopilot says of itself, in one line for people."""

from __future__ import annotations

from asvhil.types import FrontseatStatus

FIXES = {0: "no GNSS", 1: "no fix", 2: "2D fix", 3: "3D fix", 4: "DGNSS fix", 5: "RTK float", 6: "RTK fix"}  # MAVLink


def vehicle_text(status: FrontseatStatus | None) -> str:
    """Such as "armed, MANUAL, 3D fix, 12 satellites, battery 15.2 V, 80 %"; empty before the autopilot was heard."""
    if status is None or not status.mode:
        return ""
    equipment = equipment_text(status.fix, status.satellites, status.battery_v, status.battery_percent)
    armed = "armed" if status.armed else "not armed"
    return ", ".join(part for part in (armed, status.mode, equipment) if part)


def equipment_text(fix: int | None, satellites: int | None, battery_v: float | None, percent: float | None) -> str:
    """Receiver and battery; what is not known is left out."""
    parts = []
    if fix is not None:
        parts.append(FIXES.get(fix, f"fix type {fix}"))
    if satellites is not None:
        parts.append(f"{satellites} satellites")
    if battery_v is not None:
        parts.append(f"battery {battery_v:.1f} V")
    if percent is not None:
        parts.append(f"{percent:.0f} %" if battery_v is not None else f"battery {percent:.0f} %")
    return ", ".join(parts)
