"""Radio control of ArduRover: the pilot's sticks, overrides by MAVLink, and the time-outs of both."""

from __future__ import annotations

from collections.abc import Sequence

from asvhil.types import record

CHANNELS = 18
NEUTRAL_US = 1500
IGNORE = 65535
RELEASE_HIGH = 65534  # channels above 8 take 0 as "ignore" and this as "release"
STICKS_AT_REST = (1500, 1500, 1500, 1500, 1800, 1000, 1000, 1800)  # of the recorded vehicle: 5 to 8 are switches


class RcInputs:
    """The 18 channels. `radio_us` is what the vehicle acts on and reports: an override, else the sticks.

    Without a receiver a channel whose override ends keeps its last value (ArduPilot's radio_in is not refreshed), so
    safety there rests on `alive`. A vehicle looks at its channels once in each loop (`read`): of an override that is
    released in the loop in which it came nothing is seen.
    """

    def __init__(self, receiver: bool, t_ns: int) -> None:
        self.receiver = receiver
        self.ignored = False  # the receiver, by the vehicle (RC_OPTIONS)
        self.strength: int | None = None  # of a receiver that reports it
        self.sticks_us = [*STICKS_AT_REST, *[0] * (CHANNELS - len(STICKS_AT_REST))]
        self.radio_us: list[int] = []
        self._overrides_ns: dict[int, int] = {}
        self._oldest_ns = t_ns  # no override is older
        self._unread_us: dict[int, int] = {}  # overrides since the last loop; 0: released
        self.restart(t_ns)

    def restart(self, t_ns: int) -> None:
        """Power on: overrides are reset, the pilot's sticks are kept."""
        self.radio_us[:] = self.sticks_us if self.receiver else [0] * CHANNELS
        self.heard = self.receiver  # a receiver, since power-on
        self.seen = self.receiver  # any input, since power-on
        self._overrides_ns.clear()
        self._unread_us.clear()
        self.last_input_ns = t_ns  # of an override, of the receiver's loss, or of power-on
        self._streak_ns: int | None = None

    def set_receiver(self, t_ns: int, present: bool) -> None:
        """The receiver appears, or is lost; then its last values are kept."""
        if self.receiver and not present:
            self.last_input_ns = t_ns
            self._streak_ns = None
        self.receiver = present
        if present:
            self.heard = self.seen = True
            for index, pulse_us in enumerate(self.sticks_us):
                if index not in self._overrides_ns:
                    self.radio_us[index] = pulse_us

    def set_stick(self, channel: int, pulse_us: int) -> None:
        """The pilot moves a control; channels count from 1."""
        self.sticks_us[channel - 1] = pulse_us
        if self.receiver and channel - 1 not in self._overrides_ns:
            self.radio_us[channel - 1] = pulse_us

    def override(self, t_ns: int, values: Sequence[int], gap_ns: int) -> None:
        """Apply one RC_CHANNELS_OVERRIDE (18 raw values); a pause longer than `gap_ns` starts a new streak."""
        touched = False
        if not self._overrides_ns:
            self._oldest_ns = t_ns
        for index, value in enumerate(values):
            if value == IGNORE or (index >= 8 and value == 0):
                continue
            touched = True
            if value == 0 or (index >= 8 and value == RELEASE_HIGH):
                self._overrides_ns.pop(index, None)
                self._unread_us[index] = 0
            else:
                self._overrides_ns[index] = t_ns
                self._unread_us[index] = value
        if touched:
            self.seen = True
            if self._streak_ns is None or t_ns - self.last_input_ns > gap_ns:
                self._streak_ns = t_ns
            self.last_input_ns = t_ns

    def read(self) -> None:
        """Look at what came since the last loop."""
        if not self._unread_us:
            return
        for index, value in self._unread_us.items():
            if value:
                self.radio_us[index] = value
            else:
                self._release(index)
        self._unread_us.clear()

    def expire(self, t_ns: int, timeout_ns: int) -> None:
        """End overrides older than the time-out."""
        if self._overrides_ns and t_ns - self._oldest_ns >= timeout_ns:
            for index in [i for i, since_ns in self._overrides_ns.items() if t_ns - since_ns >= timeout_ns]:
                self._release(index)
            self._oldest_ns = min(self._overrides_ns.values(), default=t_ns)

    def drop_overrides(self) -> None:
        """Release every channel."""
        for index in list(self._overrides_ns):
            self._release(index)

    def note_frame(self, t_ns: int) -> None:
        """Note a frame of the receiver: even of an ignored one, it makes present overrides count as input."""
        if self.receiver and self.ignored and self._overrides_ns:
            self.last_input_ns = t_ns

    def alive(self, t_ns: int, timeout_ns: int) -> bool:
        """Whether the radio gives input: a receiver, or overrides not older than the time-out."""
        return (self.receiver and not self.ignored) or t_ns - self.last_input_ns < timeout_ns

    @property
    def rssi(self) -> int:
        """Signal strength as RC_CHANNELS tells it; 255 where the receiver does not report one."""
        return 255 if self.strength is None else self.strength if self.receiver else 0

    def streamed_ns(self, t_ns: int) -> int:
        """For how long overrides have come without a pause."""
        return 0 if self._streak_ns is None else t_ns - self._streak_ns

    def _release(self, index: int) -> None:
        self._overrides_ns.pop(index, None)
        if self.receiver and not self.ignored:
            self.radio_us[index] = self.sticks_us[index]


@record
class ChannelCalibration:
    """RCn_MIN, _TRIM, _MAX, _DZ (us) and _REVERSED of one channel."""

    low_us: float
    trim_us: float
    high_us: float
    dead_zone_us: float
    reversed: bool

    def fraction(self, pulse_us: int) -> float:
        """A channel in [-1, 1] with its dead zone taken out and the rest stretched over what is left of the travel."""
        offset_us = pulse_us - self.trim_us
        beyond_us = abs(offset_us) - self.dead_zone_us
        travel_us = (self.high_us - self.trim_us if offset_us > 0 else self.trim_us - self.low_us) - self.dead_zone_us
        if beyond_us <= 0 or travel_us <= 0:
            return 0.0
        fraction = min(1.0, beyond_us / travel_us)
        return fraction if (offset_us > 0) is not self.reversed else -fraction
