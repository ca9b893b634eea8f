"""Whether the pilot's transmitter is heard, by what the autopilot tells of it. Sans-IO."""

from __future__ import annotations

from asvhil.io.mavlink.frames import dialect
from asvhil.types import Radio

RECEIVER = int(dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER)
NO_RSSI = 255
RSSI_LOST_NS = 1_000_000_000  # of a signal strength of 0
OVERRIDDEN_NS = 1_000_000_000  # after the last override, for which an ArduRover still takes the radio for alive


class Transmitter:
    """Follows RC_CHANNELS and the receiver's bits in SYS_STATUS; `radio` is what both come to.

    The number of channels keeps its last value after a loss, so the health bit is the witness of one. But an ArduRover
    counts overrides as radio input: while they flow the bit stays good whatever becomes of the receiver, and only a
    signal strength of 0, where the receiver reports one, tells of a loss.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """The autopilot has started anew: nothing has been heard."""
        self._channels: int | None = None
        self._present = False
        self._healthy: bool | None = None
        self._signal = False  # a signal strength has been reported
        self._no_signal_ns: int | None = None
        self._override_ns: int | None = None
        self.radio = Radio.UNKNOWN

    @property
    def tells_signal(self) -> bool:
        """Whether the receiver reports the strength of its signal."""
        return self._signal

    def on_rc_channels(self, t_ns: int, channels: int, rssi: int) -> None:
        """RC_CHANNELS: `channels` of the receiver, overrides aside, and its signal strength, 255 where unknown."""
        self._channels = channels
        if rssi == NO_RSSI or (not self._signal and rssi == 0):
            self._no_signal_ns = None
        elif rssi > 0:
            self._signal, self._no_signal_ns = True, None
        elif self._no_signal_ns is None:
            self._no_signal_ns = t_ns
        self._judge(t_ns)

    def on_sys_status(self, t_ns: int, present: int, health: int) -> None:
        """SYS_STATUS: bits of the sensors that are there, and of those that are well."""
        self._present = bool(present & RECEIVER)
        self._healthy = bool(health & RECEIVER)
        self._judge(t_ns)

    def note_override(self, t_ns: int) -> None:
        """We override sticks."""
        self._override_ns = t_ns

    def _judge(self, t_ns: int) -> None:
        if self._channels == 0 or (self._channels is None and self._healthy is not None and not self._present):
            self.radio = Radio.ABSENT
        elif self._no_signal_ns is not None and t_ns - self._no_signal_ns >= RSSI_LOST_NS:
            self.radio = Radio.LOST
        elif self._healthy is False:
            never = self._channels is None and self.radio in (Radio.UNKNOWN, Radio.ABSENT)
            self.radio = Radio.ABSENT if never else Radio.LOST
        elif self.radio is not Radio.LOST or not self._overridden(t_ns):
            self.radio = Radio.HEARD

    def _overridden(self, t_ns: int) -> bool:
        return self._override_ns is not None and t_ns - self._override_ns < OVERRIDDEN_NS
