"""Faults and glitches of the simulated boat."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from asvhil.config.base import Degrees, NonNegative, Positive, Section

Device = Literal["autopilot", "ins", "nmea"]
DEFAULT_SIZE = {
    "gnss-jump": 20.0,
    "heading-jump": 60.0,
    "heading-drift": 2.0,
    "compass-turned": 90.0,
    "port-motor-weak": 0.3,
    "starboard-motor-weak": 0.3,
    "battery": 10.5,
}
SIZE_UNITS: dict[str, tuple[str, ...]] = {  # of each kind in DEFAULT_SIZE, as people write it; none: a share
    "gnss-jump": ("m",),
    "heading-jump": ("deg",),
    "heading-drift": ("deg/s", "deg"),
    "compass-turned": ("deg",),
    "port-motor-weak": (),
    "starboard-motor-weak": (),
    "battery": ("V",),
}
MOST_TOLD_V = 65.5  # SYS_STATUS has 16 bits of millivolts, of which the highest means unknown
OWN_DEVICE: dict[str, Device] = {"ins": "ins", "ins-gnss": "ins", "nmea": "nmea"}  # kinds of one device alone
OF_ONE_DEVICE = frozenset(
    {
        *("gnss-jump", "gnss-frozen", "gnss-silent", "imu-silent"),
        *("heading-jump", "heading-drift", "heading-silent", "compass-turned"),
    }
)
FaultKind = Literal[
    "port-motor",
    "starboard-motor",
    "port-motor-reversed",
    "starboard-motor-reversed",
    "motors-swapped",
    "port-motor-weak",
    "starboard-motor-weak",
    "port-motor-stuck",
    "starboard-motor-stuck",
    "gnss",
    "gnss-jump",
    "gnss-frozen",
    "gnss-silent",
    "heading-jump",
    "heading-silent",
    "heading-drift",
    "compass-turned",
    "imu-silent",
    "anemometer",
    "anemometer-stuck",
    "vane",
    "cups",
    "ins",
    "ins-gnss",
    "nmea",
    "transmitter",
    "battery",
]


class FaultConfig(Section):
    """A fault of the simulated boat during a span of time.

    docs/sensors.md says what each kind does to each device. A sensor's fault shows on every device that has the sensor,
    or on `device` alone.
    """

    kind: FaultKind = Field(description="What fails.")
    from_s: NonNegative = Field(default=0.0, description="Begin, after power-on.")
    until_s: Positive | None = Field(default=None, description="End, after power-on; null: it lasts.")
    size: float | None = Field(
        default=None,
        description=(
            "How much. gnss-jump: m (null: 20). heading-jump, compass-turned: degrees (null: 60, 90). "
            "heading-drift: degrees a second (null: 2). A weak motor: "
            "the share of its thrust that is left (null: 0.3). battery: V (null: 10.5)."
        ),
    )
    toward_deg: Degrees = Field(default=45.0, description="Direction of a gnss-jump, clockwise from north.")
    device: Device | None = Field(
        default=None, description="The one device that has a gnss-, heading-, compass- or imu- fault; null: all."
    )

    @property
    def to_s(self) -> float:
        """The end of the span (s); infinity where it has none."""
        return math.inf if self.until_s is None else self.until_s

    @property
    def magnitude(self) -> float:
        """The size of the fault: the config's, or the kind's default."""
        return DEFAULT_SIZE.get(self.kind, 0.0) if self.size is None else self.size

    @model_validator(mode="after")
    def _check(self) -> FaultConfig:
        if self.to_s <= self.from_s:
            raise ValueError("from_s < until_s must hold")
        if self.size is not None and self.kind not in DEFAULT_SIZE:
            raise ValueError(f"only {', '.join(DEFAULT_SIZE)} have a size, {self.kind} has none")
        if self.kind.endswith("-weak") and not 0.0 <= self.magnitude <= 1.0:
            raise ValueError(f"the size of {self.kind} is a share of the thrust, between 0 and 1")
        if self.kind == "battery" and not 0.0 < self.magnitude < MOST_TOLD_V:
            raise ValueError(f"the size of battery is a voltage above 0 and below {MOST_TOLD_V:g} V")
        if self.device is not None and self.kind not in OF_ONE_DEVICE:
            raise ValueError(f"a device can be named for {', '.join(sorted(OF_ONE_DEVICE))}, not for {self.kind}")
        return self


class GlitchConfig(Section):
    """One kind of fault that comes at random, for a time that is uniform between two bounds."""

    kind: FaultKind = Field(description="What fails.")
    least_s: Positive = Field(default=0.2, description="Shortest duration.")
    most_s: Positive = Field(default=3.0, description="Longest duration.")
    size: float | None = Field(default=None, description="As in `plant.faults`.")
    device: Device | None = Field(default=None, description="As in `plant.faults`; null: that of `plant.glitches`.")

    @model_validator(mode="after")
    def _check(self) -> GlitchConfig:
        if self.most_s < self.least_s:
            raise ValueError("least_s <= most_s must hold")
        FaultConfig(kind=self.kind, size=self.size, device=self.device)
        return self


def needed_device(fault: FaultConfig | GlitchConfig) -> Device | None:
    """The one device that can have a fault; None where it is not that of one device."""
    return OWN_DEVICE.get(fault.kind, fault.device)


_GLITCHES = (
    GlitchConfig(kind="gnss-jump", least_s=0.2, most_s=5.0),
    GlitchConfig(kind="gnss-frozen", least_s=2.0, most_s=10.0),
    GlitchConfig(kind="gnss-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="heading-jump", least_s=0.2, most_s=5.0),
    GlitchConfig(kind="heading-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="imu-silent", least_s=2.0, most_s=30.0),
    GlitchConfig(kind="anemometer-stuck", least_s=5.0, most_s=30.0),
    GlitchConfig(kind="anemometer", least_s=5.0, most_s=30.0),
)


class GlitchesConfig(Section):
    """Sensor faults at random times, one after the other, drawn from `plant.seed`.

    Every round has all kinds in random order. Jumps of the position go in a random direction, those of the heading to a
    random side.
    """

    kinds: tuple[GlitchConfig, ...] = Field(
        default=_GLITCHES, min_length=1, description="Kinds of fault; by default eight kinds of sensor fault."
    )
    from_s: NonNegative = Field(default=30.0, description="Begin, after power-on.")
    until_s: Positive = Field(default=3600.0, description="End, after power-on.")
    rest_s: NonNegative = Field(default=5.0, description="Least time between two faults.")
    gap_s: Positive = Field(default=10.0, description="Mean of the exponential time that is added to rest_s.")
    device: Device | None = Field(
        default=None, description="Device that fails, for kinds that name none; null: all that have the sensor."
    )

    @property
    def needed_devices(self) -> tuple[tuple[str, Device], ...]:
        """The kinds that only one device can have, each with that device."""
        found = []
        for glitch in self.kinds:
            device = needed_device(glitch) or (self.device if glitch.kind in OF_ONE_DEVICE else None)
            if device is not None:
                found.append((glitch.kind, device))
        return tuple(found)
