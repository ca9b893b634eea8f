"""Base class of the vehicles inside the simulated autopilots: power, radio, and their reports."""

from __future__ import annotations

from asvhil.config import FrontseatConfig
from asvhil.simplant.vehicle.rc import RcInputs

BATTERY_V = 12.6


class PoweredVehicle:
    """State without bytes. `texts` and `changed` collect what the link is to send to the stations.

    A vehicle calls `restart` at the end of its constructor, when all its parts are there.
    """

    def __init__(self, config: FrontseatConfig, t_ns: int) -> None:
        self._config = config
        self.rc = RcInputs(config.rc_receiver, t_ns)
        self.texts: list[tuple[int, str]] = []
        self.servo_us = [0] * 16
        self.battery_v = BATTERY_V
        self.battery_a: float | None = None  # None: it has no current sensor
        self.used_ah = self.used_wh = 0.0

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is reset."""
        self.t_ns = self.power_on_ns = t_ns
        self.boot_ns = t_ns + round(1e9 * self._config.boot_s)
        self.ready_ns = max(self.boot_ns, t_ns + round(1e9 * self._config.ready_after_s))
        self.rc.restart(self.boot_ns)
        self.armed = self.changed = False
        self.texts.clear()
        self.used_ah = self.used_wh = 0.0
        self.servo_us[:] = [0] * 16
