"""Which sensor each quantity is taken from: named messages of links in order of preference, with fail-over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from asvhil.config.base import NonNegative, Positive, Section
from asvhil.config.links import AutopilotLinkConfig, LinksConfig
from asvhil.config.ports import ANEMOMETER, AUTOPILOT
from asvhil.config.registry import AUTOPILOTS, SENSORS
from asvhil.config.sensors import ATTITUDE, FIX, INERTIAL, QUANTITIES, WIND, Quantity

LEAST_INTERVALS = 2.0  # of a stream within a time-out: jitter alone must not be a failure
# How often the estimator wants a quantity: the rate at which a listed message is asked for that has none.
NEEDED_HZ: dict[Quantity, float] = {
    "position": 5.0,
    "velocity": 5.0,
    "heading": 20.0,
    "yaw_rate": 20.0,
    "acceleration": 20.0,
    "wind": 5.0,
}

# What each message of the autopilot can give.
AUTOPILOT_MESSAGES: dict[str, tuple[Quantity, ...]] = {
    "GLOBAL_POSITION_INT": FIX,
    "GPS_RAW_INT": FIX,
    "GPS2_RAW": FIX,
    "ATTITUDE": ATTITUDE,
    "ATTITUDE_QUATERNION": ATTITUDE,
    "RAW_IMU": INERTIAL,
    "SCALED_IMU": INERTIAL,
    "SCALED_IMU2": INERTIAL,
    "SCALED_IMU3": INERTIAL,
    "HIGHRES_IMU": INERTIAL,
    "WIND": WIND,
    "WIND_COV": WIND,
}


class SourceConfig(Section):
    """One source of a quantity: a message of a link. In YAML also as one word, `LINK.MESSAGE`."""

    link: str = Field(
        description="The link that it arrives on: autopilot, anemometer, gnss, ins, or a name of links.sensors."
    )
    message: str = Field(description="The message; docs/sensors.md lists those of each link and what they give.")
    timeout_s: Positive = Field(
        default=1.0,
        description=(
            "Without a valid value for this long, the next source takes over; at least two intervals of the message."
        ),
    )
    delay_s: NonNegative = Field(
        default=0.0,
        description="How old its values are when they arrive, for the estimator to process them at their own time.",
    )
    arm_m: tuple[float, float] = Field(
        default=(0.0, 0.0),
        description="Where the antenna or sensor is: forward and to starboard of the boat's origin.",
    )

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        link, dot, message = value.partition(".")
        if not dot:
            raise ValueError("a source is LINK.MESSAGE, such as ins.BINARY, or a mapping with link and message")
        return {"link": link, "message": message}

    @property
    def name(self) -> str:
        """LINK.MESSAGE."""
        return f"{self.link}.{self.message}"


Sources = tuple[SourceConfig, ...]


class SourcesConfig(Section):
    """Sources of each quantity in order of preference: one is used at a time, and the next one when it fails."""

    position: Sources = Field(
        default=(),
        description="Sources of position; empty: GPS_RAW_INT, GLOBAL_POSITION_INT (links.autopilot.position_source).",
    )
    velocity: Sources = Field(default=(), description="Sources of velocity over ground; empty: as for position.")
    heading: Sources = Field(default=(), description="Sources of heading; empty: autopilot.ATTITUDE.")
    yaw_rate: Sources = Field(default=(), description="Sources of yaw rate; empty: autopilot.ATTITUDE.")
    acceleration: Sources = Field(
        default=(), description="Sources of specific force; empty: autopilot.RAW_IMU (PX4: HIGHRES_IMU)."
    )
    wind: Sources = Field(default=(), description="Sources of wind; empty: anemometer.MWV.")
    return_after_s: NonNegative = Field(
        default=5.0,
        description="A preferred source is used again once it has sent valid values without a break for this long.",
    )

    def resolved(self, links: LinksConfig) -> dict[Quantity, Sources]:
        """The sources of every quantity, the defaults for lists that are empty."""
        fixes = _fixes(links.autopilot)
        attitude = SourceConfig(link=AUTOPILOT, message="ATTITUDE")
        # Without a stream request the IMU's rate is 1 Hz.
        message = AUTOPILOTS.find(links.autopilot.profile).imu_message
        imu = SourceConfig(link=AUTOPILOT, message=message, timeout_s=3.0)
        return {
            "position": self.position or fixes,
            "velocity": self.velocity or fixes,
            "heading": self.heading or (attitude,),
            "yaw_rate": self.yaw_rate or (attitude,),
            "acceleration": self.acceleration or (imu,),
            "wind": self.wind or (SourceConfig(link=ANEMOMETER, message="MWV"),),
        }


def _fixes(link: AutopilotLinkConfig) -> Sources:
    """The sources of position and velocity by default, in order of preference.

    The receiver's fix comes first: its velocity, from the Doppler shift, is independent of its position. The velocity
    of an autopilot's filter is not: on a real ArduRover it is off by 1 to 2 cm/s for minutes
    (docs/results/real-ardurover.md).
    """
    raw, fused = (SourceConfig(link=AUTOPILOT, message=name) for name in ("GPS_RAW_INT", "GLOBAL_POSITION_INT"))
    rates = link.streams_hz
    fast = raw.timeout_s * rates.get(raw.message, 0.0) >= LEAST_INTERVALS
    preferred = link.position_source or (raw.message if fast else fused.message)
    first, second = (raw, fused) if preferred == raw.message else (fused, raw)
    return (first, second) if second.timeout_s * rates.get(second.message, 0.0) >= LEAST_INTERVALS else (first,)


def with_streams_of(sources: SourcesConfig, links: LinksConfig) -> LinksConfig:
    """The links with a rate for every listed message of the autopilot that has none: the rate that its quantity needs.

    The links that were given are not changed.
    """
    rates = links.autopilot.streams_hz
    missing: dict[str, float] = {}
    for quantity in QUANTITIES:
        for source in getattr(sources, quantity):
            known = source.link == AUTOPILOT and quantity in AUTOPILOT_MESSAGES.get(source.message, ())
            if known and source.message not in rates:
                least_hz = LEAST_INTERVALS / source.timeout_s
                missing[source.message] = max(missing.get(source.message, 0.0), NEEDED_HZ[quantity], least_hz)
    if not missing:
        return links
    autopilot = links.autopilot.model_copy(update={"streams_hz": dict(sorted({**rates, **missing}.items()))})
    return links.model_copy(update={"autopilot": autopilot})


def _check_stream(where: str, source: SourceConfig, rate_hz: float) -> None:
    key = f"links.autopilot.streams_hz.{source.message}"
    if source.timeout_s * rate_hz < LEAST_INTERVALS:
        least_s = LEAST_INTERVALS / rate_hz
        raise ValueError(f"{where} comes at {rate_hz:g} Hz: timeout_s of at least {least_s:g}, or a higher {key}")


def _check_alike(sources: SourcesConfig, one: Quantity, other: Quantity) -> None:
    """Two quantities of one message are of one time and place."""
    for source in getattr(sources, one):
        for number, same in enumerate(getattr(sources, other)):
            if same.name == source.name and (same.delay_s, same.arm_m) != (source.delay_s, source.arm_m):
                where = f"sources.{other}.{number}: {same.name}"
                raise ValueError(f"{where} must have the delay_s and arm_m that it has under sources.{one}")


def _messages(links: LinksConfig, link: str) -> Mapping[str, tuple[str, ...]] | None:
    """What each message of a link can give; None where the config has no such link."""
    if link == AUTOPILOT:
        return AUTOPILOT_MESSAGES
    return SENSORS.find(links.kind_of(link)).messages if link in links.sensor_links() else None


def check_sources(sources: SourcesConfig, links: LinksConfig, history_s: float, stale_after_s: float) -> None:
    """ValueError naming the first source that no link can give, whose stream is not asked for, or that is too late."""
    _check_alike(sources, "position", "velocity")
    _check_alike(sources, "heading", "yaw_rate")
    for quantity in QUANTITIES:
        seen: set[str] = set()
        for number, source in enumerate(getattr(sources, quantity)):
            where = f"sources.{quantity}.{number}: {source.name}"
            messages = _messages(links, source.link)
            if messages is None:
                there = ", ".join((AUTOPILOT, *links.sensor_links()))
                raise ValueError(f"{where}: there is no {links.key_of(source.link)} (links with sensors: {there})")
            able = [name for name, gives in messages.items() if quantity in gives]
            if source.message not in able:
                key = links.key_of(source.link)
                raise ValueError(f"{where} gives no {quantity}; of {key} can: {', '.join(able) or 'nothing'}")
            if source.link == AUTOPILOT:
                _check_stream(where, source, links.autopilot.streams_hz[source.message])
            if source.delay_s > history_s:
                raise ValueError(f"{where}: delay_s must not be above estimator.ekf.history_s, which is {history_s:g}")
            if source.delay_s >= stale_after_s:
                limit = f"estimator.ekf.stale_after_s, which is {stale_after_s:g}"
                raise ValueError(f"{where}: delay_s must be below {limit}")
            if quantity == "wind" and source.delay_s > 0.0:
                raise ValueError(f"{where}: wind is taken as of its arrival; leave delay_s out")
            if source.name in seen:
                raise ValueError(f"{where} stands in the list twice")
            seen.add(source.name)
