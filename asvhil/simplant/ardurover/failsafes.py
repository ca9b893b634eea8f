"""ArduRover's fail-safes: when the radio or the ground station counts as lost, and which modes follow."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig
from asvhil.config.autopilots import ARDUROVER_MODES
from asvhil.simplant.ardurover.parameters import Parameters
from asvhil.simplant.vehicle.rc import RcInputs
from asvhil.types import record

RECEIVER_IGNORED, OVERRIDES_IGNORED = 1, 2  # bits of RC_OPTIONS
DISARM = -1
HOLD, LOITER, RTL, SMART_RTL = (ARDUROVER_MODES[name] for name in ("HOLD", "LOITER", "RTL", "SMART_RTL"))
# FS_ACTION: modes to be entered, the first that is possible; 0 does nothing.
FAILSAFE_ACTIONS: dict[int, tuple[int, ...]] = {
    1: (RTL, HOLD),
    2: (HOLD,),
    3: (SMART_RTL, RTL, HOLD),
    4: (SMART_RTL, HOLD),
    5: (DISARM,),
    6: (LOITER, HOLD),
}
WARNING = dialect.MAV_SEVERITY_WARNING


@record
class RadioSettings:
    """What the parameters say of the radio. `override_ns`: how long an override stands, None: until another."""

    enabled: bool
    throttle_us: float
    receiver_ignored: bool
    overrides_ignored: bool
    override_ns: int | None
    neutral_ns: int  # of silence, until sticks count as neutral; a parameter since 4.7
    failsafe_ns: int  # of silence, until the fail-safe acts


class RadioWatch:
    """Receiver and overrides, which count as one radio. `texts` takes what the stations are told."""

    def __init__(
        self, config: FrontseatConfig, parameters: Parameters, rc: RcInputs, texts: list[tuple[int, str]]
    ) -> None:
        self._config = config
        self._parameters = parameters
        self._rc = rc
        self._texts = texts
        self._settings: tuple[int, RadioSettings] | None = None  # with how often parameters had changed by then
        self.restart()

    def restart(self) -> None:
        """Power on."""
        self.failsafe = False
        self.silent = self._parameters["FS_THR_ENABLE"] != 0.0 and not self._rc.receiver  # sticks count as neutral
        self._low_ns: int | None = None

    @property
    def settings(self) -> RadioSettings:
        """As the parameters are now."""
        if self._settings is None or self._settings[0] != self._parameters.changes:
            self._settings = self._parameters.changes, self._read()
        return self._settings[1]

    def _read(self) -> RadioSettings:
        parameters, config = self._parameters, self._config
        options, hold_s = int(parameters["RC_OPTIONS"]), parameters["RC_OVERRIDE_TIME"]
        neutral_ns = round(1e9 * (parameters.get("RC_FS_TIMEOUT") or config.neutral_timeout_s))
        return RadioSettings(
            enabled=parameters["FS_THR_ENABLE"] != 0.0,
            throttle_us=parameters["FS_THR_VALUE"],
            receiver_ignored=bool(options & RECEIVER_IGNORED),
            overrides_ignored=bool(options & OVERRIDES_IGNORED) or hold_s == 0.0,
            override_ns=round(1e9 * hold_s) if hold_s > 0.0 else None,
            neutral_ns=neutral_ns,
            failsafe_ns=neutral_ns + round(1e9 * (config.failsafe_timeout_s - config.neutral_timeout_s)),
        )

    def look_at_throttle(self, t_ns: int, throttle_us: int) -> None:
        """A throttle stick below FS_THR_VALUE, overridden or not, says that the transmitter is lost."""
        if not 0 < throttle_us < self.settings.throttle_us:
            self._low_ns = None
        elif self._low_ns is None:
            self._low_ns = t_ns

    def advance(self, t_ns: int) -> bool:
        """Time-outs of one loop; True where the fail-safe begins in it."""
        rc, settings = self._rc, self.settings
        enabled, neutral_ns = settings.enabled, settings.neutral_ns
        if settings.overrides_ignored:
            rc.drop_overrides()
        elif settings.override_ns is not None:
            rc.expire(t_ns, settings.override_ns)
        rc.ignored = settings.receiver_ignored
        rc.note_frame(t_ns)
        lost = enabled and self._is_lost(t_ns, neutral_ns, neutral_ns)
        if enabled:  # with 0 nobody looks any more: what was found last stands
            self.silent = lost
        if self.failsafe:
            if not lost:
                self.failsafe = False
                self._texts.append((WARNING, "Radio Failsafe Cleared"))
            return False
        self.failsafe = enabled and self._is_lost(t_ns, settings.failsafe_ns, neutral_ns)
        return self.failsafe

    def _is_lost(self, t_ns: int, timeout_ns: int, neutral_ns: int) -> bool:
        """A low throttle counts as lost at once, as a silent radio does after `neutral_ns`."""
        low = self._low_ns is not None and t_ns - self._low_ns >= timeout_ns - neutral_ns
        return low or not self._rc.alive(t_ns, timeout_ns)


class StationWatch:
    """The ground station's heartbeats. `texts` takes what the stations are told."""

    def __init__(self, parameters: Parameters, texts: list[tuple[int, str]]) -> None:
        self._parameters = parameters
        self._texts = texts
        self.restart()

    def restart(self) -> None:
        """Power on."""
        self.failsafe = False
        self._heard_ns: int | None = None

    def note(self, t_ns: int) -> None:
        """A heartbeat, or what counts as one."""
        self._heard_ns = t_ns

    def advance(self, t_ns: int) -> bool:
        """Time-outs of one loop; True where the fail-safe begins: as with a real one, not before a first heartbeat."""
        parameters = self._parameters
        lost = False
        if parameters["FS_GCS_ENABLE"] != 0.0 and self._heard_ns is not None:
            lost = t_ns - self._heard_ns > round(1e9 * (parameters["FS_GCS_TIMEOUT"] + parameters["FS_TIMEOUT"]))
        if self.failsafe and not lost:
            self._texts.append((WARNING, "GCS Failsafe Cleared"))
        begins = lost and not self.failsafe
        self.failsafe = lost
        return begins
