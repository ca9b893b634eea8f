"""The sensor links, and the kinds of sensors on them: which messages each can give, and what is measured by which."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, SerializeAsAny, ValidationInfo, ValidatorFunctionWrapHandler, WrapValidator

from asvhil.config.base import Degrees, LinkSpecText, Section
from asvhil.config.chosen import NamedIn
from asvhil.config.ports import ANEMOMETER, AUTOPILOT, GNSS, INS, OPERATOR
from asvhil.config.registry import SENSORS, SensorKind

Quantity = Literal["position", "velocity", "heading", "yaw_rate", "acceleration", "wind"]
QUANTITIES: tuple[Quantity, ...] = ("position", "velocity", "heading", "yaw_rate", "acceleration", "wind")

FIX: tuple[Quantity, ...] = ("position", "velocity")
ATTITUDE: tuple[Quantity, ...] = ("heading", "yaw_rate")
INERTIAL: tuple[Quantity, ...] = ("yaw_rate", "acceleration")
WIND: tuple[Quantity, ...] = ("wind",)

# Kinds of the links that have a key of their own, by their ports.
OWN_LINKS = {ANEMOMETER: "nmea", GNSS: "nmea", INS: "vectornav"}


class NmeaLinkConfig(Section):
    """A line with NMEA 0183 sentences: GNSS, heading, wind, in any mix."""

    endpoint: LinkSpecText = Field(description="Link spec, such as serial:/dev/ttyUSB1:38400.")
    declination_deg: Degrees | None = Field(
        default=None,
        description=(
            "Magnetic declination, east positive, which turns magnetic directions into true ones; null: the variation "
            "in RMC or HDG on the same line, and no magnetic direction is used before one has arrived."
        ),
    )


class AnemometerLinkConfig(NmeaLinkConfig):
    """A wind sensor."""

    firmware: Literal["arduino_anemometer"] | None = Field(
        default=None,
        description="Firmware that it must run, whose version is requested and checked; null: another instrument.",
    )


class InsLinkConfig(Section):
    """A VectorNav INS (VN-300): binary output messages and ASCII sentences."""

    endpoint: LinkSpecText = Field(description="Link spec, such as serial:/dev/ttyUSB0:115200.")


class SensorLinkConfig(Section):
    """A sensor of any kind on a link of its own. A kind may have further keys, such as declination_deg of `nmea`."""

    kind: Annotated[str, NamedIn(SENSORS)] = Field(
        description="Kind of the sensor: one of asvhil, or of a plug-in (docs/extending.md)."
    )
    endpoint: LinkSpecText = Field(description="Link spec, such as serial:/dev/ttyUSB2:9600.")


class NmeaSensorConfig(NmeaLinkConfig, SensorLinkConfig):
    """A line with NMEA 0183 sentences, beside those of links.gnss and links.anemometer."""


def _of_its_kind(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> SensorLinkConfig:
    """The section that the kind has for its settings."""
    name = value.get("kind") if isinstance(value, dict) else None
    kind = SENSORS.get(name) if isinstance(name, str) else None
    if kind is None or kind.section is None:
        found: SensorLinkConfig = handler(value)
        return found
    return kind.section.model_validate(value, context=info.context)  # type: ignore[return-value]


def _not_taken(name: str) -> str:
    if name in (AUTOPILOT, OPERATOR, *OWN_LINKS):
        raise ValueError("the name is that of a link with a key of its own; give this sensor another")
    return name


SensorName = Annotated[str, Field(pattern="^[a-z0-9_-]+$"), AfterValidator(_not_taken)]
AnySensorLink = Annotated[SerializeAsAny[SensorLinkConfig], WrapValidator(_of_its_kind)]

SENSORS.fill(
    (
        SensorKind(
            name="nmea",
            build="asvhil.io.sensors.nmea:build",
            section=NmeaSensorConfig,
            encoding="nmea",
            messages={
                "GGA": ("position",),
                "GLL": ("position",),
                "GNS": ("position",),
                "RMC": FIX,
                "VTG": ("velocity",),
                "HDT": ("heading",),
                "HDG": ("heading",),
                "HDM": ("heading",),
                "THS": ("heading",),
                "ROT": ("yaw_rate",),
                "MWV": WIND,
                "MWV_T": WIND,
                "MWD": WIND,
                "VWR": WIND,
                "VWT": WIND,
            },
        ),
        SensorKind(
            name="vectornav",
            build="asvhil.io.sensors.vectornav.codec:build",
            encoding="vectornav",
            messages={
                "BINARY": (*FIX, *ATTITUDE, "acceleration"),
                "GNSS1": FIX,
                "VNINS": (*FIX, "heading"),
                "VNYMR": INERTIAL,
            },
        ),
    )
)
