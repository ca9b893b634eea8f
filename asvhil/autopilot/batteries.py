"""The batteries of a vehicle, as BATTERY_STATUS tells of them: a message for each, by its `id`. Sans-IO."""

from __future__ import annotations

from typing import Any

from asvhil.io.mavlink.frames import dialect
from asvhil.types import BatterySum, record

UNMEASURED = (-1, -100)  # current_battery (cA) of one that is not measured; the second is PX4's
NO_CELL = (0, 0xFFFF)  # mV: without a measurement, in `voltages_ext` and in `voltages`
FORGOTTEN_NS = 60_000_000_000  # a battery that has been silent for so long is not there any more
WH_PER_HECTOJOULE = 100.0 / 3600.0
# MAV_BATTERY_CHARGE_STATE that are no well battery's, and how bad each is; the others: unknown, well and charging.
COMPLAINTS = {
    dialect.MAV_BATTERY_CHARGE_STATE_LOW: "low",
    dialect.MAV_BATTERY_CHARGE_STATE_CRITICAL: "critical",
    dialect.MAV_BATTERY_CHARGE_STATE_EMERGENCY: "critical, an emergency",
    dialect.MAV_BATTERY_CHARGE_STATE_UNHEALTHY: "not healthy",
    dialect.MAV_BATTERY_CHARGE_STATE_FAILED: "failed",
}
FAULT = "MAV_BATTERY_FAULT"


@record
class _Reading:
    t_ns: int
    power_w: float
    used_wh: float | None


class Batteries:
    """The charge of each, and readings of those that have a current sensor.

    Of the readings, what tells no voltage or no current is as silent: a battery without a sensor never counts, and one
    that has lost it makes the sum old, and later leaves it.
    """

    def __init__(self) -> None:
        self._readings: dict[int, _Reading] = {}
        self._sum: BatterySum | None = None  # of these; it is asked for with every status, several times in a tick
        self._charges: dict[int, tuple[int, float | None]] = {}  # when, and how many per cent
        self._complaints: dict[int, tuple[int, str]] = {}  # when, and what

    def restart(self) -> None:
        """The autopilot has rebooted: which it has is told anew."""
        self._readings.clear()
        self._charges.clear()
        self._complaints.clear()
        self._sum = None

    def receive(self, t_ns: int, m: Any) -> None:
        """BATTERY_STATUS. Its charge and consumption count from the autopilot's start, or from a battery's own."""
        complaint = _complaint(m.charge_state, m.fault_bitmask)
        if complaint:
            self._complaints[m.id] = t_ns, complaint
        else:
            self._complaints.pop(m.id, None)
        self._charges[m.id] = t_ns, charge(m.battery_remaining)
        volts = 1e-3 * sum(mv for mv in (*m.voltages, *m.voltages_ext) if mv not in NO_CELL)
        if volts <= 0.0 or m.current_battery in UNMEASURED:  # one that is being charged has a negative current
            return
        if m.energy_consumed >= 0:
            used_wh = m.energy_consumed * WH_PER_HECTOJOULE
        else:  # PX4 counts the charge alone
            used_wh = 1e-3 * m.current_consumed * volts if m.current_consumed >= 0 else None
        self._readings[m.id] = _Reading(
            t_ns=t_ns,
            power_w=volts * 0.01 * m.current_battery,
            used_wh=used_wh,
        )
        self._sum = self._added(t_ns)

    def sum(self, t_ns: int) -> BatterySum | None:
        """All together, as old as the oldest of them; None where none measures a current."""
        if self._sum is not None and t_ns - self._sum.t_ns >= FORGOTTEN_NS:
            self._sum = self._added(t_ns)
        return self._sum

    def lowest_percent(self, t_ns: int) -> float | None:
        """The lowest charge of several; None where there is one alone, or none of them tells it."""
        if len(self._charges) < 2:  # as nearly always; it is asked for with every status
            return None
        self._charges = {i: one for i, one in self._charges.items() if t_ns - one[0] < FORGOTTEN_NS}
        if len(self._charges) < 2:
            return None
        return min((percent for _, percent in self._charges.values() if percent is not None), default=None)

    def complaint(self, t_ns: int) -> str:
        """What is wrong with which battery, by the autopilot's judgement; empty where it has none."""
        if not self._complaints:
            return ""
        self._complaints = {i: one for i, one in self._complaints.items() if t_ns - one[0] < FORGOTTEN_NS}
        return "; ".join(f"battery {i + 1} {text}" for i, (_, text) in sorted(self._complaints.items()))

    def _added(self, t_ns: int) -> BatterySum | None:
        self._readings = {i: one for i, one in self._readings.items() if t_ns - one.t_ns < FORGOTTEN_NS}
        readings = [self._readings[i] for i in sorted(self._readings)]
        if not readings:
            return None
        power_w = used_wh = 0.0
        for one in readings:  # `sum` of floats is another one in a newer Python
            power_w += one.power_w
            used_wh += one.used_wh or 0.0
        return BatterySum(
            t_ns=min(one.t_ns for one in readings),
            number=len(readings),
            power_w=power_w,
            used_wh=None if any(one.used_wh is None for one in readings) else used_wh,
        )


def charge(battery_remaining: int) -> float | None:
    """Per cent by `battery_remaining` of SYS_STATUS and BATTERY_STATUS; None where it is not known, which is -1."""
    return float(battery_remaining) if 0 <= battery_remaining <= 100 else None


def _complaint(charge_state: int, faults: int) -> str:
    """Such as "critical (over temperature)"; empty for a battery of which the autopilot says nothing bad."""
    names = []
    for bit in range(faults.bit_length()):
        if faults >> bit & 1:
            known = dialect.enums[FAULT].get(1 << bit)
            name = f"fault {1 << bit}" if known is None else known.name
            names.append(name.removeprefix(f"{FAULT}_").removeprefix("BATTERY_FAULT_").replace("_", " ").lower())
    state = COMPLAINTS.get(charge_state, "faulty" if names else "")
    return f"{state} ({', '.join(names)})" if names else state
